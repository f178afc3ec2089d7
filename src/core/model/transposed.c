#include "core/model/transposed.h"

#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include <pthread.h>

struct CtsTransposed {
    pthread_mutex_t lock;
    uint16_t *grey; /* NULL: not made */
};

CtsStatus cts_transposed_new(CtsTransposed **transposed, CtsError *err)
{
    const CtsStatus st = cts_alloc_zeroed(transposed, 1, err);
    if (!st)
        pthread_mutex_init(&(*transposed)->lock, NULL); /* never fails without attributes */
    return st;
}

void cts_transposed_free(CtsTransposed **transposed)
{
    if (!*transposed)
        return;
    pthread_mutex_destroy(&(*transposed)->lock);
    cts_free(&(*transposed)->grey);
    cts_free(transposed);
}

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

CtsStatus cts_transposed_find(CtsTransposed *transposed, const CtsVolume *volume, int n_threads, const uint16_t **grey,
                              CtsError *err)
{
    CtsStatus st = CTS_OK;
    pthread_mutex_lock(&transposed->lock);
    if (!transposed->grey && !(st = cts_alloc_array(&transposed->grey, cts_volume_n_voxels(volume), err))) {
        Transposing t = {volume, transposed->grey};
        cts_parallel(n_threads, (size_t)volume->dims[2], 1, transpose_some, &t);
    }
    *grey = transposed->grey;
    pthread_mutex_unlock(&transposed->lock);
    return st;
}
