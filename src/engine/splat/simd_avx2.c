/* The AVX2 path. Compiled with -mavx2 and without fused multiply-add; called only where the processor has it. */
#include "engine/splat/simd.h"

#if defined(__AVX2__)

#include "base/mutation.h"
#include "engine/splat/simd_one.h"
#include <immintrin.h>
#include <stdbool.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

/* Voxels to splat: where their first tap goes, and the change of grey. Neighbours' footprints overlap, and to add to
 * what was stored a moment ago stalls; so of a list every TURNS-th voxel is taken before the next ones. */
enum { TURNS = 4, ENOUGH = 128, MOST = ENOUGH + 64 + 8 };

typedef struct List {
    int n;
    int32_t column[MOST];
    uint32_t change[MOST];
} List;

/* Add voxels i..i+n-1, eight at a time as long as that stays below voxel `end`. */
INLINE void list_run(List *l, const CtsScatter *job, int i, int n, int end)
{
    const int density = job->footprint->density[0], past = i + n;
    const __m256i base = _mm256_set1_epi32((int)job->base), steps = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256i columns = _mm256_mullo_epi32(steps, _mm256_set1_epi32(density));
    int at = l->n;
    l->n += n;
    for (; i < past && i + 8 <= end; i += 8, at += 8) {
        const __m256i value = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(job->value + i)));
        const __m256i old = job->old ? _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(job->old + i))) : base;
        _mm256_storeu_si256((__m256i *)(l->column + at), _mm256_add_epi32(columns, _mm256_set1_epi32(i * density)));
        _mm256_storeu_si256((__m256i *)(l->change + at), _mm256_sub_epi32(value, old));
    }
    for (; i < past; i++, at++) {
        l->column[at] = i * density;
        l->change[at] = (uint32_t)job->value[i] - (job->old ? (uint32_t)job->old[i] : job->base);
    }
}

INLINE void add_vector(uint32_t *to, const uint32_t *weight, __m256i change)
{
    const __m256i sum = _mm256_loadu_si256((const __m256i *)to);
    _mm256_storeu_si256((__m256i *)to,
                        _mm256_add_epi32(sum, _mm256_mullo_epi32(change, _mm256_loadu_si256((const __m256i *)weight))));
}

INLINE void add_half_vector(uint32_t *to, const uint32_t *weight, __m128i change)
{
    const __m128i sum = _mm_loadu_si128((const __m128i *)to);
    _mm_storeu_si128((__m128i *)to,
                     _mm_add_epi32(sum, _mm_mullo_epi32(change, _mm_loadu_si128((const __m128i *)weight))));
}

/* Rows of taps one after the other, so that a row's weights stay in registers. n_vectors 0: at most four taps. */
INLINE void scatter_list(const CtsScatter *job, const List *l, int n_vectors)
{
    uint32_t *row = job->sheet;
    for (int v = job->tap0; v < job->tap1; v++, row += job->stride) {
        const uint32_t *weight = job->footprint->weight[v];
        for (int turn = 0; turn < TURNS; turn++)
            for (int k = turn; k < l->n; k += TURNS) {
                uint32_t *to = row + l->column[k];
                if (n_vectors == 0)
                    add_half_vector(to, weight, _mm_set1_epi32((int)l->change[k]));
                for (int i = 0; i < n_vectors; i++)
                    add_vector(to + 8 * i, weight + 8 * i, _mm256_set1_epi32((int)l->change[k]));
            }
    }
}

static void scatter_marked_avx2(const CtsScatter *job, const uint64_t *marks, int i0, int i1)
{
    const int n_taps = 2 * job->footprint->reach[0] + 1;
    List list;
    list.n = 0;
    for (int i = i0; i < i1;) {
        const int first = i & ~63, past = first + 64 < i1 ? first + 64 : i1;
        uint64_t bits = marks ? marks[first / 64] : ~UINT64_C(0);
        bits &= ~UINT64_C(0) << (i - first);
        if (past - first < 64)
            bits &= (UINT64_C(1) << (past - first)) - 1;
        i = past;
        for (int at = first; bits;) {
            const int gap = __builtin_ctzll(bits);
            bits >>= gap;
            const int n = ~bits ? __builtin_ctzll(~bits) : 64;
            list_run(&list, job, at + gap, n, i1);
            at += gap + n;
            bits = n < 64 ? bits >> n : 0;
        }
        if (list.n < ENOUGH && i < i1)
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

static void scatter_avx2(const CtsScatter *job, int i0, int i1)
{
    scatter_marked_avx2(job, NULL, i0, i1);
}

/* 32 grey levels that differ, as bits. */
INLINE uint32_t differ_32(const uint16_t *value, const uint16_t *old, __m256i base)
{
    __m256i equal[2];
    for (int h = 0; h < 2; h++) {
        const __m256i b = old ? _mm256_loadu_si256((const __m256i *)(old + 16 * h)) : base;
        equal[h] = _mm256_cmpeq_epi16(_mm256_loadu_si256((const __m256i *)(value + 16 * h)), b);
    }
    const __m256i bytes = _mm256_permute4x64_epi64(_mm256_packs_epi16(equal[0], equal[1]), 0xD8);
    return ~(uint32_t)_mm256_movemask_epi8(bytes);
}

static void mark_avx2(const uint16_t *value, const uint16_t *old, uint16_t base, int n, uint64_t *marks)
{
    const __m256i bases = _mm256_set1_epi16((short)base);
    for (int i0 = 0; i0 < n; i0 += 64) {
        uint64_t word = 0;
        int i = i0;
        for (; i + 32 <= n && i < i0 + 64; i += 32)
            word |= (uint64_t)differ_32(value + i, old ? old + i : NULL, bases) << (i - i0);
        for (; i < n && i < i0 + 64; i++)
            word |= (uint64_t)(value[i] != (old ? old[i] : base)) << (i - i0);
        marks[i0 / 64] = word;
    }
}

static void widen_avx2(const uint16_t *value, int n, uint16_t *low, uint16_t *high)
{
    int i = 0;
    for (; i + 16 <= n; i += 16) {
        const __m256i v = _mm256_loadu_si256((const __m256i *)(value + i));
        __m256i *l = (__m256i *)(low + i), *h = (__m256i *)(high + i);
        _mm256_storeu_si256(l, _mm256_min_epu16(v, _mm256_loadu_si256(l)));
        _mm256_storeu_si256(h, _mm256_max_epu16(v, _mm256_loadu_si256(h)));
    }
    for (; i < n; i++) {
        low[i] = value[i] < low[i] ? value[i] : low[i];
        high[i] = value[i] > high[i] ? value[i] : high[i];
    }
}

static void place_avx2(double base, double by_x, int last, int x0, int n, int32_t *cell, float *frac)
{
    const __m256d base4 = _mm256_set1_pd(base), by_x4 = _mm256_set1_pd(by_x);
    const __m256d last_cell = _mm256_set1_pd(last > 1 ? last - 1 : 0);
    const __m128 last_frac = _mm_set1_ps(last > 0 ? 1 : 0);
    for (int i = 0; i < n; i += 4) {
        const __m128i x = _mm_add_epi32(_mm_set1_epi32(x0 + i), _mm_set_epi32(3, 2, 1, 0));
        const __m256d at = _mm256_add_pd(base4, _mm256_mul_pd(by_x4, _mm256_cvtepi32_pd(x)));
        const __m256d down = _mm256_min_pd(_mm256_max_pd(_mm256_floor_pd(at), _mm256_setzero_pd()), last_cell);
        const __m128 f = _mm256_cvtpd_ps(_mm256_sub_pd(at, down));
        _mm_storeu_si128((__m128i *)(cell + i), _mm256_cvttpd_epi32(down));
        _mm_storeu_ps(frac + i, _mm_min_ps(last_frac, _mm_max_ps(_mm_setzero_ps(), f)));
    }
}

/* Two lattice neighbours of each of eight samples. Lanes are loaded as 0 1 4 5 and 2 3 6 7, so that one shuffle within
 * 128-bit halves puts them in order; eight-byte loads do better than gathers. */
INLINE __m256i load_four(const uint32_t *sheet, int32_t a, int32_t b, int32_t c, int32_t d)
{
    const __m128i low = _mm_unpacklo_epi64(_mm_loadl_epi64((const __m128i *)(sheet + a)),
                                           _mm_loadl_epi64((const __m128i *)(sheet + b)));
    const __m128i high = _mm_unpacklo_epi64(_mm_loadl_epi64((const __m128i *)(sheet + c)),
                                            _mm_loadl_epi64((const __m128i *)(sheet + d)));
    return _mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1);
}

INLINE void load_pairs(const uint32_t *sheet, const int32_t at[8], __m256 *left, __m256 *right)
{
    const __m256i a = load_four(sheet, at[0], at[1], at[4], at[5]), b = load_four(sheet, at[2], at[3], at[6], at[7]);
    const __m256 af = _mm256_cvtepi32_ps(_mm256_srli_epi32(a, 1)), bf = _mm256_cvtepi32_ps(_mm256_srli_epi32(b, 1));
    *left = _mm256_shuffle_ps(af, bf, 0x88);
    *right = _mm256_shuffle_ps(af, bf, 0xDD);
}

INLINE __m256 lerp(__m256 a, __m256 b, __m256 t)
{
    return _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), t));
}

INLINE __m256 bilinear_8(const uint32_t *sheet, size_t stride, const int32_t at[8], __m256 fu, __m256 fv)
{
    __m256 a, b, c, d;
    load_pairs(sheet, at, &a, &b);
    load_pairs(sheet + stride, at, &c, &d);
    return lerp(lerp(a, b, fu), lerp(c, d, fu), fv);
}

/* level: as in places; sheets start at the row of cells then. */
INLINE void sample_row(const CtsSheetPair *sheets, const CtsPlaces *places, int n, uint16_t *grey, bool level)
{
    const __m256i stride = _mm256_set1_epi32((int)sheets->stride);
    for (int i = 0; i < n; i += 8) {
        const __m256 fu = _mm256_loadu_ps(places->frac[0] + i);
        const __m256 fv = level ? _mm256_broadcast_ss(places->frac[1]) : _mm256_loadu_ps(places->frac[1] + i);
        const int32_t *at = places->cell[0] + i;
        int32_t oblique[8];
        if (!level) {
            const __m256i v = _mm256_loadu_si256((const __m256i *)(places->cell[1] + i));
            const __m256i u = _mm256_loadu_si256((const __m256i *)at);
            _mm256_storeu_si256((__m256i *)oblique, _mm256_add_epi32(_mm256_mullo_epi32(v, stride), u));
            at = oblique;
        }
        __m256 value = bilinear_8(sheets->first, sheets->stride, at, fu, fv);
        if (sheets->second) {
            const __m256 other = bilinear_8(sheets->second, sheets->stride, at, fu, fv);
            value = lerp(value, other, _mm256_set1_ps(sheets->weight));
        }
        value = _mm256_mul_ps(value, _mm256_set1_ps(2.0f / CTS_WEIGHT_ONE));
        const __m256i whole = CTS_MUTATED(ROUNDING) ? _mm256_cvttps_epi32(value) : _mm256_cvtps_epi32(value);
        _mm_storeu_si128((__m128i *)(grey + i),
                         _mm_packus_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256(whole, 1)));
    }
}

static void sample_avx2(const CtsSheetPair *sheets, const CtsPlaces *places, int n, uint16_t *grey)
{
    const int32_t row = places->cell[1][0];
    if (!places->level) {
        sample_row(sheets, places, n, grey, false);
        return;
    }
    CtsSheetPair rows = *sheets;
    rows.first += (size_t)row * sheets->stride;
    if (rows.second)
        rows.second += (size_t)row * sheets->stride;
    sample_row(&rows, places, n, grey, true);
}

/* Bit i: grey level i of eight, of which n count, lies within the levels that may show. */
INLINE unsigned shown_8(const uint16_t *grey, int n, const CtsEntries *entries)
{
    const __m128i range = _mm_set1_epi16((short)(entries->high - entries->low));
    const __m128i above = _mm_sub_epi16(_mm_loadu_si128((const __m128i *)grey), _mm_set1_epi16((short)entries->low));
    const __m128i shown = _mm_cmpeq_epi16(_mm_min_epu16(above, range), above);
    const unsigned bits = (unsigned)_mm_movemask_epi8(_mm_packs_epi16(shown, _mm_setzero_si128()));
    return n < 8 ? bits & ((1u << n) - 1) : bits;
}

/* Add transmittance times entry, then let what is left of almost nothing be nothing. Returns whether that closed it. */
INLINE bool blend_one(float *pixel, __m128 entry)
{
    const __m128 floor = _mm_setr_ps(-INFINITY, -INFINITY, -INFINITY, CTS_OPAQUE_BELOW);
    const __m128 old = _mm_loadu_ps(pixel);
    const __m128 new = _mm_add_ps(old, _mm_mul_ps(_mm_permute_ps(old, 0xFF), entry));
    const __m128 open = _mm_cmpge_ps(new, floor);
    _mm_storeu_ps(pixel, _mm_and_ps(new, open));
    return _mm_movemask_ps(_mm_andnot_ps(open, _mm_cmpgt_ps(old, _mm_setzero_ps()))) >> 3;
}

/* A row of samples cut into bits: which of 64 may show. */
INLINE uint64_t shown_64(const uint16_t *grey, int n, const CtsEntries *entries)
{
    uint64_t all = 0;
    for (int i = 0; i < 64 && i < n; i += 8)
        all |= (uint64_t)shown_8(grey + i, n - i, entries) << i;
    return all;
}

static bool blend_avx2(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries)
{
    bool closed = false;
    if (entries->low > entries->high)
        return false;
    for (int i = 0; i < n; i += 64)
        for (uint64_t shown = shown_64(grey + i, n - i, entries); shown; shown &= shown - 1) {
            const int at = i + __builtin_ctzll(shown);
            closed |= blend_one(pixels + 4 * (size_t)at, _mm_load_ps(entries->entry[grey[at]]));
        }
    return closed;
}

/* Gradients of eight samples, as three vectors. */
typedef struct Gradient8 {
    __m256 g[3];
} Gradient8;

typedef struct Places8 {
    int32_t voxel[8];
    float fu[8], fv[8];
} Places8;

INLINE __m256 load_two(const float *a, const float *b)
{
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(a)), _mm_loadu_ps(b), 1);
}

INLINE __m256 two_of(const float *a, const float *b)
{
    return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_broadcast_ss(a)), _mm_broadcast_ss(b), 1);
}

INLINE Gradient8 gradient_8(const float (*field)[4], size_t stride, const Places8 *p)
{
    __m256 two[4];
    /* Samples i and i + 4 share a vector, so that the transpose stays within 128-bit halves. */
    for (int i = 0; i < 4; i++) {
        const float(*a)[4] = field + p->voxel[i], (*b)[4] = field + p->voxel[i + 4];
        const __m256 fu = two_of(&p->fu[i], &p->fu[i + 4]), fv = two_of(&p->fv[i], &p->fv[i + 4]);
        const __m256 top = lerp(load_two(a[0], b[0]), load_two(a[1], b[1]), fu);
        const __m256 bottom = lerp(load_two(a[stride], b[stride]), load_two(a[stride + 1], b[stride + 1]), fu);
        two[i] = lerp(top, bottom, fv);
    }
    const __m256 low01 = _mm256_unpacklo_ps(two[0], two[1]), low23 = _mm256_unpacklo_ps(two[2], two[3]);
    const __m256 high01 = _mm256_unpackhi_ps(two[0], two[1]), high23 = _mm256_unpackhi_ps(two[2], two[3]);
    return (Gradient8){{_mm256_shuffle_ps(low01, low23, 0x44), _mm256_shuffle_ps(low01, low23, 0xEE),
                        _mm256_shuffle_ps(high01, high23, 0x44)}};
}

INLINE __m256 mul(__m256 a, __m256 b)
{
    return _mm256_mul_ps(a, b);
}

INLINE __m256 add(__m256 a, __m256 b)
{
    return _mm256_add_ps(a, b);
}

/* As cts_shade_facing(). */
INLINE __m256 facing_8(const CtsShade *s, const Gradient8 *g)
{
    __m256 v[3];
    for (int i = 0; i < 3; i++)
        v[i] = add(add(mul(_mm256_set1_ps(s->frame[i][0]), g->g[0]), mul(_mm256_set1_ps(s->frame[i][1]), g->g[1])),
                   mul(_mm256_set1_ps(s->frame[i][2]), g->g[2]));
    const __m256 square = add(add(mul(v[0], v[0]), mul(v[1], v[1])), mul(v[2], v[2]));
    const __m256 some = _mm256_cmp_ps(square, _mm256_setzero_ps(), _CMP_GT_OQ);
    const __m256 size = _mm256_andnot_ps(_mm256_set1_ps(-0.0f), v[2]);
    const __m256 facing = _mm256_min_ps(_mm256_div_ps(size, _mm256_sqrt_ps(square)), _mm256_set1_ps(1));
    return _mm256_and_ps(facing, some);
}

/* As cts_shade_factors(). */
INLINE void factors_8(const CtsShade *s, __m256 facing, float colour[8], float white[8])
{
    const __m256 at = mul(facing, _mm256_set1_ps((float)s->n_power));
    const __m256i i = _mm256_min_epi32(_mm256_cvttps_epi32(at), _mm256_set1_epi32(s->n_power - 1));
    const __m256 low = _mm256_i32gather_ps(s->power, i, 4), high = _mm256_i32gather_ps(s->power + 1, i, 4);
    const __m256 power = lerp(low, high, _mm256_sub_ps(at, _mm256_cvtepi32_ps(i)));
    const __m256 some = _mm256_cmp_ps(facing, _mm256_setzero_ps(), _CMP_GT_OQ);
    _mm256_storeu_ps(colour, add(_mm256_set1_ps(s->ambient), mul(_mm256_set1_ps(s->diffuse), facing)));
    _mm256_storeu_ps(white, _mm256_and_ps(mul(_mm256_set1_ps(s->specular), power), some));
}

/* Voxels and fractions of eight pixels, each by its own place in the row. */
INLINE void place_8(Places8 *p, const CtsPlaces *places, const int pixel[8], const CtsLight *light)
{
    int32_t cells[2][8];
    float fracs[2][8];
    for (int axis = 0; axis < 2; axis++)
        for (int k = 0; k < 8; k++) {
            const int at = axis == 1 && places->level ? 0 : pixel[k];
            cells[axis][k] = places->cell[axis][at];
            fracs[axis][k] = places->frac[axis][at];
        }
    __m256i voxel[2];
    for (int axis = 0; axis < 2; axis++) {
        const int shift = light->shift[axis];
        const __m256i cell = _mm256_loadu_si256((const __m256i *)cells[axis]);
        voxel[axis] = _mm256_srai_epi32(cell, shift);
        const __m256 inside = _mm256_cvtepi32_ps(_mm256_sub_epi32(cell, _mm256_slli_epi32(voxel[axis], shift)));
        const __m256 frac = mul(add(inside, _mm256_loadu_ps(fracs[axis])), _mm256_set1_ps(1.0f / (float)(1 << shift)));
        _mm256_storeu_ps(axis ? p->fv : p->fu, frac);
    }
    const __m256i row = _mm256_mullo_epi32(voxel[1], _mm256_set1_epi32((int)light->stride));
    _mm256_storeu_si256((__m256i *)p->voxel, _mm256_add_epi32(row, voxel[0]));
}

/* Colour times the colour factor plus alpha times white; the fourth stays. */
INLINE __m128 lit_entry(__m128 entry, float colour, float white)
{
    const __m128 factor = _mm_blend_ps(_mm_set1_ps(colour), _mm_set1_ps(1), 8);
    const __m128 whites = _mm_blend_ps(_mm_set1_ps(white), _mm_setzero_ps(), 8);
    const __m128 alpha = _mm_xor_ps(_mm_permute_ps(entry, 0xFF), _mm_set1_ps(-0.0f));
    return _mm_add_ps(_mm_mul_ps(entry, factor), _mm_mul_ps(alpha, whites));
}

/* Light the n (1 to 8) pixels whose places in the row are given. */
INLINE bool light_some(float *pixels, const uint16_t *grey, const CtsEntries *entries, const CtsPlaces *places,
                       const CtsLight *light, int pixel[8], int n)
{
    Places8 p;
    float colour[8], white[8];
    for (int k = n; k < 8; k++)
        pixel[k] = pixel[0];
    place_8(&p, places, pixel, light);
    Gradient8 g = gradient_8(light->first, light->stride, &p);
    if (light->second) {
        const Gradient8 h = gradient_8(light->second, light->stride, &p);
        for (int c = 0; c < 3; c++)
            g.g[c] = lerp(g.g[c], h.g[c], _mm256_set1_ps(light->weight));
    }
    factors_8(light->shade, facing_8(light->shade, &g), colour, white);
    bool closed = false;
    for (int k = 0; k < n; k++)
        closed |= blend_one(pixels + 4 * (size_t)pixel[k],
                            lit_entry(_mm_load_ps(entries->entry[grey[pixel[k]]]), colour[k], white[k]));
    return closed;
}

/* Few of a row's samples are seen and not yet hidden: those are picked out first, so that eight of them fill a
 * vector.
 */
static bool light_avx2(float *pixels, const uint16_t *grey, int n, const CtsEntries *entries, const CtsPlaces *places,
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
INLINE __m256 difference_8(const uint16_t *after, const uint16_t *before)
{
    const __m256i a = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)after));
    const __m256i b = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)before));
    return _mm256_cvtepi32_ps(_mm256_sub_epi32(a, b));
}

static void gradient_avx2(const CtsGradientRows *rows, int i0, int i1, float (*gradient)[4])
{
    const uint16_t *const row = rows->row, *const *const before = rows->before, *const *const after = rows->after;
    const float *const scale = rows->scale;
    int i = i0;
    for (; i < i1 && i < 1; i++)
        cts_one_gradient(rows, i, gradient);
    for (; i + 8 <= i1 && i + 8 < rows->n; i += 8) {
        const __m256 u = difference_8(row + i + 1, row + i - 1);
        const __m256 v = mul(difference_8(after[0] + i, before[0] + i), _mm256_set1_ps(scale[0]));
        const __m256 k = mul(difference_8(after[1] + i, before[1] + i), _mm256_set1_ps(scale[1]));
        const __m256 uv_low = _mm256_unpacklo_ps(u, v), uv_high = _mm256_unpackhi_ps(u, v);
        const __m256 k_low = _mm256_unpacklo_ps(k, _mm256_setzero_ps());
        const __m256 k_high = _mm256_unpackhi_ps(k, _mm256_setzero_ps());
        const __m256 a = _mm256_shuffle_ps(uv_low, k_low, 0x44), b = _mm256_shuffle_ps(uv_low, k_low, 0xEE);
        const __m256 c = _mm256_shuffle_ps(uv_high, k_high, 0x44), d = _mm256_shuffle_ps(uv_high, k_high, 0xEE);
        float *to = gradient[i];
        _mm256_storeu_ps(to, _mm256_permute2f128_ps(a, b, 0x20));
        _mm256_storeu_ps(to + 8, _mm256_permute2f128_ps(c, d, 0x20));
        _mm256_storeu_ps(to + 16, _mm256_permute2f128_ps(a, b, 0x31));
        _mm256_storeu_ps(to + 24, _mm256_permute2f128_ps(c, d, 0x31));
    }
    for (; i < i1; i++)
        cts_one_gradient(rows, i, gradient);
}

void cts_simd_init_avx2(CtsSimd *simd)
{
    *simd = (CtsSimd){
        .scatter = scatter_avx2,
        .scatter_marked = scatter_marked_avx2,
        .mark = mark_avx2,
        .widen = widen_avx2,
        .place = place_avx2,
        .sample = sample_avx2,
        .blend = blend_avx2,
        .light = light_avx2,
        .gradient = gradient_avx2,
    };
}

#else

void cts_simd_init_avx2(CtsSimd *simd)
{
    (void)simd;
}

#endif
