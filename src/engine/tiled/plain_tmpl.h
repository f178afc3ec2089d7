/* What is not element-wise, lane by lane. */

typedef vi vmask;

INLINE vf select_f(vmask mask, vf yes, vf no)
{
    return (vf)((mask & (vi)yes) | (~mask & (vi)no));
}

INLINE vi select_i(vmask mask, vi yes, vi no)
{
    return (mask & yes) | (~mask & no);
}

INLINE vmask vf_lt(vf a, vf b)
{
    return a < b;
}

INLINE vmask vf_le(vf a, vf b)
{
    return a <= b;
}

INLINE vmask vi_lt(vi a, vi b)
{
    return a < b;
}

INLINE vf vf_min(vf a, vf b)
{
    return select_f(a < b, a, b);
}

INLINE vf vf_max(vf a, vf b)
{
    return select_f(a > b, a, b);
}

INLINE vi vi_min(vi a, vi b)
{
    return select_i(a < b, a, b);
}

INLINE vi vi_max(vi a, vi b)
{
    return select_i(a > b, a, b);
}

INLINE unsigned bits_of(vmask mask)
{
    unsigned bits = 0;
    for (int l = 0; l < LANES; l++)
        bits |= (unsigned)(mask[l] & 1) << l;
    return bits;
}

INLINE vmask mask_of(unsigned bits)
{
    vmask m;
    for (int l = 0; l < LANES; l++)
        m[l] = -(whole)(bits >> l & 1);
    return m;
}

INLINE vf look_up(const float *table, int n, vi index)
{
    vf v;
    (void)n;
    for (int l = 0; l < LANES; l++)
        v[l] = (real)table[index[l]];
    return v;
}

INLINE vmask vi_above(vi a, vi b)
{
    return (vu)a > (vu)b;
}

INLINE vmask share_bits(vi a, vi b)
{
    return (a & b) != 0;
}

INLINE vi load_words(const TiledMask *mask, const vi cell[3], vmask lanes)
{
    vi words = vi_of(0);
    for (int l = 0; l < LANES; l++)
        if (lanes[l])
            words[l] = (whole)mask->words[cts_tiled_word(mask, (int)cell[0][l], (int)cell[1][l], (int)cell[2][l])];
    return words;
}

INLINE vi load_bytes(const uint8_t *from, vi at, vmask lanes)
{
    vi v = vi_of(0);
    for (int l = 0; l < LANES; l++)
        if (lanes[l])
            v[l] = from[at[l]];
    return v;
}

/* Voxel (x, y, z) and the next along x, for the rows y, y + 1 of the layers z, z + 1. */
INLINE void load_pairs(const TiledJob *j, const vi cell[3], vmask lanes, vi pair[4])
{
    for (int i = 0; i < 4; i++)
        pair[i] = vi_of(0);
    for (int l = 0; l < LANES; l++) {
        if (!lanes[l])
            continue;
        const uint16_t *const v = j->grey + (ptrdiff_t)cell[0][l] * j->stride[0] +
                                  (ptrdiff_t)cell[1][l] * j->stride[1] + (ptrdiff_t)cell[2][l] * j->stride[2];
        for (int i = 0; i < 4; i++) {
            const uint16_t *const p = v + (i & 1) * j->stride[1] + (i >> 1) * j->stride[2];
            pair[i][l] = (whole)(p[0] | (uint32_t)p[j->stride[0]] << 16);
        }
    }
}
