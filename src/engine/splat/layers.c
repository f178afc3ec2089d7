#include "engine/splat/layers.h"

#include "base/bits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include <stdlib.h>
#include <string.h>

enum { SAMPLE_EVERY = 16, SAMPLE_AT = 5 };

/* Changes in row v between two layers, where the volume has them. */
static uint64_t count_changes(const CtsPaperPlan *p, int k, int old_k, int v)
{
    const CtsStack *stack = &p->stack;
    const uint16_t *row = stack->grey + (size_t)v * stack->v_step;
    const uint16_t *here = row + (size_t)k * stack->layer_step, *old = row + (size_t)old_k * stack->layer_step;
    const size_t step = stack->axis == 0 ? (size_t)stack->n_layers : 1;
    uint64_t n = 0;
    for (int u = 0; u < stack->n[0]; u++)
        n += abs(here[(size_t)u * step] - old[(size_t)u * step]) > p->tolerance;
    return n;
}

/* Voxels of row v of layer k that are splatted without reuse. */
static uint64_t count_shown(const CtsPaperPlan *p, int k, int v, uint64_t *shows)
{
    const CtsPatches *patches = &p->patches;
    uint64_t n = 0;
    if (!p->skip_void)
        return (uint64_t)p->stack.n[0];
    if (!p->map.active[k] || v / CTS_PATCH >= patches->n[1])
        return 0;
    memset(shows, 0, (size_t)patches->n_words * sizeof *shows);
    cts_void_add_row(&p->map, k, k, v / CTS_PATCH, shows);
    for (int w = 0; w < patches->n_words; w++)
        n += (uint64_t)cts_popcount(shows[w]) * CTS_PATCH;
    return n;
}

CtsStatus cts_layers_sample(const CtsPaperPlan *p, CtsChangeSample *sample, CtsError *err)
{
    const int first = SAMPLE_AT < p->stack.n_layers ? SAMPLE_AT : p->n_sheets;
    uint64_t *shows;
    *sample = (CtsChangeSample){0};
    const CtsStatus st = cts_alloc_array(&shows, (size_t)p->patches.n_words, err);
    for (int s = first; s < p->stack.n_layers && !st; s += SAMPLE_EVERY)
        for (int v = SAMPLE_AT; v < p->stack.n[1]; v += SAMPLE_EVERY) {
            const int k = cts_paper_layer(p, s);
            const uint64_t n = count_shown(p, k, v, shows);
            sample->voxels += n;
            sample->changed += n > 0 ? count_changes(p, k, cts_paper_layer(p, s - p->n_sheets), v) : 0;
        }
    cts_free(&shows);
    return st;
}

bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint, bool skips_void)
{
    /* As measured with all kernels at a quarter of a voxel to one a pixel, 8 to 16 bits: by itself reuse takes 0.3 to
     * 0.7 of the time where up to 0.3 of the voxels change, and breaks even at 0.7, or at 0.36 where a footprint is a
     * single row. Beside void skipping, which drops the quiet voxels anyway, only what a large footprint takes is
     * worth comparing voxels for: 0.8 to 1.05 of the time at 0.3, and never where it is smaller. */
    const int vectors = (2 * footprint->reach[1] + 1) * ((2 * footprint->reach[0] + 8) / 8);
    const double most = skips_void ? (vectors > 5 ? 0.4 : 0) : vectors > 1 ? 0.5 : 0.3;
    return sample.voxels > 0 && (double)sample.changed < most * (double)sample.voxels;
}

void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, int tolerance, int n, uint16_t *kept)
{
    for (int i = 0; i < n; i++) {
        const int change = before ? fresh[i] - before[i] : 0;
        kept[i] =
            before && change <= tolerance - CTS_MUTATED(TOLERANCE_LESS) && change >= -tolerance ? before[i] : fresh[i];
    }
}

CtsStatus cts_quiet_init(CtsQuiet *q, const CtsPatches *patches, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&q->known, (size_t)patches->n_swaths * (size_t)patches->n_words, err)) ||
        (st = cts_alloc_zeroed(&q->empty, (size_t)patches->n_swaths * (size_t)patches->n_words, err)))
        return st;
    return cts_alloc_array(&q->range, (size_t)patches->n_swaths * (size_t)patches->n[0], err);
}

void cts_quiet_free(CtsQuiet *q)
{
    cts_free(&q->known);
    cts_free(&q->empty);
    cts_free(&q->range);
}

static CtsRange *range_of(const CtsPaperPlan *p, const CtsQuiet *q, int swath, int t)
{
    return &q->range[(size_t)swath * (size_t)p->patches.n[0] + (size_t)t];
}

/* Every fourth bit, from bit 0 on, moved together. */
static uint64_t every_fourth(uint64_t x)
{
    x &= UINT64_C(0x1111111111111111);
    x = (x | x >> 3) & UINT64_C(0x0303030303030303);
    x = (x | x >> 6) & UINT64_C(0x000f000f000f000f);
    x = (x | x >> 12) & UINT64_C(0x000000ff000000ff);
    return (x | x >> 24) & UINT64_C(0xffff);
}

/* Sixteen patches, those whose voxels are bits 64 w and on of n_words words: set where a changed voxel reaches in. */
static uint64_t changed_patches(const uint64_t *changed, int n_words, int w, int apron)
{
    const uint64_t before = w > 0 ? changed[w - 1] : 0, after = w + 1 < n_words ? changed[w + 1] : 0;
    uint64_t any = changed[w];
    for (int i = 1; i <= apron; i++)
        any |= changed[w] << i | before >> (64 - i);
    /* A patch has the voxels of both its edges. */
    for (int i = 1; i <= CTS_PATCH + apron; i++)
        any |= changed[w] >> i | after << (64 - i);
    return every_fourth(any);
}

/* The levels of the voxels of column t of a swath, and of those around them that reach in. */
static CtsRange column_range(const CtsPaperPlan *p, const CtsPaperStore *store, int step, int swath, int t)
{
    const CtsPatches *patches = &p->patches;
    const int first[2] = {t * CTS_PATCH, cts_swath_start(patches, swath, 1)};
    const int end[2] = {(t + 1) * CTS_PATCH, (swath + 1) * CTS_SWATH * CTS_PATCH};
    CtsRange range = {UINT16_MAX, 0};
    int low[2], high[2];
    for (int c = 0; c < 2; c++) {
        const int last = patches->last_voxel[c], apron = p->rule.apron;
        low[c] = first[c] - apron;
        high[c] = (end[c] < last ? end[c] : last) + apron;
        if (low[c] < 0 || high[c] > last)
            range.low = 0;
        low[c] = low[c] > 0 ? low[c] : 0;
        high[c] = high[c] < last ? high[c] : last;
    }
    for (int v = low[1]; v <= high[1]; v++) {
        const uint16_t *row = cts_paper_row(p, store, step, v);
        for (int u = low[0]; u <= high[0]; u++)
            range = cts_range_union(range, (CtsRange){row[u], row[u]});
    }
    range.high = (uint16_t)(range.high - CTS_MUTATED(QUIET_RANGE));
    return range;
}

void cts_quiet_swath(const CtsPaperPlan *p, const CtsPaperStore *store, int step, int swath, const uint64_t *changed)
{
    const CtsQuiet *q = &p->quiet[step % p->n_sheets];
    const int n_words = (p->stack.n[0] + 63) / 64, n_patch_words = p->patches.n_words;
    uint64_t *known = q->known + (size_t)swath * (size_t)n_patch_words;
    uint64_t *empty = q->empty + (size_t)swath * (size_t)n_patch_words;
    for (int i = 0; i < n_patch_words; i++) {
        const int left = p->patches.n[0] - 64 * i;
        uint64_t same = !changed ? 0 : left < 64 ? (UINT64_C(1) << left) - 1 : ~UINT64_C(0);
        for (int w = 4 * i; w < 4 * i + 4 && w < n_words && changed; w++)
            same &= ~(changed_patches(changed, n_words, w, p->rule.apron) << 16 * (w & 3));
        uint64_t now_known = same & ~known[i];
        empty[i] &= same;
        known[i] = same;
        for (; now_known; now_known &= now_known - 1) {
            const int t = 64 * i + __builtin_ctzll(now_known);
            CtsRange *range = range_of(p, q, swath, t);
            *range = column_range(p, store, step, swath, t);
            if (!cts_range_visible(&p->rule, *range))
                empty[i] |= UINT64_C(1) << (t & 63);
        }
    }
}

void cts_quiet_drop(const CtsPaperPlan *p, int step, int swath, uint64_t *row)
{
    const CtsQuiet *here = &p->quiet[step % p->n_sheets], *before = &p->quiet[(step + 1) % p->n_sheets];
    const size_t at = (size_t)swath * (size_t)p->patches.n_words;
    for (int w = 0; w < p->patches.n_words; w++) {
        const uint64_t both = here->empty[at + (size_t)w] & before->empty[at + (size_t)w];
        uint64_t dropped = both;
        for (uint64_t left = here == before ? 0 : both & row[w]; left; left &= left - 1) {
            const int t = 64 * w + __builtin_ctzll(left);
            if (cts_range_visible(&p->rule,
                                  cts_range_union(*range_of(p, here, swath, t), *range_of(p, before, swath, t))))
                dropped &= ~(left & -left);
        }
        row[w] &= ~dropped;
    }
}
