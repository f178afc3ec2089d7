#include "engine/tiled/transfer_segments.h"

#include "base/compare.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* HU of the control points, in any order. */
typedef struct ControlPoints {
    double hu[TILED_CONTROL_POINTS];
    int n;
} ControlPoints;

/* The opacity from which the extinction has its maximum. */
static double opacity_at_most(const CtsPreset *p)
{
    return -expm1(-CTS_MAX_EXTINCTION_PER_MM * p->unit_distance_mm);
}

static void list_control_points(const CtsPreset *p, ControlPoints *k)
{
    const double most = opacity_at_most(p);
    k->n = 0;
    for (int i = 0; i < p->n_opacity; i++) {
        const CtsOpacityPoint *const a = &p->opacity[i];
        k->hu[k->n++] = a->hu;
        if (i + 1 < p->n_opacity && (a->opacity - most) * (a[1].opacity - most) < 0 && most < 1)
            k->hu[k->n++] = a->hu + (a[1].hu - a->hu) * (most - a->opacity) / (a[1].opacity - a->opacity);
    }
    for (int i = 0; i < p->n_colour; i++)
        k->hu[k->n++] = p->colour[i].hu;
    qsort(k->hu, (size_t)k->n, sizeof *k->hu, cts_compare_double);
    int n = 0;
    for (int i = 0; i < k->n; i++)
        if (n == 0 || k->hu[i] > k->hu[n - 1])
            k->hu[n++] = k->hu[i];
    k->n = n;
}

/* A linear segment: opacity and colours, at its begin and per level. */
typedef struct LinearSegment {
    double begin, value[4], slope[4];
} LinearSegment;

/* Opacity, at most that of the largest extinction, and colour. */
static void sample_preset(const CtsPreset *p, double hu, double value[4])
{
    value[0] = fmin(cts_preset_opacity(p, hu), opacity_at_most(p));
    cts_preset_colour(p, hu, value + 1);
}

/* Between two HU, from two places inside it: at its very ends a step may have its other side. */
static LinearSegment find_line(const CtsPreset *p, const CtsVolume *v, double low, double high)
{
    LinearSegment l = {.begin = (low - v->hu_offset) / v->hu_step};
    double a[4], b[4];
    const double first = low + 0.25 * (high - low), second = low + 0.75 * (high - low);
    sample_preset(p, first, a);
    sample_preset(p, second, b);
    for (int c = 0; c < 4; c++) {
        const double rise = (b[c] - a[c]) / (second - first);
        l.value[c] = a[c] - rise * (first - low);
        l.slope[c] = rise * v->hu_step;
    }
    return l;
}

static double extinction(const TiledTransfer *t, double opacity)
{
    const double most = (double)t->max_extinction * M_LN2;
    return opacity < 1 ? fmin(-log1p(-fmax(opacity, 0)) * (double)t->by_log2, most) : most;
}

/* The change at a level between two linear segments: extinction, and colours weighted with it. */
static bool find_change(const TiledTransfer *t, const LinearSegment *below, const LinearSegment *above, double level,
                        double *discontinuity, double *slope_change)
{
    const LinearSegment *const sides[2] = {below, above};
    double side[2], slope[2], colour[2][3];
    for (int i = 0; i < 2; i++) {
        const LinearSegment *const l = sides[i];
        const double away = level - l->begin, opacity = l->value[0] + l->slope[0] * away;
        /* The mean slope over a level, as that at opacity 1 has no end. */
        side[i] = extinction(t, opacity);
        slope[i] = (i ? 1 : -1) * (extinction(t, opacity + (i ? 1 : -1) * l->slope[0]) - side[i]);
        for (int c = 0; c < 3; c++)
            colour[i][c] = l->value[c + 1] + l->slope[c + 1] * away;
    }
    const double most = fmax(side[0], side[1]), least = 1e-6 * most;
    *discontinuity = fabs(side[1] - side[0]);
    *slope_change = fabs(slope[1] - slope[0]);
    for (int c = 0; c < 3; c++) {
        *discontinuity = fmax(*discontinuity, most * fabs(colour[1][c] - colour[0][c]));
        *slope_change = fmax(*slope_change, most * fabs(above->slope[c + 1] - below->slope[c + 1]));
    }
    *discontinuity = *discontinuity > least ? *discontinuity : 0;
    return *discontinuity > 0 || *slope_change > least * 1e-3;
}

static void find_colours(TiledTransfer *t, const CtsScene *scene)
{
    const CtsPreset *const p = scene->preset;
    for (int c = 0; c < 3; c++) {
        double low = p->background_none ? 0 : p->background[c], high = low;
        for (int i = 0; i < p->n_colour; i++) {
            low = fmin(low, p->colour[i].rgb[c]);
            high = fmax(high, p->colour[i].rgb[c]);
        }
        t->max_colour_difference = fmaxf(t->max_colour_difference, (float)(high - low));
    }
    if (p->n_colour == 0)
        t->max_colour_difference = 1;
}

/* Beyond the first and last control point. */
#define NEVER 1e30f

static void set_end(TiledTransfer *t, int end, int segment, double level, double discontinuity, double slope_change)
{
    t->end[end][segment] = (float)level;
    t->remainder[end][segment] = (float)(level - (double)t->end[end][segment]);
    t->discontinuity[end][segment] = (float)discontinuity;
    t->slope_change[end][segment] = (float)slope_change;
}

static void set_line(TiledTransfer *t, int segment, const LinearSegment *l)
{
    for (int c = 0; c < 4; c++) {
        t->value[c][segment] = (float)l->value[c];
        t->slope[c][segment] = (float)l->slope[c];
        t->max_colour_slope[segment] = fmaxf(t->max_colour_slope[segment], c > 0 ? fabsf(t->slope[c][segment]) : 0);
    }
}

/* Control points without a change are left out, which joins their segments. */
static void set_segments(TiledTransfer *t, const CtsPreset *p, const CtsVolume *v, const ControlPoints *control_points)
{
    const double first = control_points->n > 0 ? control_points->hu[0] : 0;
    LinearSegment below = find_line(p, v, first - 2, first);
    memset(below.slope, 0, sizeof below.slope);
    set_end(t, 0, 0, -(double)NEVER, 0, 0);
    set_line(t, 0, &below);
    for (int k = 0; k < control_points->n; k++) {
        const double hu = control_points->hu[k], level = (hu - v->hu_offset) / v->hu_step;
        const bool last = k + 1 == control_points->n;
        LinearSegment above = find_line(p, v, hu, last ? hu + 2 : control_points->hu[k + 1]);
        double discontinuity, slope_change;
        if (last)
            memset(above.slope, 0, sizeof above.slope);
        if (!find_change(t, &below, &above, level, &discontinuity, &slope_change))
            continue;
        set_end(t, 1, t->n_control_points++, level, discontinuity, slope_change);
        set_end(t, 0, t->n_control_points, level, discontinuity, slope_change);
        set_line(t, t->n_control_points, &above);
        below = above;
    }
    set_end(t, 1, t->n_control_points, (double)NEVER, 0, 0);
    for (int q = 0; q <= t->n_control_points; q++) {
        t->beyond[0][q] = q > 0 ? t->end[0][q - 1] : -NEVER;
        t->beyond[1][q] = q < t->n_control_points ? t->end[1][q + 1] : NEVER;
    }
}

void cts_tiled_transfer_init(TiledTransfer *t, const CtsScene *scene)
{
    const CtsPreset *const p = scene->preset;
    ControlPoints control_points;
    *t = (TiledTransfer){.by_log2 = (float)(scene->extinction_scale / p->unit_distance_mm),
                         .max_extinction = (float)(CTS_MAX_EXTINCTION_PER_MM * scene->extinction_scale / M_LN2)};
    list_control_points(p, &control_points);
    set_segments(t, p, scene->volume, &control_points);
    find_colours(t, scene);
}
