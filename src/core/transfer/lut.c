#include "core/transfer/lut.h"

#include "base/mem.h"
#include "base/mutation.h"
#include <math.h>
#include <stdlib.h>

/* Marks intervals between levels in which a point of the preset has opacity. */
static void mark_points(uint8_t *between, int n, const CtsPreset *preset, const CtsVolume *volume,
                        const CtsVoidKey *key)
{
    for (int i = 0; i < preset->n_opacity; i++) {
        const double hu = preset->opacity[i].hu, level = floor((hu - volume->hu_offset) / volume->hu_step);
        if (preset->opacity[i].opacity > 0 && level >= 0 && level < n - 1 && !(key && cts_void_key_drops(key, hu)))
            between[(int)level] = 1;
    }
}

static void count_visible(CtsLut *l, const uint8_t *between)
{
    const float *e = l->extinction_per_mm;
    uint32_t n = 0;
    for (int g = 0; g < l->n; g++) {
        l->visible_below[2 * g] = n;
        n += e[g] > 0;
        l->visible_below[2 * g + 1] = n;
        n += g + 1 < l->n && (e[g] > 0 || e[g + 1] > 0 || between[g]) && !CTS_MUTATED(WHOLE_LEVELS);
    }
}

static CtsStatus find_visible_levels(CtsLut *l, const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key,
                                     CtsError *err)
{
    uint8_t *between;
    const CtsStatus st = cts_alloc_zeroed(&between, (size_t)l->n, err);
    if (st)
        return st;
    mark_points(between, l->n, preset, volume, key);
    count_visible(l, between);
    cts_free(&between);
    return CTS_OK;
}

void cts_lut_visible_levels(const CtsLut *lut, int *low, int *high)
{
    const uint32_t *below = lut->visible_below, all = below[2 * lut->n - 1];
    int first = 0, last = 2 * lut->n - 2; /* half levels */
    while (first < last && below[first + 1] == 0)
        first++;
    while (last > first && below[last] == all)
        last--;
    *low = first > 0 ? (first - 1) / 2 : 0;
    *high = last < 2 * lut->n - 2 ? last / 2 + 1 : CTS_N_GREY - 1;
}

/* The first grey level past all of the preset's points, and the key's, or the last: from there on nothing changes. */
static int settled_level(const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key)
{
    double last_hu = -INFINITY;
    if (preset->n_opacity > 0)
        last_hu = preset->opacity[preset->n_opacity - 1].hu;
    if (preset->n_colour > 0)
        last_hu = fmax(last_hu, preset->colour[preset->n_colour - 1].hu);
    for (int i = 0; key && i < key->n_ranges; i++)
        last_hu = fmax(last_hu, isfinite(key->range[i].below_hu) ? key->range[i].below_hu : key->range[i].from_hu);
    int below = 0, past = CTS_N_GREY - 1;
    while (below < past) {
        const int middle = (below + past) / 2;
        if (cts_volume_hu(volume, (uint16_t)middle) > last_hu)
            past = middle;
        else
            below = middle + 1;
    }
    return past;
}

static void fill_levels(CtsLut *l, const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key,
                        double extinction_scale)
{
    for (int g = 0; g < l->n; g++) {
        const double hu = cts_volume_hu(volume, (uint16_t)g);
        double rgb[3];
        cts_preset_colour(preset, hu, rgb);
        for (int c = 0; c < 3; c++)
            l->rgb[g][c] = (float)rgb[c];
        const bool drops = key && cts_void_key_drops(key, hu);
        const double extinction = drops ? 0 : cts_preset_extinction_per_mm(preset, hu) * extinction_scale;
        l->extinction_per_mm[g] = (float)extinction;
        l->max_extinction_per_mm = fmax(l->max_extinction_per_mm, extinction);
    }
}

CtsStatus cts_lut_new(CtsLut **lut, const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key,
                      double extinction_scale, CtsError *err)
{
    CtsStatus st;
    CtsLut *l = *lut = calloc(1, sizeof *l);
    if (!l)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const size_t n = (size_t)settled_level(preset, volume, key) + 1;
    l->n = (int)n;
    if (!(st = cts_alloc_array(&l->rgb, n, err)) && !(st = cts_alloc_array(&l->extinction_per_mm, n, err)) &&
        !(st = cts_alloc_array(&l->visible_below, 2 * n, err))) {
        fill_levels(l, preset, volume, key, extinction_scale);
        st = find_visible_levels(l, preset, volume, key, err);
    }
    if (st)
        cts_lut_free(lut);
    return st;
}

void cts_lut_free(CtsLut **lut)
{
    if (!*lut)
        return;
    cts_free(&(*lut)->rgb);
    cts_free(&(*lut)->extinction_per_mm);
    cts_free(&(*lut)->visible_below);
    free(*lut);
    *lut = NULL;
}
