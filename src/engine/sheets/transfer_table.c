#include "engine/sheets/sheets.h"

#include "base/clamp.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

/* Bins are coarse where nothing is visible: there a bin only says where a slab enters what is, to a share of the slab
 * of half a bin's width by the whole change of grey level. */
enum { COARSE = 64 };
/* Metal lies far above the range that presets resolve; bins up to it would be too coarse elsewhere. */
#define HU_ABOVE 4096.0

static void init_bins(SheetsBins *l, const CtsScene *scene, int largest_grey)
{
    const CtsLut *const lut = scene->lut;
    cts_lut_visible_levels(lut, &l->grey_low, &l->grey_high);
    if (cts_lut_visible(lut, 0, 0))
        l->grey_low = -1;
    if (cts_lut_visible(lut, CTS_N_GREY - 1, CTS_N_GREY - 1))
        l->grey_high = CTS_N_GREY;
    const double top = cts_clamp(lut->n - 1, l->grey_low + 1, fmax(largest_grey, l->grey_low + 1));
    const double bottom = fmax(l->grey_low, 0);
    const double end = cts_clamp(largest_grey, top, top + HU_ABOVE / scene->volume->hu_step);
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

/* Integrals from grey level 0 on of extinction, and of extinction times each colour; straight lines between grey
 * levels.
 */
typedef struct Integrals {
    const CtsLut *lut;
    double (*to)[4];
} Integrals;

static double value_at(const CtsLut *lut, int grey, int channel)
{
    const int g = grey < lut->n - 1 ? grey : lut->n - 1;
    const double extinction = (double)lut->extinction_per_mm[g];
    return channel == 0 ? extinction : extinction * (double)lut->rgb[g][channel - 1];
}

static double integral_to(const Integrals *in, double grey, int channel)
{
    const int g = (int)fmin(grey, CTS_N_GREY - 1);
    const double part = grey - g, low = value_at(in->lut, g, channel);
    const double high = value_at(in->lut, g < CTS_N_GREY - 1 ? g + 1 : g, channel);
    return in->to[g][channel] + part * (low + part / 2 * (high - low));
}

static void fill_integrals(Integrals *in)
{
    memset(in->to[0], 0, sizeof in->to[0]);
    for (int g = 1; g < CTS_N_GREY; g++)
        for (int c = 0; c < 4; c++)
            in->to[g][c] = in->to[g - 1][c] + (value_at(in->lut, g - 1, c) + value_at(in->lut, g, c)) / 2;
}

/* Means between two bins; if both are equal, the slab's grey levels lie anywhere within the bin's width. at_bin:
 * integrals to the bins' middles. */
static void mean_between(const Integrals *in, const SheetsBins *l, double (*at_bin)[4], int front, int back,
                         float mean[4], float quarter[SHEETS_LIT])
{
    const bool same = front == back || l->grey[front] == l->grey[back];
    const double from = same ? l->edge[front] : l->grey[front], to = same ? l->edge[front + 1] : l->grey[back];
    double sum[4], at = at_bin[front][0];
    for (int c = 0; c < 4; c++)
        sum[c] = to == from ? value_at(in->lut, (int)from, c)
                 : same     ? (integral_to(in, to, c) - integral_to(in, from, c)) / (to - from)
                            : (at_bin[back][c] - at_bin[front][c]) / (to - from);
    mean[0] = sum[0] > 0 ? (float)sum[0] : 0;
    for (int c = 1; c < 4; c++) /* never -0, whose sign would be packed into opacity */
        mean[c] = sum[0] > 0 ? (float)cts_clamp01(sum[c] / sum[0]) : 0;
    for (int q = 1; q <= SHEETS_LIT; q++) {
        const double before = at;
        at = same || q == SHEETS_LIT ? at_bin[back][0] : integral_to(in, from + q * (to - from) / SHEETS_LIT, 0);
        quarter[q - 1] = same ? mean[0] : (float)fmax((at - before) * SHEETS_LIT / (to - from), 0);
    }
}

CtsStatus cts_sheets_transfer_init(SheetsTransfer *t, const CtsScene *scene, int largest_grey, CtsError *err)
{
    CtsStatus st;
    Integrals in = {.lut = scene->lut};
    double at_bin[SHEETS_BINS][4];
    *t = (SheetsTransfer){.extinction_scale = scene->extinction_scale};
    if ((st = cts_alloc_array(&t->mean, (size_t)SHEETS_BINS * SHEETS_BINS, err)) ||
        (st = cts_alloc_array(&t->quarter, (size_t)SHEETS_BINS * SHEETS_BINS, err)) ||
        (st = cts_alloc_array(&in.to, CTS_N_GREY, err)))
        goto end;
    init_bins(&t->bins, scene, largest_grey);
    fill_integrals(&in);
    const SheetsBins *const l = &t->bins;
    for (int i = 0; i < SHEETS_BINS; i++)
        for (int c = 0; c < 4; c++)
            at_bin[i][c] = integral_to(&in, l->grey[i], c);
    for (int i = 0; i < SHEETS_BINS; i++)
        for (int j = 0; j < SHEETS_BINS; j++)
            mean_between(&in, l, at_bin, i, j, t->mean[i * SHEETS_BINS + j], t->quarter[i * SHEETS_BINS + j]);
end:
    cts_free(&in.to);
    if (st)
        cts_sheets_transfer_free(t);
    return st;
}

void cts_sheets_transfer_free(SheetsTransfer *t)
{
    cts_free(&t->mean);
    cts_free(&t->quarter);
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
    f->kernels->fill_opacity((const float(*)[4])f->transfer->mean, (float)f->opacity->length_mm, first * SHEETS_BINS,
                             end * SHEETS_BINS, f->opacity->rgba);
    if (f->opacity->light)
        f->kernels->fill_light((const float(*)[SHEETS_LIT])f->transfer->quarter, (float)f->opacity->length_mm,
                               first * SHEETS_BINS, end * SHEETS_BINS, f->opacity->light);
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
