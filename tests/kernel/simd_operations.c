/* Each operation of base/simd.h on one input; SIMD_FUNCTION is the name of the function. */
#include "simd_operations.h"
#include "base/simd.h"

SIMD_EACH(wf, wf_sqrt, (wf a), vf_sqrt(a.part[p]))
SIMD_EACH(wmask, wi_eq, (wi a, wi b), vi_eq(a.part[p], b.part[p]))
SIMD_EACH(wmask, wu_lt, (wi a, wi b), vu_lt(a.part[p], b.part[p]))
SIMD_EACH(wmask, wi_test, (wi a, wi b), vi_test(a.part[p], b.part[p]))
SIMD_EACH(ws, ws_mul_high, (ws a, ws b), vs_mul_high(a.part[p], b.part[p]))
SIMD_EACH(wi, wi_load_shorts, (const int16_t *from), vi_load_shorts(from + LANES * p))
SIMD_EACH(wi, wi_load_words, (const uint16_t *from), vi_load_words(from + LANES * p))
SIMD_EACH(wi, wi_gather, (const void *from, wi at, wmask mask), vi_gather(from, at.part[p], mask.part[p]))
SIMD_EACH(wi, wi_gather_pairs, (const void *from, wi at, wmask mask), vi_gather_pairs(from, at.part[p], mask.part[p]))
SIMD_EACH(wi, wi_gather_bytes, (const void *from, wi at, wmask mask), vi_gather_bytes(from, at.part[p], mask.part[p]))

static wmask all_lanes(bool set)
{
    return wmask_of_bits(set ? 0xffff : 0);
}

static wi take_64(const int32_t (*from)[2], wi at, int which)
{
    wi second, first = wi_take_64(from, at, sizeof *from, &second);
    return which ? second : first;
}

/* The lanes of the mask, then 0. */
static wf pack(wf from, wmask mask)
{
    float to[16 + LANES];
    int n = 0;
    for (int p = 0; p < N_PARTS; p++) {
        vf_pack(to + n, from.part[p], mask.part[p]);
        n += __builtin_popcount(mask_bits(mask.part[p]));
    }
    for (; n < 16; n++)
        to[n] = 0;
    return wf_load(to);
}

int SIMD_FUNCTION(const SimdInput *in, SimdRow row[MAX_ROWS])
{
    const wf f = wf_load(in->f), g = wf_load(in->g), c = wf_load(in->c), r = wf_load(in->r);
    const wi i = wi_load(in->i), j = wi_load(in->j), b = wi_load(in->b);
    const ws s = ws_load(in->s), t = ws_load(in->t), p = ws_load(in->p), q = ws_load(in->q);
    const wmask m = wmask_of_bits(in->m), n = wmask_of_bits(in->n);
    int at = 0;
#define FLOATS(name, vectors, lane) wf_store(row[at++].floats, vectors);
#define WHOLES(name, vectors, lane) wi_store(row[at++].wholes, vectors);
#define TRUTHS(name, vectors, lane)                                                                                    \
    for (unsigned l = 0, bits = wmask_bits(vectors); l < 16; l++)                                                      \
        row[at].wholes[l] = bits >> l & 1;                                                                             \
    at++;
#define SHORTS(name, vectors, lane) ws_store(row[at++].shorts, vectors);
#include "simd_operations_tmpl.h"
    return at;
}
