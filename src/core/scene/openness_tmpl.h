/* The kernel of openness, included once for each SIMD path. */
#include "base/simd.h"
#include "core/scene/openness_beams.h"

typedef uint16_t vw SIMD_VECTOR(real);
SIMD_MEMORY(vw, uint16_t)

enum { WORDS = 2 * LANES, N_VECTORS = OPENNESS_CHUNK / WORDS };

INLINE void follow_beams_from(const OpennessBeams beams[OPENNESS_DIRECTIONS], int i, uint8_t *openness)
{
    const vw none = {0};
    const int shift = 16 - OPENNESS_BITS;
    vw all[N_VECTORS];
    for (int v = 0; v < N_VECTORS; v++)
        all[v] = none;
    for (int d = 0; d < OPENNESS_DIRECTIONS; d++) {
        const OpennessBeams w = beams[d];
        const uint16_t *at = w.from + i;
        vw left[N_VECTORS], sum[N_VECTORS];
        for (int v = 0; v < N_VECTORS; v++) {
            left[v] = none + (uint16_t)UINT16_MAX;
            sum[v] = none + (uint16_t)OPENNESS_OPEN;
        }
        for (int s = 0; s < w.n_inside; s++) {
            at += w.step;
            for (int v = 0; v < N_VECTORS; v++) {
                left[v] = (vw)vs_mul_high((vs)left[v], (vs)vw_load(at + v * WORDS));
                sum[v] += left[v] >> shift;
            }
        }
        for (int v = 0; v < N_VECTORS; v++) {
            const vw steps = sum[v] + w.n_beyond * (left[v] >> shift);
            all[v] += (vw)vs_mul_high((vs)steps, (vs)(none + w.mean));
        }
    }
    for (int v = 0; v < N_VECTORS; v++)
        for (int l = 0; l < WORDS; l++) {
            const unsigned most = OPENNESS_DIRECTIONS * OPENNESS_OPEN;
            openness[v * WORDS + l] = (uint8_t)((all[v][l] * 255u + most / 2) / most);
        }
}
