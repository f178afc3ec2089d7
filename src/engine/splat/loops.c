/* The hot loops, vectorised by the compiler with identical results. Compiled for plain C and for AVX2. */
#include "engine/splat/loops.h"

#include "base/mutation.h"
#include "base/simd_fixed.h"
#include "base/simd_path.h"
#include <math.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
/* Voxels to splat: offset of the first tap, and change of grey. Neighbours' footprints overlap, and adding to a value
 * stored just before stalls; so every TURNS-th voxel of a list is processed before the next ones. */
enum { TURNS = 4, ENOUGH = 128, MOST = ENOUGH + 64 + 8 };

typedef struct List {
    int n;
    int32_t column[MOST];
    uint32_t change[MOST];
} List;

INLINE i32x8 grey_8(const uint16_t *grey)
{
    const u16x8 eight = *(const u16x8 *)grey;
    int32_t wide[8];
    for (int k = 0; k < 8; k++)
        wide[k] = eight[k];
    return *(const i32x8 *)wide;
}

/* Add voxels i..i+n-1, eight at a time as long as that stays below voxel `end`. */
INLINE void list_run(List *l, const CtsScatter *job, int i, int n, int end)
{
    const int density = job->footprint->density[0], past = i + n;
    const i32x8 columns = (i32x8){0, 1, 2, 3, 4, 5, 6, 7} * density;
    int at = l->n;
    l->n += n;
    for (; i < past && i + 8 <= end; i += 8, at += 8) {
        i32x8 change = grey_8(job->value + i);
        if (job->old)
            change -= grey_8(job->old + i);
        *(i32x8 *)(l->column + at) = columns + i * density;
        *(i32x8 *)(l->change + at) = change;
    }
    for (; i < past; i++, at++) {
        l->column[at] = i * density;
        l->change[at] = (uint32_t)job->value[i] - (job->old ? job->old[i] : 0);
    }
}

/* A voxel's rows of taps, then the next one's. n_vectors 0: at most four taps. */
INLINE void scatter_list(const CtsScatter *job, const List *l, int n_vectors)
{
    const size_t stride = job->stride;
    const int n_rows = job->tap1 - job->tap0;
    for (int turn = 0; turn < TURNS; turn++)
        for (int k = turn; k < l->n; k += TURNS) {
            const uint32_t change = l->change[k];
            uint32_t *to = job->sheet + l->column[k];
            const u32x8 *weight = (const u32x8 *)job->footprint->weight[job->tap0];
            for (int v = 0; v < n_rows; v++, to += stride, weight += CTS_MAX_TAPS / 8) {
                if (n_vectors == 0)
                    *(u32x4 *)to += change * *(const u32x4 *)weight;
                for (int i = 0; i < n_vectors; i++)
                    ((u32x8 *)to)[i] += change * weight[i];
            }
        }
}

static void scatter(const CtsScatter *job, const uint64_t *marks, int n)
{
    const int n_taps = 2 * job->footprint->reach[0] + 1;
    List list;
    list.n = 0;
    for (int i = 0; i < n; i += 64) {
        uint64_t bits = marks[i / 64];
        for (int at = i; bits;) {
            const int gap = __builtin_ctzll(bits);
            bits >>= gap;
            const int run = ~bits ? __builtin_ctzll(~bits) : 64;
            list_run(&list, job, at + gap, run, n);
            at += gap + run;
            bits = run < 64 ? bits >> run : 0;
        }
        if (list.n < ENOUGH && i + 64 < n)
            continue;
        if (n_taps <= 4)
            scatter_list(job, &list, 0);
        else if (n_taps <= 8)
            scatter_list(job, &list, 1);
        else if (n_taps <= 16)
            scatter_list(job, &list, 2);
        else
            scatter_list(job, &list, 4);
        list.n = 0;
    }
}

/* Transposes 64 bits: bit k of lane l becomes bit 8 k + l. */
INLINE uint64_t lane_bits(u16x8 lanes)
{
    const u8x8 narrow = CONVERT(lanes, u8x8);
    uint64_t x, swap;
    memcpy(&x, &narrow, sizeof x);
    if (!x)
        return 0;
    swap = (x ^ x >> 7) & UINT64_C(0x00aa00aa00aa00aa);
    x ^= swap ^ swap << 7;
    swap = (x ^ x >> 14) & UINT64_C(0x0000cccc0000cccc);
    x ^= swap ^ swap << 14;
    swap = (x ^ x >> 28) & UINT64_C(0x00000000f0f0f0f0);
    return x ^ swap ^ swap << 28;
}

/* Eight lanes of all bits where a voxel is marked. */
INLINE u16x8 marked_8(const uint16_t *value, const uint16_t *old, uint16_t least)
{
    const u16x8 eight = *(const u16x8 *)value;
    return old ? (u16x8)(eight != *(const u16x8 *)old) : (u16x8)(eight >= least);
}

static void mark(const uint16_t *value, const uint16_t *old, uint16_t least, int n, const uint64_t *wanted,
                 uint64_t *marks)
{
    int i = 0;
    for (; i + 64 <= n; i += 64) {
        const uint64_t of = wanted ? wanted[i / 64] : ~UINT64_C(0);
        u16x8 lanes = {0};
        for (int k = 0; k < 8 && of; k++)
            lanes |= marked_8(value + i + 8 * k, old ? old + i + 8 * k : NULL, least) & (uint16_t)(1 << k);
        marks[i / 64] = lane_bits(lanes) & of;
    }
    if (i < n)
        marks[i / 64] = 0;
    for (; i < n; i++)
        marks[i / 64] |= (uint64_t)(old ? value[i] != old[i] : value[i] >= least) << (i & 63);
    if (wanted && n % 64)
        marks[n / 64] &= wanted[n / 64];
}

static void place_samples(double base, double by_x, int last, int x0, int n, int32_t *cell, float *frac)
{
    const int last_cell = last > 1 ? last - 1 : 0;
    const f64x4 end = last - (f64x4){0};
    for (int i = 0; i < n; i += 4) {
        const f64x4 at = base + by_x * ((f64x4){0, 1, 2, 3} + (x0 + i));
        const f64x4 up = (f64x4)((i64x4)at & (at > 0));
        const i64x4 inside = up < end;
        const f64x4 held = (f64x4)(((i64x4)up & inside) | ((i64x4)end & ~inside));
        i32x4 down = CONVERT(held, i32x4);
        down += down > last_cell; /* the end belongs to the cell before it */
        double whole[4];
        for (int k = 0; k < 4; k++)
            whole[k] = down[k];
        *(i32x4 *)(cell + i) = down;
        *(f32x4 *)(frac + i) = CONVERT(held - *(const f64x4 *)whole, f32x4);
    }
}

INLINE f32x8 lerp(f32x8 a, f32x8 b, f32x8 t)
{
    return a + (b - a) * t;
}

INLINE u32x4 load_two(const uint32_t *a, const uint32_t *b)
{
    return SHUFFLE(*(const u32x2 *)a, *(const u32x2 *)b, 0, 1, 2, 3);
}

/* Two lattice neighbours of each of eight samples, halved so that they fit a signed integer, which vector units can
 * convert. Lanes are loaded as 0 1 4 5 and 2 3 6 7, so that one shuffle within 128-bit halves puts them in order. */
INLINE void load_sheet_pairs(const uint32_t *sheet, const int32_t *at, f32x8 *left, f32x8 *right)
{
    const u32x4 ab = load_two(sheet + at[0], sheet + at[1]), cd = load_two(sheet + at[2], sheet + at[3]);
    const u32x4 ef = load_two(sheet + at[4], sheet + at[5]), gh = load_two(sheet + at[6], sheet + at[7]);
    const u32x8 a = SHUFFLE(ab, ef, 0, 1, 2, 3, 4, 5, 6, 7);
    const u32x8 b = SHUFFLE(cd, gh, 0, 1, 2, 3, 4, 5, 6, 7);
    const f32x8 af = CONVERT((i32x8)(a >> 1), f32x8), bf = CONVERT((i32x8)(b >> 1), f32x8);
    *left = SHUFFLE(af, bf, 0, 2, 8, 10, 4, 6, 12, 14);
    *right = SHUFFLE(af, bf, 1, 3, 9, 11, 5, 7, 13, 15);
}

INLINE f32x8 bilinear_8(const uint32_t *sheet, size_t stride, const int32_t *at, f32x8 fu, f32x8 fv)
{
    f32x8 a, b, c, d;
    load_sheet_pairs(sheet, at, &a, &b);
    load_sheet_pairs(sheet + stride, at, &c, &d);
    return lerp(lerp(a, b, fu), lerp(c, d, fu), fv);
}

/* Potentially visible ones of 64 grey levels. */
INLINE uint64_t shown_64(const uint16_t *grey, const CtsEntries *entries)
{
    const uint16_t low = entries->low, range = (uint16_t)(entries->high - low);
    u16x8 lanes = {0};
    for (int k = 0; k < 8; k++)
        lanes |= (u16x8)(*(const u16x8 *)(grey + 8 * k) - low <= range) & (uint16_t)(1 << k);
    return lane_bits(lanes);
}

/* The grey levels of pixels i..i+7; horizontal: as in places. */
INLINE u16x8 sample_8(const CtsSheetPair *sheets, const CtsPlaces *places, int i, bool horizontal)
{
    const size_t row = horizontal ? (size_t)places->cell[1][0] * sheets->stride : 0;
    const f32x8 fu = *(const f32x8 *)(places->frac[0] + i);
    f32x8 fv = places->frac[1][0] - (f32x8){0};
    const int32_t *at = places->cell[0] + i;
    i32x8 oblique;
    if (!horizontal) {
        fv = *(const f32x8 *)(places->frac[1] + i);
        oblique = *(const i32x8 *)at + *(const i32x8 *)(places->cell[1] + i) * (int32_t)sheets->stride;
        at = (const int32_t *)&oblique;
    }
    f32x8 value = bilinear_8(sheets->first + row, sheets->stride, at, fu, fv);
    if (sheets->second)
        value = lerp(value, bilinear_8(sheets->second + row, sheets->stride, at, fu, fv), sheets->weight - (f32x8){0});
    value *= 2.0f / CTS_WEIGHT_ONE;
    /* Beside 2^23 a float has no bits left for fractions: the nearest whole number, ties to even. */
    i32x8 whole = (i32x8)(value + 0x1p23f) & 0x7fffff;
    if (CTS_MUTATED(ROUNDING))
        whole = CONVERT(value, i32x8);
    const i32x8 above = whole > sheets->top;
    return CONVERT((whole & ~above) | (sheets->top & above), u16x8);
}

/* Positions in a word of the first group of eight with a mark, and of the end of the last one. */
INLINE int first_eight(uint64_t marks)
{
    return __builtin_ctzll(marks) & 56;
}

INLINE int past_eight(uint64_t marks)
{
    return 64 - (__builtin_clzll(marks) & 56);
}

INLINE uint64_t sample_row(const CtsSheetPair *sheets, const CtsPlaces *places, const CtsRowMarks *marks,
                           uint16_t *grey, bool horizontal)
{
    uint64_t n = 0;
    for (int w = marks->first; w < marks->past; w++) {
        const uint64_t wanted = marks->bits[w];
        const int first = wanted ? first_eight(wanted) : 0, past = wanted ? past_eight(wanted) : 0;
        for (int at = first; at < past; at += 8)
            if (wanted >> at & 255)
                *(u16x8 *)(grey + 64 * w + at) = sample_8(sheets, places, 64 * w + at, horizontal);
        n += (uint64_t)(past - first) / 8;
    }
    return n;
}

static uint64_t sample(const CtsSheetPair *sheets, const CtsPlaces *places, const CtsEntries *entries,
                       const CtsRowMarks *marks, uint16_t *grey)
{
    const uint64_t n = places->horizontal ? sample_row(sheets, places, marks, grey, true)
                                          : sample_row(sheets, places, marks, grey, false);
    /* In a separate loop, since reading a value written just before would stall. */
    for (int w = marks->first; w < marks->past; w++)
        if (marks->bits[w])
            marks->bits[w] &= shown_64(grey + 64 * w, entries);
    return n;
}

/* Adds transmittance, which is above 0, times entry, and sets a negligible transmittance to 0. Returns true if the
 * pixel is opaque then. */
INLINE bool blend_one(float *pixel, f32x4 entry)
{
    const f32x4 old = *(const f32x4 *)pixel;
    f32x4 new = old + old[3] * entry;
    const bool closes = new[3] < CTS_OPAQUE_BELOW;
    *(f32x4 *)pixel = new;
    if (closes)
        pixel[3] = 0;
    return closes;
}

/* |n.v| in 0..1; 0 without a gradient. */
INLINE float facing_of(const CtsShade *s, float g0, float g1, float g2)
{
    float in_view[3];
    for (int i = 0; i < 3; i++)
        in_view[i] = s->frame[i][0] * g0 + s->frame[i][1] * g1 + s->frame[i][2] * g2;
    const float square = in_view[0] * in_view[0] + in_view[1] * in_view[1] + in_view[2] * in_view[2];
    if (!(square > 0))
        return 0;
    const float facing = fabsf(in_view[2]) / sqrtf(square);
    return facing < 1 ? facing : 1;
}

/* The factor of the colour, and the white that is added to it. */
INLINE void light_factors(const CtsShade *s, float facing, float *colour, float *white)
{
    const float at = facing * (float)s->n_power;
    const int i = at < (float)s->n_power ? (int)at : s->n_power - 1;
    const float low = s->power[i];
    *colour = s->ambient + s->diffuse * facing;
    *white = facing > 0 ? s->specular * (low + (s->power[i + 1] - low) * (at - (float)i)) : 0;
}

/* The same where so much light arrives (core/scene/openness.h). */
INLINE void occlude_light(const CtsShade *s, float facing, float openness, float *colour, float *white)
{
    const float dark = s->occlusion * (1 - openness);
    *colour -= dark * (s->ambient + s->occlusion * s->diffuse * facing);
    *white -= dark * *white;
}

INLINE f32x4 lerp_4(const float a[4], const float b[4], float t)
{
    return *(const f32x4 *)a + (*(const f32x4 *)b - *(const f32x4 *)a) * t;
}

/* The gradient of a layer, between four voxels. */
INLINE f32x4 layer_gradient_at(const float (*field)[4], size_t stride, float fu, float fv)
{
    const f32x4 top = lerp_4(field[0], field[1], fu), bottom = lerp_4(field[stride], field[stride + 1], fu);
    return top + (bottom - top) * fv;
}

/* The entry of a pixel, lit. */
INLINE f32x4 light_entry(f32x4 entry, const CtsPlaces *places, const CtsLight *light, int at)
{
    float frac[2], colour, white;
    size_t voxel[2];
    for (int axis = 0; axis < 2; axis++) {
        const int shift = light->shift[axis], i = axis == 1 && places->horizontal ? 0 : at;
        const int32_t cell = places->cell[axis][i], whole = cell >> shift;
        voxel[axis] = (size_t)whole;
        frac[axis] = ((float)(cell - (whole << shift)) + places->frac[axis][i]) * (1.0f / (float)(1 << shift));
    }
    const size_t from = voxel[1] * light->stride + voxel[0];
    f32x4 g = layer_gradient_at(light->first + from, light->stride, frac[0], frac[1]);
    if (light->second)
        g += (layer_gradient_at(light->second + from, light->stride, frac[0], frac[1]) - g) * light->weight;
    const float facing = facing_of(light->shade, g[0], g[1], g[2]);
    light_factors(light->shade, facing, &colour, &white);
    if (light->open) {
        double vox[3];
        for (int axis = 0; axis < 2; axis++)
            vox[light->axis[axis]] = (double)voxel[axis] + (double)frac[axis];
        vox[light->axis[2]] = light->layer;
        occlude_light(light->shade, facing, (float)cts_openness_at(light->open, vox), &colour, &white);
    }
    const float lift = -entry[3] * white;
    const f32x4 factor = {colour, colour, colour, 1}, whites = {lift, lift, lift, 0};
    return entry * factor + whites;
}

static void blend(float *pixels, const uint16_t *grey, const CtsRowMarks *marks, const CtsEntries *entries,
                  const CtsPlaces *places, const CtsLight *light, uint64_t *closed)
{
    for (int w = marks->first; w < marks->past; w++)
        for (uint64_t left = marks->bits[w]; left; left &= left - 1) {
            const int at = 64 * w + __builtin_ctzll(left);
            float *const pixel = pixels + 4 * (size_t)at;
            f32x4 entry = *(const f32x4 *)entries->entry[grey[at]];
            if (!(pixel[3] > 0))
                continue;
            if (light)
                entry = light_entry(entry, places, light, at);
            if (blend_one(pixel, entry) && closed)
                closed[w] |= left & -left;
        }
}

/* Alternates elements of a and b, from the low and from the high half of each 128 bits. */
INLINE f32x8 weave_low(f32x8 a, f32x8 b)
{
    return SHUFFLE(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
}

INLINE f32x8 weave_high(f32x8 a, f32x8 b)
{
    return SHUFFLE(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}

/* after - before of eight grey levels. */
INLINE f32x8 difference_8(const uint16_t *after, const uint16_t *before)
{
    return CONVERT(grey_8(after) - grey_8(before), f32x8);
}

INLINE void one_gradient(const CtsGradientRows *rows, int i, float gradient[4])
{
    const int beyond = rows->air_beyond ? 0 : rows->row[i];
    const int left = i > 0 ? rows->row[i - 1] : beyond, right = i < rows->n - 1 ? rows->row[i + 1] : beyond;
    const bool one_sided = !rows->air_beyond && (i == 0 || i == rows->n - 1);
    gradient[0] = (float)((one_sided ? 2 : 1) * (right - left));
    gradient[1] = (float)(rows->after[0][i] - rows->before[0][i]) * rows->scale[0];
    gradient[2] = (float)(rows->after[1][i] - rows->before[1][i]) * rows->scale[1];
    gradient[3] = 0;
}

static void gradient(const CtsGradientRows *rows, int i0, int i1, float (*gradient)[4])
{
    const uint16_t *const row = rows->row, *const *const before = rows->before, *const *const after = rows->after;
    int i = i0;
    for (; i < i1 && i < 1; i++)
        one_gradient(rows, i, gradient[i]);
    for (; i + 8 <= i1 && i + 8 < rows->n; i += 8) {
        const f32x8 u = difference_8(row + i + 1, row + i - 1), none = {0};
        const f32x8 v = difference_8(after[0] + i, before[0] + i) * rows->scale[0];
        const f32x8 k = difference_8(after[1] + i, before[1] + i) * rows->scale[1];
        const f32x8 uv[2] = {weave_low(u, v), weave_high(u, v)}, k0[2] = {weave_low(k, none), weave_high(k, none)};
        f32x8 *to = (f32x8 *)gradient[i];
        for (int h = 0; h < 2; h++) {
            const f32x8 even = SHUFFLE(uv[h], k0[h], 0, 1, 8, 9, 4, 5, 12, 13);
            const f32x8 odd = SHUFFLE(uv[h], k0[h], 2, 3, 10, 11, 6, 7, 14, 15);
            to[h] = SHUFFLE(even, odd, 0, 1, 2, 3, 8, 9, 10, 11);
            to[h + 2] = SHUFFLE(even, odd, 4, 5, 6, 7, 12, 13, 14, 15);
        }
    }
    for (; i < i1; i++)
        one_gradient(rows, i, gradient[i]);
}

const CtsSimd CTS_ON_PATH(cts_simd) = {scatter, mark, place_samples, sample, blend, gradient};
