/* Entries of the pre-integrated tables for one length of slabs; needs sample_tmpl.h. */
#include "engine/sheets/sheets.h"

INLINE void store_slabs(const Slab *s, uint64_t rgba[SHEETS_LANES])
{
    int32_t number[4][SHEETS_LANES];
    for (int c = 0; c < 3; c++)
        wi_store(number[c], sheets_pack(s->rgb[c]));
    wi_store(number[3], sheets_pack(s->alpha));
    for (int l = 0; l < SHEETS_LANES; l++)
        rgba[l] = (uint64_t)number[0][l] | (uint64_t)number[1][l] << 16 | (uint64_t)number[2][l] << 32 |
                  (uint64_t)number[3][l] << 48;
}

INLINE void store_light(const wf absorbed[SHEETS_LIT], wf sum, uint32_t light[SHEETS_LANES])
{
    /* A slab that absorbs nothing has even shares, of 64; the bound is any number below all visible ones. */
    const wmask any = wf_gt(sum, wf_of(1e-20f));
    const wf scale = wf_div(wf_of(255), wf_max(sum, wf_of(1e-20f)));
    int32_t share[SHEETS_LIT][SHEETS_LANES];
    wi rest = wi_of(255);
    for (int q = 0; q < SHEETS_LIT; q++) {
        const wi one =
            q + 1 < SHEETS_LIT
                ? wi_min(wf_to_int(wf_select(any, wf_scale(wf_mul(absorbed[q], scale), 1, 0.5f), wf_of(64))), rest)
                : rest;
        wi_store(share[q], one);
        rest = wi_sub(rest, one);
    }
    for (int l = 0; l < SHEETS_LANES; l++)
        light[l] = (uint32_t)share[0][l] | (uint32_t)share[1][l] << 8 | (uint32_t)share[2][l] << 16 |
                   (uint32_t)share[3][l] << 24;
}

INLINE void fill_slabs(const SheetsPart *table, float length_mm, size_t first, size_t end, uint64_t *rgba,
                       uint32_t *light)
{
    for (size_t i = first; i < end; i += SHEETS_LANES) {
        wf part[SHEETS_LIT][4], absorbed[SHEETS_LIT];
        for (int q = 0; q < SHEETS_LIT; q++)
            for (int c = 0; c < 4; c++)
                part[q][c] = wf_load(table[q][c] + i);
        const Slab slab = integrate_slab((const wf(*)[4])part, wf_of(length_mm), absorbed);
        store_slabs(&slab, rgba + i);
        if (light)
            store_light(absorbed, slab.alpha, light + i);
    }
}
