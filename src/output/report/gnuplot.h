/* Plots by gnuplot, which is run as a program of its own. */
#ifndef CTS_REPORT_GNUPLOT_H
#define CTS_REPORT_GNUPLOT_H

#include "ctsplat/render.h"

/* One colour an engine, in all plots. */
extern const char *const cts_engine_colours[CTS_N_ENGINES];

/* Runs gnuplot on a script that sets an SVG terminal and no output; *svg is what it drew, to be freed with free().
 * CTS_ERR_OUTPUT when gnuplot is not there or fails, with its own first words. */
CtsStatus cts_gnuplot(const char *script, char **svg, CtsError *err);

#endif
