#include "app/job/auto_window.h"

#include "base/compare.h"
#include "ctsplat/mixture.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* SIDE: pixels of a side; 16384 pixels have 160 in the top percentile. MAX_VIEWS: from the front and from the side,
 * between which a rotation's pictures lie. */
enum { SIDE = 128, MAX_VIEWS = 2 };
/* Readable limits that do not change with small changes of a series. */
static const double round_hu = 10;
/* Noise alone has a wider histogram. */
static const double narrowest_hu = 50;

/* Renders a small projection and appends its values, except air and empty pixels, to the n values; 0 is the low end of
 * wide's window, 1 the high end. */
static CtsStatus render_projection(const CtsModel *model, const CtsPreset *wide, const CtsRenderSettings *settings,
                                   double turn_deg, double *values, size_t *n, CtsError *err)
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
    const double least_hu =
        volume->quantity == CTS_QUANTITY_HU ? volume->hu_offset + volume->hu_step : volume->air_limit;
    const double air = (least_hu - wide->window_low_hu) / (wide->window_high_hu - wide->window_low_hu);
    for (int i = 0; !st && i < SIDE * SIDE; i++) {
        const float value = picture->pixels[(size_t)i * (size_t)picture->n_channels];
        if (value >= air)
            values[(*n)++] = value;
    }
    cts_picture_free(&picture);
    return st;
}

/* A tenth of this width, at most: 1, 2 or 5 times a power of ten. */
static double round_step(double width)
{
    const double power = pow(10, floor(log10(width / 10))), times = width / 10 / power;
    return power * (times >= 5 ? 5 : times >= 2 ? 2 : 1);
}

/* Sets the window from the 5th to the 99th percentile of the values, at least narrowest_hu or two grey levels wide. */
static void set_window(CtsPreset *preset, const CtsPreset *wide, const CtsVolume *volume, const double *values,
                       size_t n)
{
    const bool is_hu = volume->quantity == CTS_QUANTITY_HU;
    const double width = wide->window_high_hu - wide->window_low_hu;
    const double low = wide->window_low_hu + width * (n ? values[n / 20] : 0);
    const double high = wide->window_low_hu + width * (n ? values[n - 1 - n / 100] : 1);
    const double middle = (low + high) / 2, half = fmax(high - low, is_hu ? narrowest_hu : 2 * volume->hu_step) / 2;
    const double step = is_hu ? round_hu : round_step(2 * half);
    preset->window_low_hu = step * floor((middle - half) / step);
    preset->window_high_hu = step * ceil((middle + half) / step);
}

static CtsStatus auto_window(const CtsModel *model, const CtsRenderSettings *settings, CtsPreset *preset,
                             CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsVolume *const volume = model->volume;
    if (preset->mode == CTS_MODE_COMPOSITE || preset->window_low_hu != preset->window_high_hu)
        return CTS_OK;
    const char *const unit = cts_quantity_units[volume->quantity];
    CtsPreset wide = *preset;
    wide.window_low_hu = volume->hu_offset - volume->hu_step; /* level 0 lies outside the volume */
    wide.window_high_hu = volume->hu_offset + volume->hu_step * UINT16_MAX;
    const int n_views = settings->rotation_frames > 1 ? MAX_VIEWS : 1;
    double *values = malloc(sizeof(double[MAX_VIEWS][SIDE * SIDE]));
    size_t n = 0;
    if (!values)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < n_views && !st; i++)
        st = render_projection(model, &wide, settings, 90.0 * i, values, &n, err);
    if (!st) {
        qsort(values, n, sizeof *values, cts_compare_double);
        set_window(preset, &wide, volume, values, n);
        cts_report_plan(report, "window %g to %g%s%s, fitted to mode %s (`window` gives another)",
                        preset->window_low_hu, preset->window_high_hu, *unit ? " " : "", unit,
                        cts_mode_names[preset->mode]);
    }
    free(values);
    return st;
}

CtsStatus cts_fit_preset(const CtsModel *model, const CtsRenderSettings *settings, CtsPreset *preset, CtsReport *report,
                         CtsError *err)
{
    const CtsVolume *const v = model->volume;
    const bool is_relative = preset->scale == CTS_SCALE_RELATIVE;
    const CtsStatus st = cts_preset_resolve(preset, v, err);
    if (!st && is_relative)
        cts_report_plan(report,
                        "preset %s is relative: its 0, the level of air, is %.6g, its 1, the 99.5th percentile of "
                        "values above Otsu's threshold %.6g, is %.6g (%s)",
                        preset->name, v->air_value, v->air_limit, v->bright_value, cts_quantity_names[v->quantity]);
    return st ? st : auto_window(model, settings, preset, report, err);
}

CtsStatus cts_contrast_check(const CtsVolume *volume, int n_threads, CtsPreset *preset, bool *missing, CtsError *err)
{
    const CtsPreset *const bone = cts_preset_builtin(0);
    uint64_t *count = NULL;
    CtsMixture mixture;
    *missing = false;
    if (!preset->needs_contrast)
        return CTS_OK;
    CtsStatus st = cts_volume_histogram(volume, n_threads, &count, err);
    if (!st && !(st = cts_mixture_fit(count, volume->hu_offset, volume->hu_step, &mixture, err)))
        *missing = !cts_mixture_has_contrast(&mixture);
    cts_volume_histogram_free(&count);
    if (*missing) {
        preset->n_colour = bone->n_colour;
        memcpy(preset->colour, bone->colour, sizeof bone->colour);
    }
    return st;
}

void cts_contrast_report(const CtsPreset *preset, CtsReport *report)
{
    cts_report_diagnostic(
        report, CTS_DIAGNOSTIC_NO_CONTRAST,
        "preset %s: no contrast agent was found in the blood, so the picture shows bone, in the colours "
        "of bone (choose preset %s, or a series with contrast agent)",
        preset->name, cts_preset_builtin(0)->name);
}
