/* `ctsplat bench --paper`: the paper's engines, configured as in the paper (cones from a table, 8 bits, unlit, one
 * picture of each in turn), and their times in per cent of plain splatting beside the published ones. */
#pragma once

#include "lab/bench/bench.h"

enum { CTS_PAPER_ROUNDS = 15, CTS_PAPER_BITS = 8 };

/* Times are wall, or with one thread CPU time, which others disturb less. Free with cts_table_free(). */
CtsStatus cts_paper_table(const CtsBenchSettings *settings, CtsTable **table, CtsError *err);
