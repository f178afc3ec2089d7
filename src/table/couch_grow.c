#include "table/couch_grow.h"

#include "base/cpu.h"
#include "base/mem.h"
#include <math.h>
#include <string.h>

static const double RIM_MM = 3;

CouchRim couch_rim(const CouchScene *scene)
{
    CouchRim rim = {0};
    const double in_slice_mm = fmin(scene->spacing_mm[0], scene->spacing_mm[1]), between_mm = scene->spacing_mm[2];
    rim.n_steps = (int)fmin(fmax(ceil(RIM_MM / in_slice_mm), 2), COUCH_MAX_RIM);
    rim.n_slices = (int)fmin(fmax(ceil(RIM_MM / between_mm), 1), COUCH_MAX_RIM);
    rim.reach_mm = fmax(rim.n_steps * fmax(scene->spacing_mm[0], scene->spacing_mm[1]), rim.n_slices * between_mm);
    for (int d = 1; d <= rim.n_slices; d++) {
        const double left_mm = sqrt(fmax(RIM_MM * RIM_MM - d * between_mm * d * between_mm, 0));
        const int steps = (int)fmin(fmax(ceil(left_mm / in_slice_mm), 1), rim.n_steps);
        rim.first_step[d] = rim.n_steps - steps;
    }
    return rim;
}

CtsStatus couch_columns_new(CouchColumns *c, const CtsBits *like, int n_slices, CtsError *err)
{
    size_t n;
    *c = (CouchColumns){.n_words = (int)like->row_words, .n_rows = like->dims[1], .n_slices = n_slices};
    c->stride = (size_t)c->n_rows + 2;
    if (cts_mul_overflows(c->stride * like->row_words, (size_t)n_slices, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a mask of %d x %d x %d voxels is too large", like->dims[0], like->dims[1],
                        n_slices);
    return cts_alloc_zeroed(&c->words, n, err);
}

void couch_columns_free(CouchColumns *c)
{
    cts_free(&c->words);
}

void couch_columns_take(CouchColumns *c, const CtsBits *bits, int k, int first, int end)
{
    enum { ROWS = 64 }; /* of which all words stay in the cache */
    for (int j0 = first; j0 < end; j0 += ROWS) {
        const int j1 = end - j0 < ROWS ? end : j0 + ROWS;
        for (int w = 0; w < c->n_words; w++) {
            uint64_t *column = couch_column(c, w, k);
            const uint64_t *from = cts_bits_row(bits, 0, k) + w;
            for (int j = j0; j < j1; j++)
                column[j] = from[(size_t)j * bits->row_words];
        }
    }
}

void couch_expand_cells(const CouchGrid *g, const CtsBits *cells, int cj, int ck, const CtsBits *like, uint64_t *row)
{
    const int nx = like->dims[0];
    const uint64_t *from = cts_bits_row(cells, cj, ck);
    memset(row, 0, like->row_words * sizeof *row);
    for (size_t w = 0; w < cells->row_words; w++)
        for (uint64_t set = from[w], run; set; set &= ~run) {
            run = set & ~(set + (set & -set)); /* the lowest ones that follow each other */
            const int first = ((int)(64 * w) + __builtin_ctzll(run)) * g->block[0];
            const int end = first + cts_popcount(run) * g->block[0];
            cts_bits_fill(row, first, end < nx ? end : nx);
        }
}

static CtsStatus side_new(CouchSide *side, const CouchGrid *g, const CtsBits *like, const CouchColumns *whole,
                          CtsError *err)
{
    CtsStatus st;
    const size_t most = like->row_words * ((size_t)g->dims[1] / 2 + 1);
    side->whole = whole;
    if ((st = couch_columns_new(&side->grown, like, 1, err)) || (st = couch_columns_new(&side->next, like, 1, err)) ||
        (st = cts_alloc_array(&side->spans.items, most, err)))
        return st;
    return CTS_OK;
}

static void side_free(CouchSide *side)
{
    couch_columns_free(&side->grown);
    couch_columns_free(&side->next);
    cts_free(&side->spans.items);
}

CtsStatus couch_grower_new(CouchGrower *grower, const CouchGrid *g, const CtsBits *like, const CouchColumns *body,
                           const CouchColumns *foreign, CtsError *err)
{
    CtsStatus st;
    grower->last_word = cts_bits_mask(like, like->row_words - 1);
    if ((st = side_new(&grower->body, g, like, body, err)) ||
        (st = side_new(&grower->foreign, g, like, foreign, err)) ||
        (st = cts_alloc_zeroed(&grower->zeros, (size_t)like->dims[1] + 2, err)) ||
        (st = cts_alloc_array(&grower->in_use, like->row_words * (size_t)g->dims[1], err)))
        return st;
    return CTS_OK;
}

void couch_grower_free(CouchGrower *grower)
{
    side_free(&grower->body);
    side_free(&grower->foreign);
    cts_free(&grower->zeros);
    cts_free(&grower->in_use);
}

/* in_use: one flag for each column and row of cells. */
static void find_spans(CouchSpans *spans, const CouchGrid *g, const CtsBits *cells, int ck, const CtsBits *like,
                       uint8_t *in_use)
{
    uint64_t row[CTS_BITS_ROW_WORDS];
    const int n_words = (int)like->row_words, n_cells = g->dims[1];
    for (int cj = 0; cj < n_cells; cj++) {
        couch_expand_cells(g, cells, cj, ck, like, row);
        for (int w = 0; w < n_words; w++)
            in_use[(size_t)w * (size_t)n_cells + (size_t)cj] = row[w] != 0;
    }
    spans->n = 0;
    for (int w = 0; w < n_words; w++) {
        const uint8_t *used = in_use + (size_t)w * (size_t)n_cells;
        for (int cj = 0, end; cj < n_cells; cj = end) {
            for (end = cj + 1; end < n_cells && used[end] == used[cj];)
                end++;
            const int last = couch_cell_end(g, 1, end - 1);
            if (used[cj])
                spans->items[spans->n++] =
                    (CouchSpan){w, couch_cell_end(g, 1, cj - 1), last < like->dims[1] ? last : like->dims[1]};
        }
    }
}

void couch_grower_aim(CouchGrower *grower, const CouchGrid *g, const CtsBits *body_cells, const CtsBits *foreign_cells,
                      int ck, const CtsBits *like)
{
    find_spans(&grower->body.spans, g, body_cells, ck, like, grower->in_use);
    find_spans(&grower->foreign.spans, g, foreign_cells, ck, like, grower->in_use);
}

/* What a side must leave alone, in column w: what its rival holds by now, and what it owned from the start. */
typedef struct Taken {
    const uint64_t *now, *own;
} Taken;

static Taken taken_by(const CouchGrower *grower, const CouchSide *rival, int w, int k)
{
    if (!rival->spans.n)
        return (Taken){grower->zeros + 1, grower->zeros + 1};
    return (Taken){couch_column(&rival->grown, w, 0), couch_column(rival->whole, w, k)};
}

static void join_column(uint64_t *restrict to, const uint64_t *restrict a, const uint64_t *restrict b,
                        const uint64_t *restrict now, const uint64_t *restrict own, int n)
{
    for (int j = 0; j < n; j++)
        to[j] |= (a[j] | b[j]) & ~now[j] & ~own[j];
}

static void join_slices(const CouchGrower *grower, CouchSide *side, const CouchSide *rival, int k, int d)
{
    const bool before = k >= d, behind = k + d < side->whole->n_slices;
    for (int s = 0; s < side->spans.n && (before || behind); s++) {
        const CouchSpan *span = &side->spans.items[s];
        const uint64_t *a = couch_column(side->whole, span->w, before ? k - d : k + d);
        const uint64_t *b = behind ? couch_column(side->whole, span->w, k + d) : a;
        const Taken taken = taken_by(grower, rival, span->w, k);
        join_column(couch_column(&side->grown, span->w, 0) + span->first, a + span->first, b + span->first,
                    taken.now + span->first, taken.own + span->first, span->end - span->first);
    }
}

/* A column and its neighbours on either side. */
typedef struct Trio {
    const uint64_t *low, *at, *high;
} Trio;

static inline __attribute__((always_inline)) uint64_t spread(uint64_t low, uint64_t at, uint64_t high)
{
    return at | at << 1 | at >> 1 | low >> 63 | high << 63;
}

static void grow_cross(uint64_t *restrict out, const Trio *in, const uint64_t *restrict now,
                       const uint64_t *restrict own, uint64_t mask, int n)
{
    const uint64_t *const low = in->low, *const at = in->at, *const high = in->high;
    for (int j = 0; j < n; j++) {
        const uint64_t grown = spread(low[j], at[j], high[j]) | at[j - 1] | at[j + 1];
        out[j] = at[j] | (grown & ~now[j] & ~own[j] & mask);
    }
}

static void grow_box(uint64_t *restrict out, const Trio *in, const uint64_t *restrict now, const uint64_t *restrict own,
                     uint64_t mask, int n)
{
    const uint64_t *const low = in->low, *const at = in->at, *const high = in->high;
    for (int j = 0; j < n; j++) {
        const uint64_t grown = spread(low[j - 1] | low[j] | low[j + 1], at[j - 1] | at[j] | at[j + 1],
                                      high[j - 1] | high[j] | high[j + 1]);
        out[j] = at[j] | (grown & ~now[j] & ~own[j] & mask);
    }
}

static void grow_side(const CouchGrower *grower, CouchSide *side, const CouchSide *rival, int k, int step)
{
    const int last = side->whole->n_words - 1;
    for (int s = 0; s < side->spans.n; s++) {
        const CouchSpan *span = &side->spans.items[s];
        const int w = span->w, first = span->first, n = span->end - span->first;
        const Taken taken = taken_by(grower, rival, w, k);
        const Trio in = {(w > 0 ? couch_column(&side->grown, w - 1, 0) : grower->zeros + 1) + first,
                         couch_column(&side->grown, w, 0) + first,
                         (w < last ? couch_column(&side->grown, w + 1, 0) : grower->zeros + 1) + first};
        uint64_t *out = couch_column(&side->next, w, 0) + first;
        const uint64_t mask = w < last ? ~UINT64_C(0) : grower->last_word;
        (step % 2 ? grow_box : grow_cross)(out, &in, taken.now + first, taken.own + first, mask, n);
    }
    const CouchColumns t = side->grown;
    side->grown = side->next;
    side->next = t;
}

static void start(CouchSide *side, int k)
{
    const size_t n_bytes = side->grown.stride * (size_t)side->grown.n_words * sizeof *side->grown.words;
    const uint64_t *own = couch_column(side->whole, 0, k) - 1;
    if (!side->spans.n)
        return;
    memcpy(side->grown.words, own, n_bytes);
    memcpy(side->next.words, own, n_bytes);
}

void couch_grow(CouchGrower *grower, const CouchRim *rim, int k)
{
    CouchSide *body = &grower->body, *foreign = &grower->foreign;
    start(body, k);
    start(foreign, k);
    for (int step = 0; step < rim->n_steps; step++) {
        for (int d = 1; d <= rim->n_slices; d++)
            if (rim->first_step[d] == step) {
                join_slices(grower, body, foreign, k, d);
                join_slices(grower, foreign, body, k, d);
            }
        grow_side(grower, body, foreign, k, step);
        grow_side(grower, foreign, body, k, step);
    }
}
