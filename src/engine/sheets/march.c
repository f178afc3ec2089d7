/* The kernels of sheets, on each SIMD path. */
#include "base/simd_path.h"

#include "engine/sheets/march_tmpl.h"

SHEETS_MARCH(march_gathered, 0)
#ifdef SIMD_PATH_AVX512
/* Windows of up to 8 x 8 voxels fit two registers; what pixels so coarse that they need more see is gathered. */
SHEETS_MARCH(march_4_rows, 4)
SHEETS_MARCH(march_6_rows, 6)
SHEETS_MARCH(march_8_rows, 8)

static void march_by_rows(const SheetsGroup *g, SheetsPixels *out)
{
    const int rows = g->grid->reach[0] <= 8 ? g->grid->reach[1] : 9;
    (rows <= 4 ? march_4_rows : rows <= 6 ? march_6_rows : rows <= 8 ? march_8_rows : march_gathered)(g, out);
}
#else
#define march_by_rows march_gathered
#endif

const SheetsKernels CTS_ON_PATH(cts_sheets) = {march_by_rows, find_visible, fill_slabs};
