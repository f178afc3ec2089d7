/* Samples of sheets by the lanes of a group, and classified slabs: what the other templates are made of. */
#include "engine/sheets/sheets.h"

#include "base/invariant.h"
#include "base/mutation.h"
#include "base/simd.h"

#include "base/simd_math_tmpl.h"

/* Two of Newton's steps: light is off by less than 5e-6. */
SIMD_EACH(wf, wf_inverse_root, (wf x), vf_inverse_root_by(x.part[p], 2))
SIMD_EACH(wf, wf_log2, (wf x), vf_log2(x.part[p]))

/* 1 - exp(-x) for x of 0 or more. */
SIMD_EACH(wf, wf_opacity, (wf x), vf_opacity(x.part[p] * (real)M_LOG2E))

INLINE wi wi_lanes(void)
{
    static const int32_t lane[SHEETS_LANES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return wi_load(lane);
}

/* A number of 0 to 1 as 5 bits of exponent and 11 of fraction, those of a float, rounded; all below 2^-31 is 0. Back:
 * sheets_unpack(). */
INLINE wi sheets_pack(wf x)
{
    const wi bits = wi_sub(wf_as_int(x), wi_of(((127 - 31) << 23) - (1 << 11)));
    return wi_max(wi_shr(bits, 12), wi_of(0));
}

/* The footprint of a group on a sheet: which voxels each lane takes, and their weights. */
typedef struct Footprint {
    wi at;           /* windows: places of two neighbours in the window; else voxels from the window's first */
    ws along_a;      /* weights of two neighbours, 2^14 together */
    wf along_b;      /* weight of the second row, 0 to 1 */
    ptrdiff_t first; /* voxel of the window's corner within the sheet */
} Footprint;

/* Samples of a sheet: both rows, each the sum of two neighbours (grey level - 32768) by their weights. */
typedef struct Rows {
    wi upper, lower;
} Rows;

typedef struct March {
    const SheetsJob *job;
    const SheetsGrid *grid;
    const SheetsGroup *group;
    int window_rows;  /* rows of a window that are loaded whole, 4 to 8; 0: voxels are gathered */
    int64_t shear[2]; /* of the corner, from sheet to sheet, front to back; 32 bits of fraction */
} March;

/* Position of a group's corner on a sheet; 32 bits of fraction. */
typedef struct Corner {
    int64_t at[2];
} Corner;

INLINE Footprint footprint_of(const March *m, Corner corner, bool window)
{
    Footprint f;
    wi at[2];
    for (int c = 0; c < 2; c++)
        at[c] = wi_add(wi_load(m->grid->lane[c]), wi_of((int32_t)(corner.at[c] >> 16 & 0xffff)));
    const wi column = wi_shr(at[0], 16), row = wi_shr(at[1], 16);
    const wi second = wi_and(wi_shr(at[0], 16 - SHEETS_WEIGHT_BITS), wi_of((1 << SHEETS_WEIGHT_BITS) - 1));
    CTS_INVARIANT(!wmask_any(wi_lt(second, wi_of(0))) && !wmask_any(wi_gt(second, wi_of(1 << SHEETS_WEIGHT_BITS))));
    f.along_a = wi_as_short(wi_add(wi_sub(wi_shl(second, 16), second), wi_of(1 << SHEETS_WEIGHT_BITS)));
    f.along_b = wf_mul(wi_to_float(wi_lower_half(at[1])), wf_of(0x1p-16f));
    if (window) {
        const wi place = wi_add(wi_shl(row, 3), column);
        f.at = wi_or(place, wi_shl(wi_add(place, wi_of(1)), 16));
    } else {
        f.at = wi_add(wi_mul(row, wi_of((int32_t)m->job->view.row)), column);
    }
    f.first = (ptrdiff_t)(corner.at[1] >> 32) * m->job->view.row + (ptrdiff_t)(corner.at[0] >> 32);
    return f;
}

INLINE wi along_row(ws pairs, ws weights)
{
    return ws_madd(ws_sub(pairs, ws_of(INT16_MIN)), weights);
}

/* Two neighbours of both rows that a lane takes, from a window of so many rows, the first four and the others. */
INLINE void pick_pairs(const Footprint *f, ws first, ws others, int rows, ws pairs[2])
{
    const ws index = wi_as_short(f->at), below = wi_as_short(wi_add(f->at, wi_of(0x00080008)));
    pairs[0] = rows > 4 ? ws_permute2(first, others, index) : ws_permute(first, index);
    pairs[1] = rows > 4 ? ws_permute2(first, others, below) : ws_permute(first, below);
}

INLINE void take_pairs(const March *m, const Footprint *f, const uint16_t *from, ws pairs[2])
{
    pairs[0] = wi_as_short(wi_take_pairs(from, f->at));
    pairs[1] = wi_as_short(wi_take_pairs(from + m->job->view.row, f->at));
}

/* Pairs as by pick_pairs(), of voxels; a window begins at `from`. */
INLINE void load_pairs(const March *m, const Footprint *f, const uint16_t *from, bool window, ws pairs[2])
{
    const int rows = m->window_rows;
    const ptrdiff_t row = m->job->view.row;
    if (!window) {
        take_pairs(m, f, from, pairs);
        return;
    }
    const ws first = ws_load_rows((const int16_t *)from, row, 4);
    pick_pairs(f, first, rows > 4 ? ws_load_rows((const int16_t *)from + 4 * row, row, rows - 4) : first, rows, pairs);
}

INLINE Rows sample_rows(const March *m, const Footprint *f, const uint16_t *sheet, bool window)
{
    ws pairs[2];
    load_pairs(m, f, sheet + f->first, window, pairs);
    return (Rows){along_row(pairs[0], f->along_a), along_row(pairs[1], f->along_a)};
}

INLINE wf across_rows(Rows rows, wf along_b)
{
    return wf_lerp(wi_to_float(rows.upper), wi_to_float(rows.lower), CTS_MUTATED(SHEET_WEIGHTS) ? wf_of(0) : along_b);
}

/* Number of the bin of the pre-integrated table. */
INLINE wi bin_of(const SheetsBins *l, wf sample)
{
    const wf coarse = wf_scale(sample, l->coarse_scale, l->coarse_add);
    const wf fine = wf_clamp(wf_scale(sample, l->fine_scale, l->fine_add), 0, l->fine_span);
    return wf_to_int(wf_clamp(wf_add(coarse, fine), 0, SHEETS_BINS - 1));
}

/* Colour and opacity of slabs. */
typedef struct Slab {
    wf rgb[3], alpha;
} Slab;

INLINE wf sheets_unpack(wi number)
{
    return wi_as_float(wi_add(wi_shl(number, 12), wi_of((127 - 31) << 23)));
}

INLINE Slab look_up_slab(const uint64_t *opacity, wi front, wi back)
{
    wi blue_alpha;
    const wi at = wi_add(wi_shl(front, 8), back);
    const wi red_green = wi_take_64(opacity, at, sizeof *opacity, &blue_alpha);
    return (Slab){{sheets_unpack(wi_lower_half(red_green)), sheets_unpack(wi_upper_half(red_green)),
                   sheets_unpack(wi_lower_half(blue_alpha))},
                  sheets_unpack(wi_upper_half(blue_alpha))};
}

INLINE wmask visible_between(const SheetsBins *l, wi front, wi back)
{
    return wmask_and(wi_gt(wi_max(front, back), wi_of(l->first - 1)), wi_lt(wi_min(front, back), wi_of(l->last + 1)));
}

/* Slabs between successive sheets that are void or visible as a whole. */
typedef struct Block {
    int sheet, n; /* its front sheet; slabs */
    Corner corner;
    bool inside;     /* no lane leaves the volume or the part of it that is looked at */
    bool lit_inside; /* nor do the neighbours that gradients take */
    bool window;     /* windows can be loaded whole */
} Block;

/* Samples of a block inside, sheets front to back at 2 s, and the planes in the middle of its slabs at 2 s + 1. */
enum { AT_ONCE = 2 * SHEETS_BLOCK + 1 };
typedef struct SheetSamples {
    wf value[AT_ONCE];
    wi bin[AT_ONCE];
    ws highest[SHEETS_BLOCK + 1], lowest[SHEETS_BLOCK + 1]; /* of the two rows of voxels that a sheet's samples take */
    int last_sheet;                                         /* sheet of the last of them; NO_SHEET: none */
} SheetSamples;
enum { NO_SHEET = -9 };

/* Samples of no sheet; those that the next block may take over are set, so that compilers see them set. */
INLINE void start_samples(SheetSamples *k)
{
    k->last_sheet = NO_SHEET;
    k->value[2 * SHEETS_BLOCK] = wf_of(0);
    k->bin[2 * SHEETS_BLOCK] = wi_of(0);
    k->highest[SHEETS_BLOCK] = k->lowest[SHEETS_BLOCK] = ws_of(0);
}

INLINE Corner corner_at(const March *m, const Block *b, int slab)
{
    return (Corner){{b->corner.at[0] + slab * m->shear[0], b->corner.at[1] + slab * m->shear[1]}};
}

INLINE const uint16_t *sheet_at(const March *m, int sheet)
{
    return m->job->view.grey + (ptrdiff_t)sheet * m->job->view.sheet;
}

INLINE void sample_sheet(const March *m, const Block *b, int slab, bool window, SheetSamples *k)
{
    ws pairs[2];
    const Footprint f = footprint_of(m, corner_at(m, b, slab), window);
    load_pairs(m, &f, sheet_at(m, b->sheet + slab * m->job->view.step) + f.first, window, pairs);
    k->value[2 * slab] = across_rows((Rows){along_row(pairs[0], f.along_a), along_row(pairs[1], f.along_a)}, f.along_b);
    k->bin[2 * slab] = bin_of(&m->job->bins, k->value[2 * slab]);
    k->highest[slab] = ws_max(pairs[0], pairs[1]);
    k->lowest[slab] = ws_min(pairs[0], pairs[1]);
}

/* The middle of a slab: the mean of both sheets where the ray is half way. */
INLINE void sample_middle(const March *m, const Block *b, int slab, bool window, SheetSamples *k)
{
    wf *const value = &k->value[2 * slab + 1];
    if (m->job->view.straight) {
        *value = wf_lerp(k->value[2 * slab], k->value[2 * slab + 2], wf_of(0.5f));
        k->bin[2 * slab + 1] = bin_of(&m->job->bins, *value);
        return;
    }
    Corner corner = corner_at(m, b, slab);
    for (int c = 0; c < 2; c++)
        corner.at[c] += m->shear[c] / 2;
    const Footprint f = footprint_of(m, corner, window);
    const int step = m->job->view.step;
    const Rows front = sample_rows(m, &f, sheet_at(m, b->sheet + slab * step), window);
    const Rows back = sample_rows(m, &f, sheet_at(m, b->sheet + (slab + 1) * step), window);
    const Rows sum = {wi_add(front.upper, back.upper), wi_add(front.lower, back.lower)};
    *value = wf_mul(across_rows(sum, f.along_b), wf_of(0.5f));
    k->bin[2 * slab + 1] = bin_of(&m->job->bins, *value);
}

/* Near the volume's faces and at the ends of what is looked at, positions are floats, and each lane has its own part of
 * a slab. */
typedef struct Lanes {
    wf at[2]; /* voxels along a and b */
} Lanes;

INLINE Lanes lanes_at(const March *m, Corner corner)
{
    Lanes l;
    for (int c = 0; c < 2; c++) {
        const int32_t voxel = (int32_t)(corner.at[c] >> 32), part = (int32_t)(corner.at[c] >> 16 & 0xffff);
        const wi at = wi_add(wi_load(m->grid->lane[c]), wi_of(part));
        l.at[c] = wf_add(wi_to_float(wi_add(wi_shr(at, 16), wi_of(voxel))),
                         wf_times(wi_to_float(wi_lower_half(at)), 0x1p-16f));
    }
    return l;
}

/* Part of the way from front to back, 0 to 1, on which low <= position <= high. */
INLINE void clip(wf front, wf back, float low, float high, wf *from, wf *to)
{
    const wf change = wf_sub(back, front);
    const wmask still = wf_lt(wf_abs(change), wf_of(1e-6f));
    const wf per = wf_div(wf_of(1), wf_select(still, wf_of(1), change));
    const wf one = wf_mul(wf_sub(wf_of(low), front), per), other = wf_mul(wf_sub(wf_of(high), front), per);
    const wmask outside = wmask_or(wf_lt(front, wf_of(low)), wf_gt(front, wf_of(high)));
    const wf enters = wf_select(still, wf_select(outside, wf_of(2), wf_of(0)), wf_min(one, other));
    *from = wf_max(*from, enters);
    *to = wf_min(*to, wf_select(still, wf_of(1), wf_max(one, other)));
}

/* Sample at a share of the way through a slab, of lanes that are inside the volume there. */
INLINE wf sample_at(const March *m, const Lanes *front, const Lanes *back, wf share, int sheet, int next)
{
    const SheetsView *const v = &m->job->view;
    wi cell[2];
    wf part[2];
    for (int c = 0; c < 2; c++) {
        const wf at = wf_clamp(wf_lerp(front->at[c], back->at[c], share), 0, (float)(v->n[c] - 1));
        cell[c] = wi_min(wf_to_int(at), wi_of(v->n[c] - 2));
        part[c] = wf_sub(at, wi_to_float(cell[c]));
        CTS_INVARIANT(!wmask_any(wf_lt(part[c], wf_of(0))) && !wmask_any(wf_gt(part[c], wf_of(1))));
    }
    const wi second = wf_to_int(wf_times(part[0], 1 << SHEETS_WEIGHT_BITS));
    /* Two weights of 16 bits; the second may be 2^14, the first then is 0. */
    const ws weights = wi_as_short(wi_add(wi_sub(wi_shl(second, 16), second), wi_of(1 << SHEETS_WEIGHT_BITS)));
    const wi at = wi_add(wi_mul(cell[1], wi_of((int32_t)v->row)), cell[0]);
    wf of[2];
    for (int i = 0; i < 2; i++) {
        const uint16_t *const from = sheet_at(m, i == 0 ? sheet : next);
        const wi upper = along_row(wi_as_short(wi_take_pairs(from, at)), weights);
        const wi lower = along_row(wi_as_short(wi_take_pairs(from + v->row, at)), weights);
        of[i] = wf_lerp(wi_to_float(upper), wi_to_float(lower), part[1]);
    }
    return wf_lerp(of[0], of[1], share);
}

/* Millimetres along the rays where they meet a sheet, from the plane through the view's centre. */
INLINE wf mm_at(const March *m, int sheet)
{
    const SheetsView *const v = &m->job->view;
    const int x = m->group->x, y = m->group->y, pitch = m->grid->pitch;
    float lane[SHEETS_LANES];
    for (int l = 0; l < SHEETS_LANES; l++)
        lane[l] = (float)(v->start_mm + (x + pitch * (l % SHEETS_SIDE)) * v->start_right_mm +
                          (y + pitch * (l / SHEETS_SIDE)) * v->start_down_mm + sheet * v->start_sheet_mm);
    return wf_load(lane);
}

/* Part of a slab that lies in the volume: from where, and how much of it. */
typedef struct Clip {
    wf from, share;
} Clip;

OUTLINE Clip clip_slab(const March *m, const Block *b, int slab)
{
    const SheetsView *const v = &m->job->view;
    const Lanes front = lanes_at(m, corner_at(m, b, slab)), back = lanes_at(m, corner_at(m, b, slab + 1));
    wf from = wf_of(0), to = wf_of(1);
    for (int c = 0; c < 2; c++)
        clip(front.at[c], back.at[c], 0, (float)(v->n[c] - 1), &from, &to);
    const int sheet = b->sheet + slab * v->step;
    if (!m->job->all_depths)
        clip(mm_at(m, sheet), mm_at(m, sheet + v->step), (float)v->near_mm, (float)v->far_mm, &from, &to);
    return (Clip){from, wf_max(wf_sub(to, from), wf_of(0))};
}

/* Samples at both ends of the part of a slab that lies in the volume, and in its middle: the first three. */
OUTLINE SheetSamples sample_partial(const March *m, const Block *b, int slab, const Clip *clip)
{
    const int step = m->job->view.step, sheet = b->sheet + slab * step;
    const Lanes front = lanes_at(m, corner_at(m, b, slab)), back = lanes_at(m, corner_at(m, b, slab + 1));
    SheetSamples s;
    for (int i = 0; i < 3; i++) {
        const wf at = wf_clamp(wf_mul_add(clip->share, wf_of(0.5f * (float)i), clip->from), 0, 1);
        s.value[i] = sample_at(m, &front, &back, at, sheet, sheet + step);
        s.bin[i] = bin_of(&m->job->bins, s.value[i]);
    }
    return s;
}

/* A slab of quarters, each of even extinction per mm and colour, front to back; absorbed: light that each takes. */
INLINE Slab integrate_slab(const wf part[SHEETS_LIT][4], wf length_mm, wf absorbed[SHEETS_LIT])
{
    const wf part_mm = wf_times(length_mm, 1.0f / SHEETS_LIT), none = wf_of(0);
    Slab s = {{none, none, none}, none};
    wf left = wf_of(1);
    for (int q = 0; q < SHEETS_LIT; q++) {
        absorbed[q] = wf_mul(left, wf_opacity(wf_mul(part[q][0], part_mm)));
        for (int c = 0; c < 3; c++)
            s.rgb[c] = wf_mul_add(absorbed[q], part[q][1 + c], s.rgb[c]);
        s.alpha = wf_add(s.alpha, absorbed[q]);
        left = wf_sub(left, absorbed[q]);
    }
    s.alpha = wf_min(s.alpha, wf_of(1));
    return s;
}

/* A slab of which rays have a share alone. */
OUTLINE void take_share(const SheetsJob *j, wi front, wi back, float length_mm, wf share, wmask lanes, Slab *s)
{
    const wmask partial = wmask_and(lanes, wf_lt(share, wf_of(1)));
    if (!wmask_any(partial) || CTS_MUTATED(SHEET_SHARE))
        return;
    const wi at = wi_add(wi_shl(front, 8), back);
    wf part[SHEETS_LIT][4], absorbed[SHEETS_LIT];
    for (int q = 0; q < SHEETS_LIT; q++)
        for (int c = 0; c < 4; c++)
            part[q][c] = wf_look_up(j->part[q][c], SHEETS_BINS * SHEETS_BINS, at);
    const Slab shorter = integrate_slab((const wf(*)[4])part, wf_times(share, length_mm), absorbed);
    for (int c = 0; c < 3; c++)
        s->rgb[c] = wf_select(partial, shorter.rgb[c], s->rgb[c]);
    s->alpha = wf_select(partial, shorter.alpha, s->alpha);
}
