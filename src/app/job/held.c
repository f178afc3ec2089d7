#include "app/job/held.h"

#include "base/clock.h"
#include "base/mem.h"
#include <string.h>

void cts_held_take(CtsHeld *held, CtsPicture *band, int frame)
{
    held->picture = *band;
    held->frame = frame;
    band->pixels = band->depth_mm = band->bound = NULL;
}

CtsStatus cts_held_write(CtsHeld *held, CtsFiles *files, CtsError *err)
{
    const double cpu = cts_thread_cpu_ms();
    held->writing->verified = held->verified;
    CtsStatus st = cts_files_rows(files, held->frame, &held->picture, held->writing, err);
    cts_free(&held->picture.pixels);
    cts_free(&held->picture.depth_mm);
    cts_free(&held->picture.bound);
    if (!st)
        st = cts_files_frame_done(files, held->frame, held->writing, err);
    held->cpu_ms = cts_thread_cpu_ms() - cpu;
    return st;
}

static void share_out(const CtsStageTime before[CTS_N_STAGES], double cpu_ms, CtsReport *report)
{
    double all_wall_ms = 0, all_cpu_ms = 0;
    for (int s = 0; s < CTS_N_STAGES; s++) {
        all_wall_ms += report->stages[s].wall_ms - before[s].wall_ms;
        all_cpu_ms += report->stages[s].cpu_ms - before[s].cpu_ms;
    }
    const double share = cpu_ms < all_cpu_ms ? cpu_ms / all_cpu_ms : 1;
    for (int s = 0; s < CTS_N_STAGES; s++) {
        CtsStageTime *const t = &report->stages[s];
        t->wall_ms -= share * (t->wall_ms - before[s].wall_ms);
        t->cpu_ms -= share * (t->cpu_ms - before[s].cpu_ms);
    }
    cts_report_stage(report, CTS_STAGE_EXPORT, share * all_wall_ms, share * all_cpu_ms, 0, 0);
}

void cts_held_tell(CtsHeld *held, CtsFiles *files, const CtsStageTime before[CTS_N_STAGES], CtsReport *report)
{
    /* Times that were taken while something else ran are nobody's; what was made is. */
    CtsStageTime *const made = &held->writing->stages[CTS_STAGE_EXPORT];
    share_out(before, held->cpu_ms, report);
    cts_report_stage(report, CTS_STAGE_EXPORT, 0, 0, made->items, made->bytes);
    memset(held->writing->stages, 0, sizeof held->writing->stages);
    for (size_t i = 0; i < held->writing->findings.n; i++) {
        const CtsFinding *f = &held->writing->findings.items[i];
        cts_report_finding(report, f->code, f->severity, "%s", f->text);
    }
    cts_findings_free(&held->writing->findings);
    cts_files_tell(files);
}

void cts_held_free(CtsHeld *held)
{
    cts_free(&held->picture.pixels);
    cts_free(&held->picture.depth_mm);
    cts_free(&held->picture.bound);
}
