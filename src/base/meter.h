/* Times around a call, so that no time of a run is lost between its stages. */
#ifndef CTS_BASE_METER_H
#define CTS_BASE_METER_H

#include "ctsplat/report.h"

/* Measures a call: its time, minus the stages that it reported itself, is added to the given stage. */
typedef struct CtsMeter {
    double wall_ms, cpu_ms, known_wall_ms, known_cpu_ms;
} CtsMeter;
CtsMeter cts_meter_start(const CtsReport *report);
void cts_meter_stop(CtsMeter meter, CtsReport *report, CtsStage stage);

#endif
