#include "core/couch/table_removal.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

/* Share of the box in the radius of a regular octagon: sqrt(2) - 1. */
static const double BOX_SHARE = 0.4142;
static const CtsReach ONE = {.diamond = 1};

CtsReach cts_reach_mm(double radius_mm, const double spacing_mm[2])
{
    /* At most 10000 voxels, which voxels of 1.6 micrometres need for the largest radius, 16 mm. */
    const int r[2] = {(int)fmin(fmax(round(radius_mm / spacing_mm[0]), 1), 10000),
                      (int)fmin(fmax(round(radius_mm / spacing_mm[1]), 1), 10000)};
    const int least = r[0] < r[1] ? r[0] : r[1], diamond = least - (int)lround(BOX_SHARE * least);
    return (CtsReach){diamond, {r[0] - diamond, r[1] - diamond}};
}

/* MARGIN: rows and columns outside the section that may be set between steps, half of the word between two rows;
 * EMPTY: rows beyond them that stay 0, as far as a step reads. */
enum { MARGIN = 32, EMPTY = MARGIN };

static CtsStatus morphology_new(CtsMorphology *m, const CtsBits *like, CtsError *err)
{
    *m = (CtsMorphology){.row_words = like->row_words, .ny = (size_t)like->dims[1]};
    m->n_words = like->row_words * (size_t)like->dims[1];
    m->last_word = cts_bits_mask(like, like->row_words - 1);
    /* At least one word between two rows: half of it is margin of one, half of the other. */
    m->stride = like->row_words + (like->dims[0] % 64 != 0);
    m->n_copy = m->stride * ((size_t)like->dims[1] + 2 * (MARGIN + EMPTY)) + 2;
    const CtsStatus st = cts_alloc_zeroed(&m->buffer, 2 * m->n_copy, err);
    m->a = m->buffer + 1 + (MARGIN + EMPTY) * m->stride;
    m->b = m->a + m->n_copy;
    return st;
}

CtsStatus cts_morphologies_new(CtsMorphology **workers, const CtsBits *like, int n_threads, CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(workers, (size_t)n_threads, err);
    for (int t = 0; !st && t < n_threads; t++)
        st = morphology_new(&(*workers)[t], like, err);
    return st;
}

void cts_morphologies_free(CtsMorphology **workers, int n_threads)
{
    for (int t = 0; *workers && t < n_threads; t++)
        cts_free(&(*workers)[t].buffer);
    cts_free(workers);
}

static void copy_rows(uint64_t *to, size_t to_stride, const uint64_t *from, size_t from_stride, size_t n_rows)
{
    const size_t words = to_stride < from_stride ? to_stride : from_stride;
    if (to_stride == from_stride)
        memcpy(to, from, n_rows * words * sizeof *to);
    else
        for (size_t j = 0; j < n_rows; j++)
            memcpy(to + j * to_stride, from + j * from_stride, words * sizeof *to);
}

static void read_section(CtsMorphology *m, const uint64_t *in)
{
    copy_rows(m->a, m->stride, in, m->row_words, m->ny);
}

static void write_section(const CtsMorphology *m, uint64_t *out)
{
    copy_rows(out, m->row_words, m->a, m->stride, m->ny);
}

typedef enum Way { ALL_WAYS, ALONG, ACROSS } Way;

/* One dilation step of n voxels, 1 to MARGIN: each voxel is kept, and copied in all four directions, or in two. */
static inline __attribute__((always_inline)) void dilate_far_any_words(Way way, const uint64_t *restrict in,
                                                                       uint64_t *restrict out, size_t n_words, int n,
                                                                       ptrdiff_t rows)
{
    const int back = 64 - n;
    if (way == ALL_WAYS)
        for (size_t i = 0; i < n_words; i++) {
            const uint64_t *x = in + i;
            out[i] = x[0] | x[0] << n | x[-1] >> back | x[0] >> n | x[1] << back | x[-rows] | x[rows];
        }
    else if (way == ALONG)
        for (size_t i = 0; i < n_words; i++) {
            const uint64_t *x = in + i;
            out[i] = x[0] | x[0] << n | x[-1] >> back | x[0] >> n | x[1] << back;
        }
    else
        for (size_t i = 0; i < n_words; i++)
            out[i] = in[i] | in[(ptrdiff_t)i - rows] | in[(ptrdiff_t)i + rows];
}

CTS_CPU_VARIANTS(void, dilate_far_words,
                 (Way way, const uint64_t *in, uint64_t *out, size_t n_words, int n, ptrdiff_t rows),
                 dilate_far_any_words(way, in, out, n_words, n, rows))

/* Dilates m->a by another step; `reach` rows outside the section on either side may be set afterwards. */
static void dilate_far(CtsMorphology *m, Way way, int n, int reach)
{
    const ptrdiff_t row = (ptrdiff_t)m->stride, from = -reach * row;
    const size_t n_words = m->stride * (m->ny + 2 * (size_t)reach);
    CTS_CPU_CHOICE(cts_cpu_flags(), dilate_far_words)(way, m->a + from, m->b + from, n_words, n, n * row);
    uint64_t *const t = m->a;
    m->a = m->b;
    m->b = t;
}

/* Clears voxels outside the section in both copies, where `rows` rows on either side may be set. */
static void clear_outside(CtsMorphology *m, int rows)
{
    const size_t margin = (size_t)rows * m->stride, n = m->stride * m->ny;
    for (int copy = 0; copy < 2 && rows; copy++) {
        uint64_t *const words = copy ? m->b : m->a;
        memset(words - margin - 1, 0, (margin + 1) * sizeof *words);
        memset(words + n, 0, margin * sizeof *words);
    }
    for (size_t w = m->row_words - 1; w < n; w += m->stride) {
        m->a[w] &= m->last_word;
        if (m->stride > m->row_words)
            m->a[w + 1] = 0;
    }
}

/* A diamond of n steps becomes one of n + leap by one leap along the axes, if that is no longer than n; so it doubles
 * in each step (van den Boomgaard and van Balen). */
static void grow_diamond(CtsMorphology *m, int steps)
{
    while (steps > 0) {
        const int most = steps < MARGIN ? steps : MARGIN;
        for (int n = 0; n < most;) {
            const int further = n == 0 ? 1 : most - n < n ? most - n : n;
            n += further;
            dilate_far(m, ALL_WAYS, further, n);
        }
        clear_outside(m, most);
        steps -= most;
    }
}

/* A line of n voxels to either side, copied three times without a gap, is a longer one; no voxel between two voxels of
 * the section lies outside. */
static void grow_line(CtsMorphology *m, Way way, int steps)
{
    while (steps > 0) {
        const int most = steps < MARGIN ? steps : MARGIN;
        for (int n = 0; n < most;) {
            const int further = most - n < n + 1 ? most - n : n + 1;
            n += further;
            dilate_far(m, way, further, 0);
        }
        clear_outside(m, 0);
        steps -= most;
    }
}

static void dilate(CtsMorphology *m, CtsReach reach)
{
    grow_diamond(m, reach.diamond);
    grow_line(m, ALONG, reach.box[0]);
    grow_line(m, ACROSS, reach.box[1]);
}

static void invert(CtsMorphology *m)
{
    for (size_t w = 0; w < m->stride * m->ny; w++)
        m->a[w] = ~m->a[w];
    clear_outside(m, 0);
}

void cts_dilate_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out)
{
    read_section(m, in);
    dilate(m, reach);
    write_section(m, out);
}

static void opened(CtsMorphology *m, const uint64_t *in, CtsReach reach)
{
    read_section(m, in);
    invert(m);
    dilate(m, reach);
    invert(m);
    dilate(m, reach);
}

void cts_open_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out)
{
    opened(m, in, reach);
    write_section(m, out);
}

void cts_thin_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out)
{
    opened(m, in, reach);
    dilate(m, ONE);
    invert(m);
    for (size_t j = 0; j < m->ny; j++)
        for (size_t w = 0; w < m->row_words; w++)
            m->a[j * m->stride + w] &= in[j * m->row_words + w];
    write_section(m, out);
}

typedef struct Sections {
    CtsMorphology *workers;
    cts_section_fn change;
    const CtsBits *in;
    CtsReach reach;
    CtsBits *out;
} Sections;

static void change_some(void *context, int worker, size_t first, size_t end)
{
    const Sections *const s = context;
    for (int k = (int)first; k < (int)end; k++)
        s->change(&s->workers[worker], cts_bits_row(s->in, 0, k), s->reach, cts_bits_row(s->out, 0, k));
}

void cts_each_section(CtsMorphology *workers, int n_threads, cts_section_fn change, const CtsBits *in, CtsReach reach,
                      CtsBits *out)
{
    Sections sections = {workers, change, in, reach, out};
    cts_parallel(n_threads, (size_t)in->dims[2], 1, change_some, &sections);
}
