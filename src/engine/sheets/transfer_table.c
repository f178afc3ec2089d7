#include "engine/sheets/sheets.h"

#include "base/clamp.h"
#include "base/compare.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

/* Bins are coarse where nothing is visible: there a bin only says where a slab enters what is, to a share of the slab
 * of half a bin's width by the whole change of grey level. */
enum { COARSE = 64 };
/* Metal lies far above the range that presets resolve; bins up to it would be too coarse elsewhere. */
#define HU_ABOVE 4096.0
/* Share of the levels with fine bins by which these begin below what is visible, and end above it: a slab's entry is
 * wrong by half of the bin in front of it. 0.05 to 0.2 leave equal errors. */
#define MARGIN 0.05

/* Extinction, and extinction times each colour, at grey levels with straight lines between, and their integrals from
 * level 0 on. Beyond the last level nothing changes. */
typedef struct Integrals {
    int n;
    double (*value)[4], (*to)[4];
} Integrals;

static CtsStatus integrals_init(Integrals *in, const CtsLut *lut, CtsError *err)
{
    CtsStatus st;
    *in = (Integrals){.n = lut->n};
    if ((st = cts_alloc_array(&in->value, (size_t)in->n, err)) || (st = cts_alloc_zeroed(&in->to, (size_t)in->n, err)))
        return st;
    for (int g = 0; g < in->n; g++)
        for (int c = 0; c < 4; c++) {
            in->value[g][c] = (double)lut->extinction_per_mm[g] * (c > 0 ? (double)lut->rgb[g][c - 1] : 1);
            in->to[g][c] = g > 0 ? in->to[g - 1][c] + (in->value[g - 1][c] + in->value[g][c]) / 2 : 0;
        }
    return CTS_OK;
}

static void integrals_free(Integrals *in)
{
    cts_free(&in->value);
    cts_free(&in->to);
}

static void integrate_to(const Integrals *in, double grey, double integral[4])
{
    const int g = cts_smaller_int((int)grey, in->n - 1), next = cts_smaller_int(g + 1, in->n - 1);
    const double part = grey - g;
    for (int c = 0; c < 4; c++)
        integral[c] = in->to[g][c] + part * (in->value[g][c] + part / 2 * (in->value[next][c] - in->value[g][c]));
}

/* Square of the slope of the quantity that changes most from a level to the next. */
static double squared_slope(const Integrals *in, int grey)
{
    double largest = 0;
    for (int c = 0; c < 4; c++)
        largest = fmax(largest, fabs(in->value[grey + 1][c] - in->value[grey][c]));
    return largest * largest;
}

/* The level up to which, from `bottom` on, bins are best fine. A bin is wrong by its width times the slope: that
 * squared, summed over all levels, is least. */
static double end_of_fine(const Integrals *in, double bottom, double top, double end)
{
    double all = 0, below = 0, least = INFINITY, best = top;
    for (int g = (int)bottom; g + 1 < in->n; g++)
        all += squared_slope(in, g);
    for (int g = (int)bottom; g + 1 < in->n && g + 1 <= top; g++) {
        below += squared_slope(in, g);
        const double fine = fmax((g + 1 - bottom) / (SHEETS_BINS - 1 - COARSE), 1),
                     coarse = fmax((bottom + end - (g + 1)) / COARSE, 1),
                     wrong = fine * fine * below + coarse * coarse * (all - below);
        if (wrong < least) {
            least = wrong;
            best = g + 1;
        }
    }
    return best;
}

static void init_bins(SheetsBins *l, const CtsScene *scene, const Integrals *in, int largest_grey)
{
    const CtsLut *const lut = scene->lut;
    cts_lut_visible_levels(lut, &l->grey_low, &l->grey_high);
    if (cts_lut_visible(lut, 0, 0))
        l->grey_low = -1;
    if (cts_lut_visible(lut, CTS_N_GREY - 1, CTS_N_GREY - 1))
        l->grey_high = CTS_N_GREY;
    const double settled = cts_clamp(lut->n - 1, l->grey_low + 1, fmax(largest_grey, l->grey_low + 1));
    const double end = cts_clamp(largest_grey, settled, settled + HU_ABOVE / scene->volume->hu_step);
    const double visible = fmax(l->grey_low, 0), fine_to = end_of_fine(in, visible, settled, end);
    const double levels = fine_to - visible, margin = fmax(MARGIN * levels, (SHEETS_BINS - 1 - COARSE - levels) / 2);
    const double bottom = fmax(floor(visible - margin), 0), top = fmin(ceil(fine_to + margin), end);
    /* A fine bin a grey level is enough; the coarse ones share what is left. Below a wide visible range they would be
     * the finer ones: then all are of one width. */
    double n_fine = fmin(top - bottom, SHEETS_BINS - 1 - COARSE);
    const double n_coarse = SHEETS_BINS - 1 - n_fine, outside = bottom + end - top;
    double coarse = outside > 0 ? n_coarse / outside : 0, fine = n_fine / (top - bottom);
    if (coarse > fine && outside > 0) {
        coarse = fine = fmin((SHEETS_BINS - 1) / end, 1);
        n_fine = fine * (top - bottom);
    }
    /* Grey levels have fine bins of their own where there are enough; so the first has a whole number. */
    const double first = floor(coarse * bottom), one = 1 << SHEETS_WEIGHT_BITS;
    l->coarse_scale = (float)(coarse / one);
    l->coarse_add = (float)(first + coarse * (32768 - bottom) + 0.5);
    l->fine_scale = (float)((fine - coarse) / one);
    l->fine_add = (float)((fine - coarse) * (32768 - bottom));
    l->fine_span = (float)((fine - coarse) * (top - bottom));
    for (int i = 0; i < SHEETS_BINS; i++)
        l->grey[i] = i < first            ? bottom - (first - i) / coarse
                     : i < first + n_fine ? bottom + (i - first) / fine
                     : coarse > 0         ? top + (i - first - n_fine) / coarse
                                          : top;
    for (int i = 0; i <= SHEETS_BINS; i++)
        l->edge[i] = i == 0             ? l->grey[0]
                     : i == SHEETS_BINS ? l->grey[SHEETS_BINS - 1]
                                        : (l->grey[i - 1] + l->grey[i]) / 2;
    l->first = 0;
    l->last = SHEETS_BINS - 1;
    while (l->first < SHEETS_BINS - 1 && l->edge[l->first + 1] <= l->grey_low)
        l->first++;
    while (l->last > 0 && l->edge[l->last] >= l->grey_high)
        l->last--;
}

/* Means between two levels whose integrals are given: extinction per mm, and its mean colour. One division, as each
 * takes as long as all the rest. */
static void mean_between(const double from[4], const double to[4], double per_level, double mean[4])
{
    const double extinction = to[0] - from[0], per = extinction > 0 ? 1 / extinction : 0;
    mean[0] = fmax(extinction * per_level, 0);
    for (int c = 1; c < 4; c++) /* never -0, whose sign would be packed into opacity */
        mean[c] = cts_clamp01((to[c] - from[c]) * per);
}

static void set_part(SheetsTransfer *t, int front, int back, int quarter, const double mean[4])
{
    for (int c = 0; c < 4; c++)
        t->part[quarter][c][front * SHEETS_BINS + back] = (float)mean[c];
}

/* A slab of one bin: its grey levels lie anywhere within the bin's width. */
static void fill_even(SheetsTransfer *t, const Integrals *in, int front, int back)
{
    const double low = t->bins.edge[front], high = fmax(t->bins.edge[front + 1], low + 1e-3);
    double from[4], to[4], mean[4];
    integrate_to(in, low, from);
    integrate_to(in, high, to);
    mean_between(from, to, 1 / (high - low), mean);
    for (int q = 0; q < SHEETS_LIT; q++)
        set_part(t, front, back, q, mean);
}

/* A slab from one bin to another, and the way back. */
static void fill_change(SheetsTransfer *t, const Integrals *in, double (*at_bin)[4], int one, int other)
{
    const double from = t->bins.grey[one], levels = (t->bins.grey[other] - from) / SHEETS_LIT;
    const double per_level = 1 / levels;
    double before[4], after[4], mean[4];
    memcpy(before, at_bin[one], sizeof before);
    for (int q = 0; q < SHEETS_LIT; q++) {
        if (q == SHEETS_LIT - 1)
            memcpy(after, at_bin[other], sizeof after);
        else
            integrate_to(in, from + (q + 1) * levels, after);
        mean_between(before, after, per_level, mean);
        set_part(t, one, other, q, mean);
        set_part(t, other, one, SHEETS_LIT - 1 - q, mean);
        memcpy(before, after, sizeof before);
    }
}

static void fill_parts(SheetsTransfer *t, const Integrals *in)
{
    const SheetsBins *const l = &t->bins;
    double at_bin[SHEETS_BINS][4];
    for (int i = 0; i < SHEETS_BINS; i++)
        integrate_to(in, l->grey[i], at_bin[i]);
    for (int i = 0; i <= l->last; i++)
        for (int j = i < l->first ? l->first : i; j < SHEETS_BINS; j++) {
            if (l->grey[j] > l->grey[i]) {
                fill_change(t, in, at_bin, i, j);
            } else {
                fill_even(t, in, i, j);
                fill_even(t, in, j, i);
            }
        }
}

CtsStatus cts_sheets_transfer_init(SheetsTransfer *t, const CtsScene *scene, int largest_grey, CtsError *err)
{
    CtsStatus st;
    Integrals in;
    *t = (SheetsTransfer){.extinction_scale = scene->extinction_scale};
    if (!(st = integrals_init(&in, scene->lut, err)) && !(st = cts_alloc_zeroed(&t->part, SHEETS_LIT, err))) {
        init_bins(&t->bins, scene, &in, largest_grey);
        fill_parts(t, &in);
    }
    integrals_free(&in);
    return st;
}

void cts_sheets_transfer_free(SheetsTransfer *t)
{
    cts_free(&t->part);
}

typedef struct Filling {
    const SheetsTransfer *transfer;
    const SheetsKernels *kernels;
    SheetsOpacity *opacity;
} Filling;

static void fill_some(void *context, int worker, size_t first, size_t end)
{
    const Filling *const f = context;
    (void)worker;
    f->kernels->fill_slabs(f->transfer->part, (float)f->opacity->length_mm, first * SHEETS_BINS, end * SHEETS_BINS,
                           f->opacity->rgba, f->opacity->light);
}

static void fill_near(SheetsOpacity *o)
{
    const size_t n = SHEETS_BINS;
    uint16_t at_back[SHEETS_BINS];
    for (size_t back = 0; back < n; back++)
        at_back[back] = (uint16_t)(o->rgba[back * n + back] >> 48);
    for (size_t i = 0; i < n * n; i++) {
        const uint16_t one = (uint16_t)(o->rgba[i] >> 48), other = at_back[i % n];
        o->near[i] = one > other ? one : other;
    }
    o->near[n * n] = 0;
}

CtsStatus cts_sheets_opacity_find(SheetsOpacity *o, const SheetsTransfer *transfer, double length_mm, bool with_near,
                                  bool lit, const SheetsKernels *kernels, int n_threads, CtsError *err)
{
    CtsStatus st;
    const size_t n = (size_t)SHEETS_BINS * SHEETS_BINS;
    if (o->rgba && (o->light || !lit) && (o->near || !with_near) && o->length_mm == length_mm &&
        o->extinction_scale == transfer->extinction_scale)
        return CTS_OK;
    if ((lit && !o->light && (st = cts_alloc_array(&o->light, n, err))) ||
        (with_near && !o->near && (st = cts_alloc_array(&o->near, n + 1, err))) ||
        (!o->rgba && (st = cts_alloc_array(&o->rgba, n, err))))
        return st;
    o->length_mm = length_mm;
    o->extinction_scale = transfer->extinction_scale;
    Filling f = {transfer, kernels, o};
    cts_parallel(n_threads, SHEETS_BINS, 32, fill_some, &f);
    if (o->near)
        fill_near(o);
    return CTS_OK;
}
