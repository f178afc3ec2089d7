#include "ctsplat/volume.h"

#include "base/cpu.h"
#include "base/mem.h"

/* Neighbours are often equal: each of four takes a table of its own, so that none waits for the other's sum. */
enum { N_GREY = 65536, TABLES = 4, MOST_PARTS = 64 };

CtsStatus cts_volume_histogram(const CtsVolume *volume, int n_threads, uint64_t **count, CtsError *err)
{
    CtsStatus st;
    uint64_t *tables = NULL;
    const uint16_t *grey = volume->grey;
    const size_t n = cts_volume_n_voxels(volume), whole = n / TABLES;
    const int asked = cts_threads(n_threads), parts = asked < MOST_PARTS ? asked : MOST_PARTS;
    *count = NULL;
    if ((st = cts_alloc_zeroed(&tables, (size_t)parts * TABLES * N_GREY, err)) ||
        (st = cts_alloc_zeroed(count, N_GREY, err)))
        goto end;
#pragma omp parallel for num_threads(parts) schedule(static, 1)
    for (int part = 0; part < parts; part++) {
        uint64_t *mine = tables + (size_t)part * TABLES * N_GREY;
        const size_t first = whole * (size_t)part / (size_t)parts, past = whole * ((size_t)part + 1) / (size_t)parts;
        for (size_t i = first * TABLES; i < past * TABLES; i += TABLES)
            for (int t = 0; t < TABLES; t++)
                mine[(size_t)t * N_GREY + grey[i + (size_t)t]]++;
    }
    for (size_t i = whole * TABLES; i < n; i++)
        tables[grey[i]]++;
    for (size_t t = 0; t < (size_t)parts * TABLES; t++)
        for (size_t g = 0; g < N_GREY; g++)
            (*count)[g] += tables[t * N_GREY + g];
end:
    cts_free(&tables);
    return st;
}

void cts_volume_histogram_free(uint64_t **count)
{
    cts_free(count);
}
