#include "engine/splat/sheet.h"

#include "base/mem.h"

enum { LEFT_MARGIN = 16, MARGINS = 64 };

CtsStatus cts_sheet_init(CtsSheet *s, const CtsPatches *patches, CtsError *err)
{
    CtsStatus st;
    *s = (CtsSheet){.last = {0, 0}};
    for (int c = 0; c < 2; c++)
        s->last[c] = patches->last_voxel[c] * patches->density[c];
    s->stride = ((size_t)s->last[0] + 1 + MARGINS + 15) / 16 * 16;
    /* Rows a large power of two apart would fall on the same cache lines. */
    if (s->stride % 512 == 0)
        s->stride += 16;
    size_t n;
    if (cts_mul_overflows(s->stride, (size_t)s->last[1] + 2, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a layer's sheet is too large");
    if ((st = cts_alloc_zeroed(&s->memory, n, err)))
        return st;
    s->origin = s->memory + LEFT_MARGIN;
    if ((st = cts_alloc_array(&s->step, (size_t)patches->n_swaths, err)))
        return st;
    for (int i = 0; i < patches->n_swaths; i++)
        s->step[i] = -1;
    return CTS_OK;
}

void cts_sheet_free(CtsSheet *s)
{
    cts_free(&s->memory);
    cts_free(&s->step);
}
