/* The suite's results as a picture: how much of its bound each error takes. */
#ifndef CTS_CHECK_PLOT_H
#define CTS_CHECK_PLOT_H

#include "lab/check/check.h"
#include <stddef.h>

/* SVG by gnuplot. Names and engines of the results must still be valid. */
CtsStatus cts_check_plot(const CtsCheckResult *results, size_t n, const char *path, bool force, CtsError *err);

#endif
