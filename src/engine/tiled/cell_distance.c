/* The set of macro-cells within distance n + 1 is the set within n dilated by one macro-cell to all 26 neighbours:
 * along one axis after the other, on rows of bits. */
#include "engine/tiled/cell_distance.h"

#include "base/mem.h"
#include <stdbool.h>
#include <string.h>

typedef struct Grid {
    int nu, nv, nk;
    size_t words;  /* of a row of nu bits */
    uint64_t last; /* mask of a row's last word */
} Grid;

static size_t n_grid_words(const Grid *g)
{
    return (size_t)g->nk * (size_t)g->nv * g->words;
}

static void set_bits(const Grid *g, const uint8_t *distance, uint64_t *bits)
{
    for (size_t row = 0; row < (size_t)g->nk * (size_t)g->nv; row++) {
        const uint8_t *d = distance + row * (size_t)g->nu;
        for (size_t w = 0; w < g->words; w++) {
            uint64_t word = 0;
            for (size_t u = 64 * w; u < 64 * (w + 1) && u < (size_t)g->nu; u++)
                word |= (uint64_t)(d[u] == 0) << (u - 64 * w);
            bits[row * g->words + w] = word;
        }
    }
}

static void spread_u(const Grid *g, const uint64_t *from, uint64_t *to)
{
    for (size_t row = 0; row < n_grid_words(g); row += g->words)
        for (size_t w = 0; w < g->words; w++) {
            const uint64_t here = from[row + w];
            uint64_t all = here | here << 1 | here >> 1;
            if (w > 0)
                all |= from[row + w - 1] >> 63;
            if (w + 1 < g->words)
                all |= from[row + w + 1] << 63;
            else
                all &= g->last;
            to[row + w] = all;
        }
}

/* Dilation along an axis of n steps of `stride` words, in each of n_outer groups of n * stride. */
static void spread_rows(const uint64_t *from, uint64_t *to, int n_outer, int n, size_t stride)
{
    for (int outer = 0; outer < n_outer; outer++)
        for (int i = 0; i < n; i++) {
            const uint64_t *here = from + ((size_t)outer * (size_t)n + (size_t)i) * stride;
            const uint64_t *back = i > 0 ? here - stride : here, *on = i + 1 < n ? here + stride : here;
            uint64_t *out = to + (here - from);
            for (size_t w = 0; w < stride; w++)
                out[w] = here[w] | back[w] | on[w];
        }
}

/* Stores `level` for new bits; false when there are none. */
static bool note_new(const Grid *g, const uint64_t *before, const uint64_t *after, uint8_t level, uint8_t *distance)
{
    uint64_t any = 0;
    for (size_t i = 0; i < n_grid_words(g); i++) {
        uint64_t after_split = after[i] & ~before[i];
        any |= after_split;
        uint8_t *d = distance + i / g->words * (size_t)g->nu + 64 * (i % g->words);
        for (; after_split; after_split &= after_split - 1)
            d[__builtin_ctzll(after_split)] = level;
    }
    return any != 0;
}

CtsStatus cts_cell_distance(uint8_t *distance, int nu, int nv, int nk, CtsError *err)
{
    const Grid g = {nu, nv, nk, ((size_t)nu + 63) / 64, nu % 64 ? (UINT64_C(1) << nu % 64) - 1 : ~UINT64_C(0)};
    const size_t n = n_grid_words(&g);
    CtsStatus st;
    uint64_t *bits = NULL;
    if ((st = cts_alloc_array(&bits, 3 * n, err)))
        return st;
    uint64_t *now = bits, *next = bits + n, *between = bits + 2 * n;
    set_bits(&g, distance, now);
    for (size_t i = 0; i < (size_t)nu * (size_t)nv * (size_t)nk; i++)
        distance[i] = distance[i] ? CTS_CELL_FAR : 0;
    for (int level = 1; level < CTS_CELL_FAR; level++) {
        spread_u(&g, now, next);
        spread_rows(next, between, nk, nv, g.words);
        spread_rows(between, next, 1, nk, g.words * (size_t)nv);
        if (!note_new(&g, now, next, (uint8_t)level, distance))
            break;
        uint64_t *const old = now;
        now = next;
        next = old;
    }
    cts_free(&bits);
    return CTS_OK;
}
