#include "ctsplat/picture.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include "ctsplat/bounds.h"
#include <stdlib.h>

CtsStatus cts_picture_new(CtsPicture **picture, int width, int height, int n_channels, CtsError *err)
{
    *picture = NULL;
    if (width < 1 || height < 1 || width > CTS_MAX_SIDE || height > CTS_MAX_SIDE)
        return cts_fail(err, CTS_ERR_USAGE, "a picture of %dx%d pixels is not possible (1 to %d each way)", width,
                        height, CTS_MAX_SIDE);
    if (n_channels != 1 && n_channels != 4)
        return cts_fail(err, CTS_ERR_INTERNAL, "a picture has 1 or 4 channels, not %d", n_channels);
    CtsPicture *p = calloc(1, sizeof *p);
    if (!p)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    p->width = width;
    p->height = p->whole_height = height;
    p->n_channels = n_channels;
    p->has_alpha = n_channels == 4;
    const CtsStatus st = cts_alloc_zeroed(&p->pixels, (size_t)width * height * n_channels, err);
    if (st)
        cts_picture_free(&p);
    *picture = p;
    return st;
}

void cts_picture_free(CtsPicture **picture)
{
    CtsPicture *p = *picture;
    if (!p)
        return;
    cts_free(&p->pixels);
    cts_free(&p->depth_mm);
    cts_free(&p->bound);
    free(p);
    *picture = NULL;
}

typedef struct Over {
    f32x4 *pixels;
    f32x4 background; /* alpha 0 */
} Over;

static void over_pixels(void *context, int worker, size_t first, size_t end)
{
    const Over *const o = context;
    (void)worker;
    for (f32x4 *p = o->pixels + first; p < o->pixels + end; p++) {
        *p += (1.0f - (*p)[3]) * o->background;
        (*p)[3] = 1.0f;
    }
}

void cts_picture_over(CtsPicture *picture, const double background[3], int n_threads)
{
    if (picture->n_channels != 4)
        return;
    Over over = {(f32x4 *)picture->pixels, {(float)background[0], (float)background[1], (float)background[2]}};
    cts_parallel(cts_threads(n_threads), (size_t)picture->width * picture->height, 0, over_pixels, &over);
    picture->has_alpha = false;
    picture->info.grey &= background[0] == background[1] && background[1] == background[2];
}
