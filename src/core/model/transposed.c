#include "core/model/transposed.h"

#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include "core/model/macrocells.h"

typedef struct Transposing {
    const CtsVolume *volume;
    uint16_t *copy;
} Transposing;

/* Parts of ROWS x COLUMNS voxels stay in the cache: the fastest of nine sizes on a layer of 512 x 512 voxels. */
static void transpose_layer(const uint16_t *from, size_t nx, size_t ny, uint16_t *to)
{
    enum { SIDE = 8, ROWS = 64, COLUMNS = 32 };
    const size_t whole_x = nx - nx % SIDE, whole_y = ny - ny % SIDE;
    for (size_t y0 = 0; y0 < whole_y; y0 += ROWS)
        for (size_t x0 = 0; x0 < whole_x; x0 += COLUMNS)
            for (size_t x = x0; x < whole_x && x < x0 + COLUMNS; x += SIDE)
                for (size_t y = y0; y < whole_y && y < y0 + ROWS; y += SIDE)
                    transpose_8x8(from + y * nx + x, nx, to + x * ny + y, ny);
    for (size_t y = 0; y < ny; y++)
        for (size_t x = y < whole_y ? whole_x : 0; x < nx; x++)
            to[x * ny + y] = from[y * nx + x];
}

static void transpose_some(void *context, int worker, size_t first, size_t end)
{
    const Transposing *const t = context;
    const size_t nx = (size_t)t->volume->dims[0], ny = (size_t)t->volume->dims[1];
    (void)worker;
    for (size_t k = first; k < end; k++)
        transpose_layer(t->volume->grey + k * nx * ny, nx, ny, t->copy + k * nx * ny);
}

CtsStatus cts_model_transposed(const CtsModel *model, int n_threads, const uint16_t **grey, CtsError *err)
{
    const CtsVolume *const volume = model->volume;
    CtsMacrocells *const m = model->macrocells;
    CtsStatus st = CTS_OK;
    pthread_mutex_lock(&m->lock);
    if (!m->transposed && !(st = cts_alloc_array(&m->transposed, cts_volume_n_voxels(volume), err))) {
        Transposing t = {volume, m->transposed};
        cts_parallel(n_threads, (size_t)volume->dims[2], 1, transpose_some, &t);
    }
    *grey = m->transposed;
    pthread_mutex_unlock(&m->lock);
    return st;
}
