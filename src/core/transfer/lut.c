#include "core/transfer/lut.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Whether a point of the preset shows something between two levels; key may be NULL. */
static void mark_points(uint8_t *between, const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key)
{
    for (int i = 0; i < preset->n_opacity; i++) {
        const double hu = preset->opacity[i].hu, level = floor((hu - volume->hu_offset) / volume->hu_step);
        if (preset->opacity[i].opacity > 0 && level >= 0 && level < CTS_N_GREY - 1 &&
            !(key && cts_void_key_drops(key, hu)))
            between[(int)level] = 1;
    }
}

static void count_visible(CtsLut *l, const uint8_t *between)
{
    const float *e = l->extinction_per_mm;
    uint32_t n = 0;
    for (int g = 0; g < CTS_N_GREY; g++) {
        l->visible_below[2 * g] = n;
        n += e[g] > 0;
        l->visible_below[2 * g + 1] = n;
        n += g + 1 < CTS_N_GREY && (e[g] > 0 || e[g + 1] > 0 || between[g]) && !CTS_MUTATED(WHOLE_LEVELS);
    }
    l->any_visible = n > 0;
}

static CtsStatus find_visible(CtsLut *l, const CtsPreset *preset, const CtsVolume *volume, const CtsVoidKey *key,
                              CtsError *err)
{
    uint8_t *between;
    const CtsStatus st = cts_alloc_zeroed(&between, CTS_N_GREY, err);
    if (st)
        return st;
    mark_points(between, preset, volume, key);
    count_visible(l, between);
    cts_free(&between);
    return CTS_OK;
}

void cts_lut_visible_levels(const CtsLut *lut, int *low, int *high)
{
    const uint32_t *below = lut->visible_below, all = below[2 * CTS_N_GREY - 1];
    int first = 0, last = 2 * CTS_N_GREY - 2; /* half levels */
    while (first < last && below[first + 1] == 0)
        first++;
    while (last > first && below[last] == all)
        last--;
    *low = first > 0 ? (first - 1) / 2 : 0;
    *high = last < 2 * CTS_N_GREY - 2 ? last / 2 + 1 : CTS_N_GREY - 1;
}

/* The first grey level past all of the preset's points, or the last: from there on nothing changes. */
static int settled_level(const CtsPreset *preset, const CtsVolume *volume)
{
    double last_hu = -INFINITY;
    if (preset->n_opacity > 0)
        last_hu = preset->opacity[preset->n_opacity - 1].hu;
    if (preset->n_colour > 0)
        last_hu = fmax(last_hu, preset->colour[preset->n_colour - 1].hu);
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

enum { MOST_WORKERS = 64 };

typedef struct Fill {
    CtsLut *lut;
    const CtsPreset *preset;
    const CtsVolume *volume;
    double extinction_scale;
    double *most; /* the largest extinction that each worker met */
} Fill;

static void fill_levels(void *context, int worker, size_t first, size_t end)
{
    const Fill *const f = context;
    for (size_t g = first; g < end; g++) {
        const double hu = cts_volume_hu(f->volume, (uint16_t)g);
        double rgb[3];
        cts_preset_colour(f->preset, hu, rgb);
        for (int c = 0; c < 3; c++)
            f->lut->rgb[g][c] = (float)rgb[c];
        const double extinction = cts_preset_extinction_per_mm(f->preset, hu) * f->extinction_scale;
        f->lut->extinction_per_mm[g] = (float)extinction;
        f->most[worker] = fmax(f->most[worker], extinction);
    }
}

CtsStatus cts_lut_new(CtsLut **lut, const CtsPreset *preset, const CtsVolume *volume, double extinction_scale,
                      int n_threads, CtsError *err)
{
    CtsStatus st;
    double most[MOST_WORKERS] = {0};
    CtsLut *l = *lut = calloc(1, sizeof *l);
    if (!l)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = cts_alloc_array(&l->rgb, CTS_N_GREY, err)) ||
        (st = cts_alloc_array(&l->extinction_per_mm, CTS_N_GREY, err)) ||
        (st = cts_alloc_array(&l->visible_below, 2 * CTS_N_GREY, err))) {
        cts_lut_free(lut);
        return st;
    }
    const int settled = settled_level(preset, volume);
    Fill fill = {l, preset, volume, extinction_scale, most};
    cts_parallel(n_threads < MOST_WORKERS ? n_threads : MOST_WORKERS, (size_t)settled + 1, 0, fill_levels, &fill);
    for (int w = 0; w < MOST_WORKERS; w++)
        l->max_extinction_per_mm = fmax(l->max_extinction_per_mm, most[w]);
    for (int g = settled + 1; g < CTS_N_GREY; g++) {
        memcpy(l->rgb[g], l->rgb[settled], sizeof l->rgb[g]);
        l->extinction_per_mm[g] = l->extinction_per_mm[settled];
    }
    if ((st = find_visible(l, preset, volume, NULL, err)))
        cts_lut_free(lut);
    return st;
}

CtsStatus cts_lut_hide(CtsLut *lut, const CtsVoidKey *key, const CtsPreset *preset, const CtsVolume *volume,
                       CtsError *err)
{
    lut->max_extinction_per_mm = 0;
    for (int g = 0; g < CTS_N_GREY; g++) {
        if (cts_void_key_drops(key, cts_volume_hu(volume, (uint16_t)g)))
            lut->extinction_per_mm[g] = 0;
        if ((double)lut->extinction_per_mm[g] > lut->max_extinction_per_mm)
            lut->max_extinction_per_mm = (double)lut->extinction_per_mm[g];
    }
    return find_visible(lut, preset, volume, key, err);
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
