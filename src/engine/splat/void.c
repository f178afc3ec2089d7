#include "engine/splat/void.h"

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

/* False when all mixtures of the grey levels in the range are invisible. */
static bool is_range_visible(const CtsRangeRule *rule, CtsRange range)
{
    return cts_lut_visible(rule->lut, sample_low(rule, range.low), sample_high(rule, range.high));
}

uint16_t cts_range_least(const CtsRangeRule *rule)
{
    int below = 0, least = UINT16_MAX;
    while (below < least) {
        const int middle = (below + least) / 2;
        if (is_range_visible(rule, (CtsRange){0, (uint16_t)middle}))
            least = middle;
        else
            below = middle + 1;
    }
    return (uint16_t)least;
}

/* The volume's fine macro-cells as the stack has them: a line of them runs along the volume's x axis, which is along u,
 * or where the layers lie across x from layer to layer. */
typedef struct MacrocellLines {
    const CtsRange *fine;
    const CtsRangeRule *rule;
    int n;       /* macro-cells in a line */
    bool across; /* lines run from layer to layer */
    size_t u_step, v_step, k_step;
    CtsRange *wide, *row; /* scratch: lines of n + 2 macro-cells for each thread */
} MacrocellLines;

static void widen_line(CtsRange *line, const CtsRange *other, int n)
{
    for (int i = 0; i < n; i++)
        line[i] = cts_range_union(line[i], other[i]);
}

/* True if voxels outside the volume reach into a patch. */
static bool reached_from_outside(const CtsPatches *patches, const CtsRangeRule *rule, int axis, int patch)
{
    return patch * CTS_PATCH - rule->apron < 0 || (patch + 1) * CTS_PATCH + rule->apron > patches->last_voxel[axis];
}

/* Ranges of a line's macro-cells and of those around them that reach in. */
static const CtsRange *line_ranges(const CtsVoidMap *map, const MacrocellLines *l, int k, int patch_v, int patch_u,
                                   CtsRange *row, CtsRange *wide)
{
    const CtsPatches *patches = &map->patches;
    const CtsRange *line = l->fine + (size_t)k * l->k_step + (size_t)patch_v * l->v_step + (size_t)patch_u * l->u_step;
    if (l->rule->apron == 0)
        return line;
    memcpy(row, line, (size_t)l->n * sizeof *row);
    for (int dv = -1; dv <= 1; dv++)
        for (int du = l->across ? -1 : 0; du <= l->across; du++)
            if (patch_v + dv >= 0 && patch_v + dv < patches->n[1] && patch_u + du >= 0 && patch_u + du < patches->n[0])
                widen_line(row, line + (ptrdiff_t)l->v_step * dv + (ptrdiff_t)l->u_step * du, l->n);
    const bool out = reached_from_outside(patches, l->rule, 1, patch_v) ||
                     (l->across && reached_from_outside(patches, l->rule, 0, patch_u));
    for (int i = 0; i < l->n; i++) {
        wide[i] = row[i];
        if (!l->across) {
            wide[i] = cts_range_union(wide[i], row[i > 0 ? i - 1 : i]);
            wide[i] = cts_range_union(wide[i], row[i < l->n - 1 ? i + 1 : i]);
        }
        if (out || (!l->across && reached_from_outside(patches, l->rule, 0, i)))
            wide[i].low = 0;
    }
    return wide;
}

static uint64_t *shows_row(const CtsVoidMap *map, int macrocell, int patch_v)
{
    return map->shows +
           ((size_t)macrocell * (size_t)map->patches.n[1] + (size_t)patch_v) * (size_t)map->patches.n_words;
}

/* Set the bits of one line; returns how many. */
static uint64_t map_line(const CtsVoidMap *map, const MacrocellLines *l, int worker, int k, int patch_v, int patch_u)
{
    const size_t scratch = (size_t)worker * (size_t)l->n;
    const CtsRange *range = line_ranges(map, l, k, patch_v, patch_u, l->row + scratch, l->wide + scratch);
    uint64_t n_shown = 0;
    for (int i = 0; i < l->n; i++) {
        if (!is_range_visible(l->rule, range[i]))
            continue;
        const int u = l->across ? patch_u : i;
        shows_row(map, l->across ? i : k, patch_v)[u / 64] |= UINT64_C(1) << (u & 63);
        n_shown++;
    }
    return n_shown;
}

void cts_void_add_row(const CtsVoidMap *map, int a, int b, int patch_v, uint64_t *row)
{
    const int layer = a < b ? a : b, last = map->n_macrocells - 1;
    const int macrocell = layer / CTS_PATCH < last ? layer / CTS_PATCH : last;
    const uint64_t *shows = shows_row(map, macrocell, patch_v), *also = shows;
    /* Two macro-cells contain the layer at their common face. */
    if (a == b && macrocell > 0 && macrocell * CTS_PATCH == layer)
        also = shows_row(map, macrocell - 1, patch_v);
    for (int w = 0; w < map->patches.n_words; w++)
        row[w] |= CTS_MUTATED(VOID_EDGES) ? shows[w] & also[w] & shows[w] << 1 : shows[w] & also[w];
}

/* Layers of visible macro-cells, and with slabs their neighbours. */
static void find_active(CtsVoidMap *map)
{
    const size_t n_words = (size_t)map->patches.n[1] * (size_t)map->patches.n_words;
    for (int macrocell = 0; macrocell < map->n_macrocells; macrocell++) {
        bool any = false;
        for (size_t w = 0; w < n_words; w++)
            any |= map->shows[(size_t)macrocell * n_words + w] != 0;
        if (any)
            for (int k = macrocell * CTS_PATCH; k <= (macrocell + 1) * CTS_PATCH && k < map->n_layers; k++)
                map->active[k] = 1;
    }
}

typedef struct VoidMapping {
    const CtsVoidMap *map;
    const MacrocellLines *lines;
    int n_other;
    _Atomic uint64_t n_shown;
} VoidMapping;

/* Lines of one row of patches share words of bits, so they belong to one thread. */
static void map_rows(void *context, int worker, size_t first, size_t end)
{
    VoidMapping *const m = context;
    const bool across = m->lines->across;
    for (size_t v = first; v < end; v++)
        for (int i = 0; i < m->n_other; i++)
            atomic_fetch_add(&m->n_shown, map_line(m->map, m->lines, worker, across ? 0 : i, (int)v, across ? i : 0));
}

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsPatches *patches, const CtsRangeRule *rule,
                           const CtsMacrocells *macrocells, int n_threads, CtsError *err)
{
    const size_t step[3] = {1, (size_t)macrocells->n_fine[0],
                            (size_t)macrocells->n_fine[0] * (size_t)macrocells->n_fine[1]};
    const int n_macrocells = macrocells->n_fine[stack->axis], n_v = patches->n[1];
    const size_t n_rows = (size_t)n_macrocells * (size_t)n_v;
    MacrocellLines lines = {.fine = macrocells->fine,
                            .rule = rule,
                            .n = macrocells->n_fine[0],
                            .across = stack->axis == 0,
                            .u_step = step[stack->u_axis],
                            .v_step = step[stack->v_axis],
                            .k_step = step[stack->axis]};
    CtsStatus st;
    *map = (CtsVoidMap){.patches = *patches, .n_layers = stack->n_layers, .n_macrocells = n_macrocells};
    if ((st = cts_alloc_zeroed(&map->shows, n_rows * (size_t)patches->n_words, err)) ||
        (st = cts_alloc_zeroed(&map->active, (size_t)stack->n_layers, err)) ||
        (st = cts_alloc_array(&lines.row, (size_t)lines.n * (size_t)n_threads, err)) ||
        (st = cts_alloc_array(&lines.wide, (size_t)lines.n * (size_t)n_threads, err)))
        goto end;
    VoidMapping mapping = {.map = map, .lines = &lines, .n_other = lines.across ? patches->n[0] : n_macrocells};
    cts_parallel(n_threads, (size_t)n_v, 1, map_rows, &mapping);
    map->n_shown = atomic_load(&mapping.n_shown);
    map->n_patches = n_rows * (size_t)patches->n[0];
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
