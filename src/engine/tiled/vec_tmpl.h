/* Vectors of LANES pixels as GCC vector types: element-wise C that compiles with and without vector instructions.
 *
 * A file that includes this first defines LANES, a multiple of 8, and includes march_tmpl.h last, in between defining
 * what is not element-wise or has an instruction of its own:
 *   vf_min, vf_max, vi_min, vi_max, vs_min, vs_max, vf_fma (rounded once)
 *   vmask with vf_lt, vf_le, vi_eq, mask_and, mask_or; select_f and select_i(mask, yes, no)
 *   any_in(mask), all_in(mask): bit h tells of the lanes of packet h
 *   vf_packets(const float[PACKETS]), mask_packets(unsigned): a value, or a bit, for each packet
 *   lane_positions, Taps, make_taps: the lanes' positions on a layer
 *   load_window, load_level, load_differences: the field there
 *   weigh_pairs: the same lane by lane, where windows cannot hold them
 *   look_up_difference, look_up_rows, look_up_pairs, shade_power: tables
 * All of them give the same bits on every path. */
#ifndef CTS_TILED_VEC_TMPL_H
#define CTS_TILED_VEC_TMPL_H

#include "base/sanitized.h"
#include "engine/tiled/march.h"
#include <stdint.h>

enum { PACKETS = LANES / CTS_PACKET, ALL_PACKETS = (1 << PACKETS) - 1 };
enum { BIAS = 32768 * 16384 }; /* what a weighted sum of grey levels less 32768 lacks */

typedef float vf __attribute__((vector_size(4 * LANES)));
typedef int32_t vi __attribute__((vector_size(4 * LANES)));
typedef int16_t vs __attribute__((vector_size(16))); /* eight voxels of a row, whatever LANES is */

/* Fast paths want their small functions inlined whatever the compiler thinks; plain ones, and builds with sanitizers,
 * whose code is several times as long, do not. */
#if defined(__FMA__) && !CTS_SANITIZED
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
/* Kept out of the hot loops that call it now and then. */
#define OUTLINE static __attribute__((noinline))

/* Written out: loops over elements become one insertion for each. */
#if LANES == 8
#define CTS_PACKETS_OF(x)                                                                                              \
    {                                                                                                                  \
        x                                                                                                              \
    }
#define CTS_LANES_OF(x)                                                                                                \
    {                                                                                                                  \
        x, x, x, x, x, x, x, x                                                                                         \
    }
#else
#define CTS_PACKETS_OF(x)                                                                                              \
    {                                                                                                                  \
        x, x                                                                                                           \
    }
#define CTS_LANES_OF(x)                                                                                                \
    {                                                                                                                  \
        x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x                                                                 \
    }
#endif

INLINE vf vf_of(float x)
{
    return (vf)CTS_LANES_OF(x);
}

INLINE vi vi_of(int32_t x)
{
    return (vi)CTS_LANES_OF(x);
}

INLINE int clamp_int(int x, int low, int high)
{
    return x < low ? low : x > high ? high : x;
}

INLINE vf to_float(vi a)
{
    return __builtin_convertvector(a, vf);
}

INLINE vi to_int(vf a)
{
    return __builtin_convertvector(a, vi);
}

INLINE vf vf_abs(vf a)
{
    return (vf)((vi)a & 0x7fffffff);
}

#endif
