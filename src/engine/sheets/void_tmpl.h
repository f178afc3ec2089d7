/* Layers of blocks in which a rectangle of pixels may see anything, sixteen at a time; needs sample_tmpl.h. */
#include "base/mutation.h"
#include "engine/sheets/sheets.h"

/* Box of voxels along a and b that the rays of a rectangle of pixels pass in layer 0 of blocks, and its shift from
 * layer to layer; voxels. */
typedef struct Shaft {
    float low[2], high[2], shift[2];
} Shaft;

/* Shaft of pixels x[0] to x[1], y[0] to y[1]. That of a part of them lies within it, also as rounded. */
INLINE Shaft shaft_of(const SheetsView *v, const int x[2], const int y[2])
{
    Shaft s;
    for (int c = 0; c < 2; c++) {
        const bool left = v->right[c] < 0, up = v->down[c] < 0; /* positions decrease along a row or a column */
        const double shift = SHEETS_BLOCK * v->shear[c];
        s.shift[c] = (float)shift;
        s.low[c] =
            (float)(v->origin[c] + x[left] * v->right[c] + y[up] * v->down[c] + (shift < 0 ? shift : 0) - v->margin);
        s.high[c] =
            (float)(v->origin[c] + x[!left] * v->right[c] + y[!up] * v->down[c] + (shift > 0 ? shift : 0) + v->margin);
    }
    return s;
}

/* Most blocks that a shaft meets along an axis of a layer: two more than its width in whole blocks, and one for
 * rounding. */
INLINE int blocks_across(const Shaft *s, const SheetsVoid *v, int axis)
{
    const float width = (s->high[axis] - s->low[axis]) * (1.0f / SHEETS_BLOCK);
    return width < (float)v->n[axis] ? (int)width + 3 : v->n[axis];
}

/* Bits of `of`, of layers from `first` on, in which the shaft meets a potentially visible block. */
INLINE unsigned visible_layers(const SheetsJob *job, const Shaft *shaft, int first, unsigned of)
{
    const SheetsVoid *const v = job->blocks;
    const wi layer = wi_min(wi_add(wi_lanes(), wi_of(first)), wi_of(v->n_layers - 1));
    const wf number = wi_to_float(layer);
    wmask meets = wmask_of_bits(of);
    wi from[2], to[2], any = wi_of(0);
    for (int c = 0; c < 2; c++) {
        const wf shift = wf_times(number, shaft->shift[c]);
        const wf low = wf_add(shift, wf_of(shaft->low[c])), high = wf_add(shift, wf_of(shaft->high[c]));
        const float most = (float)(v->n[c] - 1), per = 1.0f / SHEETS_BLOCK, off = CTS_MUTATED(SHEET_SHAFT) ? -1 : 0;
        meets = wmask_and(meets, wmask_and(wf_le(wf_of(0), high), wf_le(low, wf_of((float)(job->view.n[c] - 1)))));
        from[c] = wf_to_int(wf_clamp(wf_scale(low, per, off), 0, most));
        to[c] = wf_to_int(wf_clamp(wf_scale(high, per, off), 0, most));
    }
    if (!wmask_any(meets))
        return 0;
    const int rows = blocks_across(shaft, v, 1), columns = blocks_across(shaft, v, 0);
    for (int column = 0; column < columns; column += SHEETS_WORD_STEP) {
        /* Up to 15 bits of the word lie in front of the shaft's first block. */
        const wi begin = wi_add(from[0], wi_of(column)), n = wi_sub(wi_add(to[0], wi_of(1)), begin);
        const wi bit = wi_and(begin, wi_of(SHEETS_WORD_STEP - 1));
        const wi word = wi_min(wi_shr(begin, SHEETS_WORD_SHIFT), wi_of(v->row_words - 1));
        const wi above = wi_sub(wi_of(32), wi_min(wi_max(n, wi_of(1)), wi_of(SHEETS_WORD_STEP)));
        wi some = wi_of(0);
        for (int row = 0; row < rows; row++) {
            const wi at = wi_add(wi_mul(layer, wi_of(v->n[1])), wi_min(wi_add(from[1], wi_of(row)), to[1]));
            some = wi_or(some, wi_take(v->bits, wi_add(wi_mul(at, wi_of(v->row_words)), word)));
        }
        any = wi_or(any, wi_select(wi_gt(n, wi_of(0)), wi_shl_each(wi_shr_each(some, bit), above), wi_of(0)));
    }
    return wmask_bits(wmask_and(meets, wi_nonzero(any)));
}

static bool find_visible(const SheetsJob *job, const int x[2], const int y[2], const uint64_t *of, uint64_t *bits)
{
    const int n_layers = job->blocks->n_layers;
    const Shaft shaft = shaft_of(&job->view, x, y);
    uint64_t any = 0;
    for (int word = 0; word < cts_sheets_words(n_layers); word++) {
        bits[word] = 0;
        for (int first = 64 * word; first < n_layers && first < 64 * (word + 1); first += SHEETS_LANES) {
            const int n = n_layers - first;
            unsigned some = n < SHEETS_LANES ? (1U << n) - 1 : (1U << SHEETS_LANES) - 1;
            some &= of ? (unsigned)(of[word] >> first % 64) : some;
            if (some)
                bits[word] |= (uint64_t)visible_layers(job, &shaft, first, some) << first % 64;
        }
        any |= bits[word];
    }
    return any;
}
