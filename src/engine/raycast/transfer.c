#include "engine/raycast/raycaster.h"

#include "base/compare.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int sort_unique(double *x, int n)
{
    qsort(x, (size_t)n, sizeof *x, cts_compare_double);
    int kept = 0;
    for (int i = 0; i < n; i++)
        if (kept == 0 || x[i] > x[kept - 1])
            x[kept++] = x[i];
    return kept;
}

/* The HU inside low..high at which a line of opacity passes the cap, or NAN. */
static double cap_hu(const CtsPreset *preset, double low, double high)
{
    const double cap = -expm1(-CTS_MAX_EXTINCTION_PER_MM * preset->unit_distance_mm);
    const double a = cts_preset_opacity(preset, low), b = cts_preset_opacity(preset, nextafter(high, low));
    if ((a < cap) == (b < cap))
        return NAN;
    const double hu = low + (high - low) * ((cap - a) / (b - a));
    return hu > low && hu < high ? hu : NAN;
}

static void init_span(CtsSpan *span, const CtsTransfer *transfer, const CtsPreset *preset)
{
    /* Outside the control points the end values apply: the lines are flat. */
    const bool open = isinf(span->low_hu) || isinf(span->high_hu);
    const double first = !isinf(span->low_hu)    ? span->low_hu
                         : !isinf(span->high_hu) ? nextafter(span->high_hu, -INFINITY)
                                                 : 0;
    const double last = open ? first : nextafter(span->high_hu, span->low_hu);
    double rgb_last[3];
    span->at_hu = first;
    span->opacity = cts_preset_opacity(preset, first);
    cts_preset_colour(preset, first, span->rgb);
    cts_preset_colour(preset, last, rgb_last);
    const double opacity_last = cts_preset_opacity(preset, last), width = open || last <= first ? 1 : last - first;
    span->opacity_slope = (opacity_last - span->opacity) / width;
    span->flat_colour = true;
    for (int c = 0; c < 3; c++) {
        span->rgb_slope[c] = (rgb_last[c] - span->rgb[c]) / width;
        span->flat_colour = span->flat_colour && rgb_last[c] == span->rgb[c];
    }
    span->visible = span->opacity > 0 || opacity_last > 0;
    const double middle = span->opacity + 0.5 * (opacity_last - span->opacity);
    const double full = CTS_MAX_EXTINCTION_PER_MM * transfer->scale;
    span->extinction_per_mm = cts_transfer_extinction(transfer, middle);
    span->flat_extinction =
        opacity_last == span->opacity ||
        (span->extinction_per_mm == full && cts_transfer_extinction(transfer, span->opacity) >= full * (1 - 1e-12) &&
         cts_transfer_extinction(transfer, opacity_last) >= full * (1 - 1e-12));
}

void cts_transfer_init(CtsTransfer *transfer, const CtsPreset *preset, double extinction_scale)
{
    memset(transfer, 0, sizeof *transfer);
    transfer->unit_distance_mm = preset->unit_distance_mm;
    transfer->scale = extinction_scale;
    double control_points[4 * CTS_MAX_POINTS], caps[2 * CTS_MAX_POINTS];
    int n = 0, n_caps = 0;
    for (int i = 0; i < preset->n_opacity; i++)
        control_points[n++] = preset->opacity[i].hu;
    for (int i = 0; i < preset->n_colour; i++)
        control_points[n++] = preset->colour[i].hu;
    n = sort_unique(control_points, n);
    for (int i = 0; i + 1 < n; i++) {
        const double hu = cap_hu(preset, control_points[i], control_points[i + 1]);
        if (!isnan(hu))
            caps[n_caps++] = hu;
    }
    memcpy(control_points + n, caps, (size_t)n_caps * sizeof *caps);
    n = sort_unique(control_points, n + n_caps);

    CtsHuRanges *visible = &transfer->visible;
    transfer->n = n + 1;
    for (int i = 0; i <= n; i++) {
        CtsSpan *span = &transfer->spans[i];
        span->low_hu = i > 0 ? control_points[i - 1] : -INFINITY;
        span->high_hu = i < n ? control_points[i] : INFINITY;
        init_span(span, transfer, preset);
        if (!span->visible)
            continue;
        if (visible->n > 0 && visible->range[visible->n - 1].high == span->low_hu) {
            visible->range[visible->n - 1].high = span->high_hu;
        } else {
            visible->range[visible->n].low = span->low_hu;
            visible->range[visible->n++].high = span->high_hu;
        }
    }
}

int cts_transfer_find(const CtsTransfer *transfer, double hu)
{
    int low = 0, high = transfer->n - 1;
    while (low < high) {
        const int middle = (low + high + 1) / 2;
        if (hu >= transfer->spans[middle].low_hu)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

int cts_transfer_find_below(const CtsTransfer *transfer, double hu)
{
    int i = cts_transfer_find(transfer, hu);
    while (i > 0 && hu <= transfer->spans[i].low_hu)
        i--;
    return i;
}

double cts_transfer_extinction(const CtsTransfer *transfer, double opacity)
{
    if (opacity <= 0)
        return 0;
    const double per_mm = opacity >= 1 ? CTS_MAX_EXTINCTION_PER_MM : -log1p(-opacity) / transfer->unit_distance_mm;
    return fmin(per_mm, CTS_MAX_EXTINCTION_PER_MM) * transfer->scale;
}
