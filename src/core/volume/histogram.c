#include "ctsplat/volume.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/volume/levels.h"
#include <string.h>

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

/* The grey level below or at which a share of the voxels lies; count: from level `from` on. */
static int level_below(const uint64_t *count, int from, double share)
{
    uint64_t n = 0, below = 0;
    for (int g = from; g < N_GREY; g++)
        n += count[g];
    for (int g = from; g < N_GREY; g++)
        if ((double)(below += count[g]) >= share * (double)n)
            return g;
    return N_GREY - 1;
}

/* Otsu's threshold (1979), the last level of the lower of two classes with the largest variance between them; levels
 * above `last` count as it. -1 where all are one. */
static int otsu(const uint64_t *count, int last)
{
    double n = 0, sum = 0, n_low = 0, sum_low = 0, best = 0;
    int threshold = -1;
    for (int g = 0; g < N_GREY; g++) {
        n += (double)count[g];
        sum += (double)count[g] * (g < last ? g : last);
    }
    for (int g = 0; g < last; g++) {
        n_low += (double)count[g];
        sum_low += (double)count[g] * g;
        const double n_high = n - n_low;
        if (!(n_low > 0 && n_high > 0))
            continue;
        const double apart = sum_low / n_low - (sum - sum_low) / n_high, between = n_low * n_high * apart * apart;
        if (between > best) {
            best = between;
            threshold = g;
        }
    }
    return threshold;
}

CtsStatus cts_volume_measure_levels(CtsVolume *v, int n_slices, int n_threads, CtsError *err)
{
    static const double bright = 0.995;
    CtsVolume scanned = *v;
    uint64_t *count = NULL;
    scanned.dims[2] = n_slices;
    if (v->quantity == CTS_QUANTITY_HU)
        return CTS_OK;
    const CtsStatus st = cts_volume_histogram(&scanned, n_threads, &count, err);
    if (st)
        return st;
    /* A few hot organs of a PET are no class of their own, so they count as the 99.5th percentile of all. */
    int threshold = otsu(count, level_below(count, 0, bright));
    threshold = threshold < 0 ? otsu(count, N_GREY - 1) : threshold;
    if (threshold >= 0) {
        v->bright_value = cts_volume_hu(v, (uint16_t)level_below(count, threshold + 1, bright));
        v->air_limit = cts_volume_hu(v, (uint16_t)threshold);
        memset(count + threshold + 1, 0, (size_t)(N_GREY - threshold - 1) * sizeof *count);
        v->air_value = cts_volume_hu(v, (uint16_t)level_below(count, 0, 0.5));
    }
    cts_volume_histogram_free(&count);
    return CTS_OK;
}
