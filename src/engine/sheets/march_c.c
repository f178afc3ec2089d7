/* The kernels in plain C. */
#include "engine/sheets/march_tmpl.h"

SHEETS_MARCH(march_gathered, 0)

const SheetsKernels cts_sheets_c = {"plain C", march_gathered, find_visible, fill_opacity, fill_light};
