/* Gradients, openness and light of slabs; needs sample_tmpl.h. */
#include "base/mutation.h"
#include "core/scene/light_tmpl.h"
#include "engine/sheets/sheets.h"
#include <stdlib.h>

/* Differences of grey levels along a, b and p at a sheet, 2^14 times. */
typedef struct Differences {
    wf along[3];
} Differences;

/* A gradient by the picture's axes: to the right, up and along the viewing direction; and its squared length. */
typedef struct Gradient {
    wf in_view[3], square;
} Gradient;

INLINE wf dot_product(const wf a[3], const wf b[3])
{
    return wf_mul_add(a[2], b[2], wf_mul_add(a[1], b[1], wf_mul(a[0], b[0])));
}

INLINE Gradient gradient_in_view(const CtsShade *s, const Differences *d)
{
    Gradient g;
    for (int i = 0; i < 3; i++)
        g.in_view[i] = wf_add(wf_add(wf_times(d->along[0], s->frame[i][0]), wf_times(d->along[1], s->frame[i][1])),
                              wf_times(d->along[2], s->frame[i][2]));
    g.square = dot_product(g.in_view, g.in_view);
    return g;
}

/* Difference of 16 bits without a sign, at most 32767 either way: no more than half of the scale of grey levels lies
 * between two voxels but where a fractional rescale slope spreads metal and air over all of it. */
INLINE ws ws_difference(ws more, ws less)
{
    const ws most = ws_of(INT16_MAX);
    return ws_sub(ws_min(ws_excess(more, less), most), ws_min(ws_excess(less, more), most));
}

/* Rows of a window at `more` less those at `less`. */
INLINE ws difference_of_rows(const uint16_t *more, const uint16_t *less, ptrdiff_t row, int n)
{
    return ws_difference(ws_load_rows((const int16_t *)more, row, n), ws_load_rows((const int16_t *)less, row, n));
}

INLINE wf difference_of(const March *m, const Footprint *f, const uint16_t *sheet, ptrdiff_t apart, bool window)
{
    const uint16_t *const more = sheet + f->first + apart, *const less = sheet + f->first - apart;
    const ptrdiff_t row = m->job->view.row;
    ws pairs[2];
    if (window) {
        const int rows = m->window_rows;
        const ws first = difference_of_rows(more, less, row, 4);
        pick_pairs(f, first, rows > 4 ? difference_of_rows(more + 4 * row, less + 4 * row, row, rows - 4) : first, rows,
                   pairs);
    } else {
        ws of_less[2];
        take_pairs(m, f, more, pairs);
        take_pairs(m, f, less, of_less);
        for (int i = 0; i < 2; i++)
            pairs[i] = ws_difference(pairs[i], of_less[i]);
    }
    return across_rows((Rows){ws_madd(pairs[0], f->along_a), ws_madd(pairs[1], f->along_a)}, f->along_b);
}

/* Differences along a and b of neighbouring voxels, for a window that is gathered: four voxels of a row are loaded at
 * once, and the two in their middle serve both axes. */
INLINE void gather_differences(const March *m, const Footprint *f, const uint16_t *from, wf along[2])
{
    const ptrdiff_t row = m->job->view.row;
    ws own[2], pairs[2][2];
    for (int i = 0; i < 2; i++) {
        wi after;
        const wi before = wi_take_64(from + i * row - 1, f->at, sizeof *from, &after);
        pairs[0][i] = ws_difference(wi_as_short(after), wi_as_short(before));
        own[i] = wi_as_short(wi_or(wi_upper_half(before), wi_shl(after, 16)));
    }
    pairs[1][0] = ws_difference(own[1], wi_as_short(wi_take_pairs(from - row, f->at)));
    pairs[1][1] = ws_difference(wi_as_short(wi_take_pairs(from + 2 * row, f->at)), own[0]);
    for (int c = 0; c < 2; c++)
        along[c] = across_rows((Rows){ws_madd(pairs[c][0], f->along_a), ws_madd(pairs[c][1], f->along_a)}, f->along_b);
}

/* Inside, where all neighbours exist. */
INLINE Differences differences_inside(const March *m, const Footprint *f, const uint16_t *sheet, bool window)
{
    const SheetsView *const v = &m->job->view;
    const int *const step = m->job->shade->step;
    Differences d;
    if (!window && step[0] == 1 && step[1] == 1) {
        gather_differences(m, f, sheet + f->first, d.along);
    } else {
        d.along[0] = difference_of(m, f, sheet, step[0], window);
        d.along[1] = difference_of(m, f, sheet, step[1] * v->row, window);
    }
    d.along[2] = difference_of(m, f, sheet, (CTS_MUTATED(SHEET_LIGHT) ? -1 : 1) * step[2] * v->sheet, window);
    return d;
}

/* Grey levels of two neighbours along a, or their differences. */
typedef struct Neighbours {
    wi of[2];
} Neighbours;

/* Grey levels of voxels `index` and the next; any numbers for voxels outside the volume, which are not read. */
INLINE Neighbours neighbours_at(const SheetsJob *job, wi index)
{
    const SheetsView *const v = &job->view;
    const wi read = wi_min(wi_max(index, wi_of(0)), wi_of(v->n[0] * v->n[1] * v->n[2] - 2));
    const wi pair = wi_take_pairs(job->view.grey, read);
    const wi low = wi_lower_half(pair), high = wi_upper_half(pair);
    return (Neighbours){{wi_select(wi_gt(index, read), high, low), wi_select(wi_lt(index, read), low, high)}};
}

/* Differences along an axis at voxels `index`, which lie at `at` along it, and at the next along a: to air beyond the
 * border, or one-sided and twice. */
INLINE Neighbours neighbour_differences(const SheetsJob *job, int axis, wi at, wi index, const Neighbours *own)
{
    const SheetsView *const v = &job->view;
    const int32_t stride[3] = {1, (int32_t)v->row, (int32_t)v->sheet}, step = job->shade->step[axis];
    const wi by = wi_of(step * stride[axis]);
    const Neighbours less = neighbours_at(job, wi_sub(index, by)), more = neighbours_at(job, wi_add(index, by));
    Neighbours d;
    for (int i = 0; i < 2; i++) {
        const wi place = axis == 0 ? wi_add(at, wi_of(i)) : at;
        const wmask before = wi_gt(place, wi_of(step - 1)), after = wi_lt(place, wi_of(v->n[axis] - step));
        const wi beyond = job->shade->air_beyond ? wi_of(0) : own->of[i];
        const wi low = wi_select(before, less.of[i], beyond), high = wi_select(after, more.of[i], beyond);
        const wmask one = wmask_or(wmask_and(before, wmask_not(after)), wmask_and(after, wmask_not(before)));
        d.of[i] = wi_sub(high, low);
        if (!job->shade->air_beyond)
            d.of[i] = wi_add(d.of[i], wi_select(one, d.of[i], wi_of(0)));
    }
    return d;
}

/* At points near the volume's faces or at the ends of rays; in voxels along a, b and p. Those outside the volume count
 * as on its faces. */
OUTLINE Differences differences_at(const March *m, const wf at[3])
{
    const SheetsView *const v = &m->job->view;
    wi cell[3];
    wf part[3];
    Differences d;
    for (int c = 0; c < 3; c++) {
        const wf place = wf_clamp(at[c], 0, (float)(v->n[c] - 1));
        cell[c] = wi_min(wf_to_int(place), wi_of(v->n[c] - 2));
        part[c] = wf_sub(place, wi_to_float(cell[c]));
    }
    const wi first =
        wi_add(wi_add(wi_mul(cell[2], wi_of((int32_t)v->sheet)), wi_mul(cell[1], wi_of((int32_t)v->row))), cell[0]);
    wf plane[3][2], row[3][2];
    for (int k = 0; k < 2; k++) {
        for (int j = 0; j < 2; j++) {
            const wi corner[3] = {cell[0], wi_add(cell[1], wi_of(j)), wi_add(cell[2], wi_of(k))};
            const wi index = wi_add(first, wi_of((int32_t)(j * v->row + k * v->sheet)));
            Neighbours own = {{wi_of(0), wi_of(0)}};
            if (!m->job->shade->air_beyond)
                own = neighbours_at(m->job, index);
            for (int axis = 0; axis < 3; axis++) {
                const Neighbours n = neighbour_differences(m->job, axis, corner[axis], index, &own);
                row[axis][j] = wf_lerp(wi_to_float(n.of[0]), wi_to_float(n.of[1]), part[0]);
            }
        }
        for (int axis = 0; axis < 3; axis++)
            plane[axis][k] = wf_lerp(row[axis][0], row[axis][1], part[1]);
    }
    for (int axis = 0; axis < 3; axis++)
        d.along[axis] = wf_times(wf_lerp(plane[axis][0], plane[axis][1], part[2]), 1 << SHEETS_WEIGHT_BITS);
    return d;
}

/* Points of a slab part at which |n.v| is found: both ends of its quarters, and their middles, where they are lit. */
enum { FACINGS = 2 * SHEETS_LIT + 1 };
/* Distance of the outermost ones from the ends, as a share: the parabola, rounded by 2^-23, has two digits there. */
#define NEAR_END (1 / 64.0f)

INLINE float lit_at(int quarter)
{
    return ((float)quarter + 0.5f) / SHEETS_LIT;
}

/* |n.v| on the line between the gradients at both ends; 0 without a gradient. Not at the very ends, where a gradient
 * may begin from nothing. The square of a gradient that changes linearly is a parabola. */
INLINE void facings_of(const Gradient *front, const Gradient *back, wf facing[FACINGS])
{
    const wf both = dot_product(front->in_view, back->in_view), to_both = wf_sub(both, front->square),
             slope = wf_add(to_both, to_both), curvature = wf_sub(wf_sub(back->square, both), to_both),
             rise = wf_sub(back->in_view[2], front->in_view[2]);
    for (int i = 0; i < FACINGS; i++) {
        const wf at = wf_of(i == 0 ? NEAR_END : i == FACINGS - 1 ? 1 - NEAR_END : (float)i / (FACINGS - 1));
        const wf square = wf_mul_add(wf_mul_add(curvature, at, slope), at, front->square);
        const wf towards = wf_mul_add(rise, at, front->in_view[2]);
        facing[i] = wf_min(wf_mul(wf_abs(towards), wf_inverse_root(wf_max(square, wf_of(1e-12f)))), wf_of(1));
    }
}

/* |n.v|^power at the lit points; side by side, since each is a chain of multiplications. */
INLINE void highlights_of(const CtsShade *s, const wf all[FACINGS], wf highlight[SHEETS_LIT])
{
    wf facing[SHEETS_LIT], square[SHEETS_LIT];
    for (int i = 0; i < SHEETS_LIT; i++)
        facing[i] = all[2 * i + 1];
    if (s->whole_power > 0) {
        for (int i = 0; i < SHEETS_LIT; i++) {
            highlight[i] = wf_of(1);
            square[i] = wf_max(facing[i], wf_of(s->least_power));
        }
        for (int n = s->whole_power; n > 0; n >>= 1) {
            for (int i = 0; i < SHEETS_LIT && n & 1; i++)
                highlight[i] = wf_mul(highlight[i], square[i]);
            for (int i = 0; i < SHEETS_LIT && n > 1; i++)
                square[i] = wf_mul(square[i], square[i]);
        }
    } else {
        for (int i = 0; i < SHEETS_LIT; i++) {
            const wf at = wf_mul(facing[i], wf_of((float)s->n_power));
            const wi entry = wi_min(wf_to_int(at), wi_of(s->n_power - 1));
            const wf low = wf_look_up(s->power, s->n_power + 1, entry),
                     high = wf_look_up(s->power + 1, s->n_power, entry);
            highlight[i] = wf_lerp(low, high, wf_sub(at, wi_to_float(entry)));
        }
    }
    for (int i = 0; i < SHEETS_LIT; i++)
        highlight[i] = wf_select(wf_gt(facing[i], wf_of(0)), highlight[i], wf_of(0));
}

/* light_terms() of sixteen lanes. */
INLINE void group_light_terms(const CtsShade *s, wf facing, wf highlight, wf open, wf *colour, wf *white)
{
    for (int p = 0; p < N_PARTS; p++)
        light_terms(s, facing.part[p], highlight.part[p], open.part[p], &colour->part[p], &white->part[p]);
}

/* Shares of a slab part's absorbed light that its quarters take; it is lit in the middle of each. */
typedef struct LitShares {
    wf of[SHEETS_LIT];
} LitShares;

INLINE LitShares lit_shares(const uint32_t *light, wi front, wi back)
{
    const wi packed = wi_take(light, wi_add(wi_shl(front, 8), back));
    LitShares s;
    for (int i = 0; i < SHEETS_LIT; i++)
        s.of[i] = wf_times(wi_to_float(wi_and(wi_shr(packed, 8 * i), wi_of(255))), 1 / 255.0f);
    return s;
}

/* Second difference of the light at the four points of a slab part, weighted by their shares: an indicator of the error
 * of the rule, 0 where light changes linearly and the shares are even. */
INLINE wf second_difference_of_light(const LitShares *s, const wf light[SHEETS_LIT])
{
    return wf_abs(wf_add(wf_mul(wf_add(s->of[0], s->of[1]), wf_sub(light[0], light[1])),
                         wf_mul(wf_add(s->of[2], s->of[3]), wf_sub(light[3], light[2]))));
}

/* Colours of a slab part by its light, premultiplied, white highlight added. end, open: gradient and openness at its
 * ends. Shading slab parts of low weight does not pay: the mean of |n.v| over directions is a half. */
INLINE void shade_slab(const SheetsJob *j, const Gradient *const end[2], const LitShares *shares, const wf open[2],
                       wmask significant, Slab *s, wf *second_difference)
{
    const CtsShade *const shade = j->shade;
    wf colour = wf_of(0), white = wf_of(0), light[SHEETS_LIT], mean_colour;
    wf facing[FACINGS], highlight[SHEETS_LIT];
    facings_of(end[0], end[1], facing);
    highlights_of(shade, facing, highlight);
    for (int i = 0; i < SHEETS_LIT; i++) {
        const wf reached = wf_lerp(open[0], open[1], wf_of(lit_at(i)));
        const wf ends = wf_times(wf_add(facing[2 * i], facing[2 * i + 2]), 0.5f),
                 mean = wf_times(wf_add(ends, facing[2 * i + 1]), 0.5f);
        wf one_colour, one_white, none;
        group_light_terms(shade, mean, highlight[i], reached, &one_colour, &one_white);
        if (i == 0)
            group_light_terms(shade, wf_of(0.5f), wf_of(0), reached, &mean_colour, &none);
        colour = wf_mul_add(shares->of[i], one_colour, colour);
        white = wf_mul_add(shares->of[i], one_white, white);
        light[i] = wf_add(one_colour, one_white);
    }
    *second_difference = second_difference_of_light(shares, light);
    colour = wf_select(significant, colour, mean_colour);
    white = wf_select(significant, wf_mul(white, s->alpha), wf_of(0));
    for (int c = 0; c < 3; c++)
        s->rgb[c] = wf_mul_add(s->rgb[c], colour, white);
}

/* Gradients at both sheets of a slab, kept from slab to slab. */
typedef struct SlabShading {
    Gradient front, middle, back;
    Gradient clipped[2]; /* at both ends of a clipped slab part */
    int middle_sheet;    /* the front sheet of the slab that `middle` is of */
    int back_sheet;      /* the sheet that `back` is of */
    wf open[2];          /* openness at the front sheet of a slab, and at its back */
    int open_sheet;      /* the sheet that the latter is of */
    wf light_changes;    /* sum of squares of weighted second_difference_of_light() of slabs */
    wf unlit[3];         /* colours without light, beside the coarse ones */
} SlabShading;

/* Values that may be read before they are computed; the rest is left alone, as clearing all of it for each group takes
 * 6 % of a picture. */
INLINE void start_shading(SlabShading *light)
{
    const wf none = wf_of(0), all = wf_of(1);
    light->middle_sheet = light->back_sheet = light->open_sheet = NO_SHEET;
    light->open[0] = light->open[1] = all;
    light->light_changes = none;
    for (int c = 0; c < 3; c++)
        light->unlit[c] = none;
}

/* At a sheet where the rays are at `corner`. */
INLINE Differences differences_of(const March *m, const Block *b, Corner corner, int sheet)
{
    if (!b->lit_inside) {
        const Lanes l = lanes_at(m, corner);
        return differences_at(m, (const wf[]){l.at[0], l.at[1], wf_of((float)sheet)});
    }
    const Footprint f = footprint_of(m, corner, b->window);
    return b->window ? differences_inside(m, &f, sheet_at(m, sheet), true)
                     : differences_inside(m, &f, sheet_at(m, sheet), false);
}

INLINE Gradient gradient_of(const March *m, const Block *b, Corner corner, int sheet)
{
    const Differences d = differences_of(m, b, corner, sheet);
    return gradient_in_view(m->job->shade, &d);
}

INLINE Gradient mean_gradient(const Gradient *front, const Gradient *back)
{
    Gradient g;
    for (int i = 0; i < 3; i++)
        g.in_view[i] = wf_lerp(front->in_view[i], back->in_view[i], wf_of(0.5f));
    g.square = dot_product(g.in_view, g.in_view);
    return g;
}

/* In the middle of a slab: the mean of both sheets where the ray is half way. */
OUTLINE Gradient gradient_in_middle(const March *m, const Block *b, int slab)
{
    const int sheet = b->sheet + slab * m->job->view.step, next = sheet + m->job->view.step;
    Corner corner = corner_at(m, b, slab);
    for (int c = 0; c < 2; c++)
        corner.at[c] += m->shear[c] / 2;
    Differences d = differences_of(m, b, corner, sheet);
    const Differences back = differences_of(m, b, corner, next);
    for (int c = 0; c < 3; c++)
        d.along[c] = wf_lerp(d.along[c], back.along[c], wf_of(0.5f));
    return gradient_in_view(m->job->shade, &d);
}

/* At a share of the way through a slab that is each ray's own. */
OUTLINE Gradient gradient_of_part(const March *m, const Block *b, int slab, wf share)
{
    const Lanes front = lanes_at(m, corner_at(m, b, slab)), back = lanes_at(m, corner_at(m, b, slab + 1));
    wf at[3];
    for (int c = 0; c < 2; c++)
        at[c] = wf_lerp(front.at[c], back.at[c], share);
    at[2] = wf_scale(share, (float)m->job->view.step, (float)(b->sheet + slab * m->job->view.step));
    const Differences d = differences_at(m, at);
    return gradient_in_view(m->job->shade, &d);
}

/* Openness at a sheet. */
OUTLINE wf openness_of(const March *m, const Block *b, int slab)
{
    const SheetsView *const v = &m->job->view;
    const Corner corner = corner_at(m, b, slab);
    const int axis[2] = {v->a, v->b};
    wf open;
    for (int p = 0; p < N_PARTS; p++) {
        vf place[3];
        place[v->p] = vf_of((float)(b->sheet + slab * v->step));
        for (int c = 0; c < 2; c++)
            place[axis[c]] =
                to_float(vi_load(m->grid->lane[c] + p * LANES)) * 0x1p-16f + (float)((double)corner.at[c] * 0x1p-32);
        const OpenCell cell = load_open(m->job->open, place, vi_lt(vi_of(0), vi_of(1)));
        open.part[p] = open_between(m->job->open, &cell, place);
    }
    return open;
}

/* Openness at both sheets of a slab, as it is where light reaches everywhere. Where the slab is not significant, that
 * of two sheets away will do. */
INLINE void find_openness(const March *m, const Block *b, int slab, bool approximate, SlabShading *light)
{
    const int sheet = b->sheet + slab * m->job->view.step, next = sheet + m->job->view.step;
    if (!m->job->open || light->open_sheet == next || (approximate && abs(next - light->open_sheet) <= 2))
        return;
    if (approximate)
        light->open[0] = light->open[1] = openness_of(m, b, slab + 1);
    else {
        light->open[0] = light->open_sheet == sheet ? light->open[1] : openness_of(m, b, slab);
        light->open[1] = openness_of(m, b, slab + 1);
    }
    light->open_sheet = next;
}
