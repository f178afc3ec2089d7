/* Vectors of LANES rays as GCC vector types: element-wise C that compiles with and without vector instructions.
 *
 * A file that includes this first defines LANES, and EXACT for double precision, and includes cells_tmpl.h last, in
 * between defining what is not element-wise or has an instruction of its own:
 *   vf_min, vf_max, vi_min, vi_max (the second where the first is not smaller, or larger)
 *   vmask with vf_lt, vf_le, vi_lt, & | ~, bits_of(mask), mask_of(bits); select_f and select_i(mask, yes, no)
 *   look_up(table, n, index): table[index], of n entries
 *   vi_above(a, b): a > b, both without sign; share_bits(a, b): (a & b) != 0
 *   load_words(mask, cell, lanes): what the mask says of cells
 *   load_pairs(job, cell, lanes): the levels of two voxels side by side, the first in the lower half
 *   load_bytes(from, at, lanes): from[at]; three bytes behind the last may be read, too
 *   vf_log2, vf_exp2, vf_log2_rest, vf_taken; vf_inverse_root
 * All of them give the same bits on every path but the exact one. */
#ifndef CTS_TILED_VEC_TMPL_H
#define CTS_TILED_VEC_TMPL_H

#include "base/mutation.h"
#include "base/sanitized.h"
#include "engine/tiled/cells.h"
#include <math.h>
#include <stdint.h>
#include <string.h>

#ifdef EXACT
typedef double real;
typedef int64_t whole;
typedef uint64_t natural;
#else
typedef float real;
typedef int32_t whole;
typedef uint32_t natural;
#endif
typedef real vf __attribute__((vector_size(LANES * sizeof(real))));
typedef whole vi __attribute__((vector_size(LANES * sizeof(real))));
typedef natural vu __attribute__((vector_size(LANES * sizeof(real))));

/* Fast paths want their small functions inlined whatever the compiler thinks; plain ones, and builds with sanitizers,
 * whose code is several times as long, do not. */
#if defined(__FMA__) && !CTS_SANITIZED
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
/* Kept out of the hot loops that call it now and then. */
#define OUTLINE static __attribute__((noinline))

INLINE vf vf_of(real x)
{
    return x - (vf){0};
}

INLINE vi vi_of(whole x)
{
    return x - (vi){0};
}

INLINE vf to_float(vi a)
{
    return __builtin_convertvector(a, vf);
}

INLINE vi upper_half(vi pair)
{
    return (vi)((vu)pair >> 16) & 0xffff;
}

/* Towards 0. */
INLINE vi to_int(vf a)
{
    return __builtin_convertvector(a, vi);
}

INLINE vf vf_abs(vf a)
{
    return (vf)((vi)a & (sizeof(real) == 4 ? (whole)INT32_MAX : (whole)INT64_MAX));
}

/* cts_tiled_word() of cells. */
INLINE vi word_of(const TiledMask *mask, const vi cell[3])
{
    const vi block = ((cell[2] >> 2) * mask->n[1] + (cell[1] >> 2)) * mask->n[0] + (cell[0] >> 2);
    return block * 2 + (cell[2] >> 1 & 1);
}

#endif
