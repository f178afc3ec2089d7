/* One verdict on all frames of a rotation. */
#ifndef CTS_JOB_POOLED_H
#define CTS_JOB_POOLED_H

#include "ctsplat/report.h"

/* Pooled rmse and interval, the largest maximum and percentile. */
void cts_verified_add(CtsVerified *all, const CtsVerified *frame);

#endif
