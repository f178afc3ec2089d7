#include "splat/layers.h"

#include <string.h>

enum { SAMPLE_EVERY = 8, SAMPLE_AT = 3 };

static void sample_row(const CtsStack *stack, const CtsVoidMap *map, const uint16_t *level, int tolerance, int k,
                       int old_k, int v, CtsChangeSample *sample)
{
    const size_t u_step = stack->axis == 0 ? (size_t)stack->n_layers : 1;
    const uint16_t *at = stack->grey + (size_t)v * stack->v_step + (size_t)k * stack->layer_step;
    const uint16_t *old = stack->grey + (size_t)v * stack->v_step + (size_t)old_k * stack->layer_step;
    const uint8_t *shows = map ? cts_void_row(map, k, k, v / CTS_TILE) : NULL;
    for (int u = 0; u < stack->n[0]; u++, at += u_step, old += u_step) {
        if (shows && !shows[u / CTS_TILE < map->tiles.n[0] ? u / CTS_TILE : map->tiles.n[0] - 1])
            continue;
        const int change = level ? level[*at] - level[*old] : *at - *old;
        sample->voxels++;
        sample->changed += change > tolerance || change < -tolerance;
    }
}

CtsChangeSample cts_layers_sample(const CtsStack *stack, const CtsTiles *tiles, const CtsVoidMap *map,
                                  const uint16_t *level, int tolerance, int distance, int axis_sign)
{
    CtsChangeSample sample = {0};
    const int first = distance > SAMPLE_AT ? distance : SAMPLE_AT < stack->n_layers ? SAMPLE_AT : distance;
    for (int s = first; s < stack->n_layers; s += SAMPLE_EVERY) {
        const int k = axis_sign > 0 ? s : stack->n_layers - 1 - s;
        for (int v = SAMPLE_AT; v < stack->n[1] && v / CTS_TILE < tiles->n[1]; v += SAMPLE_EVERY)
            sample_row(stack, map, level, tolerance, k, k - axis_sign * distance, v, &sample);
    }
    return sample;
}

bool cts_layers_pay(CtsChangeSample sample, const CtsFootprint *footprint)
{
    /* In units of one vector of taps added: a footprint is its rows of eight taps and a fixed part; to compare and
     * find a changed voxel costs about one. */
    const double vectors = (2 * footprint->reach[1] + 1) * ((2 * footprint->reach[0] + 8) / 8);
    const double anew = 2 + vectors;
    return sample.voxels > 0 && (double)sample.changed / (double)sample.voxels * anew + 1 < anew;
}

void cts_layers_settle(const uint16_t *fresh, const uint16_t *before, const uint16_t *level, int tolerance, int n,
                       uint16_t *kept)
{
    for (int i = 0; i < n; i++) {
        const uint16_t value = level ? level[fresh[i]] : fresh[i];
        const int change = before ? value - before[i] : 0;
        kept[i] = before && change <= tolerance && change >= -tolerance ? before[i] : value;
    }
}

/* Whether any of bits first..past-1 is set. */
static bool any_bit(const uint64_t *bits, int first, int past)
{
    for (int i = first; i < past;) {
        const int end = (i / 64 + 1) * 64 < past ? (i / 64 + 1) * 64 : past;
        const uint64_t word = bits[i / 64] >> (i & 63);
        if (end - i == 64 ? word != 0 : (word & ((UINT64_C(1) << (end - i)) - 1)) != 0)
            return true;
        i = end;
    }
    return false;
}

void cts_layers_quiet(const CtsQuietRow *job, int tile_v, CtsQuiet *quiet)
{
    const CtsTiles *tiles = job->tiles;
    const int words = (job->n[0] + 63) / 64, apron = job->rule->apron;
    if (!job->old_rows) {
        for (int t = 0; t < tiles->n[0]; t++)
            quiet[t].known = false;
        return;
    }
    const int low = tile_v * CTS_TILE - apron, high = (tile_v + 1) * CTS_TILE + apron;
    memset(job->changed, 0, (size_t)words * sizeof *job->changed);
    for (int v = low > 0 ? low : 0; v <= high && v < job->n[1]; v++) {
        job->kernels->mark(job->row_of(job->rows, v), job->row_of(job->old_rows, v), 0, job->n[0], job->marks);
        for (int w = 0; w < words; w++)
            job->changed[w] |= job->marks[w];
    }
    for (int t = 0; t < tiles->n[0]; t++) {
        const int u0 = t * CTS_TILE - apron, u1 = (t + 1) * CTS_TILE + apron + 1;
        if (any_bit(job->changed, u0 > 0 ? u0 : 0, u1 < job->n[0] ? u1 : job->n[0])) {
            quiet[t].known = false;
        } else if (!quiet[t].known) {
            quiet[t].known = true;
            quiet[t].range = cts_tile_range(tiles, job->rule, t, tile_v, job->row_of, job->rows);
        }
    }
}
