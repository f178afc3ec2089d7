#include "engine/splat/void.h"

#include "base/bits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
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

/* True if voxels outside the volume reach into a patch. */
static bool reached_from_outside(const CtsPatches *patches, const CtsRangeRule *rule, int axis, int patch)
{
    return patch * CTS_PATCH - rule->apron < 0 || (patch + 1) * CTS_PATCH + rule->apron > patches->last_voxel[axis];
}

/* The volume's fine macro-cells as the stack has them, by their distances along u, v and the layers. */
typedef struct VoidMapping {
    const CtsVoidMap *map;
    const CtsRange *fine;
    const CtsRangeRule *rule;
    size_t u_step, v_step, k_step;
} VoidMapping;

/* The range of a macro-cell, and of those around it that reach in. */
static CtsRange reaching_range(const VoidMapping *m, int k, int patch_v, int patch_u)
{
    const CtsPatches *const patches = &m->map->patches;
    const CtsRange *const own =
        m->fine + (size_t)k * m->k_step + (size_t)patch_v * m->v_step + (size_t)patch_u * m->u_step;
    CtsRange range = *own;
    if (m->rule->apron == 0)
        return range;
    for (int dv = patch_v > 0 ? -1 : 0; dv <= (patch_v + 1 < patches->n[1]); dv++)
        for (int du = patch_u > 0 ? -1 : 0; du <= (patch_u + 1 < patches->n[0]); du++)
            range = cts_range_union(range, own[(ptrdiff_t)m->v_step * dv + (ptrdiff_t)m->u_step * du]);
    if (reached_from_outside(patches, m->rule, 0, patch_u) || reached_from_outside(patches, m->rule, 1, patch_v))
        range.low = 0;
    return range;
}

static uint64_t *shows_row(const CtsVoidMap *map, int macrocell, int patch_v)
{
    return map->shows +
           ((size_t)macrocell * (size_t)map->patches.n[1] + (size_t)patch_v) * (size_t)map->patches.n_words;
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
        uint64_t n_shown = 0;
        for (size_t w = 0; w < n_words; w++)
            n_shown += (uint64_t)cts_popcount(map->shows[(size_t)macrocell * n_words + w]);
        map->n_shown += n_shown;
        if (n_shown > 0)
            for (int k = macrocell * CTS_PATCH; k <= (macrocell + 1) * CTS_PATCH && k < map->n_layers; k++)
                map->active[k] = 1;
    }
}

/* A row of patches of all layers; patches of a row share words of bits. */
static void map_rows(void *context, int worker, size_t first, size_t end)
{
    const VoidMapping *const m = context;
    (void)worker;
    for (int v = (int)first; v < (int)end; v++)
        for (int k = 0; k < m->map->n_macrocells; k++)
            for (int u = 0; u < m->map->patches.n[0]; u++)
                if (is_range_visible(m->rule, reaching_range(m, k, v, u)))
                    shows_row(m->map, k, v)[u / 64] |= UINT64_C(1) << (u & 63);
}

CtsStatus cts_void_map_new(CtsVoidMap *map, const CtsStack *stack, const CtsPatches *patches, const CtsRangeRule *rule,
                           const CtsMacrocells *macrocells, int n_threads, CtsError *err)
{
    const size_t step[3] = {1, (size_t)macrocells->n_fine[0],
                            (size_t)macrocells->n_fine[0] * (size_t)macrocells->n_fine[1]};
    const int n_macrocells = macrocells->n_fine[stack->axis];
    const size_t n_rows = (size_t)n_macrocells * (size_t)patches->n[1];
    VoidMapping mapping = {.map = map,
                           .fine = macrocells->fine,
                           .rule = rule,
                           .u_step = step[stack->u_axis],
                           .v_step = step[stack->v_axis],
                           .k_step = step[stack->axis]};
    CtsStatus st;
    *map = (CtsVoidMap){.patches = *patches, .n_layers = stack->n_layers, .n_macrocells = n_macrocells};
    if ((st = cts_alloc_zeroed(&map->shows, n_rows * (size_t)patches->n_words, err)) ||
        (st = cts_alloc_zeroed(&map->active, (size_t)stack->n_layers, err)))
        return st;
    cts_parallel(n_threads, (size_t)patches->n[1], 1, map_rows, &mapping);
    map->n_patches = n_rows * (size_t)patches->n[0];
    find_active(map);
    return CTS_OK;
}
