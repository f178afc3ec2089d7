/* The march of a group through the sheets, front to back; included once for each SIMD path. Every path does the same
 * operations lane by lane: whole numbers up to a sample's level, then floats rounded after each operation. */
#include "engine/sheets/void_blocks.h"

#include "base/mutation.h"
#include "base/simd.h"

#include "base/simd_math_tmpl.h"
#include <math.h>
#include <stdlib.h>

SIMD_EACH(ws, wi_as_short, (wi a), (vs)a.part[p])
SIMD_EACH(wi, ws_as_int, (ws a), (vi)a.part[p])
SIMD_EACH(wmask, wi_nonzero, (wi a), vi_test(a.part[p], a.part[p]))
SIMD_EACH(ws, ws_max, (ws a, ws b), vs_unsigned_max(a.part[p], b.part[p]))
SIMD_EACH(ws, ws_min, (ws a, ws b), vs_unsigned_min(a.part[p], b.part[p]))
SIMD_EACH(ws, ws_excess, (ws a, ws b), vs_excess(a.part[p], b.part[p]))

SIMD_EACH(wf, wf_inverse_root, (wf x), vf_inverse_root(x.part[p]))
SIMD_EACH(wf, wf_log2, (wf x), vf_log2(x.part[p]))
SIMD_EACH(wf, wf_lerp, (wf a, wf b, wf at), a.part[p] + (b.part[p] - a.part[p]) * at.part[p])
SIMD_EACH(wf, wf_mul_add, (wf a, wf b, wf c), a.part[p] * b.part[p] + c.part[p])
SIMD_EACH(wf, wf_clamp, (wf a, float low, float high), vf_min(vf_max(a.part[p], vf_of(low)), vf_of(high)))
SIMD_EACH(wf, wf_scale, (wf a, float by, float plus), a.part[p] * by + plus)

/* 1 - exp(-x) for x of 0 or more. */
SIMD_EACH(wf, wf_taken, (wf x), vf_taken(x.part[p] * (real)M_LOG2E))

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

/* Two neighbours of both rows that a lane takes, from the window that begins at `from`. */
INLINE void load_pairs(const March *m, const Footprint *f, const uint16_t *from, bool window, ws pairs[2])
{
    if (window) {
        const int rows = m->window_rows;
        const ws upper = ws_load_rows((const int16_t *)from, m->job->view.row, 4);
        const ws index = wi_as_short(f->at), below = wi_as_short(wi_add(f->at, wi_of(0x00080008)));
        if (rows > 4) {
            const ws lower = ws_load_rows((const int16_t *)from + 4 * m->job->view.row, m->job->view.row, rows - 4);
            pairs[0] = ws_permute2(upper, lower, index);
            pairs[1] = ws_permute2(upper, lower, below);
        } else {
            pairs[0] = ws_permute(upper, index);
            pairs[1] = ws_permute(upper, below);
        }
        return;
    }
    const wmask all = wmask_of_bits(0xffff);
    pairs[0] = wi_as_short(wi_gather_pairs(from, f->at, all));
    pairs[1] = wi_as_short(wi_gather_pairs(from + m->job->view.row, f->at, all));
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

/* Number of the level in the pre-integrated table. */
INLINE wi level_of(const SheetsLevels *l, wf sample)
{
    const wf coarse = wf_scale(sample, l->coarse_scale, l->coarse_add);
    const wf fine = wf_clamp(wf_scale(sample, l->fine_scale, l->fine_add), 0, l->fine_span);
    return wf_to_int(wf_clamp(wf_add(coarse, fine), 0, SHEETS_LEVELS - 1));
}

/* Colour and opacity of slabs; 0 outside the mask. */
typedef struct Slab {
    wf rgb[3], alpha;
} Slab;

INLINE wf sheets_unpack(wi number)
{
    return wi_as_float(wi_add(wi_shl(number, 12), wi_of((127 - 31) << 23)));
}

INLINE Slab look_up_slab(const uint64_t *opacity, wi front, wi back, wmask lanes)
{
    wi blue_alpha;
    const wi at = wi_add(wi_shl(front, 8), back);
    const wi red_green = wi_gather_64((const int32_t(*)[2])opacity, at, lanes, &blue_alpha);
    return (Slab){{sheets_unpack(wi_lower_half(red_green)), sheets_unpack(wi_upper_half(red_green)),
                   sheets_unpack(wi_lower_half(blue_alpha))},
                  sheets_unpack(wi_upper_half(blue_alpha))};
}

INLINE wmask visible_between(const SheetsLevels *l, wi front, wi back)
{
    return wmask_and(wi_gt(wi_max(front, back), wi_of(l->first - 1)), wi_lt(wi_min(front, back), wi_of(l->last + 1)));
}

/* Accumulated state of a march. */
typedef struct State {
    wf rgb[3], left;               /* left: transmittance */
    wf coarse_rgb[3], coarse_left; /* the same by slabs of twice the length */
    wf depth_mm, first_mm;         /* where half of the light is gone; where anything is visible */
    wmask alive;
    wf missed, near[2]; /* opacity that samples may have missed: as it counts; of one and two slabs ago */
} State;

#define FAR_MM 1e30f

INLINE void blend(wf rgb[3], wf *left, const Slab *s, wmask lanes)
{
    const wf weight = wf_select(lanes, *left, wf_of(0));
    for (int c = 0; c < 3; c++)
        rgb[c] = wf_mul_add(weight, s->rgb[c], rgb[c]);
    *left = wf_sub(*left, wf_mul(weight, s->alpha));
}

/* Opacity that a slab's samples may have missed is weighted with the transmittance two slabs later: in front of a
 * surface nearly every ray passes slabs whose samples just miss it. */
INLINE void advance_missed(State *s, wf near)
{
    s->missed = wf_mul_add(s->near[1], s->left, s->missed);
    s->near[1] = s->near[0];
    s->near[0] = near;
}

/* Differences of grey levels along a, b and p at a sheet, 2^14 times. */
typedef struct Gradient {
    wf along[3];
} Gradient;

INLINE wf difference_of(const March *m, const Footprint *f, const uint16_t *sheet, ptrdiff_t apart, bool window)
{
    const Rows more = sample_rows(m, f, sheet + apart, window), less = sample_rows(m, f, sheet - apart, window);
    return across_rows((Rows){wi_sub(more.upper, less.upper), wi_sub(more.lower, less.lower)}, f->along_b);
}

/* Inside, where all neighbours exist. */
INLINE Gradient gradient_inside(const March *m, const Footprint *f, const uint16_t *sheet, bool window)
{
    const SheetsView *const v = &m->job->view;
    const int *const step = m->job->shade->step;
    return (Gradient){{difference_of(m, f, sheet, step[0], window),
                       difference_of(m, f, sheet, step[1] * v->row, window),
                       difference_of(m, f, sheet, (CTS_MUTATED(SHEET_LIGHT) ? -1 : 1) * step[2] * v->sheet, window)}};
}

/* Difference of grey levels at a voxel: to air beyond the border, or one-sided and twice. */
static int32_t voxel_difference(const SheetsJob *job, const int at[3], int axis)
{
    const SheetsView *const v = &job->view;
    const ptrdiff_t stride[3] = {1, v->row, v->sheet};
    const uint16_t *const here = v->grey + at[0] + at[1] * v->row + at[2] * v->sheet;
    const int step = job->shade->step[axis];
    int32_t value[2];
    for (int side = 0; side < 2; side++) {
        const int to = at[axis] + (side ? step : -step);
        const bool inside = to >= 0 && to < v->n[axis];
        value[side] = inside ? here[(side ? step : -step) * stride[axis]] : job->shade->air_beyond ? 0 : *here;
    }
    const bool one_sided = !job->shade->air_beyond && (at[axis] - step < 0) != (at[axis] + step >= v->n[axis]);
    return (value[1] - value[0]) * (one_sided ? 2 : 1);
}

/* At points near the volume's faces or at the ends of rays, lane by lane; in voxels along a, b and p. Those outside the
 * volume count as on its faces. */
OUTLINE Gradient gradient_at(const March *m, const wf at[3], unsigned lanes)
{
    const SheetsView *const v = &m->job->view;
    const float one = 1 << SHEETS_WEIGHT_BITS;
    float place[3][SHEETS_LANES], out[3][SHEETS_LANES] = {{0}};
    for (int c = 0; c < 3; c++)
        wf_store(place[c], wf_clamp(at[c], 0, (float)(v->n[c] - 1)));
    for (int l = 0; l < SHEETS_LANES; l++) {
        if (!(lanes >> l & 1))
            continue;
        int cell[3];
        float part[3];
        for (int c = 0; c < 3; c++) {
            cell[c] = (int)place[c][l];
            cell[c] = cell[c] > v->n[c] - 2 ? v->n[c] - 2 : cell[c];
            part[c] = place[c][l] - (float)cell[c];
        }
        for (int axis = 0; axis < 3; axis++) {
            float plane[2], row[2];
            for (int k = 0; k < 2; k++) {
                for (int j = 0; j < 2; j++) {
                    const int voxel[3] = {cell[0], cell[1] + j, cell[2] + k};
                    const float a = (float)voxel_difference(m->job, voxel, axis);
                    const float b =
                        (float)voxel_difference(m->job, (const int[]){voxel[0] + 1, voxel[1], voxel[2]}, axis);
                    row[j] = a + (b - a) * part[0];
                }
                plane[k] = row[0] + (row[1] - row[0]) * part[1];
            }
            out[axis][l] = (plane[0] + (plane[1] - plane[0]) * part[2]) * one;
        }
    }
    return (Gradient){{wf_load(out[0]), wf_load(out[1]), wf_load(out[2])}};
}

/* |n.v| of a gradient; 0 without one. */
INLINE wf facing_of(const SheetsJob *j, const Gradient *g)
{
    const float *const q = j->shade_square, *const f = j->shade->frame[2];
    const wf *const d = g->along;
    const wf towards = wf_add(wf_add(wf_scale(d[0], f[0], 0), wf_scale(d[1], f[1], 0)), wf_scale(d[2], f[2], 0));
    const wf a = wf_add(wf_scale(d[0], q[0], 0), wf_add(wf_scale(d[1], q[3], 0), wf_scale(d[2], q[4], 0)));
    const wf b = wf_add(wf_scale(d[1], q[1], 0), wf_scale(d[2], q[5], 0)), c = wf_scale(d[2], q[2], 0);
    const wf square = wf_add(wf_add(wf_mul(d[0], a), wf_mul(d[1], b)), wf_mul(d[2], c));
    const wf least = wf_of(1e-12f);
    const wf facing = wf_mul(wf_abs(towards), wf_inverse_root(wf_max(square, least)));
    return wf_select(wf_gt(square, least), wf_min(facing, wf_of(1)), wf_of(0));
}

/* |n.v|^power. */
INLINE wf highlight_of(const CtsShade *s, wf facing)
{
    if (s->whole_power > 0) {
        wf power = wf_of(1), square = wf_max(facing, wf_of(s->least_power));
        for (int n = s->whole_power; n > 0; n >>= 1) {
            if (n & 1)
                power = wf_mul(power, square);
            square = n > 1 ? wf_mul(square, square) : square;
        }
        return wf_select(wf_gt(facing, wf_of(0)), power, wf_of(0));
    }
    const wf at = wf_mul(facing, wf_of((float)s->n_power));
    const wi i = wi_min(wf_to_int(at), wi_of(s->n_power - 1));
    const wf low = wf_look_up(s->power, s->n_power + 1, i), high = wf_look_up(s->power + 1, s->n_power, i);
    return wf_select(wf_gt(facing, wf_of(0)), wf_lerp(low, high, wf_sub(at, wi_to_float(i))), wf_of(0));
}

/* Visible part of a straight line from sample `front` to `back`, as shares of it. */
INLINE void visible_part(const SheetsJob *j, wf front, wf back, wf *from, wf *to)
{
    const float one = 1 << SHEETS_WEIGHT_BITS;
    const float low = ((float)j->levels.grey_low - 32768) * one, high = ((float)j->levels.grey_high - 32768) * one;
    const wf change = wf_sub(back, front);
    const wmask flat = wf_lt(wf_abs(change), wf_of(1));
    const wf per = wf_div(wf_of(1), wf_select(flat, wf_of(1), change));
    const wf at_low = wf_clamp(wf_mul(wf_sub(wf_of(low), front), per), 0, 1);
    const wf at_high = wf_clamp(wf_mul(wf_sub(wf_of(high), front), per), 0, 1);
    *from = wf_select(wf_lt(front, wf_of(low)), at_low, wf_select(wf_gt(front, wf_of(high)), at_high, wf_of(0)));
    *to = wf_select(wf_lt(back, wf_of(low)), at_low, wf_select(wf_gt(back, wf_of(high)), at_high, wf_of(1)));
}

INLINE Gradient gradient_between(const Gradient *front, const Gradient *back, wf at)
{
    Gradient g;
    for (int c = 0; c < 3; c++)
        g.along[c] = wf_lerp(front->along[c], back->along[c], at);
    return g;
}

/* Factor of the colour and added white for a facing, a highlight and an openness. */
INLINE void dim(const CtsShade *s, wf facing, wf highlight, wf open, wf *colour, wf *white)
{
    const wf dark = wf_scale(open, -s->occlusion, s->occlusion), left = wf_sub(wf_of(1), dark);
    const wf diffuse = wf_mul(wf_scale(facing, s->diffuse, 0), wf_scale(dark, -s->occlusion, 1));
    *colour = wf_add(wf_scale(left, s->ambient, 0), diffuse);
    *white = wf_mul(wf_scale(highlight, s->specular, 0), left);
}

/* Shares of a stretch's absorbed light that its quarters take; it is lit in the middle of each. */
typedef struct LitShares {
    wf of[SHEETS_LIT];
} LitShares;

INLINE LitShares lit_shares(const uint32_t *light, wi front, wi back, wmask lanes)
{
    const wi packed = wi_gather(light, wi_add(wi_shl(front, 8), back), lanes);
    LitShares s;
    for (int i = 0; i < SHEETS_LIT; i++)
        s.of[i] = wf_scale(wi_to_float(wi_and(wi_shr(packed, 8 * i), wi_of(255))), 1 / 255.0f, 0);
    return s;
}

/* Difference of light at a slab's outer points and its inner ones: what its points may miss, of the fourth part. */
INLINE wf bend_of_light(const LitShares *s, const wf light[SHEETS_LIT])
{
    return wf_abs(wf_add(wf_mul(wf_add(s->of[0], s->of[1]), wf_sub(light[0], light[1])),
                         wf_mul(wf_add(s->of[2], s->of[3]), wf_sub(light[3], light[2]))));
}

/* Colours of a stretch by its light, premultiplied, white highlight added. end, open: gradient and openness at its
 * ends. Shading stretches of low weight does not pay: the mean of |n.v| over directions is a half. */
INLINE void shade_slab(const SheetsJob *j, const Gradient *const end[2], const LitShares *shares, const wf open[2],
                       wmask heavy, Slab *s, wf *bend)
{
    const CtsShade *const shade = j->shade;
    wf colour = wf_of(0), white = wf_of(0), light[SHEETS_LIT], faint = wf_of(shade->ambient + 0.5f * shade->diffuse);
    for (int i = 0; i < SHEETS_LIT; i++) {
        const wf at = wf_of(((float)i + 0.5f) / SHEETS_LIT);
        const Gradient g = gradient_between(end[0], end[1], at);
        const wf facing = facing_of(j, &g), highlight = highlight_of(shade, facing);
        wf one_colour, one_white, none;
        if (j->open) {
            const wf reached = wf_lerp(open[0], open[1], at);
            dim(shade, facing, highlight, reached, &one_colour, &one_white);
            if (i == 0)
                dim(shade, wf_of(0.5f), wf_of(0), reached, &faint, &none);
        } else {
            one_colour = wf_scale(facing, shade->diffuse, shade->ambient);
            one_white = wf_scale(highlight, shade->specular, 0);
        }
        colour = wf_mul_add(shares->of[i], one_colour, colour);
        white = wf_mul_add(shares->of[i], one_white, white);
        light[i] = wf_add(one_colour, one_white);
    }
    *bend = bend_of_light(shares, light);
    colour = wf_select(heavy, colour, faint);
    white = wf_select(heavy, wf_mul(white, s->alpha), wf_of(0));
    for (int c = 0; c < 3; c++)
        s->rgb[c] = wf_mul_add(s->rgb[c], colour, white);
}

/* Sheets of a block front to back, and the planes in the middle of its slabs: sample and level at 2 s and 2 s + 1. */
enum { AT_ONCE = 2 * SHEETS_BLOCK + 1 };
typedef struct Block {
    int sheet, n; /* its front sheet; slabs */
    Corner corner;
    bool inside;     /* no lane leaves the volume or the part of it that is looked at */
    bool lit_inside; /* nor do the neighbours that gradients take */
    bool window;     /* windows can be loaded whole */
    wf sample[AT_ONCE];
    wi level[AT_ONCE];
    ws highest[SHEETS_BLOCK + 1], lowest[SHEETS_BLOCK + 1]; /* of the two rows of voxels that a sample takes */
    wf from[SHEETS_BLOCK], share[SHEETS_BLOCK];             /* not inside: part of each slab that lies in the volume */
} Block;

INLINE Corner corner_at(const March *m, const Block *b, int slab)
{
    return (Corner){{b->corner.at[0] + slab * m->shear[0], b->corner.at[1] + slab * m->shear[1]}};
}

INLINE const uint16_t *sheet_at(const March *m, int sheet)
{
    return m->job->view.grey + (ptrdiff_t)sheet * m->job->view.sheet;
}

INLINE void sample_sheet(const March *m, Block *b, int slab, bool window)
{
    ws pairs[2];
    const Footprint f = footprint_of(m, corner_at(m, b, slab), window);
    load_pairs(m, &f, sheet_at(m, b->sheet + slab * m->job->view.step) + f.first, window, pairs);
    b->sample[2 * slab] =
        across_rows((Rows){along_row(pairs[0], f.along_a), along_row(pairs[1], f.along_a)}, f.along_b);
    b->level[2 * slab] = level_of(&m->job->levels, b->sample[2 * slab]);
    b->highest[slab] = ws_max(pairs[0], pairs[1]);
    b->lowest[slab] = ws_min(pairs[0], pairs[1]);
}

/* The middle of a slab: the mean of both sheets where the ray is half way. */
INLINE void sample_middle(const March *m, Block *b, int slab, bool window)
{
    Corner corner = corner_at(m, b, slab);
    for (int c = 0; c < 2; c++)
        corner.at[c] += m->shear[c] / 2;
    const Footprint f = footprint_of(m, corner, window);
    const int step = m->job->view.step;
    const Rows front = sample_rows(m, &f, sheet_at(m, b->sheet + slab * step), window);
    const Rows back = sample_rows(m, &f, sheet_at(m, b->sheet + (slab + 1) * step), window);
    const Rows sum = {wi_add(front.upper, back.upper), wi_add(front.lower, back.lower)};
    b->sample[2 * slab + 1] = wf_mul(across_rows(sum, f.along_b), wf_of(0.5f));
    b->level[2 * slab + 1] = level_of(&m->job->levels, b->sample[2 * slab + 1]);
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
                         wf_scale(wi_to_float(wi_lower_half(at)), 0x1p-16f, 0));
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
    }
    const wi second = wf_to_int(wf_scale(part[0], 1 << SHEETS_WEIGHT_BITS, 0));
    /* Two weights of 16 bits; the second may be 2^14, the first then is 0. */
    const ws weights = wi_as_short(wi_add(wi_sub(wi_shl(second, 16), second), wi_of(1 << SHEETS_WEIGHT_BITS)));
    const wi at = wi_add(wi_mul(cell[1], wi_of((int32_t)v->row)), cell[0]);
    const wmask all = wmask_of_bits(0xffff);
    wf of[2];
    for (int i = 0; i < 2; i++) {
        const uint16_t *const from = sheet_at(m, i == 0 ? sheet : next);
        const wi upper = along_row(wi_as_short(wi_gather_pairs(from, at, all)), weights);
        const wi lower = along_row(wi_as_short(wi_gather_pairs(from + v->row, at, all)), weights);
        of[i] = wf_lerp(wi_to_float(upper), wi_to_float(lower), part[1]);
    }
    return wf_lerp(of[0], of[1], share);
}

/* Samples at both ends of the part of a slab that lies in the volume, and in its middle. */
typedef struct PartialSlab {
    wf sample[3];
    wi level[3];
} PartialSlab;

/* Millimetres along the rays where they meet a sheet, from the plane through the view's centre. */
INLINE wf mm_at(const SheetsView *v, const SheetsGrid *g, int x, int y, int sheet)
{
    float lane[SHEETS_LANES];
    for (int l = 0; l < SHEETS_LANES; l++)
        lane[l] = (float)(v->start_mm + (x + g->pitch * (l % SHEETS_SIDE)) * v->start_right_mm +
                          (y + g->pitch * (l / SHEETS_SIDE)) * v->start_down_mm + sheet * v->start_sheet_mm);
    return wf_load(lane);
}

OUTLINE void clip_slab(const March *m, Block *b, int slab, int x, int y)
{
    const SheetsView *const v = &m->job->view;
    const Lanes front = lanes_at(m, corner_at(m, b, slab)), back = lanes_at(m, corner_at(m, b, slab + 1));
    wf from = wf_of(0), to = wf_of(1);
    for (int c = 0; c < 2; c++)
        clip(front.at[c], back.at[c], 0, (float)(v->n[c] - 1), &from, &to);
    if (v->near_mm > -INFINITY || v->far_mm < INFINITY) {
        const int sheet = b->sheet + slab * v->step;
        clip(mm_at(v, m->grid, x, y, sheet), mm_at(v, m->grid, x, y, sheet + v->step), (float)v->near_mm,
             (float)v->far_mm, &from, &to);
    }
    b->from[slab] = from;
    b->share[slab] = wf_max(wf_sub(to, from), wf_of(0));
}

OUTLINE PartialSlab sample_partial(const March *m, const Block *b, int slab)
{
    const int step = m->job->view.step, sheet = b->sheet + slab * step;
    const Lanes front = lanes_at(m, corner_at(m, b, slab)), back = lanes_at(m, corner_at(m, b, slab + 1));
    PartialSlab s;
    for (int i = 0; i < 3; i++) {
        const wf at = wf_clamp(wf_mul_add(b->share[slab], wf_of(0.5f * (float)i), b->from[slab]), 0, 1);
        s.sample[i] = sample_at(m, &front, &back, at, sheet, sheet + step);
        s.level[i] = level_of(&m->job->levels, s.sample[i]);
    }
    return s;
}

/* Mean extinction per mm (0) or one of its colours between two levels. */
INLINE wf mean_of(const float (*mean)[4], wi at, int channel)
{
    const int n = SHEETS_LEVELS * SHEETS_LEVELS * 4;
    return wf_look_up((const float *)mean + channel, n, wi_shl(at, 2));
}

/* A slab of which rays have a share alone, by the mean extinction between its levels. */
OUTLINE void take_share(const SheetsJob *j, wi front, wi back, float length_mm, wf share, wmask lanes, Slab *s)
{
    const wmask partial = wmask_and(lanes, wf_lt(share, wf_of(1)));
    if (!wmask_any(partial) || CTS_MUTATED(SHEET_SHARE))
        return;
    const wi at = wi_add(wi_shl(front, 8), back);
    const wf alpha = wf_taken(wf_mul(mean_of(j->mean, at, 0), wf_scale(share, length_mm, 0)));
    for (int c = 0; c < 3; c++)
        s->rgb[c] = wf_select(partial, wf_mul(alpha, mean_of(j->mean, at, 1 + c)), s->rgb[c]);
    s->alpha = wf_select(partial, alpha, s->alpha);
}

/* Gradients at both sheets of a slab, kept from slab to slab. */
typedef struct SlabShading {
    Gradient front, middle, back;
    Gradient clipped[2]; /* at both ends of a clipped stretch */
    int middle_sheet;    /* the front sheet of the slab that `middle` is of */
    int back_sheet;      /* the sheet that `back` is of */
    wf open[2];          /* openness at the front sheet of a slab, and at its back */
    int open_sheet;      /* the sheet that the latter is of */
    wf bend;             /* sum of squares of slabs' bends of light (bend_of_light()) by their weights */
    wf plain[3];         /* colours without light, beside the coarse ones */
} SlabShading;
enum { NO_SHEET = -9 };

/* Gradient of a sheet where the rays are at `corner`. */
INLINE Gradient gradient_of(const March *m, const Block *b, Corner corner, int sheet, wmask lanes)
{
    if (!b->lit_inside) {
        const Lanes l = lanes_at(m, corner);
        return gradient_at(m, (const wf[]){l.at[0], l.at[1], wf_of((float)sheet)}, wmask_bits(lanes));
    }
    const Footprint f = footprint_of(m, corner, b->window);
    return b->window ? gradient_inside(m, &f, sheet_at(m, sheet), true)
                     : gradient_inside(m, &f, sheet_at(m, sheet), false);
}

/* In the middle of a slab: the mean of both sheets where the ray is half way. */
OUTLINE Gradient gradient_in_middle(const March *m, const Block *b, int slab, wmask lanes)
{
    const int sheet = b->sheet + slab * m->job->view.step, next = sheet + m->job->view.step;
    Corner corner = corner_at(m, b, slab);
    for (int c = 0; c < 2; c++)
        corner.at[c] += m->shear[c] / 2;
    const Gradient front = gradient_of(m, b, corner, sheet, lanes), back = gradient_of(m, b, corner, next, lanes);
    return gradient_between(&front, &back, wf_of(0.5f));
}

/* At a share of the way through a slab that is each ray's own. */
OUTLINE Gradient gradient_of_part(const March *m, const Block *b, int slab, wf share, wmask lanes)
{
    const Lanes front = lanes_at(m, corner_at(m, b, slab)), back = lanes_at(m, corner_at(m, b, slab + 1));
    wf at[3];
    for (int c = 0; c < 2; c++)
        at[c] = wf_lerp(front.at[c], back.at[c], share);
    at[2] = wf_scale(share, (float)m->job->view.step, (float)(b->sheet + slab * m->job->view.step));
    return gradient_at(m, at, wmask_bits(lanes));
}

/* Openness at a sheet, between the middles of 2 x 2 x 2 blocks. */
OUTLINE wf openness_of(const March *m, const Block *b, int slab, wmask lanes)
{
    const SheetsView *const v = &m->job->view;
    const CtsOpenness *const o = m->job->open;
    const Corner corner = corner_at(m, b, slab);
    const int32_t stride[3] = {1, o->n[0], o->n[0] * o->n[1]}, axis[3] = {v->a, v->b, v->p};
    wf share[3];
    wi at = wi_of(0);
    for (int c = 0; c < 3; c++) {
        const int a = axis[c], n = o->n[a];
        const float scale = (float)o->scale[a], shift = (float)o->shift[a];
        const wf place =
            c < 2 ? wf_scale(wi_to_float(wi_load(m->grid->lane[c])), 0x1p-16f, (float)((double)corner.at[c] * 0x1p-32))
                  : wf_of((float)(b->sheet + slab * v->step));
        const wf block = wf_clamp(wf_scale(place, scale, shift), 0, (float)(n - 1));
        const wi low = wi_min(wf_to_int(block), wi_of(n > 1 ? n - 2 : 0));
        share[a] = wf_sub(block, wi_to_float(low));
        at = wi_add(at, wi_mul(low, wi_of(stride[a])));
    }
    wf plane[2];
    for (int k = 0; k < 2; k++) {
        const wi square = wi_gather(o->square + k * o->plane, at, lanes);
        wf corners[4];
        for (int i = 0; i < 4; i++)
            corners[i] = wi_to_float(wi_and(wi_shr(square, 8 * i), wi_of(255)));
        plane[k] =
            wf_lerp(wf_lerp(corners[0], corners[1], share[0]), wf_lerp(corners[2], corners[3], share[0]), share[1]);
    }
    return wf_scale(wf_lerp(plane[0], plane[1], share[2]), 1 / 255.0f, 0);
}

/* Openness at both sheets of a slab. Where the slab is faint, that of two sheets away will do. */
INLINE void find_openness(const March *m, const Block *b, int slab, bool faint, wmask alive, SlabShading *light)
{
    const int sheet = b->sheet + slab * m->job->view.step, next = sheet + m->job->view.step;
    if (light->open_sheet == next || (faint && abs(next - light->open_sheet) <= 2))
        return;
    if (faint)
        light->open[0] = light->open[1] = openness_of(m, b, slab + 1, alive);
    else {
        light->open[0] = light->open_sheet == sheet ? light->open[1] : openness_of(m, b, slab, alive);
        light->open[1] = openness_of(m, b, slab + 1, alive);
    }
    light->open_sheet = next;
}

/* Opacity that may have been missed is there in few of the rays that pass so near. */
#define MISSED_SHARE 0.5f

/* Weight from which a part of a slab is lit by itself: a step of eight bits. */
#define SHADED_FROM (1.0f / 256)
/* With half-sheets, a step of ten bits: rays pass so many of them. */
#define LIT_FROM_HALF (1.0f / 1024)

/* Part of a slab that a stretch is; CLIPPED: each ray has its own. */
typedef enum StretchKind { WHOLE, FRONT_HALF, BACK_HALF, CLIPPED } StretchKind;

/* A stretch between two samples of a slab. */
typedef struct SlabPart {
    int slab;
    wf front, back; /* samples */
    wi front_level, back_level;
    wf from, to; /* shares of the way between both sheets */
    wf share;    /* of its length that lies in the volume */
    StretchKind kind;
    float length_mm;
    const uint64_t *opacity;
    const uint32_t *light;
} SlabPart;

/* Gradients at both ends of a stretch; those of sheets are kept for the next slab. */
INLINE void find_gradients(const March *m, const Block *b, const SlabPart *t, wmask heavy, wmask alive,
                           SlabShading *light, const Gradient *end[2])
{
    const int step = m->job->view.step, sheet = b->sheet + t->slab * step;
    if (t->kind == CLIPPED) {
        light->clipped[0] = gradient_of_part(m, b, t->slab, t->from, heavy);
        light->clipped[1] = gradient_of_part(m, b, t->slab, t->to, heavy);
        end[0] = &light->clipped[0];
        end[1] = &light->clipped[1];
        return;
    }
    if (light->back_sheet != sheet + step) {
        light->front =
            light->back_sheet == sheet ? light->back : gradient_of(m, b, corner_at(m, b, t->slab), sheet, alive);
        light->back = gradient_of(m, b, corner_at(m, b, t->slab + 1), sheet + step, alive);
        light->back_sheet = sheet + step;
    }
    if (t->kind != WHOLE && light->middle_sheet != sheet) {
        light->middle = gradient_in_middle(m, b, t->slab, alive);
        light->middle_sheet = sheet;
    }
    end[0] = t->kind == BACK_HALF ? &light->middle : &light->front;
    end[1] = t->kind == FRONT_HALF ? &light->middle : &light->back;
}

INLINE void note_depth(const March *m, const Block *b, const SlabPart *t, wf before, wmask lanes, int x, int y,
                       State *s)
{
    const SheetsView *const v = &m->job->view;
    wf from, to;
    visible_part(m->job, t->front, t->back, &from, &to);
    const wf start = mm_at(v, m->grid, x, y, b->sheet + t->slab * v->step), length = wf_sub(t->to, t->from);
    /* Within the visible part light goes down exponentially. */
    const wf least = wf_of(1e-30f), depth = wf_log2(wf_div(wf_max(before, least), wf_max(s->left, least)));
    const wf until_half = wf_log2(wf_max(wf_scale(before, 2, 0), least));
    const wf half = wf_clamp(wf_div(until_half, wf_max(depth, wf_of(1e-6f))), 0, 1);
    const wf per = wf_of((float)v->slab_mm);
    const wf first = wf_mul_add(wf_mul_add(from, length, t->from), per, start);
    const wf at_half = wf_mul_add(wf_mul_add(wf_lerp(from, to, half), length, t->from), per, start);
    const wf unseen = wf_of(FAR_MM);
    const wmask begins = wmask_and(lanes, wmask_and(wf_lt(s->left, before), wf_le(unseen, s->first_mm)));
    const wmask passes = wmask_and(lanes, wmask_and(wf_gt(before, wf_of(0.5f)), wf_le(s->left, wf_of(0.5f))));
    s->first_mm = wf_select(begins, first, s->first_mm);
    s->depth_mm = wf_select(passes, at_half, s->depth_mm);
}

INLINE wmask composite_slab_part(const March *m, const Block *b, const SlabPart *t, const bool lit, int x, int y,
                                 State *s, SlabShading *light, SheetsCounts *counts)
{
    const SheetsJob *const j = m->job;
    wmask visible = wmask_and(s->alive, visible_between(&j->levels, t->front_level, t->back_level));
    if (t->kind == CLIPPED)
        visible = wmask_and(visible, wf_gt(t->share, wf_of(0)));
    if (!wmask_any(visible))
        return visible;
    Slab slab = look_up_slab(t->opacity, t->front_level, t->back_level, visible);
    if (t->kind == CLIPPED)
        take_share(j, t->front_level, t->back_level, t->length_mm, t->share, visible, &slab);
    counts->slabs++;
    if (lit) {
        const wf weight = wf_mul(s->left, slab.alpha);
        const wmask heavy = wmask_and(visible, wf_gt(weight, wf_of(j->half ? LIT_FROM_HALF : SHADED_FROM)));
        for (int c = 0; c < 3; c++)
            light->plain[c] = wf_mul_add(wf_select(visible, s->left, wf_of(0)), slab.rgb[c], light->plain[c]);
        if (wmask_any(heavy)) {
            const Gradient *end[2];
            find_gradients(m, b, t, heavy, s->alive, light, end);
            const LitShares shares = lit_shares(t->light, t->front_level, t->back_level, heavy);
            wf open[2], bend;
            if (j->open) {
                find_openness(m, b, t->slab, false, s->alive, light);
                open[0] = wf_lerp(light->open[0], light->open[1], t->from);
                open[1] = wf_lerp(light->open[0], light->open[1], t->to);
            }
            shade_slab(j, end, &shares, open, heavy, &slab, &bend);
            const wf weighted = wf_select(heavy, wf_mul(weight, bend), wf_of(0));
            light->bend = wf_mul_add(weighted, weighted, light->bend);
            counts->lit++;
        } else {
            wf colour = wf_of(j->shade->ambient + 0.5f * j->shade->diffuse), none;
            if (j->open) {
                find_openness(m, b, t->slab, true, s->alive, light);
                dim(j->shade, wf_of(0.5f), wf_of(0), light->open[1], &colour, &none);
            }
            for (int c = 0; c < 3; c++)
                slab.rgb[c] = wf_mul(slab.rgb[c], colour);
        }
    }
    const wf before = s->left;
    blend(s->rgb, &s->left, &slab, visible);
    if (j->want_depth)
        note_depth(m, b, t, before, visible, x, y, s);
    s->alive = wmask_and(s->alive, wf_gt(s->left, wf_of(j->min_transmittance)));
    return visible;
}

INLINE void composite_coarse(const March *m, wi front, wi back, const uint64_t *opacity, wmask lanes, State *s)
{
    const wmask visible = wmask_and(lanes, visible_between(&m->job->levels, front, back));
    if (!wmask_any(visible))
        return;
    const Slab slab = look_up_slab(opacity, front, back, visible);
    blend(s->coarse_rgb, &s->coarse_left, &slab, visible);
}

/* Lanes for which any of the voxels that they take may be visible. */
INLINE wmask may_show(const SheetsLevels *l, ws highest, ws lowest)
{
    wmask may = wmask_of_bits(0xffff);
    if (l->grey_low >= 0)
        may = wi_nonzero(ws_as_int(ws_excess(highest, ws_of((int16_t)l->grey_low))));
    if (l->grey_high < CTS_N_GREY)
        may = wmask_and(may, wi_nonzero(ws_as_int(ws_excess(ws_of((int16_t)l->grey_high), lowest))));
    return may;
}

/* Opacity of a slab by a level that its field may reach between samples, of lanes none of whose samples is visible. A
 * parabola through three samples passes the highest of them by an eighth of their second difference at most; the field
 * is a cubic, and a quarter is taken. */
INLINE wf near_miss(const SheetsJob *j, const Block *b, int slab, const bool half, wmask lanes)
{
    const int at = 2 * slab;
    if (!wmask_any(lanes))
        return wf_of(0);
    const wf front = b->sample[at], back = b->sample[at + 2], both = wf_add(front, back);
    wf highest = wf_max(front, back), bend;
    if (half) {
        const wf middle = b->sample[at + 1];
        bend = wf_sub(wf_add(middle, middle), both);
        highest = wf_max(highest, middle);
    } else {
        const wf before = b->sample[slab > 0 ? at - 2 : at],
                 after = b->sample[slab < SHEETS_BLOCK - 1 ? at + 4 : at + 2];
        bend = wf_max(wf_sub(wf_sub(front, before), wf_sub(back, front)),
                      wf_sub(wf_sub(back, front), wf_sub(after, back)));
    }
    const wi level = level_of(&j->levels, wf_mul_add(wf_max(bend, wf_of(0)), wf_of(0.25f), highest));
    const wmask near = wmask_and(lanes, visible_between(&j->levels, level, level));
    if (!wmask_any(near))
        return wf_of(0);
    return wf_select(near, look_up_slab(j->opacity[half ? 0 : 1], level, level, near).alpha, wf_of(0));
}

INLINE void run_inside(const March *m, Block *b, const bool half, const bool lit, const bool window, int x, int y,
                       State *s, SlabShading *light, SheetsCounts *counts)
{
    const SheetsJob *const j = m->job;
    const float slab_mm = (float)j->view.slab_mm;
    ws highest = b->highest[0], lowest = b->lowest[0];
    for (int i = 1; i <= SHEETS_BLOCK; i++) {
        highest = ws_max(highest, b->highest[i]);
        lowest = ws_min(lowest, b->lowest[i]);
    }
    if (!wmask_any(wmask_and(s->alive, may_show(&j->levels, highest, lowest)))) {
        advance_missed(s, wf_of(0));
        advance_missed(s, wf_of(0));
        return;
    }
    const wf all_of_it = wf_of(1);
    for (int i = 0; i < SHEETS_BLOCK; i++) {
        const wmask may = wmask_and(s->alive, may_show(&j->levels, ws_max(b->highest[i], b->highest[i + 1]),
                                                       ws_min(b->lowest[i], b->lowest[i + 1])));
        wmask visible = wmask_of_bits(0);
        const wmask before = s->alive;
        if (wmask_any(may)) {
            if (half) {
                sample_middle(m, b, i, window);
                counts->sheets += 2;
            }
            for (int k = 0; k <= half; k++) {
                const int front = 2 * i + k, back = half ? front + 1 : front + 2;
                const SlabPart t = {i,
                                    b->sample[front],
                                    b->sample[back],
                                    b->level[front],
                                    b->level[back],
                                    wf_of(0.5f * (float)k),
                                    wf_of(half ? 0.5f * (float)(k + 1) : 1),
                                    all_of_it,
                                    !half ? WHOLE
                                    : k   ? BACK_HALF
                                          : FRONT_HALF,
                                    half ? slab_mm / 2 : slab_mm,
                                    j->opacity[half && !CTS_MUTATED(SHEET_OPACITY) ? 0 : 1],
                                    j->light};
                visible = wmask_or(visible, composite_slab_part(m, b, &t, lit, x, y, s, light, counts));
            }
        }
        if (half)
            composite_coarse(m, b->level[2 * i], b->level[2 * i + 2], j->opacity[1], before, s);
        else if (i % 2 == 1)
            composite_coarse(m, b->level[2 * i - 2], b->level[2 * i + 2], j->opacity[2], before, s);
        advance_missed(s, near_miss(j, b, i, half, wmask_and(may, wmask_not(visible))));
    }
}

OUTLINE void run_partial(const March *m, Block *b, const bool half, const bool lit, int x, int y, State *s,
                         SlabShading *light, SheetsCounts *counts)
{
    const SheetsJob *const j = m->job;
    const float slab_mm = (float)j->view.slab_mm;
    for (int i = 0; i < b->n && wmask_any(s->alive); i++) {
        clip_slab(m, b, i, x, y);
        const wmask lanes = wmask_and(s->alive, wf_gt(b->share[i], wf_of(0)));
        if (!wmask_any(lanes))
            continue;
        const PartialSlab p = sample_partial(m, b, i);
        counts->sheets += 3;
        for (int k = 0; k <= half; k++) {
            const int front = k, back = half ? k + 1 : 2;
            const wf length = wf_scale(b->share[i], half ? 0.5f : 1, 0);
            const wf from = wf_mul_add(length, wf_of((float)k), b->from[i]);
            const SlabPart t = {i,
                                p.sample[front],
                                p.sample[back],
                                p.level[front],
                                p.level[back],
                                from,
                                wf_add(from, length),
                                b->share[i],
                                CLIPPED,
                                half ? slab_mm / 2 : slab_mm,
                                j->opacity[half ? 0 : 1],
                                j->light};
            composite_slab_part(m, b, &t, lit, x, y, s, light, counts);
        }
        Slab coarse = look_up_slab(j->opacity[1], p.level[0], p.level[2], lanes);
        take_share(j, p.level[0], p.level[2], slab_mm, b->share[i], lanes, &coarse);
        blend(s->coarse_rgb, &s->coarse_left, &coarse,
              wmask_and(lanes, visible_between(&j->levels, p.level[0], p.level[2])));
        advance_missed(s, wf_of(0));
    }
    light->back_sheet = light->open_sheet = light->middle_sheet = NO_SHEET;
}

/* Voxels along a, b and p that a block's samples take, least and most. */
INLINE void place_block(const March *m, Block *b)
{
    const SheetsJob *const j = m->job;
    const SheetsView *const v = &j->view;
    const Corner end = corner_at(m, b, b->n);
    const int last = b->sheet + b->n * v->step;
    int64_t low[3], high[3];
    for (int c = 0; c < 2; c++) {
        const int64_t one = b->corner.at[c] >> 32, other = end.at[c] >> 32;
        low[c] = one < other ? one : other;
        high[c] = (one < other ? other : one) + m->grid->reach[c] - 1;
    }
    low[2] = last < b->sheet ? last : b->sheet;
    high[2] = last < b->sheet ? b->sheet : last;
    b->inside = b->n == SHEETS_BLOCK && j->all_depths;
    b->lit_inside = true;
    for (int c = 0; c < 3; c++) {
        b->inside &= low[c] >= 0 && high[c] <= v->n[c] - 1;
        b->lit_inside &= j->shade && low[c] - j->shade->step[c] >= 0 && high[c] + j->shade->step[c] <= v->n[c] - 1;
    }
    /* Windows are loaded by rows of eight, whatever is needed of them. */
    const int64_t n = (int64_t)v->n[0] * v->n[1] * v->n[2];
    const int64_t sheets = high[2] + (j->shade ? j->shade->step[2] : 0),
                  rows = m->window_rows + (j->shade ? j->shade->step[1] : 0);
    const int64_t first_row = high[1] - m->grid->reach[1] + 1, first_column = high[0] - m->grid->reach[0] + 1;
    b->window = m->window_rows > 0 && sheets * v->sheet + (first_row + rows - 1) * v->row + first_column + 8 + 1 <= n;
}

INLINE void run_block(const March *m, Block *b, const Block *last, const bool half, const bool lit, const bool window,
                      int x, int y, State *s, SlabShading *light, SheetsCounts *counts)
{
    const bool goes_on = last->inside && last->sheet + SHEETS_BLOCK * m->job->view.step == b->sheet;
    if (goes_on) {
        b->sample[0] = last->sample[2 * SHEETS_BLOCK];
        b->level[0] = last->level[2 * SHEETS_BLOCK];
        b->highest[0] = last->highest[SHEETS_BLOCK];
        b->lowest[0] = last->lowest[SHEETS_BLOCK];
    }
    for (int i = goes_on; i <= SHEETS_BLOCK; i++)
        sample_sheet(m, b, i, window);
    counts->sheets += SHEETS_BLOCK + !goes_on;
    run_inside(m, b, half, lit, window, x, y, s, light, counts);
}

INLINE void finish(const March *m, const State *s, const SlabShading *light, const bool lit, SheetsPixels *out)
{
    const wmask ended = wf_le(s->left, wf_of(m->job->min_transmittance));
    /* The remaining transmittance of a ray that ended early gets the ray's own colour. */
    const wf scale = wf_select(ended, wf_div(wf_of(1), wf_max(wf_sub(wf_of(1), s->left), wf_of(0.5f))), wf_of(1));
    wf off = wf_abs(wf_sub(s->left, s->coarse_left));
    for (int c = 0; c < 3; c++) {
        const wf plain = lit ? light->plain[c] : s->rgb[c];
        off = wf_max(off, wf_abs(wf_sub(plain, s->coarse_rgb[c])));
        wf_store(out->rgba[c], wf_mul(s->rgb[c], scale));
    }
    if (lit)
        off = wf_add(off, wf_mul(light->bend, wf_inverse_root(wf_max(light->bend, wf_of(1e-12f)))));
    wf_store(out->rgba[3], wf_select(ended, wf_of(1), wf_sub(wf_of(1), s->left)));
    off = wf_add(off, wf_scale(s->missed, MISSED_SHARE, 0));
    wf_store(out->indicator, wf_min(off, wf_of(1)));
    wf_store(out->depth_mm, wf_select(wf_lt(s->depth_mm, wf_of(FAR_MM)), s->depth_mm, s->first_mm));
}

INLINE void march(const SheetsJob *j, const SheetsGrid *grid, int x, int y, const uint64_t *visible, const bool half,
                  const bool lit, const int window_rows, SheetsPixels *out, SheetsCounts *counts)
{
    const SheetsView *const v = &j->view;
    March m = {.job = j, .grid = grid, .window_rows = window_rows};
    int64_t first[2], along[2];
    for (int c = 0; c < 2; c++) {
        first[c] = llrint((v->origin[c] + x * v->right[c] + y * v->down[c]) * 0x1p32) + grid->corner[c];
        along[c] = llrint(v->shear[c] * 0x1p32);
        m.shear[c] = v->step * along[c];
    }
    const wf none = wf_of(0), all = wf_of(1);
    State s = {{none, none, none},    all,  {none, none, none}, all, wf_of(FAR_MM), wf_of(FAR_MM),
               wmask_of_bits(0xffff), none, {none, none}};
    SlabShading light = {.back_sheet = NO_SHEET,
                         .middle_sheet = NO_SHEET,
                         .open = {all, all},
                         .open_sheet = NO_SHEET,
                         .bend = none,
                         .plain = {none, none, none}};
    Block blocks[2]; /* the one at hand, and the one before */
    blocks[1].inside = false;
    const int n_layers = j->blocks->n_layers, n_words = cts_sheets_words(n_layers);
    const int side = (SHEETS_SIDE - 1) * grid->pitch;
    const SheetsShaft shaft = cts_sheets_shaft(v, (const int[]){x, x + side}, (const int[]){y, y + side});
    int now = 0;
    counts->groups++;
    for (int i = 0; i < n_words && wmask_any(s.alive); i++) {
        const int word = v->step > 0 ? i : n_words - 1 - i;
        uint64_t bits = visible[word];
        while (bits && wmask_any(s.alive)) {
            const int bit = v->step > 0 ? __builtin_ctzll(bits) : 63 - __builtin_clzll(bits);
            bits ^= UINT64_C(1) << bit;
            if (!cts_sheets_shaft_is_visible(&shaft, v, j->blocks, word * 64 + bit))
                continue;
            const int low = (word * 64 + bit) * SHEETS_BLOCK;
            const int high = low + SHEETS_BLOCK < v->n[2] - 1 ? low + SHEETS_BLOCK : v->n[2] - 1;
            Block *const b = &blocks[now], *const last = &blocks[!now];
            b->sheet = v->step > 0 ? low : high;
            b->n = high - low;
            for (int c = 0; c < 2; c++)
                b->corner.at[c] = first[c] + b->sheet * along[c];
            place_block(&m, b);
            if (!b->inside)
                run_partial(&m, b, half, lit, x, y, &s, &light, counts);
            else if (window_rows > 0 && b->window)
                run_block(&m, b, last, half, lit, true, x, y, &s, &light, counts);
            else
                run_block(&m, b, last, half, lit, false, x, y, &s, &light, counts);
            now = !now;
        }
    }
    advance_missed(&s, none);
    advance_missed(&s, none);
    finish(&m, &s, &light, lit, out);
}

INLINE void fill_opacity(const float (*mean)[4], float length_mm, size_t first, size_t end, uint64_t *rgba)
{
    int32_t lanes[SHEETS_LANES];
    for (int l = 0; l < SHEETS_LANES; l++)
        lanes[l] = l;
    for (size_t i = first; i < end; i += SHEETS_LANES) {
        const wi at = wi_add(wi_load(lanes), wi_of((int32_t)i));
        const wf alpha = wf_taken(wf_scale(mean_of(mean, at, 0), length_mm, 0));
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
    int32_t lanes[SHEETS_LANES];
    for (int l = 0; l < SHEETS_LANES; l++)
        lanes[l] = l;
    for (size_t i = first; i < end; i += SHEETS_LANES) {
        const wi at = wi_shl(wi_add(wi_load(lanes), wi_of((int32_t)i)), 2);
        wf taken[SHEETS_LIT], left = wf_of(1), sum = wf_of(0);
        for (int q = 0; q < SHEETS_LIT; q++) {
            const wf extinction =
                wf_look_up((const float *)quarter + q, SHEETS_LIT * SHEETS_LEVELS * SHEETS_LEVELS, at);
            taken[q] = wf_mul(left, wf_taken(wf_scale(extinction, length_mm / SHEETS_LIT, 0)));
            left = wf_sub(left, taken[q]);
            sum = wf_add(sum, taken[q]);
        }
        const wmask any = wf_gt(sum, wf_of(1e-20f));
        const wf scale = wf_div(wf_of(255), wf_max(sum, wf_of(1e-20f)));
        int32_t share[SHEETS_LIT][SHEETS_LANES];
        wi rest = wi_of(255);
        for (int q = 0; q < SHEETS_LIT; q++) {
            const wi one =
                q + 1 < SHEETS_LIT
                    ? wi_min(wf_to_int(wf_select(any, wf_scale(wf_mul(taken[q], scale), 1, 0.5f), wf_of(64))), rest)
                    : rest;
            wi_store(share[q], one);
            rest = wi_sub(rest, one);
        }
        for (int l = 0; l < SHEETS_LANES; l++)
            light[i + (size_t)l] = (uint32_t)share[0][l] | (uint32_t)share[1][l] << 8 | (uint32_t)share[2][l] << 16 |
                                   (uint32_t)share[3][l] << 24;
    }
}

/* A march for windows of so many rows (0: voxels are gathered), compiled four times: with and without half-sheets and
 * light. */
#define SHEETS_MARCH_ARGUMENTS                                                                                         \
    const SheetsJob *j, const SheetsGrid *g, int x, int y, const uint64_t *visible, SheetsPixels *out,                 \
        SheetsCounts *counts
#define SHEETS_MARCH(name, rows)                                                                                       \
    OUTLINE void name##_whole(SHEETS_MARCH_ARGUMENTS)                                                                  \
    {                                                                                                                  \
        march(j, g, x, y, visible, false, false, rows, out, counts);                                                   \
    }                                                                                                                  \
    OUTLINE void name##_half(SHEETS_MARCH_ARGUMENTS)                                                                   \
    {                                                                                                                  \
        march(j, g, x, y, visible, true, false, rows, out, counts);                                                    \
    }                                                                                                                  \
    OUTLINE void name##_lit(SHEETS_MARCH_ARGUMENTS)                                                                    \
    {                                                                                                                  \
        march(j, g, x, y, visible, false, true, rows, out, counts);                                                    \
    }                                                                                                                  \
    OUTLINE void name##_half_lit(SHEETS_MARCH_ARGUMENTS)                                                               \
    {                                                                                                                  \
        march(j, g, x, y, visible, true, true, rows, out, counts);                                                     \
    }                                                                                                                  \
    static void name(SHEETS_MARCH_ARGUMENTS)                                                                           \
    {                                                                                                                  \
        (j->half    ? j->shade ? name##_half_lit : name##_half                                                         \
         : j->shade ? name##_lit                                                                                       \
                    : name##_whole)(j, g, x, y, visible, out, counts);                                                 \
    }
