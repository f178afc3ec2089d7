/* Confidence limits of a picture's error, for any distribution of errors. */
#pragma once

#include "ctsplat/report.h"

/* rmse_low and rmse_high (together 95 %) and share_high (97.5 %) from rmse, share_above, unit and capped: limits that
 * hold for any picture, as they assume nothing of pixels that were not sampled. A pixel's squared error is 0..1. */
void cts_error_limits(CtsVerified *verified);

/* Upper limit (Chernoff's bound) of the mean of n numbers, when independent random terms, none larger than `most`,
 * whose expectations sum to the sum of all n, came out with this sum. It holds with a probability of 99.9 %. n_limits
 * limits (0 counts as 1) that are computed so hold all together with that probability: each has its part of the chance
 * to fail (union bound). */
double cts_mean_limit(double sum, double most, double n, int n_limits);
