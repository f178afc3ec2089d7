#define _GNU_SOURCE
#include "splat/void.h"

#include "base/mem.h"
#include "base/mutation.h"
#include <omp.h>
#include <string.h>

bool cts_range_visible(const CtsRangeRule *rule, CtsTileRange range)
{
    int64_t low = range.low, high = range.high;
    low = (low > rule->slack ? low - rule->slack : 0) * rule->sum_low / CTS_WEIGHT_ONE;
    high = ((high + rule->slack) * rule->sum_high + CTS_WEIGHT_ONE - 1) / CTS_WEIGHT_ONE;
    return cts_lut_visible(rule->lut, (uint16_t)low, (uint16_t)(high < 65535 ? high : 65535));
}

/* Voxels first..past-1 of an axis that reach into a tile; true when voxels outside the volume do too. */
static bool tile_voxels(const CtsTiles *tiles, int axis, int tile, int apron, int *first, int *past)
{
    const int last = tiles->last_voxel[axis], end = (tile + 1) * CTS_TILE;
    if (CTS_MUTATED(VOID_APRON))
        apron = -1;
    const int low = tile * CTS_TILE - apron, high = (end < last ? end : last) + apron;
    *first = low > 0 ? low : 0;
    *past = (high < last ? high : last) + 1;
    return low < 0 || high > last;
}

static void widen_one(CtsTileRange *range, uint16_t value)
{
    range->low = value < range->low ? value : range->low;
    range->high = value > range->high ? value : range->high;
}

CtsTileRange cts_tile_range(const CtsTiles *tiles, const CtsRangeRule *rule, int tile_u, int tile_v,
                            const uint16_t *(*row_of)(const void *context, int v), const void *rows)
{
    CtsTileRange range = {UINT16_MAX, 0};
    int u0, u1, v0, v1;
    bool outside = tile_voxels(tiles, 0, tile_u, rule->apron, &u0, &u1);
    outside |= tile_voxels(tiles, 1, tile_v, rule->apron, &v0, &v1);
    if (outside)
        widen_one(&range, rule->outside);
    for (int v = v0; v < v1; v++) {
        const uint16_t *row = row_of(rows, v);
        for (int u = u0; u < u1; u++)
            widen_one(&range, row[u]);
    }
    return range;
}

/* One thread's columns of smallest and largest levels, and a row of levels that stand for others. */
typedef struct Scratch {
    uint16_t *low, *high, *row;
    int n;
} Scratch;

static void start_columns(Scratch *s, bool outside, const CtsRangeRule *rule)
{
    for (int i = 0; i < s->n; i++) {
        s->low[i] = outside ? rule->outside : UINT16_MAX;
        s->high[i] = outside ? rule->outside : 0;
    }
}

static void widen_columns(Scratch *s, const uint16_t *row, const CtsRangeRule *rule, const CtsKernels *kernels)
{
    if (rule->level) {
        for (int i = 0; i < s->n; i++)
            s->row[i] = rule->level[row[i]];
        row = s->row;
    }
    kernels->widen(row, s->n, s->low, s->high);
}

/* Layers whose rows are the volume's: columns of a row of tiles, then tiles. */
static void map_tile_row(CtsVoidMap *map, const CtsStack *stack, const CtsKernels *kernels, int layer, int tile_v,
                         Scratch *s)
{
    const CtsTiles *tiles = &map->tiles;
    CtsTileRange *out = map->range + ((size_t)layer * (size_t)tiles->n[1] + (size_t)tile_v) * (size_t)tiles->n[0];
    int u0, u1, v0, v1;
    start_columns(s, tile_voxels(tiles, 1, tile_v, map->rule.apron, &v0, &v1), &map->rule);
    for (int v = v0; v < v1; v++)
        widen_columns(s, cts_stack_row(stack, layer, v), &map->rule, kernels);
    for (int tile_u = 0; tile_u < tiles->n[0]; tile_u++) {
        CtsTileRange range = {UINT16_MAX, 0};
        if (tile_voxels(tiles, 0, tile_u, map->rule.apron, &u0, &u1))
            widen_one(&range, map->rule.outside);
        for (int u = u0; u < u1; u++) {
            range.low = s->low[u] < range.low ? s->low[u] : range.low;
            range.high = s->high[u] > range.high ? s->high[u] : range.high;
        }
        out[tile_u] = range;
    }
}

/* Layers across x: a row of the volume runs through all of them, so one tile is done for every layer at a time. */
static void map_tile_across(CtsVoidMap *map, const CtsStack *stack, const CtsKernels *kernels, int tile_v, int tile_u,
                            Scratch *s)
{
    const CtsTiles *tiles = &map->tiles;
    const size_t n_tiles = (size_t)tiles->n[0] * (size_t)tiles->n[1];
    CtsTileRange *out = map->range + (size_t)tile_v * (size_t)tiles->n[0] + (size_t)tile_u;
    int u0, u1, v0, v1;
    bool outside = tile_voxels(tiles, 0, tile_u, map->rule.apron, &u0, &u1);
    outside |= tile_voxels(tiles, 1, tile_v, map->rule.apron, &v0, &v1);
    start_columns(s, outside, &map->rule);
    for (int v = v0; v < v1; v++)
        for (int u = u0; u < u1; u++)
            widen_columns(s, stack->grey + (size_t)v * stack->v_step + (size_t)u * (size_t)stack->n_layers, &map->rule,
                          kernels);
    for (int layer = 0; layer < stack->n_layers; layer++)
        out[(size_t)layer * n_tiles] = (CtsTileRange){s->low[layer], s->high[layer]};
}

static void map_shows(CtsVoidMap *map, int layer, int n_layers)
{
    const size_t n_tiles = (size_t)map->tiles.n[0] * (size_t)map->tiles.n[1], at = (size_t)layer * n_tiles;
    const size_t next = map->slabs && layer < n_layers - 1 ? n_tiles : 0;
    for (size_t t = at; t < at + n_tiles; t++)
        map->shows[t] = cts_range_visible(&map->rule, cts_range_union(map->range[t], map->range[t + next]));
}

static void widen_box(const CtsVoidMap *map, int layer, int box[4])
{
    const CtsTiles *tiles = &map->tiles;
    for (int v = 0; v < tiles->n[1]; v++) {
        const uint8_t *row = cts_void_row(map, layer, layer, v);
        const uint8_t *first = memchr(row, 1, (size_t)tiles->n[0]);
        if (!first)
            continue;
        const uint8_t *last = memrchr(row, 1, (size_t)tiles->n[0]);
        const int u0 = (int)(first - row), u1 = (int)(last - row) + 1;
        box[0] = u0 < box[0] ? u0 : box[0];
        box[2] = u1 > box[2] ? u1 : box[2];
        box[1] = v < box[1] ? v : box[1];
        box[3] = v + 1 > box[3] ? v + 1 : box[3];
    }
}

static void map_all(CtsVoidMap *map, const CtsStack *stack, const CtsKernels *kernels, Scratch *s)
{
    const CtsTiles *tiles = &map->tiles;
    if (stack->axis == 0) {
#pragma omp for schedule(dynamic, 8)
        for (int tile = 0; tile < tiles->n[0] * tiles->n[1]; tile++)
            map_tile_across(map, stack, kernels, tile / tiles->n[0], tile % tiles->n[0], s);
    } else {
#pragma omp for schedule(dynamic, 8)
        for (int i = 0; i < stack->n_layers * tiles->n[1]; i++)
            map_tile_row(map, stack, kernels, i / tiles->n[1], i % tiles->n[1], s);
    }
#pragma omp for schedule(dynamic, 4)
    for (int layer = 0; layer < stack->n_layers; layer++)
        map_shows(map, layer, stack->n_layers);
#pragma omp for schedule(dynamic, 4)
    for (int layer = 0; layer < stack->n_layers; layer++) {
        int *box = map->box[layer];
        box[0] = tiles->n[0];
        box[1] = tiles->n[1];
        box[2] = box[3] = 0;
        widen_box(map, layer, box);
        if (map->slabs && layer > 0)
            widen_box(map, layer - 1, box);
    }
}

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsTiles *tiles, const CtsRangeRule *rule,
                           const CtsKernels *kernels, bool slabs, int n_threads, CtsError *err)
{
    const int n = stack->axis == 0 ? stack->n_layers : stack->n[0];
    const size_t n_tiles = (size_t)tiles->n[0] * (size_t)tiles->n[1], padded = ((size_t)n + 31) / 32 * 32;
    uint16_t *rows = NULL;
    CtsStatus st;
    *map = (CtsVoidMap){.tiles = *tiles, .rule = *rule, .slabs = slabs && stack->n_layers > 1};
    if ((st = cts_alloc_array(&map->range, n_tiles * (size_t)stack->n_layers, err)) ||
        (st = cts_alloc_array(&map->box, (size_t)stack->n_layers, err)) ||
        (st = cts_alloc_array(&map->shows, n_tiles * (size_t)stack->n_layers, err)) ||
        (st = cts_alloc_array(&rows, 3 * padded * (size_t)n_threads, err)))
        goto end;
#pragma omp parallel num_threads(n_threads)
    {
        uint16_t *mine = rows + 3 * padded * (size_t)omp_get_thread_num();
        Scratch s = {.low = mine, .high = mine + padded, .row = mine + 2 * padded, .n = n};
        map_all(map, stack, kernels, &s);
    }
end:
    cts_free(&rows);
    return st;
}

void cts_void_map_free(CtsVoidMap *map)
{
    cts_free(&map->range);
    cts_free(&map->shows);
    cts_free(&map->box);
}
