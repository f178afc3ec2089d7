#include "app/job/auto_window.h"

#include "ctsplat/mixture.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* SIDE: pixels of a side; 16384 pixels have 160 in the top percentile. MAX_VIEWS: from the front and from the side,
 * between which a rotation's pictures lie. ROUND_HU: readable limits that do not change with small changes of a series.
 * NARROWEST_HU: noise alone has a wider histogram. */
enum { SIDE = 128, MAX_VIEWS = 2, ROUND_HU = 10, NARROWEST_HU = 50 };

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

/* Renders a small projection and appends its values, except air and empty pixels, to the n values; 0 is the low end of
 * wide's window, 1 the high end. */
static CtsStatus render_projection(const CtsModel *model, const CtsPreset *wide, const CtsRenderSettings *settings,
                                   double turn_deg, float *values, size_t *n, CtsError *err)
{
    const CtsVolume *const volume = model->volume;
    CtsRenderSettings s;
    CtsPicture *picture = NULL;
    cts_render_defaults(&s);
    s.width = s.height = SIDE;
    s.azimuth_deg = settings->azimuth_deg + turn_deg;
    s.elevation_deg = settings->elevation_deg;
    s.slab_mm = settings->slab_mm;
    s.slab_at_mm = settings->slab_at_mm;
    s.n_threads = settings->n_threads;
    s.stop = settings->stop;
    const CtsStatus st = cts_render(model, wide, &s, &picture, NULL, err);
    const double air =
        (volume->hu_offset + volume->hu_step - wide->window_low_hu) / (wide->window_high_hu - wide->window_low_hu);
    for (int i = 0; !st && i < SIDE * SIDE; i++) {
        const float value = picture->pixels[(size_t)i * (size_t)picture->n_channels];
        if (value >= air)
            values[(*n)++] = value;
    }
    cts_picture_free(&picture);
    return st;
}

/* Sets the window from the 5th to the 99th percentile of the values, at least NARROWEST_HU wide. */
static void set_window(CtsPreset *preset, const CtsPreset *wide, const float *values, size_t n)
{
    const double width = wide->window_high_hu - wide->window_low_hu;
    const double low = wide->window_low_hu + width * (n ? values[n / 20] : 0);
    const double high = wide->window_low_hu + width * (n ? values[n - 1 - n / 100] : 1);
    const double middle = (low + high) / 2, half = fmax(high - low, NARROWEST_HU) / 2;
    preset->window_low_hu = ROUND_HU * floor((middle - half) / ROUND_HU);
    preset->window_high_hu = ROUND_HU * ceil((middle + half) / ROUND_HU);
}

CtsStatus cts_auto_window(const CtsModel *model, const CtsRenderSettings *settings, CtsPreset *preset,
                          CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsVolume *const volume = model->volume;
    if (preset->mode == CTS_MODE_COMPOSITE || preset->window_low_hu < preset->window_high_hu)
        return CTS_OK;
    CtsPreset wide = *preset;
    wide.window_low_hu = volume->hu_offset - volume->hu_step; /* level 0 lies outside the volume */
    wide.window_high_hu = volume->hu_offset + volume->hu_step * UINT16_MAX;
    const int n_views = settings->rotation_frames > 1 ? MAX_VIEWS : 1;
    float *values = malloc(sizeof(float[MAX_VIEWS][SIDE * SIDE]));
    size_t n = 0;
    if (!values)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < n_views && !st; i++)
        st = render_projection(model, &wide, settings, 90.0 * i, values, &n, err);
    if (!st) {
        qsort(values, n, sizeof *values, by_value);
        set_window(preset, &wide, values, n);
        cts_report_plan(report, "window %g to %g HU, fitted to mode %s (`window` gives another)", preset->window_low_hu,
                        preset->window_high_hu, cts_mode_names[preset->mode]);
    }
    free(values);
    return st;
}

static CtsStatus find_contrast(const CtsVolume *volume, int n_threads, bool *found, CtsError *err)
{
    uint64_t *count = NULL;
    CtsMixture mixture;
    CtsStatus st = cts_volume_histogram(volume, n_threads, &count, err);
    if (!st && !(st = cts_mixture_fit(count, volume->hu_offset, volume->hu_step, &mixture, err)))
        *found = cts_mixture_has_contrast(&mixture);
    cts_volume_histogram_free(&count);
    return st;
}

CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, bool *missing, CtsError *err)
{
    bool found = true;
    const CtsStatus st = preset->needs_contrast ? find_contrast(volume, n_threads, &found, err) : CTS_OK;
    *missing = !st && !found;
    if (!*missing)
        return st;
    const CtsPreset *bone = cts_preset_builtin(0);
    preset->n_colour = bone->n_colour;
    memcpy(preset->colour, bone->colour, sizeof bone->colour);
    return CTS_OK;
}

void cts_contrast_report(const CtsPreset *preset, CtsReport *report)
{
    cts_report_diagnostic(
        report, CTS_DIAGNOSTIC_NO_CONTRAST,
        "preset %s: no contrast agent was found in the blood, so the picture shows bone, in the colours "
        "of bone (choose preset %s, or a series with contrast agent)",
        preset->name, cts_preset_builtin(0)->name);
}
