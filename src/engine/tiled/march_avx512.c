/* AVX-512 primitives for the tiled engine's march, two packets at a time. Compiled for F, BW, DQ and VL; called only
 * where the processor has them. */
#include "engine/tiled/march.h"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__AVX512VL__)

#include "base/mutation.h"
#include <immintrin.h>
#include <math.h>

#define LANES 16
#include "engine/tiled/vec_tmpl.h"

typedef __mmask16 vmask;

INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm512_min_ps((__m512)a, (__m512)b);
}

INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm512_max_ps((__m512)a, (__m512)b);
}

INLINE vi vi_min(vi a, vi b)
{
    return (vi)_mm512_min_epi32((__m512i)a, (__m512i)b);
}

INLINE vi vi_max(vi a, vi b)
{
    return (vi)_mm512_max_epi32((__m512i)a, (__m512i)b);
}

INLINE vs vs_min(vs a, vs b)
{
    return (vs)_mm_min_epi16((__m128i)a, (__m128i)b);
}

INLINE vs vs_max(vs a, vs b)
{
    return (vs)_mm_max_epi16((__m128i)a, (__m128i)b);
}

INLINE vf vf_fma(vf a, vf b, vf c)
{
    return (vf)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
}

INLINE vmask vf_lt(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LT_OS);
}

INLINE vmask vf_le(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OS);
}

INLINE vmask vi_eq(vi a, vi b)
{
    return _mm512_cmpeq_epi32_mask((__m512i)a, (__m512i)b);
}

INLINE vmask mask_and(vmask a, vmask b)
{
    return _kand_mask16(a, b);
}

INLINE vmask mask_or(vmask a, vmask b)
{
    return _kor_mask16(a, b);
}

INLINE vf select_f(vmask mask, vf yes, vf no)
{
    return (vf)_mm512_mask_blend_ps(mask, (__m512)no, (__m512)yes);
}

INLINE vi select_i(vmask mask, vi yes, vi no)
{
    return (vi)_mm512_mask_blend_epi32(mask, (__m512i)no, (__m512i)yes);
}

INLINE unsigned any_in(vmask mask)
{
    return (unsigned)((mask & 0xff) != 0) | (unsigned)(mask > 0xff) << 1;
}

INLINE unsigned all_in(vmask mask)
{
    return (unsigned)((mask & 0xff) == 0xff) | (unsigned)(mask >= 0xff00) << 1;
}

INLINE vf vf_packets(const float of[PACKETS])
{
    return (vf)_mm512_mask_blend_ps(0xff00, _mm512_set1_ps(of[0]), _mm512_set1_ps(of[1]));
}

INLINE vi vi_packets(const int32_t of[PACKETS])
{
    return (vi)_mm512_mask_blend_epi32(0xff00, _mm512_set1_epi32(of[0]), _mm512_set1_epi32(of[1]));
}

INLINE vmask mask_packets(unsigned packets)
{
    return (vmask)((packets & 1) * 0xff | (packets >> 1) * 0xff00);
}

INLINE vi clamped(vi index, int last)
{
    return vi_min(vi_max(index, vi_of(0)), vi_of(last));
}

/* Of sixteen rows of four floats, each four side by side, the columns. */
INLINE void transpose_rows(__m512 e0, __m512 e1, __m512 e2, __m512 e3, vf column[4])
{
    const __m512d rg01 = _mm512_castps_pd(_mm512_unpacklo_ps(e0, e1)),
                  bk01 = _mm512_castps_pd(_mm512_unpackhi_ps(e0, e1));
    const __m512d rg23 = _mm512_castps_pd(_mm512_unpacklo_ps(e2, e3)),
                  bk23 = _mm512_castps_pd(_mm512_unpackhi_ps(e2, e3));
    column[0] = (vf)_mm512_unpacklo_pd(rg01, rg23);
    column[1] = (vf)_mm512_unpackhi_pd(rg01, rg23);
    column[2] = (vf)_mm512_unpacklo_pd(bk01, bk23);
    column[3] = (vf)_mm512_unpackhi_pd(bk01, bk23);
}

INLINE __m128 row_difference_of(const double (*rows)[4], const int32_t *from, const int32_t *to, int lane)
{
    const double *a = rows[from[lane]], *b = rows[to[lane]];
    return _mm256_cvtpd_ps(_mm256_sub_pd(_mm256_load_pd(b), _mm256_load_pd(a)));
}

/* Of lanes first, first + 4, ... side by side. */
INLINE __m512 four_differences(const double (*rows)[4], const int32_t *from, const int32_t *to, int first)
{
    __m512 e = _mm512_castps128_ps512(row_difference_of(rows, from, to, first));
    e = _mm512_insertf32x4(e, row_difference_of(rows, from, to, first + 4), 1);
    e = _mm512_insertf32x4(e, row_difference_of(rows, from, to, first + 8), 2);
    return _mm512_insertf32x4(e, row_difference_of(rows, from, to, first + 12), 3);
}

/* Rows `to` less rows `from`, both clamped to 0..last, subtracted as doubles. */
INLINE void look_up_difference(const double (*rows)[4], int last, vi from, vi to, vf d[4])
{
    int32_t a[LANES] __attribute__((aligned(64))), b[LANES] __attribute__((aligned(64)));
    _mm512_store_si512(a, (__m512i)clamped(from, last));
    _mm512_store_si512(b, (__m512i)clamped(to, last));
    __asm__("" : "+m"(a), "+m"(b)); /* loads of offsets cost less than taking the vectors apart */
    transpose_rows(four_differences(rows, a, b, 0), four_differences(rows, a, b, 1), four_differences(rows, a, b, 2),
                   four_differences(rows, a, b, 3), d);
}

INLINE __m512 four_table_rows(const float (*rows)[4], const int32_t *at, int first)
{
    __m512 e = _mm512_castps128_ps512(_mm_load_ps(rows[at[first]]));
    e = _mm512_insertf32x4(e, _mm_load_ps(rows[at[first + 4]]), 1);
    e = _mm512_insertf32x4(e, _mm_load_ps(rows[at[first + 8]]), 2);
    return _mm512_insertf32x4(e, _mm_load_ps(rows[at[first + 12]]), 3);
}

/* Rows index, clamped to 0..last. */
INLINE void look_up_rows(const float (*rows)[4], int last, vi index, vf row[4])
{
    int32_t at[LANES] __attribute__((aligned(64)));
    _mm512_store_si512(at, (__m512i)clamped(index, last));
    __asm__("" : "+m"(at));
    transpose_rows(four_table_rows(rows, at, 0), four_table_rows(rows, at, 1), four_table_rows(rows, at, 2),
                   four_table_rows(rows, at, 3), row);
}

INLINE __m128 two_pairs(const float (*rows)[2], const int32_t *at)
{
    const __m128 one = _mm_castpd_ps(_mm_load_sd((const double *)(const void *)rows[at[0]]));
    return _mm_loadh_pi(one, (const __m64 *)(const void *)rows[at[1]]);
}

/* Of lanes 0 and 1 of every four: a gather would take longer. */
INLINE __m512 eight_pairs(const float (*rows)[2], const int32_t *at)
{
    __m512 e = _mm512_castps128_ps512(two_pairs(rows, at));
    e = _mm512_insertf32x4(e, two_pairs(rows, at + 4), 1);
    e = _mm512_insertf32x4(e, two_pairs(rows, at + 8), 2);
    return _mm512_insertf32x4(e, two_pairs(rows, at + 12), 3);
}

INLINE void look_up_pairs(const float (*rows)[2], int last, vi index, vf pair[2])
{
    int32_t at[LANES] __attribute__((aligned(64)));
    _mm512_store_si512(at, (__m512i)clamped(index, last));
    __asm__("" : "+m"(at));
    const __m512 left = eight_pairs(rows, at), right = eight_pairs(rows, at + 2);
    pair[0] = (vf)_mm512_shuffle_ps(left, right, 0x88);
    pair[1] = (vf)_mm512_shuffle_ps(left, right, 0xdd);
}

/* facing to the power of the preset, from shade's table. */
INLINE vf shade_power(const CtsShade *shade, vf facing)
{
    const vf at = facing * (float)shade->n_power;
    const vi i = vi_min(to_int(at), vi_of(shade->n_power - 1));
    const vf low = (vf)_mm512_i32gather_ps((__m512i)i, shade->power, 4);
    const vf high = (vf)_mm512_i32gather_ps((__m512i)i, shade->power + 1, 4);
    return low + (high - low) * (at - to_float(i));
}

/* Where the lanes' rays meet a sheet: one window of 16 x 4 voxels for all of them where they fit, else one of 8 x 3 for
 * every four. */
typedef struct Taps {
    const uint16_t *at[LANES / 4]; /* the windows' first voxels, in layer q = 0 */
    bool one;                      /* only at[0] is used, with upper and lower; else all four, with pick and row1 */
    vi upper, lower; /* where in the window's 64 voxels a lane's pair of columns stands, in its two rows */
    vi pick;         /* bytes that fetch a pair of columns from a row of 8 */
    vmask row1;      /* where the upper row is the window's second */
    vi weights;      /* 14-bit weights of the two columns, packed as two int16 */
    vf fy;
} Taps;

INLINE vi both_packets(const int32_t of[CTS_PACKET])
{
    return (vi)_mm512_broadcast_i32x8(_mm256_loadu_si256((const __m256i *)of));
}

/* Positions of the packets' lanes, offsets from `first`, in 2^-16 voxels. */
INLINE vi lane_positions(const int32_t first[PACKETS], const int32_t lanes[CTS_PACKET])
{
    return vi_packets(first) + both_packets(lanes);
}

/* One window; u and v are the lanes' positions, inside the volume. */
INLINE Taps one_window(const TiledJob *j, const int32_t pu[PACKETS], const int32_t pv[PACKETS], vi u, vi v, bool inner)
{
    const int32_t first_u = j->half_u[0] < j->half_u[4] ? j->half_u[0] : j->half_u[4];
    const int32_t first_v = j->half_v[0] < j->half_v[4] ? j->half_v[0] : j->half_v[4];
    const int cu = ((pu[0] < pu[1] ? pu[0] : pu[1]) + first_u) >> 16;
    const int cv = ((pv[0] < pv[1] ? pv[0] : pv[1]) + first_v) >> 16;
    /* Loads must stay inside the layer, whatever the lanes do. */
    const int at_u = clamp_int(cu, 0, j->nu - 16), at_v = clamp_int(cv, 0, j->nv - 4);
    vi column = u >> 16, row = v >> 16, right = u & 0xffff, down = v & 0xffff;
    if (!inner) {
        /* At the far faces u and v are whole: take the voxel before, with full weight for the one behind. */
        column = vi_min(column, vi_of(j->nu - 2));
        row = vi_min(row, vi_of(j->nv - 2));
        right = u - (column << 16);
        down = v - (row << 16);
    }
    const vi wx = right >> 2, place = (row << 4) + column - (at_v * 16 + at_u);
    Taps t; /* all of it set one by one: zeroing it first would cost more than the rest */
    t.one = true;
    for (int i = 0; i < LANES / 4; i++)
        t.at[i] = j->layer0 + at_v * j->row_stride + at_u;
    t.row1 = 0;
    t.pick = vi_of(0);
    t.upper = (place << 16) + place + 0x10000;
    t.lower = t.upper + 0x100010;
    t.weights = (wx << 16) - wx + 16384;
    t.fy = to_float(down) * (1.0f / 65536);
    return t;
}

/* A window for every four lanes, as in taps_tmpl.h. */
INLINE Taps four_windows(const TiledJob *j, const int32_t pu[PACKETS], const int32_t pv[PACKETS], vi u, vi v,
                         bool inner)
{
    Taps t;
    t.one = false;
    t.upper = t.lower = vi_of(0);
    vi iu = (vi_packets(pu) + both_packets(j->half_u)) >> 16, iv = (vi_packets(pv) + both_packets(j->half_v)) >> 16;
    if (!inner) {
        iu = vi_min(vi_max(iu, vi_of(0)), vi_of(j->window_u));
        iv = vi_min(vi_max(iv, vi_of(0)), vi_of(j->window_v));
    }
    for (int i = 0; i < LANES / 4; i++) {
        int cu = (pu[i / 2] + j->half_u[i % 2 * 4]) >> 16, cv = (pv[i / 2] + j->half_v[i % 2 * 4]) >> 16;
        if (!inner) {
            cu = clamp_int(cu, 0, j->window_u);
            cv = clamp_int(cv, 0, j->window_v);
        }
        t.at[i] = j->layer0 + cv * j->row_stride + cu;
    }
    const vi x0 = vi_min((u >> 16) - iu, vi_of(6)), wx = (u - ((x0 + iu) << 16)) >> 2, down = v - (iv << 16);
    t.pick = x0 * 0x02020202 + 0x03020100;
    t.weights = (wx << 16) | (16384 - wx);
    t.row1 = _mm512_cmpge_epi32_mask((__m512i)down, _mm512_set1_epi32(1 << 16));
    t.fy = to_float(select_i(t.row1, down - (1 << 16), down)) * (1.0f / 65536);
    return t;
}

/* The windows for packets whose first pixels are at (pu, pv), in 2^-16 voxels. inner: all of it is far enough from the
 * volume's faces to need no clamping. */
INLINE Taps make_taps(const TiledJob *j, const int32_t pu[PACKETS], const int32_t pv[PACKETS], bool one, bool inner)
{
    vi u = lane_positions(pu, j->lane_u), v = lane_positions(pv, j->lane_v);
    if (!inner) {
        u = vi_min(vi_max(u, vi_of(0)), vi_of((j->nu - 1) << 16));
        v = vi_min(vi_max(v, vi_of(0)), vi_of((j->nv - 1) << 16));
    }
    return one ? one_window(j, pu, pv, u, v, inner) : four_windows(j, pu, pv, u, v, inner);
}

INLINE __m512i two_rows(const uint16_t *at, ptrdiff_t row_stride)
{
    const __m512i low = _mm512_castsi256_si512(_mm256_loadu_si256((const __m256i *)at));
    return _mm512_inserti64x4(low, _mm256_loadu_si256((const __m256i *)(at + row_stride)), 1);
}

/* As in march_c.c. */
INLINE vi weigh_pairs(const uint16_t *layer, vi at, vi weights)
{
    const __m512i pairs = _mm512_i32gather_epi32((__m512i)at, layer, 2);
    return (vi)_mm512_madd_epi16(_mm512_xor_si512(pairs, _mm512_set1_epi32((int)0x80008000)), (__m512i)weights);
}

INLINE __m512i four_rows(const Taps *t, ptrdiff_t offset)
{
    __m512i row = _mm512_castsi128_si512(_mm_loadu_si128((const __m128i *)(t->at[0] + offset)));
    row = _mm512_inserti32x4(row, _mm_loadu_si128((const __m128i *)(t->at[1] + offset)), 1);
    row = _mm512_inserti32x4(row, _mm_loadu_si128((const __m128i *)(t->at[2] + offset)), 2);
    return _mm512_inserti32x4(row, _mm_loadu_si128((const __m128i *)(t->at[3] + offset)), 3);
}

/* The pairs of voxels in the lanes' upper and lower rows, by shuffles instead of a gather: from one window's four rows
 * in two registers, or from the three rows of four windows in as many. */
INLINE void pick_of_one(const Taps *t, __m512i high, __m512i low, __m512i *upper, __m512i *lower)
{
    *upper = _mm512_permutex2var_epi16(high, (__m512i)t->upper, low);
    *lower = _mm512_permutex2var_epi16(high, (__m512i)t->lower, low);
}

INLINE void pick_of_four(const Taps *t, __m512i row0, __m512i row1, __m512i row2, __m512i *upper, __m512i *lower)
{
    const __m512i pick = (__m512i)t->pick, p1 = _mm512_shuffle_epi8(row1, pick);
    *upper = _mm512_mask_blend_epi32(t->row1, _mm512_shuffle_epi8(row0, pick), p1);
    *lower = _mm512_mask_blend_epi32(t->row1, p1, _mm512_shuffle_epi8(row2, pick));
}

/* Weighted sums of the pairs, in 2^-14, less 32768. */
INLINE void weigh_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride, __m512i *upper, __m512i *lower)
{
    const __m512i bias = _mm512_set1_epi32((int)0x80008000), weights = (__m512i)t->weights;
    if (t->one) {
        const uint16_t *at = t->at[0] + offset;
        pick_of_one(t, two_rows(at, row_stride), two_rows(at + 2 * row_stride, row_stride), upper, lower);
    } else {
        pick_of_four(t, four_rows(t, offset), four_rows(t, offset + row_stride), four_rows(t, offset + 2 * row_stride),
                     upper, lower);
    }
    *upper = _mm512_madd_epi16(_mm512_xor_si512(*upper, bias), weights);
    *lower = _mm512_madd_epi16(_mm512_xor_si512(*lower, bias), weights);
}

INLINE vf load_window(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    __m512i upper, lower;
    weigh_window(t, offset, row_stride, &upper, &lower);
    const vf a = (vf)_mm512_cvtepi32_ps(upper), b = (vf)_mm512_cvtepi32_ps(lower);
    return vf_fma(vf_fma(t->fy, b - a, a), vf_of(1.0f / 16384), vf_of(32768));
}

INLINE vf of_rows(const Taps *t, __m512i upper, __m512i lower)
{
    const vf a = (vf)_mm512_cvtepi32_ps(upper), b = (vf)_mm512_cvtepi32_ps(lower);
    return a + t->fy * (b - a);
}

/* One window's differences fit 16 bits: they are taken before they are picked. */
INLINE vf narrow_difference(const Taps *t, const uint16_t *minus, const uint16_t *plus, ptrdiff_t row_stride)
{
    const ptrdiff_t two = 2 * row_stride;
    const __m512i high = _mm512_sub_epi16(two_rows(plus, row_stride), two_rows(minus, row_stride));
    const __m512i low = _mm512_sub_epi16(two_rows(plus + two, row_stride), two_rows(minus + two, row_stride));
    __m512i upper, lower;
    pick_of_one(t, high, low, &upper, &lower);
    return of_rows(t, _mm512_madd_epi16(upper, (__m512i)t->weights), _mm512_madd_epi16(lower, (__m512i)t->weights));
}

INLINE vf wide_difference(const Taps *t, ptrdiff_t minus, ptrdiff_t plus, ptrdiff_t row_stride)
{
    __m512i upper, lower, upper_minus, lower_minus;
    weigh_window(t, plus, row_stride, &upper, &lower);
    weigh_window(t, minus, row_stride, &upper_minus, &lower_minus);
    return of_rows(t, _mm512_sub_epi32(upper, upper_minus), _mm512_sub_epi32(lower, lower_minus));
}

/* As in march_c.c. */
INLINE vf load_level(const Taps *t, ptrdiff_t offset, ptrdiff_t row_stride)
{
    const __m512i bias = _mm512_set1_epi32(BIAS);
    __m512i upper, lower;
    weigh_window(t, offset, row_stride, &upper, &lower);
    return of_rows(t, _mm512_add_epi32(upper, bias), _mm512_add_epi32(lower, bias));
}

/* As in march_c.c. */
INLINE void load_differences(const Taps *t, const ptrdiff_t minus[3], const ptrdiff_t plus[3], ptrdiff_t row_stride,
                             bool narrow, vf d[3])
{
    if (t->one && narrow)
        for (int axis = 0; axis < 3; axis++)
            d[axis] = narrow_difference(t, t->at[0] + minus[axis], t->at[0] + plus[axis], row_stride);
    else
        for (int axis = 0; axis < 3; axis++)
            d[axis] = wide_difference(t, minus[axis], plus[axis], row_stride);
}

#include "engine/tiled/march_tmpl.h"

void cts_tiled_packets_avx512(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    run_packets(job, beam, spans, counts);
}

#else

void cts_tiled_packets_avx512(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts)
{
    cts_tiled_packets_avx2(job, beam, spans, counts);
    cts_tiled_packets_avx2(job, beam, spans + 1, counts);
}

#endif
