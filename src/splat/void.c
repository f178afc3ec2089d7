#include "splat/void.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include <stdatomic.h>
#include <string.h>

static uint16_t sample_low(const CtsRangeRule *rule, uint16_t low)
{
    const uint64_t least = (uint64_t)(low > rule->slack ? low - rule->slack : 0) * rule->sum_low / CTS_WEIGHT_ONE;
    return (uint16_t)(least < UINT16_MAX ? least : UINT16_MAX);
}

static uint16_t sample_high(const CtsRangeRule *rule, uint16_t high)
{
    const uint64_t most = (((uint64_t)high + rule->slack) * rule->sum_high + CTS_WEIGHT_ONE - 1) / CTS_WEIGHT_ONE;
    return (uint16_t)(most < UINT16_MAX ? most : UINT16_MAX);
}

bool cts_range_visible(const CtsRangeRule *rule, CtsRange range)
{
    return cts_lut_visible(rule->lut, sample_low(rule, range.low), sample_high(rule, range.high));
}

static void widen(CtsRange *range, CtsRange other)
{
    *range = cts_range_union(*range, other);
}

CtsRange cts_tile_range(const CtsTiles *tiles, const CtsRangeRule *rule, int tile_u, int row0, int row1,
                        const uint16_t *(*row_of)(const void *context, int v), const void *rows)
{
    const int first[2] = {tile_u, row0}, past[2] = {tile_u + 1, row1 + 1};
    CtsRange range = {UINT16_MAX, 0};
    int low[2], high[2];
    for (int c = 0; c < 2; c++) {
        const int last = tiles->last_voxel[c], end = past[c] * CTS_TILE < last ? past[c] * CTS_TILE : last;
        low[c] = first[c] * CTS_TILE - rule->apron;
        high[c] = end + rule->apron;
        if (low[c] < 0 || high[c] > last)
            range = (CtsRange){rule->outside, rule->outside};
        low[c] = low[c] > 0 ? low[c] : 0;
        high[c] = high[c] < last ? high[c] : last;
    }
    for (int v = low[1]; v <= high[1]; v++) {
        const uint16_t *row = row_of(rows, v);
        for (int u = low[0]; u <= high[0]; u++)
            widen(&range, (CtsRange){row[u], row[u]});
    }
    return range;
}

/* Levels that settle most ranges by two comparisons: one whose high is below the first, or whose low is above the
 * second, shows nothing. */
typedef struct Limits {
    int high_from, low_to;
} Limits;

static Limits limits_of(const CtsRangeRule *rule)
{
    int low = 0, past = CTS_N_GREY;
    Limits limits;
    while (low < past) {
        const int middle = (low + past) / 2;
        if (cts_lut_visible(rule->lut, 0, sample_high(rule, (uint16_t)middle)))
            past = middle;
        else
            low = middle + 1;
    }
    limits.high_from = low;
    for (low = 0, past = CTS_N_GREY; low < past;) {
        const int middle = (low + past) / 2;
        if (cts_lut_visible(rule->lut, sample_low(rule, (uint16_t)middle), UINT16_MAX))
            low = middle + 1;
        else
            past = middle;
    }
    limits.low_to = low - 1;
    return limits;
}

/* The volume's fine blocks as the stack has them: a line of them runs along the volume's x axis, which is along u, or
 * where the layers lie across x from layer to layer. */
typedef struct Lines {
    const CtsRange *fine;
    const CtsRangeRule *rule;
    Limits limits;
    int n;       /* blocks in a line */
    bool across; /* lines run from layer to layer */
    size_t u_step, v_step, k_step;
    CtsRange *wide, *row; /* scratch: lines of n + 2 blocks for each thread */
} Lines;

static void widen_line(CtsRange *line, const CtsRange *other, int n)
{
    for (int i = 0; i < n; i++)
        widen(&line[i], other[i]);
}

/* Whether voxels outside the volume reach into a tile. */
static bool reached_from_outside(const CtsTiles *tiles, const CtsRangeRule *rule, int axis, int tile)
{
    return tile * CTS_TILE - rule->apron < 0 || (tile + 1) * CTS_TILE + rule->apron > tiles->last_voxel[axis];
}

/* Ranges of a line's blocks and of those around them that reach in. */
static const CtsRange *line_ranges(const CtsVoidMap *map, const Lines *l, int k, int tile_v, int tile_u, CtsRange *row,
                                   CtsRange *wide)
{
    const CtsTiles *tiles = &map->tiles;
    const CtsRange *line = l->fine + (size_t)k * l->k_step + (size_t)tile_v * l->v_step + (size_t)tile_u * l->u_step;
    const CtsRange outside = {l->rule->outside, l->rule->outside};
    if (l->rule->apron == 0)
        return line;
    memcpy(row, line, (size_t)l->n * sizeof *row);
    for (int dv = -1; dv <= 1; dv++)
        for (int du = l->across ? -1 : 0; du <= l->across; du++)
            if (tile_v + dv >= 0 && tile_v + dv < tiles->n[1] && tile_u + du >= 0 && tile_u + du < tiles->n[0])
                widen_line(row, line + (ptrdiff_t)l->v_step * dv + (ptrdiff_t)l->u_step * du, l->n);
    const bool out = reached_from_outside(tiles, l->rule, 1, tile_v) ||
                     (l->across && reached_from_outside(tiles, l->rule, 0, tile_u));
    for (int i = 0; i < l->n; i++) {
        wide[i] = row[i];
        if (!l->across) {
            widen(&wide[i], row[i > 0 ? i - 1 : i]);
            widen(&wide[i], row[i < l->n - 1 ? i + 1 : i]);
        }
        if (out || (!l->across && reached_from_outside(tiles, l->rule, 0, i)))
            widen(&wide[i], outside);
    }
    return wide;
}

static uint64_t *shows_row(const CtsVoidMap *map, int block, int tile_v)
{
    return map->shows + ((size_t)block * (size_t)map->tiles.n[1] + (size_t)tile_v) * (size_t)map->tiles.n_words;
}

/* Set the bits of one line; returns how many. */
static uint64_t map_line(const CtsVoidMap *map, const Lines *l, int worker, int k, int tile_v, int tile_u)
{
    const size_t scratch = (size_t)worker * (size_t)l->n;
    const CtsRange *range = line_ranges(map, l, k, tile_v, tile_u, l->row + scratch, l->wide + scratch);
    uint64_t n_shown = 0;
    for (int i = 0; i < l->n; i++) {
        if (range[i].high < l->limits.high_from || range[i].low > l->limits.low_to ||
            !cts_range_visible(l->rule, range[i]))
            continue;
        const int u = l->across ? tile_u : i;
        shows_row(map, l->across ? i : k, tile_v)[u / 64] |= UINT64_C(1) << (u & 63);
        n_shown++;
    }
    return n_shown;
}

void cts_void_add_row(const CtsVoidMap *map, int a, int b, int tile_v, uint64_t *row)
{
    const int layer = a < b ? a : b, last = map->n_blocks - 1;
    const int block = layer / CTS_TILE < last ? layer / CTS_TILE : last;
    const uint64_t *shows = shows_row(map, block, tile_v), *also = shows;
    /* Two blocks know the layer on which they meet. */
    if (a == b && block > 0 && block * CTS_TILE == layer)
        also = shows_row(map, block - 1, tile_v);
    for (int w = 0; w < map->tiles.n_words; w++)
        row[w] |= CTS_MUTATED(VOID_EDGES) ? shows[w] & also[w] & shows[w] << 1 : shows[w] & also[w];
}

void cts_void_keep_rows(const CtsVoidMap *map, int first, int last, int tile_v, uint64_t *row)
{
    const int last_block = last / CTS_TILE < map->n_blocks ? last / CTS_TILE : map->n_blocks - 1;
    for (int w = 0; w < map->tiles.n_words; w++) {
        uint64_t any = 0;
        for (int block = first / CTS_TILE; block <= last_block; block++)
            any |= shows_row(map, block, tile_v)[w];
        row[w] &= any;
    }
}

/* Layers of the blocks that show something, and with slabs their neighbours. */
static void find_active(CtsVoidMap *map)
{
    const size_t n_words = (size_t)map->tiles.n[1] * (size_t)map->tiles.n_words;
    for (int block = 0; block < map->n_blocks; block++) {
        bool any = false;
        for (size_t w = 0; w < n_words; w++)
            any |= map->shows[(size_t)block * n_words + w] != 0;
        if (any)
            for (int k = block * CTS_TILE; k <= (block + 1) * CTS_TILE && k < map->n_layers; k++)
                map->active[k] = 1;
    }
}

typedef struct Mapping {
    const CtsVoidMap *map;
    const Lines *lines;
    int n_other;
    _Atomic uint64_t n_shown;
} Mapping;

/* Lines of one row of tiles share words of bits, so they are one thread's. */
static void map_rows(void *context, int worker, size_t first, size_t end)
{
    Mapping *const m = context;
    const bool across = m->lines->across;
    for (size_t v = first; v < end; v++)
        for (int i = 0; i < m->n_other; i++)
            atomic_fetch_add(&m->n_shown, map_line(m->map, m->lines, worker, across ? 0 : i, (int)v, across ? i : 0));
}

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsTiles *tiles, const CtsRangeRule *rule,
                           const CtsBlocks *blocks, int n_threads, CtsError *err)
{
    const size_t step[3] = {1, (size_t)blocks->n_fine[0], (size_t)blocks->n_fine[0] * (size_t)blocks->n_fine[1]};
    const int n_blocks = blocks->n_fine[stack->axis], n_v = tiles->n[1];
    const size_t n_rows = (size_t)n_blocks * (size_t)n_v;
    Lines lines = {.fine = blocks->fine,
                   .rule = rule,
                   .limits = limits_of(rule),
                   .n = blocks->n_fine[0],
                   .across = stack->axis == 0,
                   .u_step = step[stack->u_axis],
                   .v_step = step[stack->v_axis],
                   .k_step = step[stack->axis]};
    CtsStatus st;
    *map = (CtsVoidMap){.tiles = *tiles, .n_layers = stack->n_layers, .n_blocks = n_blocks};
    if ((st = cts_alloc_zeroed(&map->shows, n_rows * (size_t)tiles->n_words, err)) ||
        (st = cts_alloc_zeroed(&map->active, (size_t)stack->n_layers, err)) ||
        (st = cts_alloc_array(&lines.row, (size_t)lines.n * (size_t)n_threads, err)) ||
        (st = cts_alloc_array(&lines.wide, (size_t)lines.n * (size_t)n_threads, err)))
        goto end;
    Mapping mapping = {.map = map, .lines = &lines, .n_other = lines.across ? tiles->n[0] : n_blocks};
    cts_parallel(n_threads, (size_t)n_v, 1, map_rows, &mapping);
    map->n_shown = atomic_load(&mapping.n_shown);
    map->n_tiles = n_rows * (size_t)tiles->n[0];
    find_active(map);
end:
    cts_free(&lines.row);
    cts_free(&lines.wide);
    return st;
}

void cts_void_map_free(CtsVoidMap *map)
{
    cts_free(&map->shows);
    cts_free(&map->active);
}
