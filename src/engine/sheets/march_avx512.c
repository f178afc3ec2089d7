/* The kernels with AVX-512. Compiled for F, BW, DQ and VL; chosen only where the processor has them. */
#include "engine/sheets/sheets.h"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__AVX512VL__)

#include "engine/sheets/march_tmpl.h"

/* Windows of up to 8 x 8 voxels fit two registers; what pixels so coarse that they need more see is gathered. */
SHEETS_MARCH(march_gathered, 0)
SHEETS_MARCH(march_4_rows, 4)
SHEETS_MARCH(march_6_rows, 6)
SHEETS_MARCH(march_8_rows, 8)

static void march_windows(SHEETS_MARCH_ARGUMENTS)
{
    const int rows = g->reach[0] <= 8 ? g->reach[1] : 9;
    (rows <= 4   ? march_4_rows
     : rows <= 6 ? march_6_rows
     : rows <= 8 ? march_8_rows
                 : march_gathered)(j, g, x, y, visible, out, counts);
}

const SheetsKernels cts_sheets_avx512 = {"AVX-512", march_windows, find_visible, fill_opacity, fill_light};

#else

const SheetsKernels cts_sheets_avx512;

#endif
