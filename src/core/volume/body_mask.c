#include "core/volume/body_mask.h"

#include "base/mem.h"
#include <string.h>

CtsStatus cts_body_mask_copy(CtsBodyMask **copy, const CtsBodyMask *mask, CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(copy, 1, err);
    if (st)
        return st;
    **copy = *mask;
    if ((st = cts_bits_new(&(*copy)->squares, mask->squares.dims, err)))
        cts_body_mask_free(copy);
    else
        memcpy((*copy)->squares.words, mask->squares.words,
               cts_bits_n_words(&mask->squares) * sizeof *mask->squares.words);
    return st;
}

void cts_body_mask_free(CtsBodyMask **mask)
{
    if (!*mask)
        return;
    cts_bits_free(&(*mask)->squares);
    cts_free(mask);
}

/* Sections whose columns are the volume's have its rows as they are, but for where these begin. */
static void read_row(const CtsBodyMask *mask, int j, int k, int n_words, uint64_t *row)
{
    int at[3] = {0, j + mask->first[1], k / mask->parts + mask->first[2]};
    const int across = at[mask->axis[2]], last = mask->squares.dims[2] - 1, before = across / mask->n_slices;
    const int behind = (across + 1) / mask->n_slices < last ? (across + 1) / mask->n_slices : last;
    const uint64_t *low = cts_bits_row(&mask->squares, at[mask->axis[1]], before);
    const uint64_t *high = cts_bits_row(&mask->squares, at[mask->axis[1]], behind);
    const int first = mask->first[0] / 64, shift = mask->first[0] % 64, n = (int)mask->squares.row_words;
    for (int w = 0; w < n_words; w++) {
        const int i = first + w;
        const uint64_t own = i < n ? low[i] & high[i] : 0, next = i + 1 < n ? low[i + 1] & high[i + 1] : 0;
        row[w] = shift ? own >> shift | next << (64 - shift) : own;
    }
}

void cts_body_mask_row(const CtsBodyMask *mask, int j, int k, int n_cells, uint64_t *row)
{
    const int n_words = (n_cells + 63) / 64;
    if (mask->axis[0] == 0) {
        read_row(mask, j, k, n_words, row);
    } else {
        memset(row, 0, (size_t)n_words * sizeof *row);
        for (int i = 0; i < n_cells; i++)
            row[i / 64] |= (uint64_t)cts_body_mask_has(mask, (const int[3]){i, j, k}) << i % 64;
    }
    if (n_cells % 64)
        row[n_words - 1] &= (UINT64_C(1) << n_cells % 64) - 1;
}
