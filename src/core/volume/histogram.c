#include "ctsplat/volume.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"

/* TABLES: neighbours are often equal, and interleaved tables avoid dependent increments. MAX_PARTS: largest number of
 * threads, which need 2 MiB each. */
enum { N_GREY = 65536, TABLES = 4, MAX_PARTS = 64 };

typedef struct Count {
    const uint16_t *grey;
    uint64_t *tables; /* TABLES for each worker */
} Count;

static void count_voxels(void *context, int worker, size_t first, size_t end)
{
    const Count *const c = context;
    const uint16_t *const grey = c->grey;
    uint64_t *const mine = c->tables + (size_t)worker * TABLES * N_GREY;
    size_t i = first;
    for (; i + TABLES <= end; i += TABLES)
        for (size_t t = 0; t < TABLES; t++)
            mine[t * N_GREY + grey[i + t]]++;
    for (; i < end; i++)
        mine[grey[i]]++;
}

CtsStatus cts_volume_histogram(const CtsVolume *volume, int n_threads, uint64_t **count, CtsError *err)
{
    CtsStatus st;
    uint64_t *tables = NULL;
    const size_t n = cts_volume_n_voxels(volume);
    const int asked = cts_threads(n_threads), parts = asked < MAX_PARTS ? asked : MAX_PARTS;
    *count = NULL;
    if ((st = cts_alloc_zeroed(&tables, (size_t)parts * TABLES * N_GREY, err)) ||
        (st = cts_alloc_zeroed(count, N_GREY, err)))
        goto end;
    Count job = {volume->grey, tables};
    cts_parallel(parts, n, 0, count_voxels, &job);
    for (size_t t = 0; t < (size_t)parts * TABLES; t++)
        for (size_t g = 0; g < N_GREY; g++)
            (*count)[g] += tables[t * N_GREY + g];
    uint64_t n_all = 1;
    for (int axis = 0; axis < 3; axis++)
        n_all *= (uint64_t)cts_volume_extent(volume, axis);
    (*count)[0] += n_all - n;
end:
    cts_free(&tables);
    return st;
}

void cts_volume_histogram_free(uint64_t **count)
{
    cts_free(count);
}
