/* The filling outside a scan: one value that padding, rotating or masking has put there. */
#include "ctsplat/series.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "core/volume/components.h"
#include "core/volume/threshold.h"
#include "input/load/load.h"
#include <math.h>

/* Largest constant that is the scanner's air: cone beams have up to -760 HU. */
static const double FILL_HU = -700;
/* EQUAL: runs of equal voxels this long are not tissue: reconstruction noise makes two neighbours equal once in ten
 * times at most, and 15 pairs once in 1e15. DEEP: rows needed at one corner alone, twice the two that reslicing may
 * leave. */
enum { EQUAL = 16, DEEP = 4 };
/* Least difference between the darkest and the brightest voxel of a scan, a tenth of that of air and water; a label map
 * has less. */
static const double MIN_RANGE_HU = 100;

static const uint16_t *slice_of(const CtsScanned *s, int k)
{
    return s->even->grey + (size_t)k * cts_scanned_layer_voxels(s);
}

/* Number of voxels from `at` on, `step` apart, that equal the first, at most n. */
static int n_equal(const uint16_t *at, ptrdiff_t step, int n)
{
    int i = 1;
    while (i < n && at[i * step] == at[0])
        i++;
    return i;
}

/* The grey level of a slice's corner from which a row or column of equal voxels begins; 0: none. *is_deep: there are
 * several rows or columns. */
static uint16_t corner_level(const CtsVolume *v, const uint16_t *slice, bool right, bool bottom, bool *is_deep)
{
    const int nx = v->dims[0], ny = v->dims[1], max_x = nx < EQUAL ? nx : EQUAL, max_y = ny < EQUAL ? ny : EQUAL;
    const uint16_t *const corner = slice + (bottom ? (size_t)(ny - 1) * (size_t)nx : 0) + (right ? nx - 1 : 0);
    const int along_row = n_equal(corner, right ? -1 : 1, max_x);
    const int along_column = n_equal(corner, bottom ? -nx : nx, max_y);
    *is_deep = (along_row == max_x && along_column >= DEEP) || (along_column == max_y && along_row >= DEEP);
    return along_row == max_x || along_column == max_y ? *corner : 0;
}

/* The filling's level in a slice: deep at one corner, or at all four; 0: none. */
static uint16_t fill_of_slice(const CtsVolume *v, const uint16_t *slice)
{
    uint16_t levels[4];
    for (int corner = 0; corner < 4; corner++) {
        bool is_deep;
        levels[corner] = corner_level(v, slice, corner & 1, corner & 2, &is_deep);
        if (cts_volume_hu(v, levels[corner]) <= FILL_HU)
            levels[corner] = 0;
        if (levels[corner] && is_deep)
            return levels[corner];
    }
    const bool same = levels[0] == levels[1] && levels[0] == levels[2] && levels[0] == levels[3];
    return same ? levels[0] : 0;
}

bool cts_scanned_find_fill(const CtsScanned *s, double *hu)
{
    if (s->even->quantity != CTS_QUANTITY_HU) /* others have no value that filling exceeds */
        return false;
    const CtsVolume *const v = s->even;
    uint16_t fill = 0;
    if (!v->grey || v->hu_max - v->hu_min < MIN_RANGE_HU)
        return false;
    for (int k = 0; k < s->n_slices && !fill; k++)
        fill = fill_of_slice(v, slice_of(s, k));
    *hu = cts_volume_hu(v, fill);
    return fill;
}

/* Sets the voxels of a level. */
static CtsStatus find_equal(const uint16_t *slices, uint16_t level, int n_threads, CtsBits *equal, CtsError *err)
{
    CtsBits above = {0};
    const CtsStatus st = level < UINT16_MAX ? cts_bits_new(&above, equal->dims, err) : CTS_OK;
    cts_bits_threshold(equal, slices, level, n_threads);
    if (!st && level < UINT16_MAX) {
        cts_bits_threshold(&above, slices, (uint16_t)(level + 1), n_threads);
        cts_bits_combine(equal, CTS_BITS_AND_NOT, &above);
    }
    cts_bits_free(&above);
    return st;
}

/* Leaves those that are connected to the border. */
static CtsStatus keep_at_border(CtsBits *bits, CtsError *err)
{
    CtsComponents parts = {0};
    uint8_t *at_border = NULL;
    CtsStatus st = cts_components_find(&parts, bits, CTS_CONNECTED_BY_FACES, err);
    if (!st && !(st = cts_alloc_array(&at_border, parts.n_parts, err))) {
        for (uint32_t p = 0; p < parts.n_parts; p++)
            at_border[p] = cts_component_at_border(&parts, p, 3);
        cts_components_paint(&parts, at_border, bits);
    }
    cts_free(&at_border);
    cts_components_free(&parts);
    return st;
}

CtsStatus cts_scanned_clear_fill(CtsScanned *s, double hu, int n_threads, uint64_t *n_cleared, CtsError *err)
{
    const CtsVolume *const v = s->even;
    const int dims[3] = {v->dims[0], v->dims[1], s->n_slices};
    const double level = floor((hu - v->hu_offset) / v->hu_step + 0.5);
    CtsBits fill = {0};
    CtsStatus st;
    *n_cleared = 0;
    if (!(level >= 1 && level <= UINT16_MAX)) /* 0 is air already */
        return CTS_OK;
    if (!(st = cts_bits_new(&fill, dims, err)) &&
        !(st = find_equal(slice_of(s, 0), (uint16_t)level, cts_threads(n_threads), &fill, err)) &&
        !(st = keep_at_border(&fill, err))) {
        uint16_t *grey = v->grey;
        for (int k = 0; k < dims[2]; k++)
            for (int j = 0; j < dims[1]; j++, grey += dims[0])
                for (int w = 0; w < (int)fill.row_words; w++)
                    for (uint64_t bits = cts_bits_row(&fill, j, k)[w]; bits; bits &= bits - 1)
                        grey[64 * w + __builtin_ctzll(bits)] = 0;
        *n_cleared = cts_bits_count(&fill);
    }
    cts_bits_free(&fill);
    return st;
}
