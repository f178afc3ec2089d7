/* Each hot loop in a compiler's vectors: no vector changes a bit. Compiled again for each instruction set. */
#include "engine/splat/simd.h"

#include "base/mutation.h"
#include <math.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define VECTOR(type, name, bytes)                                                                                      \
    typedef type name __attribute__((vector_size(bytes), aligned(sizeof(type)), may_alias))
#define SHUFFLE __builtin_shufflevector
#define CONVERT __builtin_convertvector

VECTOR(uint16_t, Short8, 16);
VECTOR(uint32_t, Word2, 8);
VECTOR(uint32_t, Word4, 16);
VECTOR(uint32_t, Word8, 32);
VECTOR(int32_t, Int4, 16);
VECTOR(int32_t, Int8, 32);
VECTOR(int64_t, Long4, 32);
VECTOR(float, Float4, 16);
VECTOR(float, Float8, 32);
VECTOR(double, Double4, 32);

/* Voxels to splat: where their first tap goes, and the change of grey. Neighbours' footprints overlap, and to add to
 * what was stored a moment ago stalls; so of a list every TURNS-th voxel is taken before the next ones. */
enum { TURNS = 4, ENOUGH = 128, MOST = ENOUGH + 64 + 8 };

typedef struct List {
    int n;
    int32_t column[MOST];
    uint32_t change[MOST];
} List;

INLINE Int8 grey_8(const uint16_t *grey)
{
    const Short8 eight = *(const Short8 *)grey;
    int32_t wide[8];
    for (int k = 0; k < 8; k++)
        wide[k] = eight[k];
    return *(const Int8 *)wide;
}

/* Add voxels i..i+n-1, eight at a time as long as that stays below voxel `end`. */
INLINE void list_run(List *l, const CtsScatter *job, int i, int n, int end)
{
    const int density = job->footprint->density[0], past = i + n;
    const Int8 columns = (Int8){0, 1, 2, 3, 4, 5, 6, 7} * density;
    int at = l->n;
    l->n += n;
    for (; i < past && i + 8 <= end; i += 8, at += 8) {
        Int8 change = grey_8(job->value + i);
        if (job->old)
            change -= grey_8(job->old + i);
        *(Int8 *)(l->column + at) = columns + i * density;
        *(Int8 *)(l->change + at) = change;
    }
    for (; i < past; i++, at++) {
        l->column[at] = i * density;
        l->change[at] = (uint32_t)job->value[i] - (job->old ? job->old[i] : 0);
    }
}

/* Rows of taps one after the other, so that a row's weights stay in registers. n_vectors 0: at most four taps. */
INLINE void scatter_list(const CtsScatter *job, const List *l, int n_vectors)
{
    uint32_t *row = job->sheet;
    for (int v = job->tap0; v < job->tap1; v++, row += job->stride) {
        const Word8 *const weight = (const Word8 *)job->footprint->weight[v];
        const Word4 four = *(const Word4 *)weight;
        for (int turn = 0; turn < TURNS; turn++)
            for (int k = turn; k < l->n; k += TURNS) {
                uint32_t *const to = row + l->column[k];
                if (n_vectors == 0)
                    *(Word4 *)to += l->change[k] * four;
                for (int i = 0; i < n_vectors; i++)
                    ((Word8 *)to)[i] += l->change[k] * weight[i];
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

/* 64 bytes, each 0 or 1, as bits: byte k of eight moves from bit 8 k to bit 56 + k. */
INLINE uint64_t bits_of(const uint8_t is[64])
{
    uint64_t bits = 0;
    for (int i = 0; i < 8; i++) {
        uint64_t eight;
        memcpy(&eight, is + 8 * i, sizeof eight);
        bits |= (eight * UINT64_C(0x0102040810204080) >> 56) << 8 * i;
    }
    return bits;
}

static void mark(const uint16_t *value, const uint16_t *old, int n, uint64_t *marks)
{
    for (int i = 0; i < n; i += 64) {
        const int past = n - i < 64 ? n - i : 64;
        uint8_t is[64] = {0};
        for (int k = 0; k < past; k++)
            is[k] = value[i + k] != old[i + k];
        marks[i / 64] = bits_of(is);
    }
}

static void place(double base, double by_x, int last, int x0, int n, int32_t *cell, float *frac)
{
    const int last_cell = last > 1 ? last - 1 : 0;
    const Double4 end = last - (Double4){0};
    for (int i = 0; i < n; i += 4) {
        const Double4 at = base + by_x * ((Double4){0, 1, 2, 3} + (x0 + i));
        const Double4 up = (Double4)((Long4)at & (at > 0));
        const Long4 inside = up < end;
        const Double4 held = (Double4)(((Long4)up & inside) | ((Long4)end & ~inside));
        Int4 down = CONVERT(held, Int4);
        down += down > last_cell; /* the end belongs to the cell before it */
        double whole[4];
        for (int k = 0; k < 4; k++)
            whole[k] = down[k];
        *(Int4 *)(cell + i) = down;
        *(Float4 *)(frac + i) = CONVERT(held - *(const Double4 *)whole, Float4);
    }
}

INLINE Float8 lerp(Float8 a, Float8 b, Float8 t)
{
    return a + (b - a) * t;
}

INLINE Word4 load_two(const uint32_t *a, const uint32_t *b)
{
    return SHUFFLE(*(const Word2 *)a, *(const Word2 *)b, 0, 1, 2, 3);
}

/* Two lattice neighbours of each of eight samples, halved so that they fit a signed integer, which is what vector units
 * convert. Lanes are loaded as 0 1 4 5 and 2 3 6 7, so that one shuffle within 128-bit halves puts them in order. */
INLINE void load_pairs(const uint32_t *sheet, const int32_t *at, Float8 *left, Float8 *right)
{
    const Word4 ab = load_two(sheet + at[0], sheet + at[1]), cd = load_two(sheet + at[2], sheet + at[3]);
    const Word4 ef = load_two(sheet + at[4], sheet + at[5]), gh = load_two(sheet + at[6], sheet + at[7]);
    const Word8 a = SHUFFLE(ab, ef, 0, 1, 2, 3, 4, 5, 6, 7);
    const Word8 b = SHUFFLE(cd, gh, 0, 1, 2, 3, 4, 5, 6, 7);
    const Float8 af = CONVERT((Int8)(a >> 1), Float8), bf = CONVERT((Int8)(b >> 1), Float8);
    *left = SHUFFLE(af, bf, 0, 2, 8, 10, 4, 6, 12, 14);
    *right = SHUFFLE(af, bf, 1, 3, 9, 11, 5, 7, 13, 15);
}

INLINE Float8 bilinear_8(const uint32_t *sheet, size_t stride, const int32_t *at, Float8 fu, Float8 fv)
{
    Float8 a, b, c, d;
    load_pairs(sheet, at, &a, &b);
    load_pairs(sheet + stride, at, &c, &d);
    return lerp(lerp(a, b, fu), lerp(c, d, fu), fv);
}

/* level: as in places. */
INLINE void sample_row(const CtsSheetPair *sheets, const CtsPlaces *places, int n, uint16_t *grey, bool level)
{
    const size_t row = level ? (size_t)places->cell[1][0] * sheets->stride : 0;
    for (int i = 0; i < n; i += 8) {
        const Float8 fu = *(const Float8 *)(places->frac[0] + i);
        Float8 fv = places->frac[1][0] - (Float8){0};
        const int32_t *at = places->cell[0] + i;
        Int8 oblique;
        if (!level) {
            fv = *(const Float8 *)(places->frac[1] + i);
            oblique = *(const Int8 *)at + *(const Int8 *)(places->cell[1] + i) * (int32_t)sheets->stride;
            at = (const int32_t *)&oblique;
        }
        Float8 value = bilinear_8(sheets->first + row, sheets->stride, at, fu, fv);
        if (sheets->second)
            value =
                lerp(value, bilinear_8(sheets->second + row, sheets->stride, at, fu, fv), sheets->weight - (Float8){0});
        value *= 2.0f / CTS_WEIGHT_ONE;
        /* Beside 2^23 a float has no bits left for fractions: the nearest whole number, ties to even. */
        Int8 whole = (Int8)(value + 0x1p23f) & 0x7fffff;
        if (CTS_MUTATED(ROUNDING))
            whole = CONVERT(value, Int8);
        const Int8 above = whole > sheets->top;
        *(Short8 *)(grey + i) = CONVERT((whole & ~above) | (sheets->top & above), Short8);
    }
}

static void sample(const CtsSheetPair *sheets, const CtsPlaces *places, int n, uint16_t *grey)
{
    if (places->level)
        sample_row(sheets, places, n, grey, true);
    else
        sample_row(sheets, places, n, grey, false);
}

/* Which of up to 64 samples may show. */
INLINE uint64_t shown_64(const uint16_t *grey, int n, const CtsEntries *entries)
{
    const uint16_t low = entries->low, range = (uint16_t)(entries->high - low);
    const int past = n < 64 ? n : 64;
    uint8_t is[64] = {0};
    for (int i = 0; i < past; i++)
        is[i] = (uint16_t)(grey[i] - low) <= range;
    return bits_of(is);
}

/* Add transmittance times entry, then let what is left of almost nothing be nothing. Returns whether that closed it. */
INLINE bool blend_one(float *pixel, Float4 entry)
{
    const Float4 old = *(const Float4 *)pixel;
    Float4 new = old + old[3] * entry;
    const bool closes = new[3] < CTS_OPAQUE_BELOW;
    *(Float4 *)pixel = new;
    if (closes)
        pixel[3] = 0;
    return closes & (old[3] > 0);
}

static bool blend(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries)
{
    bool closed = false;
    if (entries->low > entries->high)
        return false;
    for (int i = 0; i < n; i += 64)
        for (uint64_t shown = shown_64(grey + i, n - i, entries); shown; shown &= shown - 1) {
            const int at = i + __builtin_ctzll(shown);
            closed |= blend_one(pixels + 4 * (size_t)at, *(const Float4 *)entries->entry[grey[at]]);
        }
    return closed;
}

/* Voxels and fractions of eight pixels. */
typedef struct Places8 {
    int32_t voxel[8];
    float fu[8], fv[8];
} Places8;

INLINE void place_8(Places8 *p, const CtsPlaces *places, const int pixel[8], const CtsLight *light)
{
    Int8 voxel[2];
    Float8 frac[2];
    for (int axis = 0; axis < 2; axis++) {
        const int shift = light->shift[axis];
        int32_t cells[8];
        float fracs[8];
        for (int k = 0; k < 8; k++) {
            const int at = axis == 1 && places->level ? 0 : pixel[k];
            cells[k] = places->cell[axis][at];
            fracs[k] = places->frac[axis][at];
        }
        const Int8 cell = *(const Int8 *)cells;
        voxel[axis] = cell >> shift;
        frac[axis] = CONVERT(cell - (voxel[axis] << shift), Float8) + *(const Float8 *)fracs;
        frac[axis] *= 1.0f / (float)(1 << shift);
    }
    *(Int8 *)p->voxel = voxel[1] * (int32_t)light->stride + voxel[0];
    *(Float8 *)p->fu = frac[0];
    *(Float8 *)p->fv = frac[1];
}

INLINE Float8 two_of(Float4 a, Float4 b)
{
    return SHUFFLE(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}

INLINE Float8 load_both(const float *a, const float *b)
{
    return two_of(*(const Float4 *)a, *(const Float4 *)b);
}

/* By turns one of a and one of b, from the low and from the high half of each 128 bits. */
INLINE Float8 weave_low(Float8 a, Float8 b)
{
    return SHUFFLE(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
}

INLINE Float8 weave_high(Float8 a, Float8 b)
{
    return SHUFFLE(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}

/* Gradients of eight samples, as three vectors. */
INLINE void gradient_8(const float (*field)[4], size_t stride, const Places8 *p, Float8 g[3])
{
    Float8 two[4];
    /* Samples i and i + 4 share a vector, so that the transpose stays within 128-bit halves. */
    for (int i = 0; i < 4; i++) {
        const float(*a)[4] = field + p->voxel[i], (*b)[4] = field + p->voxel[i + 4];
        const Float8 fu = two_of(p->fu[i] - (Float4){0}, p->fu[i + 4] - (Float4){0});
        const Float8 fv = two_of(p->fv[i] - (Float4){0}, p->fv[i + 4] - (Float4){0});
        const Float8 top = lerp(load_both(a[0], b[0]), load_both(a[1], b[1]), fu);
        const Float8 bottom = lerp(load_both(a[stride], b[stride]), load_both(a[stride + 1], b[stride + 1]), fu);
        two[i] = lerp(top, bottom, fv);
    }
    const Float8 low01 = weave_low(two[0], two[1]), low23 = weave_low(two[2], two[3]);
    g[0] = SHUFFLE(low01, low23, 0, 1, 8, 9, 4, 5, 12, 13);
    g[1] = SHUFFLE(low01, low23, 2, 3, 10, 11, 6, 7, 14, 15);
    g[2] = SHUFFLE(weave_high(two[0], two[1]), weave_high(two[2], two[3]), 0, 1, 8, 9, 4, 5, 12, 13);
}

/* As cts_shade_facing(). */
INLINE Float8 facing_8(const CtsShade *s, const Float8 g[3])
{
    Float8 v[3], root = {0};
    for (int i = 0; i < 3; i++)
        v[i] = s->frame[i][0] * g[0] + s->frame[i][1] * g[1] + s->frame[i][2] * g[2];
    const Float8 square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    for (int k = 0; k < 8; k++)
        root[k] = sqrtf(square[k]);
    const Float8 facing = (Float8)((Int8)v[2] & INT32_MAX) / root;
    return (Float8)((((Int8)facing & (facing < 1)) | ((Int8)(1 - (Float8){0}) & (facing >= 1))) & (square > 0));
}

/* As cts_shade_factors(). */
INLINE void factors_8(const CtsShade *s, Float8 facing, Float8 *colour, Float8 *white)
{
    const Float8 at = facing * (float)s->n_power;
    Int8 i = CONVERT(at, Int8);
    i += i == s->n_power; /* that is, less one */
    Float8 low = {0}, high = {0};
    for (int k = 0; k < 8; k++) {
        low[k] = s->power[i[k]];
        high[k] = s->power[i[k] + 1];
    }
    *colour = s->ambient + s->diffuse * facing;
    *white = (Float8)((Int8)(s->specular * lerp(low, high, at - CONVERT(i, Float8))) & (facing > 0));
}

/* Light the n (1 to 8) pixels whose places in the row are given. */
INLINE bool light_some(float *pixels, const uint16_t *grey, const CtsEntries *entries, const CtsPlaces *places,
                       const CtsLight *light, int pixel[8], int n)
{
    Places8 p;
    Float8 g[3], h[3], colour, white;
    for (int k = n; k < 8; k++)
        pixel[k] = pixel[0];
    place_8(&p, places, pixel, light);
    gradient_8(light->first, light->stride, &p, g);
    if (light->second) {
        gradient_8(light->second, light->stride, &p, h);
        for (int c = 0; c < 3; c++)
            g[c] = lerp(g[c], h[c], light->weight - (Float8){0});
    }
    factors_8(light->shade, facing_8(light->shade, g), &colour, &white);
    bool closed = false;
    for (int k = 0; k < n; k++) {
        const float *const e = entries->entry[grey[pixel[k]]], lift = -e[3] * white[k];
        const Float4 factor = {colour[k], colour[k], colour[k], 1}, whites = {lift, lift, lift, 0};
        closed |= blend_one(pixels + 4 * (size_t)pixel[k], *(const Float4 *)e * factor + whites);
    }
    return closed;
}

/* Few of a row's samples are seen and not yet hidden: those are picked out first, so that eight fill a vector. */
static bool light(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries, const CtsPlaces *places,
                  const CtsLight *light)
{
    int pixel[72], n_pixels = 0;
    bool closed = false;
    if (entries->low > entries->high)
        return false;
    for (int i = 0; i < n; i += 64) {
        for (uint64_t shown = shown_64(grey + i, n - i, entries); shown; shown &= shown - 1) {
            const int at = i + __builtin_ctzll(shown);
            pixel[n_pixels] = at;
            n_pixels += pixels[4 * (size_t)at + 3] > 0;
        }
        int done = 0;
        for (; done + 8 <= n_pixels; done += 8)
            closed |= light_some(pixels, grey, entries, places, light, pixel + done, 8);
        n_pixels -= done;
        memmove(pixel, pixel + done, (size_t)n_pixels * sizeof *pixel);
    }
    if (n_pixels > 0)
        closed |= light_some(pixels, grey, entries, places, light, pixel, n_pixels);
    return closed;
}

/* after - before of eight grey levels. */
INLINE Float8 difference_8(const uint16_t *after, const uint16_t *before)
{
    return CONVERT(grey_8(after) - grey_8(before), Float8);
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
        const Float8 u = difference_8(row + i + 1, row + i - 1), none = {0};
        const Float8 v = difference_8(after[0] + i, before[0] + i) * rows->scale[0];
        const Float8 k = difference_8(after[1] + i, before[1] + i) * rows->scale[1];
        const Float8 uv[2] = {weave_low(u, v), weave_high(u, v)}, k0[2] = {weave_low(k, none), weave_high(k, none)};
        Float8 *to = (Float8 *)gradient[i];
        for (int h = 0; h < 2; h++) {
            const Float8 even = SHUFFLE(uv[h], k0[h], 0, 1, 8, 9, 4, 5, 12, 13);
            const Float8 odd = SHUFFLE(uv[h], k0[h], 2, 3, 10, 11, 6, 7, 14, 15);
            to[h] = SHUFFLE(even, odd, 0, 1, 2, 3, 8, 9, 10, 11);
            to[h + 2] = SHUFFLE(even, odd, 4, 5, 6, 7, 12, 13, 14, 15);
        }
    }
    for (; i < i1; i++)
        one_gradient(rows, i, gradient[i]);
}

void cts_simd_init_plain(CtsSimd *simd)
{
    *simd = (CtsSimd){scatter, mark, place, sample, blend, light, gradient};
}
