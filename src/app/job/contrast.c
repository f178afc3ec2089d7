#include "app/job/contrast.h"

#include "base/meter.h"
#include "ctsplat/mixture.h"
#include <string.h>

static const CtsPreset *builtin(const char *name)
{
    for (size_t i = 0; cts_preset_builtin(i); i++)
        if (!strcmp(cts_preset_builtin(i)->name, name))
            return cts_preset_builtin(i);
    return NULL;
}

/* A preset of the user's that has the name may have other colours in mind. */
static bool is_vessel(const CtsPreset *preset)
{
    const CtsPreset *own = builtin("vessel");
    return own && !strcmp(preset->name, own->name) && preset->n_colour == own->n_colour &&
           !memcmp(preset->colour, own->colour, (size_t)own->n_colour * sizeof *own->colour);
}

static CtsStatus find_contrast(const CtsVolume *volume, int n_threads, bool *found, CtsError *err)
{
    uint64_t *count = NULL;
    CtsMixture mixture;
    CtsStatus st = cts_volume_histogram(volume, n_threads, &count, err);
    if (!st && !(st = cts_mixture_fit(count, volume->hu_offset, volume->hu_step, &mixture, err)))
        *found = cts_mixture_has_contrast(&mixture);
    cts_volume_histogram_free(&count);
    return st;
}

CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, CtsReport *report,
                             CtsError *err)
{
    bool found = true;
    if (!is_vessel(preset))
        return CTS_OK;
    const CtsMeter meter = cts_meter_start(report);
    const CtsStatus st = find_contrast(volume, n_threads, &found, err);
    cts_meter_stop(meter, report, CTS_STAGE_CLASSIFY);
    if (st || found)
        return st;
    const CtsPreset *bone = builtin("bone");
    preset->n_colour = bone->n_colour;
    memcpy(preset->colour, bone->colour, sizeof bone->colour);
    cts_report_finding(report, "no_contrast", CTS_WARNING,
                       "preset vessel: no contrast agent is to be seen in the blood, so what shows is bone, in the "
                       "colours of bone (take preset bone, or a series with contrast agent)");
    return CTS_OK;
}
