/* Entries of the pre-integrated tables for one length of slabs; needs sample_tmpl.h. */
#include "engine/sheets/sheets.h"

INLINE void fill_opacity(const float (*mean)[4], float length_mm, size_t first, size_t end, uint64_t *rgba)
{
    for (size_t i = first; i < end; i += SHEETS_LANES) {
        const wi at = wi_add(wi_lanes(), wi_of((int32_t)i));
        const wf alpha = wf_opacity(wf_times(mean_of(mean, at, 0), length_mm));
        int32_t number[4][SHEETS_LANES];
        for (int c = 0; c < 3; c++)
            wi_store(number[c], sheets_pack(wf_mul(alpha, mean_of(mean, at, 1 + c))));
        wi_store(number[3], sheets_pack(alpha));
        for (int l = 0; l < SHEETS_LANES; l++)
            rgba[i + (size_t)l] = (uint64_t)number[0][l] | (uint64_t)number[1][l] << 16 | (uint64_t)number[2][l] << 32 |
                                  (uint64_t)number[3][l] << 48;
    }
}

INLINE void fill_light(const float (*quarter)[SHEETS_LIT], float length_mm, size_t first, size_t end, uint32_t *light)
{
    for (size_t i = first; i < end; i += SHEETS_LANES) {
        const wi at = wi_shl(wi_add(wi_lanes(), wi_of((int32_t)i)), 2);
        wf absorbed[SHEETS_LIT], transmittance = wf_of(1), sum = wf_of(0);
        for (int q = 0; q < SHEETS_LIT; q++) {
            const wf extinction = wf_look_up((const float *)quarter + q, SHEETS_LIT * SHEETS_BINS * SHEETS_BINS, at);
            absorbed[q] = wf_mul(transmittance, wf_opacity(wf_times(extinction, length_mm / SHEETS_LIT)));
            transmittance = wf_sub(transmittance, absorbed[q]);
            sum = wf_add(sum, absorbed[q]);
        }
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
            light[i + (size_t)l] = (uint32_t)share[0][l] | (uint32_t)share[1][l] << 8 | (uint32_t)share[2][l] << 16 |
                                   (uint32_t)share[3][l] << 24;
    }
}
