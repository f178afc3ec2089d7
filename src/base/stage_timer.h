/* Times around a call, so that no time of a run is lost between its stages. */
#pragma once

#include "ctsplat/report.h"

/* Measures a call: its time, minus the stages that it reported itself, is added to the given stage. */
typedef struct CtsStageTimer {
    double wall_ms, cpu_ms, known_wall_ms, known_cpu_ms;
} CtsStageTimer;
CtsStageTimer cts_stage_timer_start(const CtsReport *report);
void cts_stage_timer_stop(CtsStageTimer meter, CtsReport *report, CtsStage stage);
