/* The kernels of openness, included once for each SIMD path. */
#include "base/simd.h"
#include "core/scene/openness_beams.h"

typedef uint16_t vw SIMD_VECTOR(real);
SIMD_MEMORY(vw, uint16_t)
SIMD_OP(vw, vw_of, (uint16_t x), x - (vw){0})
SIMD_OP(vw, vw_mul_high, (vw a, vw b), (vw)vs_mul_high((vs)a, (vs)b))

enum { WORDS = 2 * LANES, MAX_VECTORS = 6 /* whole rows of most chests with the widest vectors */ };

/* Horner's scheme: the sum T_0 + T_1 + ... is 1 + t_1 (1 + t_2 (1 + ...)). The vectors hide each other's latency. */
INLINE void add_vectors(const OpennessBeams *b, int at, int n_vectors, uint16_t *sums)
{
    const vw one = vw_of(OPENNESS_OPEN), mean = vw_of(b->mean), rest = vw_of(b->rest);
    const uint16_t *step = b->from + at + b->n_steps * b->step;
    vw sum[MAX_VECTORS];
    for (int v = 0; v < n_vectors; v++)
        sum[v] = rest;
    for (int s = b->n_steps; s > 0; s--, step -= b->step)
        for (int v = 0; v < n_vectors; v++)
            sum[v] = one + vw_mul_high(sum[v], vw_load(step + v * WORDS));
    for (int v = 0; v < n_vectors; v++) {
        uint16_t *const to = sums + at + v * WORDS;
        vw_store(to, vw_load(to) + vw_mul_high(sum[v], mean));
    }
}

static void add_beams(const OpennessBeams *beams, int n, uint16_t *sums)
{
    int at = 0;
    for (; at + MAX_VECTORS * WORDS <= n; at += MAX_VECTORS * WORDS)
        add_vectors(beams, at, MAX_VECTORS, sums);
    if (at + 4 * WORDS <= n) {
        add_vectors(beams, at, 4, sums);
        at += 4 * WORDS;
    }
    if (at + 3 * WORDS <= n)
        add_vectors(beams, at, 3, sums);
    else if (at + 2 * WORDS <= n)
        add_vectors(beams, at, 2, sums);
    else if (at < n)
        add_vectors(beams, at, 1, sums);
}

static void scale(const uint16_t *sums, uint16_t shared, int n, uint8_t *openness)
{
    enum {
        ALL = OPENNESS_DIRECTIONS * OPENNESS_OPEN,
        FACTOR = (255 * (1 << 16) + ALL / 2) / ALL, /* exact to 1e-5 */
        HALF = (1 << 15) / FACTOR                   /* rounds to the nearest */
    };
    for (int at = 0; at < n; at += WORDS) {
        const vw scaled = vw_mul_high(vw_load(sums + at) + vw_of((uint16_t)(HALF + shared)), vw_of(FACTOR));
        uint8_t found[WORDS];
        for (int l = 0; l < WORDS; l++)
            found[l] = (uint8_t)scaled[l];
        memcpy(openness + at, found, (size_t)(n - at < WORDS ? n - at : WORDS));
    }
}
