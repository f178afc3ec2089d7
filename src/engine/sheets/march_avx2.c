/* The kernels with AVX2; chosen only where the processor has it. */
#include "engine/sheets/sheets.h"

#if defined(__AVX2__)

#include "engine/sheets/march_tmpl.h"

SHEETS_MARCH(march_gathered, 0)

const SheetsKernels cts_sheets_avx2 = {"AVX2", march_gathered, find_visible, fill_opacity, fill_light};

#else

const SheetsKernels cts_sheets_avx2;

#endif
