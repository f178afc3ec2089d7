/* Between what limits a picture's error lies, whatever its errors are like. */
#ifndef CTS_BASE_LIMITS_H
#define CTS_BASE_LIMITS_H

#include "ctsplat/report.h"

/* rmse_low and rmse_high (together 95 %) and share_high (97.5 %) from rmse, share_above, unit and capped: limits that
 * hold for any picture, as they assume nothing of pixels that were not sampled. A pixel's squared error is 0..1. */
void cts_error_limits(CtsVerified *verified);

/* What the expectation of a sum of independent terms, each 0..1, does not exceed with a probability of 99.9 %, when the
 * sum came out like this (Chernoff's bound). */
double cts_expectation_limit(double sum);
/* Likewise the mean of all, when n of them, drawn by chance, had this sum, and none is larger than `most`. */
double cts_mean_limit(double sum, double most, double n);

#endif
