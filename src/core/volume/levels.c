/* Levels of air and of bright voxels of a volume whose values have no fixed meaning. */
#include "core/volume/levels.h"

#include <string.h>

enum { N_GREY = 65536 };

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

CtsStatus cts_volume_measure_levels(CtsVolume *v, const uint16_t *grey, int n_slices, int n_threads, CtsError *err)
{
    static const double bright = 0.995;
    CtsVolume scanned = *v;
    uint64_t *count = NULL;
    scanned.grey = (uint16_t *)(uintptr_t)grey;
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
