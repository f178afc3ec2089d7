#include "engine/tiled/pieces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* HU of the control points, in any order. */
typedef struct Knots {
    double hu[TILED_KNOTS];
    int n;
} Knots;

static int by_hu(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* The opacity from which the extinction has its maximum. */
static double opacity_at_most(const CtsPreset *p)
{
    return -expm1(-CTS_MAX_EXTINCTION_PER_MM * p->unit_distance_mm);
}

static void list_knots(const CtsPreset *p, Knots *k)
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
    qsort(k->hu, (size_t)k->n, sizeof *k->hu, by_hu);
    int n = 0;
    for (int i = 0; i < k->n; i++)
        if (n == 0 || k->hu[i] > k->hu[n - 1])
            k->hu[n++] = k->hu[i];
    k->n = n;
}

/* A linear segment: opacity and colours, at its begin and per level. */
typedef struct Line {
    double begin, at[4], rise[4];
} Line;

/* Opacity, at most that of the largest extinction, and colour. */
static void look(const CtsPreset *p, double hu, double value[4])
{
    value[0] = fmin(cts_preset_opacity(p, hu), opacity_at_most(p));
    cts_preset_colour(p, hu, value + 1);
}

/* Between two HU, from two places inside it: at its very ends a step may have its other side. */
static Line find_line(const CtsPreset *p, const CtsVolume *v, double low, double high)
{
    Line l = {.begin = (low - v->hu_offset) / v->hu_step};
    double a[4], b[4];
    const double first = low + 0.25 * (high - low), second = low + 0.75 * (high - low);
    look(p, first, a);
    look(p, second, b);
    for (int c = 0; c < 4; c++) {
        const double rise = (b[c] - a[c]) / (second - first);
        l.at[c] = a[c] - rise * (first - low);
        l.rise[c] = rise * v->hu_step;
    }
    return l;
}

static double extinction(const TiledPieces *t, double opacity)
{
    const double most = (double)t->most * M_LN2;
    return opacity < 1 ? fmin(-log1p(-fmax(opacity, 0)) * (double)t->by_log2, most) : most;
}

/* The change at a level between two linear segments: extinction, and colours weighted with it. */
static bool find_change(const TiledPieces *t, const Line *below, const Line *above, double level, double *jump,
                        double *bend)
{
    const Line *const sides[2] = {below, above};
    double side[2], slope[2], colour[2][3];
    for (int i = 0; i < 2; i++) {
        const Line *const l = sides[i];
        const double away = level - l->begin, opacity = l->at[0] + l->rise[0] * away;
        /* The mean slope over a level, as that at opacity 1 has no end. */
        side[i] = extinction(t, opacity);
        slope[i] = (i ? 1 : -1) * (extinction(t, opacity + (i ? 1 : -1) * l->rise[0]) - side[i]);
        for (int c = 0; c < 3; c++)
            colour[i][c] = l->at[c + 1] + l->rise[c + 1] * away;
    }
    const double most = fmax(side[0], side[1]), least = 1e-6 * most;
    *jump = fabs(side[1] - side[0]);
    *bend = fabs(slope[1] - slope[0]);
    for (int c = 0; c < 3; c++) {
        *jump = fmax(*jump, most * fabs(colour[1][c] - colour[0][c]));
        *bend = fmax(*bend, most * fabs(above->rise[c + 1] - below->rise[c + 1]));
    }
    *jump = *jump > least ? *jump : 0;
    return *jump > 0 || *bend > least * 1e-3;
}

static void find_colours(TiledPieces *t, const CtsScene *scene)
{
    const CtsPreset *const p = scene->preset;
    for (int c = 0; c < 3; c++) {
        double low = p->background_none ? 0 : p->background[c], high = low;
        for (int i = 0; i < p->n_colour; i++) {
            low = fmin(low, p->colour[i].rgb[c]);
            high = fmax(high, p->colour[i].rgb[c]);
        }
        t->colours = fmaxf(t->colours, (float)(high - low));
    }
    if (p->n_colour == 0)
        t->colours = 1;
}

/* Beyond the first and last control point. */
#define NEVER 1e30f

static void set_end(TiledPieces *t, int end, int piece, double level, double jump, double bend)
{
    t->end[end][piece] = (float)level;
    t->rest[end][piece] = (float)(level - (double)t->end[end][piece]);
    t->jump[end][piece] = (float)jump;
    t->bend[end][piece] = (float)bend;
}

static void set_line(TiledPieces *t, int piece, const Line *l)
{
    for (int c = 0; c < 4; c++) {
        t->at[c][piece] = (float)l->at[c];
        t->rise[c][piece] = (float)l->rise[c];
        t->tint[piece] = fmaxf(t->tint[piece], c > 0 ? fabsf(t->rise[c][piece]) : 0);
    }
}

/* Control points without a change are left out, which joins their segments. */
static void set_pieces(TiledPieces *t, const CtsPreset *p, const CtsVolume *v, const Knots *knots)
{
    const double first = knots->n > 0 ? knots->hu[0] : 0;
    Line below = find_line(p, v, first - 2, first);
    memset(below.rise, 0, sizeof below.rise);
    set_end(t, 0, 0, -(double)NEVER, 0, 0);
    set_line(t, 0, &below);
    for (int k = 0; k < knots->n; k++) {
        const double hu = knots->hu[k], level = (hu - v->hu_offset) / v->hu_step;
        const bool last = k + 1 == knots->n;
        Line above = find_line(p, v, hu, last ? hu + 2 : knots->hu[k + 1]);
        double jump, bend;
        if (last)
            memset(above.rise, 0, sizeof above.rise);
        if (!find_change(t, &below, &above, level, &jump, &bend))
            continue;
        set_end(t, 1, t->n_knots++, level, jump, bend);
        set_end(t, 0, t->n_knots, level, jump, bend);
        set_line(t, t->n_knots, &above);
        below = above;
    }
    set_end(t, 1, t->n_knots, (double)NEVER, 0, 0);
    for (int q = 0; q <= t->n_knots; q++) {
        t->beyond[0][q] = q > 0 ? t->end[0][q - 1] : -NEVER;
        t->beyond[1][q] = q < t->n_knots ? t->end[1][q + 1] : NEVER;
    }
}

void cts_tiled_pieces_init(TiledPieces *t, const CtsScene *scene)
{
    const CtsPreset *const p = scene->preset;
    Knots knots;
    int low, high;
    *t = (TiledPieces){.by_log2 = (float)(scene->extinction_scale / p->unit_distance_mm),
                       .most = (float)(CTS_MAX_EXTINCTION_PER_MM * scene->extinction_scale / M_LN2)};
    list_knots(p, &knots);
    set_pieces(t, p, scene->volume, &knots);
    cts_lut_visible_levels(scene->lut, &low, &high);
    t->low = low > 0 ? (float)low : -INFINITY;
    t->high = high < CTS_N_GREY - 1 ? (float)high : INFINITY;
    find_colours(t, scene);
}
