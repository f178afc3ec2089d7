#include "table/morphology.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

/* In a regular octagon the box has this share of the radius. */
static const double BOX_SHARE = 0.4142;
static const CtsReach ONE = {.diamond = 1};

CtsReach cts_reach_mm(double radius_mm, const double spacing_mm[2])
{
    const int r[2] = {(int)fmin(fmax(round(radius_mm / spacing_mm[0]), 1), 10000),
                      (int)fmin(fmax(round(radius_mm / spacing_mm[1]), 1), 10000)};
    const int least = r[0] < r[1] ? r[0] : r[1], diamond = least - (int)lround(BOX_SHARE * least);
    return (CtsReach){diamond, {r[0] - diamond, r[1] - diamond}};
}

CtsStatus cts_morphology_new(CtsMorphology *m, const CtsBits *like, CtsError *err)
{
    *m = (CtsMorphology){.row_words = like->row_words, .n_words = like->row_words * (size_t)like->dims[1]};
    m->last_word = cts_bits_mask(like, like->row_words - 1);
    /* A row and a word of nothing before, between and behind the two copies. */
    const size_t margin = m->row_words + 1;
    const CtsStatus st = cts_alloc_zeroed(&m->buffer, 2 * m->n_words + 3 * margin, err);
    m->a = m->buffer + margin;
    m->b = m->a + m->n_words + margin;
    return st;
}

void cts_morphology_free(CtsMorphology *m)
{
    cts_free(&m->buffer);
}

/* One step: along the rows (side 1), across them (stride of a row), or both. The spare bit at the end of each row is 0,
 * so nothing comes in from the row before. */
static void step(const uint64_t *restrict in, uint64_t *restrict out, size_t n, bool along, ptrdiff_t row)
{
    if (along)
        for (size_t i = 0; i < n; i++) {
            const uint64_t *x = in + i;
            out[i] = x[0] | x[0] << 1 | x[-1] >> 63 | x[0] >> 1 | x[1] << 63 | x[-row] | x[row];
        }
    else
        for (size_t i = 0; i < n; i++)
            out[i] = in[i] | in[(ptrdiff_t)i - row] | in[(ptrdiff_t)i + row];
}

/* m->a one step further. */
static void spread(CtsMorphology *m, bool along, bool across)
{
    step(m->a, m->b, m->n_words, along, across ? (ptrdiff_t)m->row_words : 0);
    for (size_t w = m->row_words - 1; w < m->n_words; w += m->row_words)
        m->b[w] &= m->last_word;
    uint64_t *const t = m->a;
    m->a = m->b;
    m->b = t;
}

static void dilate(CtsMorphology *m, CtsReach reach)
{
    for (int n = 0; n < reach.diamond; n++)
        spread(m, true, true);
    for (int n = 0; n < reach.box[0]; n++)
        spread(m, true, false);
    for (int n = 0; n < reach.box[1]; n++)
        spread(m, false, true);
}

static void invert(CtsMorphology *m)
{
    for (size_t w = 0; w < m->n_words; w++)
        m->a[w] = ~m->a[w];
    for (size_t w = m->row_words - 1; w < m->n_words; w += m->row_words)
        m->a[w] &= m->last_word;
}

void cts_dilate_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out)
{
    memcpy(m->a, in, m->n_words * sizeof *in);
    dilate(m, reach);
    memcpy(out, m->a, m->n_words * sizeof *out);
}

static void open_section(CtsMorphology *m, const uint64_t *in, CtsReach reach)
{
    memcpy(m->a, in, m->n_words * sizeof *in);
    invert(m);
    dilate(m, reach);
    invert(m);
    dilate(m, reach);
}

void cts_open_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out)
{
    open_section(m, in, reach);
    memcpy(out, m->a, m->n_words * sizeof *out);
}

void cts_thin_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out)
{
    open_section(m, in, reach);
    dilate(m, ONE);
    for (size_t w = 0; w < m->n_words; w++)
        out[w] = in[w] & ~m->a[w];
}
