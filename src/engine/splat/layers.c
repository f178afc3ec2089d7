#include "engine/splat/layers.h"

#include "base/mem.h"
#include "base/mutation.h"
#include <math.h>
#include <string.h>

enum { SAMPLE_EVERY = 16, SAMPLE_AT = 5 };

/* A row of a layer and the same row of an older layer, where the volume has them. */
typedef struct RowPair {
    const uint16_t *here, *old;
    size_t u_step;
    int tolerance;
} RowPair;

static RowPair row_pair(const CtsStack *stack, int k, int old_k, int v, int tolerance)
{
    const uint16_t *row = stack->grey + (size_t)v * stack->v_step;
    return (RowPair){.here = row + (size_t)k * stack->layer_step,
                     .old = row + (size_t)old_k * stack->layer_step,
                     .u_step = stack->axis == 0 ? (size_t)stack->n_layers : 1,
                     .tolerance = tolerance};
}

/* Voxels u0..u1-1. */
static void sample_run(const RowPair *rows, int u0, int u1, CtsChangeSample *sample)
{
    for (int u = u0; u < u1; u++) {
        const int change = rows->here[(size_t)u * rows->u_step] - rows->old[(size_t)u * rows->u_step];
        sample->changed += change > rows->tolerance || change < -rows->tolerance;
    }
    sample->voxels += (uint64_t)(u1 - u0);
}

CtsStatus cts_layers_sample(const CtsStack *stack, const CtsVoidMap *map, int tolerance, int distance, int axis_sign,
                            CtsChangeSample *sample, CtsError *err)
{
    const int first = distance > SAMPLE_AT ? distance : SAMPLE_AT < stack->n_layers ? SAMPLE_AT : distance;
    uint64_t *shows = NULL;
    *sample = (CtsChangeSample){0};
    const CtsStatus st = map ? cts_alloc_array(&shows, (size_t)map->patches.n_words, err) : CTS_OK;
    for (int s = first; s < stack->n_layers && !st; s += SAMPLE_EVERY) {
        const int k = axis_sign > 0 ? s : stack->n_layers - 1 - s, old_k = k - axis_sign * distance;
        for (int v = SAMPLE_AT; v < stack->n[1]; v += SAMPLE_EVERY) {
            const RowPair rows = row_pair(stack, k, old_k, v, tolerance);
            if (!map) {
                sample_run(&rows, 0, stack->n[0], sample);
                continue;
            }
            const int n = map->patches.n[0], patch_v = v / CTS_PATCH;
            if (!map->active[k] || patch_v >= map->patches.n[1])
                continue;
            memset(shows, 0, (size_t)map->patches.n_words * sizeof *shows);
            cts_void_add_row(map, k, k, patch_v, shows);
            for (int t = 0, past; cts_next_run(shows, n, &t, &past); t = past)
                sample_run(&rows, t * CTS_PATCH, past * CTS_PATCH < stack->n[0] ? past * CTS_PATCH : stack->n[0],
                           sample);
        }
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
    *q = (CtsQuiet){.patches = *patches};
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

static uint64_t *bits_row(const CtsQuiet *q, uint64_t *bits, int swath)
{
    return bits + (size_t)swath * (size_t)q->patches.n_words;
}

static CtsRange *range_of(const CtsQuiet *q, int swath, int t)
{
    return &q->range[(size_t)swath * (size_t)q->patches.n[0] + (size_t)t];
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

static void find_range(CtsQuiet *q, const CtsQuietJob *job, int swath, int t, int row0, int row1)
{
    CtsRange *range = range_of(q, swath, t);
    *range = cts_patch_range(&q->patches, job->rule, t, row0, row1, job->row_of, job->rows);
    range->high = (uint16_t)(range->high - CTS_MUTATED(QUIET_RANGE));
    if (!cts_range_visible(job->rule, *range))
        bits_row(q, q->empty, swath)[t / 64] |= UINT64_C(1) << (t & 63);
}

void cts_quiet_swath(CtsQuiet *q, const CtsQuietJob *job, int swath)
{
    const CtsPatches *patches = &q->patches;
    const int n_words = (job->n[0] + 63) / 64, apron = job->rule->apron, last = patches->n[1] - 1;
    const int row0 = swath * CTS_SWATH, row1 = row0 + CTS_SWATH - 1 < last ? row0 + CTS_SWATH - 1 : last;
    uint64_t *known = bits_row(q, q->known, swath), *empty = bits_row(q, q->empty, swath);
    if (!job->old_rows) {
        memset(known, 0, (size_t)patches->n_words * sizeof *known);
        memset(empty, 0, (size_t)patches->n_words * sizeof *empty);
        return;
    }
    memset(job->changed, 0, (size_t)n_words * sizeof *job->changed);
    for (int v = row0 * CTS_PATCH > apron ? row0 * CTS_PATCH - apron : 0;
         v <= (row1 + 1) * CTS_PATCH + apron && v < job->n[1]; v++) {
        job->simd->mark(job->row_of(job->rows, v), job->row_of(job->old_rows, v), 0, job->n[0], job->marks);
        for (int w = 0; w < n_words; w++)
            job->changed[w] |= job->marks[w];
    }
    for (int i = 0; i < patches->n_words; i++) {
        const int left = patches->n[0] - 64 * i;
        uint64_t same = left < 64 ? (UINT64_C(1) << left) - 1 : ~UINT64_C(0);
        for (int w = 4 * i; w < 4 * i + 4 && w < n_words; w++)
            same &= ~(changed_patches(job->changed, n_words, w, apron) << 16 * (w & 3));
        const uint64_t now_known = same & ~known[i];
        empty[i] &= same;
        known[i] = same;
        for (uint64_t more = now_known; more; more &= more - 1)
            find_range(q, job, swath, 64 * i + __builtin_ctzll(more), row0, row1);
    }
}

void cts_quiet_drop(const CtsQuiet *here, const CtsQuiet *before, const CtsRangeRule *rule, int swath, uint64_t *row)
{
    const uint64_t *empty[2] = {bits_row(here, here->empty, swath), bits_row(before, before->empty, swath)};
    for (int w = 0; w < here->patches.n_words; w++) {
        if (here == before) {
            row[w] &= ~empty[0][w];
            continue;
        }
        for (uint64_t left = empty[0][w] & empty[1][w] & row[w]; left; left &= left - 1) {
            const int bit = __builtin_ctzll(left), t = 64 * w + bit;
            if (!cts_range_visible(rule, cts_range_union(*range_of(here, swath, t), *range_of(before, swath, t))))
                row[w] &= ~(UINT64_C(1) << bit);
        }
    }
}
