#include "transfer/lut.h"

#include "base/mem.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static void count_visible(CtsLut *l)
{
    l->visible_below[0] = 0;
    for (int g = 0; g < CTS_N_GREY; g++)
        l->visible_below[g + 1] = l->visible_below[g] + (l->extinction_per_mm[g] > 0);
    l->any_visible = l->visible_below[CTS_N_GREY] > 0;
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

CtsStatus cts_lut_new(CtsLut **lut, const CtsPreset *preset, const CtsVolume *volume, double extinction_scale,
                      int n_threads, CtsError *err)
{
    CtsStatus st;
    CtsLut *l = *lut = calloc(1, sizeof *l);
    if (!l)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = cts_alloc_array(&l->rgb, CTS_N_GREY, err)) ||
        (st = cts_alloc_array(&l->extinction_per_mm, CTS_N_GREY, err)) ||
        (st = cts_alloc_array(&l->visible_below, CTS_N_GREY + 1, err))) {
        cts_lut_free(lut);
        return st;
    }
    const int settled = settled_level(preset, volume);
    double most = 0;
#pragma omp parallel for schedule(static) num_threads(n_threads) reduction(max : most)
    for (int g = 0; g <= settled; g++) {
        const double hu = cts_volume_hu(volume, (uint16_t)g);
        double rgb[3];
        cts_preset_colour(preset, hu, rgb);
        for (int c = 0; c < 3; c++)
            l->rgb[g][c] = (float)rgb[c];
        const double extinction = cts_preset_extinction_per_mm(preset, hu) * extinction_scale;
        l->extinction_per_mm[g] = (float)extinction;
        most = extinction > most ? extinction : most;
    }
    for (int g = settled + 1; g < CTS_N_GREY; g++) {
        memcpy(l->rgb[g], l->rgb[settled], sizeof l->rgb[g]);
        l->extinction_per_mm[g] = l->extinction_per_mm[settled];
    }
    l->max_extinction_per_mm = most;
    count_visible(l);
    return CTS_OK;
}

void cts_lut_hide(CtsLut *lut, const CtsVoidKey *key, const CtsVolume *volume)
{
    lut->max_extinction_per_mm = 0;
    for (int g = 0; g < CTS_N_GREY; g++) {
        if (cts_void_key_drops(key, cts_volume_hu(volume, (uint16_t)g)))
            lut->extinction_per_mm[g] = 0;
        if ((double)lut->extinction_per_mm[g] > lut->max_extinction_per_mm)
            lut->max_extinction_per_mm = (double)lut->extinction_per_mm[g];
    }
    count_visible(lut);
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
