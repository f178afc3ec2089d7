#include "render/frames/void_key_report.h"

#include "base/clock.h"
#include <stdio.h>

static void plan_mixture(const CtsMixture *m, const CtsVoidKey *key, CtsReport *report)
{
    char list[400] = "";
    size_t n = 0;
    for (int i = 0; i < m->n && n < sizeof list; i++)
        n += (size_t)snprintf(list + n, sizeof list - n, "%s%s %.0f HU%s", i ? ", " : "", m->tissue[i].name,
                              m->tissue[i].mean_hu, key->is_void[i] ? " (void)" : "");
    cts_report_plan(report, "mixture model: %s", list);
}

static void report_key(const CtsVoidKey *key, const CtsPreset *preset, CtsReport *report)
{
    char text[CTS_KEY_TEXT];
    if (!key->useful) {
        static const char why[] = "shows every tissue of the mixture, or none";
        cts_report_skip(report, "void key", "preset %s %s: only what is provably invisible is skipped", preset->name,
                        why);
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_VOID_KEY_UNUSED,
                              "`void` key: preset %s %s, so only what is provably invisible is skipped", preset->name,
                              why);
        return;
    }
    const double of_visible = key->visible ? 100 * (double)key->dropped / (double)key->visible : 0;
    cts_void_key_text(key, text);
    if (report)
        report->key_loss = key->opacity_dropped;
    cts_report_plan(report, "void key: %s counts as void (probability %.2f or more)", text, key->probability);
    cts_report_skip(report, "void tissue",
                    "%s counts as void: %.4g %% of the voxels of opacity above 0, %.4g %% of "
                    "the opacity",
                    text, of_visible, 100 * key->opacity_dropped);
    if (key->dropped == 0)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_VOID_KEY, "`void` key loses nothing: the preset shows nothing %s",
                              text);
    else
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_VOID_KEY_LOSES,
                              "`void` key: %s counts as void: %.4g %% of the voxels that would be visible, and with "
                              "them %.4g %% of the opacity, are lost",
                              text, of_visible, 100 * key->opacity_dropped);
}

CtsStatus cts_void_key_find(const CtsVolume *volume, const CtsPreset *preset, int n_threads, CtsFittedVoidKey *found,
                            CtsReport *report, CtsError *err)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    uint64_t *count = NULL;
    CtsMixture *mixture = &found->mixture;
    CtsStatus st = cts_volume_histogram(volume, n_threads, &count, err);
    if (!st && !(st = cts_mixture_fit(count, volume->hu_offset, volume->hu_step, mixture, err)) &&
        !(st = cts_void_key_propose(mixture, preset, count, volume->hu_offset, volume->hu_step, &found->key, err)))
        cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, mixture->n_voxels,
                         0);
    cts_volume_histogram_free(&count);
    return st;
}

void cts_void_key_report(const CtsFittedVoidKey *found, const CtsPreset *preset, CtsReport *report)
{
    plan_mixture(&found->mixture, &found->key, report);
    report_key(&found->key, preset, report);
}
