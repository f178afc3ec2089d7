#include "ctsplat/volume.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/volume/volume_new.h"
#include <math.h>

typedef struct Mapping {
    const uint16_t *from, *level;
    uint16_t *to;
} Mapping;

static void map_voxels(void *context, int worker, size_t first, size_t end)
{
    const Mapping *const m = context;
    (void)worker;
    for (size_t i = first; i < end; i++)
        m->to[i] = m->level[m->from[i]];
}

CtsStatus cts_volume_quantise(const CtsVolume *volume, int bits, double black_hu, double white_hu, int n_threads,
                              CtsVolume **quantised, CtsError *err)
{
    enum { N_GREY = 65536 };
    const double low_hu = fmin(black_hu, white_hu), high_hu = fmax(black_hu, white_hu);
    *quantised = NULL;
    if (bits < 1 || bits > 16 || high_hu == low_hu)
        return cts_fail(err, CTS_ERR_USAGE, "%d grey bits for a window of %g to %g HU (1 to 16 bits of a real window)",
                        bits, low_hu, high_hu);
    uint16_t *level = NULL;
    CtsVolume *v = NULL;
    const int top = (1 << bits) - 1;
    CtsStatus st = cts_alloc_array(&level, N_GREY, err);
    if (st || (st = cts_volume_new_like(&v, volume, volume->dims[2], err)))
        goto end;
    for (int g = 0; g < N_GREY; g++) {
        const double at = (cts_volume_hu(volume, (uint16_t)g) - low_hu) / (high_hu - low_hu) * top;
        level[g] = (uint16_t)floor(fmin(fmax(at, 0), top) + 0.5);
    }
    v->hu_offset = low_hu;
    v->hu_step = (high_hu - low_hu) / top;
    Mapping mapping = {volume->grey, level, v->grey};
    cts_parallel(cts_threads(n_threads), cts_volume_n_voxels(volume), 0, map_voxels, &mapping);
end:
    *quantised = v;
    cts_free(&level);
    return st;
}
