#include "volume/body_mask.h"

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
