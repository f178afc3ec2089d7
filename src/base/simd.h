/* SIMD vectors for kernels: GCC vector types, and the operations that C's operators do not express.
 *
 * A kernel is a file that is compiled once for each SIMD path; base/cpu.h chooses at run time. Every operation gives
 * the same bits on every path: integers wrap, floats are rounded after each operation and never fused.
 *
 * Vectors of one register have LANES lanes: 16 with AVX-512, 8 with AVX2, else 4, the registers of SSE2 and NEON. C's
 * operators and casts work on them.
 *
 * - vf, vi, vu: float, int32_t, uint32_t lanes
 * - vs: int16_t, two for each lane
 * - vmask: one truth value a lane, made by vf_lt() and the like, combined by & | ~
 *
 * Vectors of sixteen lanes, the same on every path, consist of N_PARTS registers. They are structs: functions instead
 * of operators (wf_add(), wi_and()), and SIMD_EACH() derives further ones from operations on registers.
 *
 * - wf, wi: float and int32_t lanes
 * - ws: 32 int16_t
 * - wmask: one truth value a lane
 *
 * SIMD_DOUBLE, defined before this header is included: vf, vi, vu have lanes of 64 bits, 8, 4 or 2; vn has as many of
 * int32_t; and there are no vectors of sixteen lanes. Compilers keep vectors wider than a register in memory.
 *
 * Vectors whose lanes do not depend on the path, such as the channels of a pixel: base/simd_fixed.h. */
#pragma once

#include "base/sanitized.h"
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(SIMD_DOUBLE)
#define SIMD_PATH_PLAIN
#elif defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__AVX512VL__)
#define SIMD_PATH_AVX512
#elif defined(__AVX2__)
#define SIMD_PATH_AVX2
#else
#define SIMD_PATH_PLAIN
#endif

#ifdef SIMD_DOUBLE
#if defined(__AVX512F__) && defined(__AVX512DQ__)
#define LANES 8
#elif defined(__AVX2__)
#define LANES 4
#else
#define LANES 2
#endif
typedef double real;
typedef int64_t whole;
typedef uint64_t natural;
#else
#if defined(SIMD_PATH_AVX512)
#define LANES 16
#elif defined(SIMD_PATH_AVX2)
#define LANES 8
#else
#define LANES 4
#endif
typedef float real;
typedef int32_t whole;
typedef uint32_t natural;
#endif

#define SIMD_VECTOR(element) __attribute__((vector_size(LANES * sizeof(element))))
typedef real vf SIMD_VECTOR(real);
typedef whole vi SIMD_VECTOR(real);
typedef natural vu SIMD_VECTOR(real);
typedef int16_t vs SIMD_VECTOR(real);

/* Functions of SIMD paths are always inlined. In plain C, and with sanitizers, whose code is several times as long, the
 * compiler decides. */
#if defined(__FMA__) && !CTS_SANITIZED
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
/* For functions that hot loops call seldom. */
#define OUTLINE static __attribute__((noinline))

/* Defines a function that returns `value`. */
#define SIMD_OP(type, name, parameters, value)                                                                         \
    INLINE type name parameters                                                                                        \
    {                                                                                                                  \
        return value;                                                                                                  \
    }

SIMD_OP(vf, vf_of, (real x), x - (vf){0})
SIMD_OP(vi, vi_of, (whole x), x - (vi){0})
SIMD_OP(vs, vs_of, (int16_t x), x - (vs){0})

/* Unaligned loads and stores, name_load and name_store. */
#define SIMD_MEMORY(name, element)                                                                                     \
    INLINE name name##_load(const element *from)                                                                       \
    {                                                                                                                  \
        name v;                                                                                                        \
        memcpy(&v, from, sizeof v);                                                                                    \
        return v;                                                                                                      \
    }                                                                                                                  \
    INLINE void name##_store(element *to, name v)                                                                      \
    {                                                                                                                  \
        memcpy(to, &v, sizeof v);                                                                                      \
    }
SIMD_MEMORY(vf, real)
SIMD_MEMORY(vi, whole)
SIMD_MEMORY(vs, int16_t)

SIMD_OP(vf, to_float, (vi a), __builtin_convertvector(a, vf))
/* Rounds towards 0. Values outside the range of an integer are undefined. */
SIMD_OP(vi, to_int, (vf a), __builtin_convertvector(a, vi))
SIMD_OP(vf, vf_abs, (vf a), (vf)((vi)(a) & (sizeof(real) == 4 ? (whole)INT32_MAX : (whole)INT64_MAX)))
/* 16 bits of each 32, as unsigned integers. */
SIMD_OP(vi, lower_half, (vi pair), pair & 0xffff)
SIMD_OP(vi, upper_half, (vi pair), (vi)((vu)pair >> 16) & 0xffff)

/* Each path defines:
 *
 * - vf_min, vf_max, vi_min, vi_max: the second operand unless the first is smaller, or larger
 * - vf_sqrt: correctly rounded
 * - vf_lt, vf_le, vi_lt, vi_eq: comparisons, false for NaN; vu_lt: of vi as unsigned integers; vi_test: (a & b) != 0
 * - vf_select, vi_select(mask, yes, no)
 * - mask_any(mask); mask_bits(mask): bit l for lane l, and its inverse mask_of_bits(bits)
 * - vf_pack(to, from, mask): stores the lanes of the mask one after the other; behind them up to LANES are overwritten
 * - vf_look_up(table, n, index): table[index] of n entries; LANES entries may be read where n is less
 * - vi_take_bytes(from, index): from[index] of 8 bits; the three bytes behind may be read, too
 * - vi_take(from, index): from[index] of 32 bits with a sign
 * - vi_gather_bytes(from, index, mask), vi_gather() and vi_gather_pairs(): the same of some lanes, the others are 0 and
 *   nothing is read for them
 *
 * and, unless SIMD_DOUBLE is defined:
 *
 * - vi_load_shorts(from), vi_load_words(from): LANES elements of 16 bits, with and without sign
 * - vi_take_pairs(from, index): from[index] of 16 bits in the lower half, from[index + 1] in the upper half
 * - vi_take_64(from, index, scale, &second): two int32_t that begin index * scale bytes on, the first returned
 * - vs_madd(a, b): a[2 l] * b[2 l] + a[2 l + 1] * b[2 l + 1] in lane l, 32 bits
 * - vs_unsigned_max, vs_unsigned_min(a, b); vs_excess(a, b): a - b where a is more, else 0; of 16 bits without a sign
 * - vs_mul_high(a, b): upper half of the product of two unsigned 16-bit integers
 * - ws_permute(table, index): element index (0..31) of the table
 * - ws_permute2(low, high, index): element index (0..63) of two tables one after the other
 * - ws_load_rows(from, stride, n): n (1..4) rows of eight int16_t that begin `stride` elements apart; then 0 */
#ifndef SIMD_PATH_AVX512
typedef vi vmask; /* 0 or -1 */
SIMD_OP(vmask, vf_lt, (vf a, vf b), a < b)
SIMD_OP(vmask, vf_le, (vf a, vf b), a <= b)
SIMD_OP(vmask, vi_lt, (vi a, vi b), a < b)
SIMD_OP(vmask, vi_eq, (vi a, vi b), a == b)
SIMD_OP(vmask, vu_lt, (vi a, vi b), (vu)a < (vu)b)
SIMD_OP(vmask, vi_test, (vi a, vi b), (a & b) != 0)
#endif
#if defined(SIMD_DOUBLE)
typedef int32_t vn __attribute__((vector_size(LANES * sizeof(int32_t))));
SIMD_OP(vn, vn_of, (int32_t x), x - (vn){0})
SIMD_OP(vf, vn_to_float, (vn a), __builtin_convertvector(a, vf))
#include "base/simd_scalar_tmpl.h"
#else
enum { N_PARTS = 16 / LANES };
typedef struct ws {
    vs part[N_PARTS];
} ws;
#if defined(SIMD_PATH_AVX512)
#include "base/simd_avx512_tmpl.h"
#elif defined(SIMD_PATH_AVX2)
#include "base/simd_avx2_tmpl.h"
#else
#include "base/simd_scalar_tmpl.h"
#endif
#endif

#if !defined(SIMD_PATH_AVX512) || defined(SIMD_DOUBLE)
INLINE void vf_pack(real *to, vf from, vmask mask)
{
    for (unsigned left = mask_bits(mask); left; left &= left - 1)
        *to++ = from[__builtin_ctz(left)];
}
#endif

SIMD_OP(vmask, vf_gt, (vf a, vf b), vf_lt(b, a))
SIMD_OP(vmask, vi_gt, (vi a, vi b), vi_lt(b, a))

#ifndef SIMD_PATH_AVX512
/* Lanes outside the mask read what its first lane reads (first_index()), since all lanes are loaded. */
#define SIMD_GATHER(suffix)                                                                                            \
    INLINE vi vi_gather##suffix(const void *from, vi index, vmask mask)                                                \
    {                                                                                                                  \
        if (!mask_any(mask))                                                                                           \
            return vi_of(0);                                                                                           \
        return vi_select(mask, vi_take##suffix(from, vi_select(mask, index, first_index(index, mask))), vi_of(0));     \
    }
SIMD_GATHER(_bytes)
SIMD_GATHER()
#ifndef SIMD_DOUBLE
SIMD_GATHER(_pairs)
#endif
#endif

#ifndef SIMD_DOUBLE
typedef struct wf {
    vf part[N_PARTS];
} wf;
typedef struct wi {
    vi part[N_PARTS];
} wi;
typedef struct wmask {
    vmask part[N_PARTS];
} wmask;

/* Defines a function on sixteen lanes: `value` computes part[p] of its result. */
#define SIMD_EACH(type, name, parameters, value)                                                                       \
    INLINE type name parameters                                                                                        \
    {                                                                                                                  \
        type result;                                                                                                   \
        for (int p = 0; p < N_PARTS; p++)                                                                              \
            result.part[p] = value;                                                                                    \
        return result;                                                                                                 \
    }

SIMD_EACH(wf, wf_of, (float x), vf_of(x))
SIMD_EACH(wi, wi_of, (int32_t x), vi_of(x))
SIMD_EACH(ws, ws_of, (int16_t x), vs_of(x))

#define SIMD_WIDE_MEMORY(name, part_name, element)                                                                     \
    SIMD_EACH(name, name##_load, (const element *from),                                                                \
              part_name##_load(from + sizeof(part_name) / sizeof(element) * p))                                        \
    INLINE void name##_store(element *to, name v)                                                                      \
    {                                                                                                                  \
        for (int p = 0; p < N_PARTS; p++)                                                                              \
            part_name##_store(to + sizeof(part_name) / sizeof(element) * p, v.part[p]);                                \
    }
SIMD_WIDE_MEMORY(wf, vf, float)
SIMD_WIDE_MEMORY(wi, vi, int32_t)
SIMD_WIDE_MEMORY(ws, vs, int16_t)

SIMD_EACH(wf, wf_add, (wf a, wf b), a.part[p] + b.part[p])
SIMD_EACH(wf, wf_sub, (wf a, wf b), a.part[p] - b.part[p])
SIMD_EACH(wf, wf_mul, (wf a, wf b), a.part[p] * b.part[p])
SIMD_EACH(wf, wf_div, (wf a, wf b), a.part[p] / b.part[p])
SIMD_EACH(wf, wf_min, (wf a, wf b), vf_min(a.part[p], b.part[p]))
SIMD_EACH(wf, wf_max, (wf a, wf b), vf_max(a.part[p], b.part[p]))
SIMD_EACH(wf, wf_abs, (wf a), vf_abs(a.part[p]))
SIMD_EACH(wmask, wf_lt, (wf a, wf b), vf_lt(a.part[p], b.part[p]))
SIMD_EACH(wmask, wf_le, (wf a, wf b), vf_le(a.part[p], b.part[p]))
SIMD_EACH(wmask, wf_gt, (wf a, wf b), vf_gt(a.part[p], b.part[p]))
SIMD_EACH(wf, wf_select, (wmask mask, wf yes, wf no), vf_select(mask.part[p], yes.part[p], no.part[p]))

SIMD_EACH(wi, wi_add, (wi a, wi b), (vi)((vu)a.part[p] + (vu)b.part[p]))
SIMD_EACH(wi, wi_sub, (wi a, wi b), (vi)((vu)a.part[p] - (vu)b.part[p]))
SIMD_EACH(wi, wi_mul, (wi a, wi b), (vi)((vu)a.part[p] * (vu)b.part[p]))
SIMD_EACH(wi, wi_and, (wi a, wi b), a.part[p] & b.part[p])
SIMD_EACH(wi, wi_or, (wi a, wi b), a.part[p] | b.part[p])
SIMD_EACH(wi, wi_shl, (wi a, int bits), (vi)((vu)a.part[p] << bits))
SIMD_EACH(wi, wi_shr, (wi a, int bits), a.part[p] >> bits) /* arithmetic shift */
SIMD_EACH(wi, wi_min, (wi a, wi b), vi_min(a.part[p], b.part[p]))
SIMD_EACH(wi, wi_max, (wi a, wi b), vi_max(a.part[p], b.part[p]))
SIMD_EACH(wmask, wi_lt, (wi a, wi b), vi_lt(a.part[p], b.part[p]))
SIMD_EACH(wmask, wi_gt, (wi a, wi b), vi_gt(a.part[p], b.part[p]))
SIMD_EACH(wi, wi_select, (wmask mask, wi yes, wi no), vi_select(mask.part[p], yes.part[p], no.part[p]))
SIMD_EACH(wi, wi_lower_half, (wi pair), lower_half(pair.part[p]))
SIMD_EACH(wi, wi_upper_half, (wi pair), upper_half(pair.part[p]))

SIMD_EACH(wf, wi_to_float, (wi a), to_float(a.part[p]))
SIMD_EACH(wi, wf_to_int, (wf a), to_int(a.part[p]))
/* The same bits. */
SIMD_EACH(wf, wi_as_float, (wi a), (vf)a.part[p])
SIMD_EACH(wi, wf_as_int, (wf a), (vi)a.part[p])

SIMD_EACH(ws, ws_sub, (ws a, ws b), (vs)(a.part[p] - b.part[p]))
SIMD_EACH(wi, ws_madd, (ws a, ws b), vs_madd(a.part[p], b.part[p]))

SIMD_EACH(wf, wf_look_up, (const float *table, int n, wi index), vf_look_up(table, n, index.part[p]))
SIMD_EACH(wi, wi_take, (const void *from, wi at), vi_take(from, at.part[p]))
SIMD_EACH(wi, wi_take_pairs, (const void *from, wi at), vi_take_pairs(from, at.part[p]))
SIMD_EACH(wi, wi_take_64, (const void *from, wi at, ptrdiff_t scale, wi *second),
          vi_take_64(from, at.part[p], scale, &second->part[p]))

SIMD_EACH(wmask, wmask_and, (wmask a, wmask b), a.part[p] & b.part[p])
SIMD_EACH(wmask, wmask_or, (wmask a, wmask b), a.part[p] | b.part[p])
SIMD_EACH(wmask, wmask_not, (wmask a), (vmask)~a.part[p])
SIMD_EACH(wmask, wmask_of_bits, (unsigned bits), mask_of_bits(bits >> LANES * p & ((1U << LANES) - 1)))

/* Bit l for lane l. */
INLINE unsigned wmask_bits(wmask mask)
{
    unsigned bits = 0;
    for (int p = 0; p < N_PARTS; p++)
        bits |= mask_bits(mask.part[p]) << LANES * p;
    return bits;
}

INLINE bool wmask_any(wmask mask)
{
    vmask any = mask.part[0];
    for (int p = 1; p < N_PARTS; p++)
        any |= mask.part[p];
    return mask_any(any);
}

SIMD_EACH(ws, wi_as_short, (wi a), (vs)a.part[p])
SIMD_EACH(wi, ws_as_int, (ws a), (vi)a.part[p])
SIMD_EACH(wmask, wi_nonzero, (wi a), vi_test(a.part[p], a.part[p]))
SIMD_EACH(ws, ws_max, (ws a, ws b), vs_unsigned_max(a.part[p], b.part[p]))
SIMD_EACH(ws, ws_min, (ws a, ws b), vs_unsigned_min(a.part[p], b.part[p]))
SIMD_EACH(ws, ws_excess, (ws a, ws b), vs_excess(a.part[p], b.part[p]))

SIMD_EACH(wf, wf_lerp, (wf a, wf b, wf at), a.part[p] + (b.part[p] - a.part[p]) * at.part[p])
SIMD_EACH(wf, wf_mul_add, (wf a, wf b, wf c), a.part[p] * b.part[p] + c.part[p])
SIMD_EACH(wf, wf_clamp, (wf a, float low, float high), vf_min(vf_max(a.part[p], vf_of(low)), vf_of(high)))
SIMD_EACH(wf, wf_times, (wf a, float by), a.part[p] * by)
SIMD_EACH(wf, wf_scale, (wf a, float by, float plus), a.part[p] * by + plus)
SIMD_EACH(wi, wi_shl_each, (wi a, wi bits), (vi)((vu)a.part[p] << (vu)bits.part[p]))
SIMD_EACH(wi, wi_shr_each, (wi a, wi bits), (vi)((vu)a.part[p] >> (vu)bits.part[p]))
#endif
