#include "base/stage_timer.h"

#include "base/clock.h"

static void sum_stages(const CtsReport *report, double *wall_ms, double *cpu_ms)
{
    *wall_ms = *cpu_ms = 0;
    for (int s = 0; report && s < CTS_N_STAGES; s++) {
        *wall_ms += report->stages[s].wall_ms;
        *cpu_ms += report->stages[s].cpu_ms;
    }
}

CtsStageTimer cts_stage_timer_start(const CtsReport *report)
{
    CtsStageTimer meter = {.wall_ms = cts_wall_ms(), .cpu_ms = cts_cpu_ms()};
    sum_stages(report, &meter.known_wall_ms, &meter.known_cpu_ms);
    return meter;
}

void cts_stage_timer_stop(CtsStageTimer meter, CtsReport *report, CtsStage stage)
{
    double wall_ms, cpu_ms;
    sum_stages(report, &wall_ms, &cpu_ms);
    const double wall_left = cts_wall_ms() - meter.wall_ms - (wall_ms - meter.known_wall_ms);
    const double cpu_left = cts_cpu_ms() - meter.cpu_ms - (cpu_ms - meter.known_cpu_ms);
    cts_report_stage(report, stage, wall_left > 0 ? wall_left : 0, cpu_left > 0 ? cpu_left : 0, 0, 0);
}
