#include "engine/tiled/pieces.h"

#include <math.h>
#include <stdlib.h>

/* HU that are knots, in any order. */
typedef struct Knots {
    double hu[TILED_KNOTS];
    int n;
} Knots;

static int by_hu(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Where an opacity has the largest extinction. */
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

/* Opacity, at most that of the largest extinction, and colour. */
static void look(const CtsPreset *p, double hu, double value[4])
{
    value[0] = fmin(cts_preset_opacity(p, hu), opacity_at_most(p));
    cts_preset_colour(p, hu, value + 1);
}

/* Of the piece between two HU, from two places inside it: at its very ends a step may have its other side. */
static void find_piece(const CtsPreset *p, double low, double high, double at_low[4], double rise[4])
{
    double a[4], b[4];
    const double first = low + 0.25 * (high - low), second = low + 0.75 * (high - low);
    look(p, first, a);
    look(p, second, b);
    for (int c = 0; c < 4; c++) {
        rise[c] = (b[c] - a[c]) / (second - first);
        at_low[c] = a[c] - rise[c] * (first - low);
    }
}

static double extinction(const TiledPieces *t, double opacity)
{
    const double most = (double)t->most * M_LN2;
    return opacity < 1 ? fmin(-log1p(-fmax(opacity, 0)) * (double)t->by_log2, most) : most;
}

/* What a knot changes: extinction, and colours weighed with it. */
static void find_changes(TiledPieces *t)
{
    for (int k = 0; k < t->n_knots; k++) {
        double side[2], slope[2], colour[2][3], tint[2][3];
        for (int i = 0; i < 2; i++) {
            const int q = k + i;
            const double away = (double)(t->knot[k] - t->from[q]);
            const double opacity = (double)t->at[0][q] + (double)t->rise[0][q] * away;
            /* The mean slope over a level, as that at opacity 1 has no end. */
            side[i] = extinction(t, opacity);
            slope[i] = (i ? 1 : -1) * (extinction(t, opacity + (i ? 1 : -1) * (double)t->rise[0][q]) - side[i]);
            for (int c = 0; c < 3; c++) {
                tint[i][c] = (double)t->rise[c + 1][q];
                colour[i][c] = (double)t->at[c + 1][q] + tint[i][c] * away;
            }
        }
        const double most = fmax(side[0], side[1]);
        double jump = fabs(side[1] - side[0]), bend = fabs(slope[1] - slope[0]);
        for (int c = 0; c < 3; c++) {
            jump = fmax(jump, most * fabs(colour[1][c] - colour[0][c]));
            bend = fmax(bend, most * fabs(tint[1][c] - tint[0][c]));
        }
        const int n = t->n_changes;
        t->change[n] = t->knot[k];
        t->change_rest[n] = t->rest[k];
        t->jump[n] = jump > 1e-6 * most ? (float)jump : 0;
        t->bend[n] = (float)bend;
        t->n_changes += t->jump[n] > 0 || bend > 0;
    }
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

static void split(double level, float *rounded, float *rest)
{
    *rounded = (float)level;
    *rest = (float)(level - (double)*rounded);
}

void cts_tiled_pieces_init(TiledPieces *t, const CtsScene *scene)
{
    const CtsPreset *const p = scene->preset;
    const CtsVolume *const v = scene->volume;
    Knots knots;
    *t = (TiledPieces){.by_log2 = (float)(scene->extinction_scale / p->unit_distance_mm),
                       .most = (float)(CTS_MAX_EXTINCTION_PER_MM * scene->extinction_scale / M_LN2)};
    list_knots(p, &knots);
    t->n_knots = knots.n;
    for (int q = 0; q <= knots.n; q++) {
        const double low = q > 0 ? knots.hu[q - 1] : knots.n > 0 ? knots.hu[0] - 2 : 0;
        const double high = q < knots.n ? knots.hu[q] : low + 2;
        double at[4], rise[4];
        find_piece(p, low, high, at, rise);
        split((low - v->hu_offset) / v->hu_step, &t->from[q], &t->from_rest[q]);
        if (q < knots.n)
            split((high - v->hu_offset) / v->hu_step, &t->knot[q], &t->rest[q]);
        for (int c = 0; c < 4; c++) {
            const bool ends = q == 0 || q == knots.n;
            t->at[c][q] = (float)at[c];
            t->rise[c][q] = ends ? 0 : (float)(rise[c] * v->hu_step);
        }
    }
    int low, high;
    cts_lut_visible_levels(scene->lut, &low, &high);
    t->low = low > 0 ? (float)low : -INFINITY;
    t->high = high < CTS_N_GREY - 1 ? (float)high : INFINITY;
    find_changes(t);
    find_colours(t, scene);
}
