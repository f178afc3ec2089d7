/* The kernels of openness, included once for each SIMD path. */
#include "base/simd.h"
#include "core/scene/openness_beams.h"

typedef uint16_t vw SIMD_VECTOR(real);
SIMD_MEMORY(vw, uint16_t)
SIMD_OP(vw, vw_of, (uint16_t x), x - (vw){0})
SIMD_OP(vw, vw_mul_high, (vw a, vw b), (vw)vs_mul_high((vs)a, (vs)b))

enum { WORDS = 2 * LANES };

/* Horner's scheme: the sum T_0 + T_1 + ... is 1 + t_1 (1 + t_2 (1 + ...)). The vectors hide each other's latency. */
INLINE void add_vectors(const OpennessBeams *b, int at, int n_vectors, uint16_t *sums)
{
    const vw one = vw_of(OPENNESS_OPEN), mean = vw_of(b->mean);
    const vw outside = vw_of((uint16_t)(OPENNESS_OPEN * (b->n_beyond + 1)));
    const uint16_t *step = b->from + at + b->n_inside * b->step;
    vw sum[4];
    for (int v = 0; v < n_vectors; v++)
        sum[v] = outside;
    for (int s = b->n_inside; s > 0; s--, step -= b->step)
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
    for (; at + 4 * WORDS <= n; at += 4 * WORDS)
        add_vectors(beams, at, 4, sums);
    if (at + 2 * WORDS <= n) {
        add_vectors(beams, at, 2, sums);
        at += 2 * WORDS;
    }
    if (at < n)
        add_vectors(beams, at, 1, sums);
}

static void scale(const uint16_t *sums, int n, uint8_t *openness)
{
    enum {
        ALL = OPENNESS_DIRECTIONS * OPENNESS_OPEN,
        FACTOR = (255 * (1 << 16) + ALL / 2) / ALL, /* exact to 1e-5 */
        HALF = (1 << 15) / FACTOR                   /* rounds to the nearest */
    };
    for (int at = 0; at < n; at += WORDS) {
        const vw scaled = vw_mul_high(vw_load(sums + at) + vw_of(HALF), vw_of(FACTOR));
        for (int l = 0; l < WORDS; l++)
            openness[at + l] = (uint8_t)scaled[l];
    }
}
