/* Masks of the SIMD paths that march one packet at a time: a vector, all ones or zero in each lane. */
#ifndef CTS_TILED_MASK_TMPL_H
#define CTS_TILED_MASK_TMPL_H

#include "engine/tiled/vec_tmpl.h"

typedef vi vmask;

INLINE vmask vf_lt(vf a, vf b)
{
    return a < b;
}

INLINE vmask vf_le(vf a, vf b)
{
    return a <= b;
}

INLINE vmask vi_eq(vi a, vi b)
{
    return a == b;
}

INLINE vmask mask_and(vmask a, vmask b)
{
    return a & b;
}

INLINE vmask mask_or(vmask a, vmask b)
{
    return a | b;
}

INLINE vf vf_packets(const float of[PACKETS])
{
    return vf_of(of[0]);
}

INLINE vmask mask_packets(unsigned packets)
{
    return vi_of(-(int32_t)packets);
}

#endif
