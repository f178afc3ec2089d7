/* Loads of voxels: lane by lane, or by gathers (GATHERS), which need offsets of 32 bits and voxels adjacent along x.
 * Lanes outside the mask are 0. */

#ifdef GATHERS

/* Numbers of rays. */
INLINE vf load_of_rays(const real table[TILED_RAYS], vi ray)
{
    return vf_look_up(table, TILED_RAYS, ray);
}

INLINE vi voxel_of(const TiledJob *j, const vi cell[3])
{
    return cell[0] + cell[1] * (int32_t)j->stride[1] + cell[2] * (int32_t)j->stride[2];
}

/* cts_tiled_word() of cells. */
INLINE vi load_words(const TiledMask *mask, const vi cell[3], vmask lanes)
{
    const vi block = ((cell[2] >> 2) * mask->n[1] + (cell[1] >> 2)) * mask->n[0] + (cell[0] >> 2);
    return vi_gather(mask->words, block * 2 + (cell[2] >> 1 & 1), lanes);
}

/* Voxel (x, y, z) and the next along x, for the rows y, y + 1 of the layers z, z + 1. */
INLINE void load_pairs(const TiledJob *j, const vi cell[3], vmask lanes, vi pair[4])
{
    const vi at = voxel_of(j, cell);
    for (int i = 0; i < 4; i++)
        pair[i] = vi_gather_pairs(j->grey + (i & 1) * j->stride[1] + (i >> 1) * j->stride[2], at, lanes);
}

#else

INLINE vf load_of_rays(const real table[TILED_RAYS], vi ray)
{
    vf v;
    for (int l = 0; l < LANES; l++)
        v[l] = table[ray[l]];
    return v;
}

INLINE vi load_words(const TiledMask *mask, const vi cell[3], vmask lanes)
{
    vi words = vi_of(0);
    for (unsigned left = mask_bits(lanes); left; left &= left - 1) {
        const int l = __builtin_ctz(left);
        words[l] = (whole)mask->words[cts_tiled_word(mask, (int)cell[0][l], (int)cell[1][l], (int)cell[2][l])];
    }
    return words;
}

/* Voxel (x, y, z) and the next along x, for the rows y, y + 1 of the layers z, z + 1. */
INLINE void load_pairs(const TiledJob *j, const vi cell[3], vmask lanes, vi pair[4])
{
    for (int i = 0; i < 4; i++)
        pair[i] = vi_of(0);
    for (unsigned left = mask_bits(lanes); left; left &= left - 1) {
        const int l = __builtin_ctz(left);
        const uint16_t *const v = j->grey + (ptrdiff_t)cell[0][l] * j->stride[0] +
                                  (ptrdiff_t)cell[1][l] * j->stride[1] + (ptrdiff_t)cell[2][l] * j->stride[2];
        for (int i = 0; i < 4; i++) {
            const uint16_t *const p = v + (i & 1) * j->stride[1] + (i >> 1) * j->stride[2];
            pair[i][l] = (whole)(p[0] | (uint32_t)p[j->stride[0]] << 16);
        }
    }
}

#endif
