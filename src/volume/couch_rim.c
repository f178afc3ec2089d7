#include "volume/couch_rim.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "volume/block_change.h"
#include <math.h>
#include <omp.h>
#include <stdbool.h>
#include <string.h>

static const double RIM_MM = 3;
enum { MAX_RIM = 32 };

/* Growth in steps of one voxel within the slice: a neighbouring slice at distance d joins in at step first_step[d],
 * late enough to make a ball of RIM_MM. */
typedef struct Rim {
    int n_steps, n_slices;
    double reach_mm; /* no voxel further than this belongs to it */
    int first_step[MAX_RIM + 1];
} Rim;

static Rim rim_of(const CouchScene *scene)
{
    Rim rim = {0};
    const double in_slice_mm = fmin(scene->spacing_mm[0], scene->spacing_mm[1]), between_mm = scene->spacing_mm[2];
    rim.n_steps = (int)fmin(fmax(ceil(RIM_MM / in_slice_mm), 2), MAX_RIM);
    rim.n_slices = (int)fmin(fmax(ceil(RIM_MM / between_mm), 1), MAX_RIM);
    rim.reach_mm = fmax(rim.n_steps * fmax(scene->spacing_mm[0], scene->spacing_mm[1]), rim.n_slices * between_mm);
    for (int d = 1; d <= rim.n_slices; d++) {
        const double left_mm = sqrt(fmax(RIM_MM * RIM_MM - d * between_mm * d * between_mm, 0));
        const int steps = (int)fmin(fmax(ceil(left_mm / in_slice_mm), 1), rim.n_steps);
        rim.first_step[d] = rim.n_steps - steps;
    }
    return rim;
}

/* Rows first <= j < end. */
typedef struct Range {
    int first, end;
} Range;

static Range widen(Range r, int by, int n_rows)
{
    if (r.first >= r.end)
        return r;
    return (Range){r.first > by ? r.first - by : 0, r.end + by < n_rows ? r.end + by : n_rows};
}

static bool row_is_empty(const CtsBits *bits, int j, int k)
{
    const uint64_t *row = cts_bits_row(bits, j, k);
    uint64_t any = 0;
    for (size_t w = 0; w < bits->row_words; w++)
        any |= row[w];
    return !any;
}

static Range rows_of_slice(const CtsBits *bits, int k)
{
    Range r = {0, bits->dims[1]};
    while (r.first < r.end && row_is_empty(bits, r.first, k))
        r.first++;
    while (r.first < r.end && row_is_empty(bits, r.end - 1, k))
        r.end--;
    return r;
}

/* The rows that hold a bit in one of the slices k - rim to k + rim. */
static Range rows_near(const Range *rows, int n_slices, int k, int rim)
{
    Range r = {0, 0};
    for (int other = k > rim ? k - rim : 0; other <= k + rim && other < n_slices; other++) {
        const Range more = rows[other];
        if (more.first >= more.end)
            continue;
        if (r.first >= r.end)
            r = more;
        r.first = more.first < r.first ? more.first : r.first;
        r.end = more.end > r.end ? more.end : r.end;
    }
    return r;
}

int couch_rim_first(const CouchScene *scene)
{
    return scene->first_slice > MAX_RIM ? scene->first_slice - MAX_RIM : 0;
}

int couch_rim_end(const CouchScene *scene)
{
    const int n = scene->volume->dims[2];
    return n - scene->end_slice > MAX_RIM ? scene->end_slice + MAX_RIM : n;
}

/* One of the two shapes of a slice while it grows. */
typedef struct Side {
    const CtsBits *whole; /* of the volume, not grown */
    const uint64_t *own;  /* this slice of it */
    CtsBits grown, next;
    Range rows; /* beyond them nothing grows */
} Side;

static void join_neighbours(Side *side, int k, int d, const Side *rival)
{
    const bool before = k >= d, behind = k + d < side->whole->dims[2];
    if (side->rows.first >= side->rows.end || (!before && !behind))
        return;
    const uint64_t *a = cts_bits_row(side->whole, 0, before ? k - d : k + d);
    const uint64_t *b = behind ? cts_bits_row(side->whole, 0, k + d) : a;
    cts_bits_join_rows(a, b, &side->grown, side->rows.first, side->rows.end, rival->grown.words, rival->own);
}

static void grow(Side *side, const Side *rival, int step)
{
    if (side->rows.first >= side->rows.end)
        return;
    cts_bits_grow_rows(&side->grown, &side->next, step % 2 ? CTS_BOX : CTS_CROSS, side->rows.first, side->rows.end,
                       rival->grown.words, rival->own);
    const CtsBits t = side->grown;
    side->grown = side->next;
    side->next = t;
}

/* One thread's masks of one slice; the grown ones never have a voxel in common. */
typedef struct Slice {
    Side body, foreign;
} Slice;

static void slice_free(Slice *s)
{
    Side *const sides[] = {&s->body, &s->foreign};
    for (int i = 0; i < 2; i++) {
        cts_bits_free(&sides[i]->grown);
        cts_bits_free(&sides[i]->next);
    }
}

static CtsStatus slice_new(Slice *s, const CtsBits *like, CtsError *err)
{
    const int dims[3] = {like->dims[0], like->dims[1], 1};
    Side *const sides[] = {&s->body, &s->foreign};
    CtsStatus st = CTS_OK;
    for (int i = 0; !st && i < 2; i++)
        if (!(st = cts_bits_new(&sides[i]->grown, dims, err)))
            st = cts_bits_new(&sides[i]->next, dims, err);
    return st;
}

/* What grows, and the rows of each slice that hold some of it. */
typedef struct Shapes {
    const CtsBits *body;
    CtsBits *rivals; /* the foreign voxels near enough to the body for the rims to meet */
    Range *body_rows, *rival_rows;
} Shapes;

static void start(Side *side, const CtsBits *whole, const Range *rows, int k, const Rim *rim)
{
    const size_t n_bytes = cts_bits_n_words(&side->grown) * sizeof *side->own;
    side->whole = whole;
    side->own = cts_bits_row(whole, 0, k);
    side->rows = widen(rows_near(rows, whole->dims[2], k, rim->n_slices), rim->n_steps, whole->dims[1]);
    memcpy(side->grown.words, side->own, n_bytes);
    memcpy(side->next.words, side->own, n_bytes);
}

/* Body and foreign grow by turns, each only over what the other does not hold; the body comes first. */
static void grow_rim(const Shapes *shapes, int k, const Rim *rim, Slice *s)
{
    Side *body = &s->body, *foreign = &s->foreign;
    start(body, shapes->body, shapes->body_rows, k, rim);
    start(foreign, shapes->rivals, shapes->rival_rows, k, rim);
    for (int step = 0; step < rim->n_steps; step++) {
        for (int d = 1; d <= rim->n_slices; d++)
            if (rim->first_step[d] == step) {
                join_neighbours(body, k, d, foreign);
                join_neighbours(foreign, k, d, body);
            }
        grow(body, foreign, step);
        grow(foreign, body, step);
    }
}

/* A row of cells as a row of voxels of a mask like `like`. */
static void expand_cells(const CouchGrid *g, const CtsBits *cells, int cj, int ck, const CtsBits *like, uint64_t *row)
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

/* The foreign voxels of the rest leave the rim alone, and go. */
static void keep_contested(const CouchScene *scene, const CouchGrid *g, const CtsBits *near, const Shapes *shapes)
{
    CtsBits *const rivals = shapes->rivals;
#pragma omp parallel for schedule(dynamic, 8) num_threads(scene->n_threads)
    for (int k = couch_rim_first(scene); k < couch_rim_end(scene); k++) {
        uint64_t here[CTS_BITS_ROW_WORDS];
        for (int j = 0; j < rivals->dims[1]; j++) {
            if (j % g->block[1] == 0)
                expand_cells(g, near, couch_cell(g, 1, j), couch_cell(g, 2, k), rivals, here);
            uint64_t *row = cts_bits_row(rivals, j, k);
            for (size_t w = 0; w < rivals->row_words; w++)
                row[w] &= here[w];
        }
        shapes->body_rows[k] = rows_of_slice(shapes->body, k);
        shapes->rival_rows[k] = rows_of_slice(rivals, k);
    }
}

/* Voxels that become air, in the order of the volume: what lies side by side is written at once. */
typedef struct Span {
    uint16_t *first, *end;
} Span;

static void flush(Span *span)
{
    if (span->end > span->first)
        memset(span->first, 0, (size_t)(span->end - span->first) * sizeof *span->first);
}

static void add_span(Span *span, uint16_t *first, int n)
{
    if (first != span->end) {
        flush(span);
        span->first = first;
    }
    span->end = first + n;
}

/* Add the voxels of one word. */
static void add_word(Span *span, uint16_t *grey, uint64_t gone)
{
    if (gone == ~UINT64_C(0)) {
        add_span(span, grey, 64);
        return;
    }
    for (uint64_t run; gone; gone &= ~run) {
        run = gone & ~(gone + (gone & -gone));
        add_span(span, grey + __builtin_ctzll(run), cts_popcount(run));
    }
}

/* What goes of one row: neither body nor in it. Spare bits of here are set. */
CTS_VECTOR_CLONES static void find_gone(const uint64_t *restrict body, const uint64_t *restrict here,
                                        const uint64_t *restrict rival, size_t n_words, CtsBlockRows *restrict rows)
{
    for (size_t w = 0; w < n_words; w++) {
        const uint64_t gone = ~(body[w] | (here[w] & ~rival[w]));
        rows->gone[w] = gone;
        rows->some[w] |= gone;
        rows->all[w] &= gone;
    }
}

static uint64_t clear_slice(CtsVolume *v, int k, const Slice *s, const CouchGrid *g, const CtsBits *inside,
                            CtsBlockChange *change)
{
    const CtsBits *body = &s->body.grown, *rival = &s->foreign.grown;
    const size_t last = body->row_words - 1;
    uint64_t n_gone = 0, here[CTS_BITS_ROW_WORDS];
    Span span = {NULL, NULL};
    CtsBlockRows rows;
    cts_block_rows_start(&rows);
    for (int j = 0; j < v->dims[1]; j++) {
        if (j % g->block[1] == 0)
            expand_cells(g, inside, couch_cell(g, 1, j), couch_cell(g, 2, k), body, here);
        here[last] |= ~cts_bits_mask(body, last);
        find_gone(cts_bits_row(body, j, 0), here, cts_bits_row(rival, j, 0), last + 1, &rows);
        uint16_t *grey = v->grey + ((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)v->dims[0];
        for (size_t w = 0; w <= last; w++)
            if (rows.gone[w]) {
                n_gone += (uint64_t)cts_popcount(rows.gone[w]);
                add_word(&span, grey + 64 * w, rows.gone[w]);
            }
        cts_block_change_row(change, &rows, j, k);
    }
    flush(&span);
    return n_gone;
}

static CtsStatus shapes_new(Shapes *shapes, const CtsBits *body, CtsBits *foreign, CtsError *err)
{
    CtsStatus st;
    *shapes = (Shapes){.body = body, .rivals = foreign};
    if ((st = cts_alloc_array(&shapes->body_rows, (size_t)body->dims[2], err)) ||
        (st = cts_alloc_array(&shapes->rival_rows, (size_t)body->dims[2], err)))
        return st;
    return CTS_OK;
}

CtsStatus couch_clear(const CouchScene *scene, CtsVolume *volume, const CtsBits *body, CtsBits *foreign,
                      const CouchGrid *g, const CtsBits *body_cells, const CtsBits *inside, uint64_t *n_cleared,
                      CtsError *err)
{
    CtsStatus st = CTS_OK;
    Slice *slices = NULL;
    CtsBits near = {0};
    Shapes shapes = {0};
    CtsBlockChange change = {0};
    const Rim rim = rim_of(scene);
    uint64_t n = 0;
    if ((st = couch_near(scene, g, body_cells, 2 * rim.reach_mm, &near, err)) ||
        (st = shapes_new(&shapes, body, foreign, err)) ||
        (st = cts_alloc_zeroed(&slices, (size_t)scene->n_threads, err)))
        goto end;
    cts_bits_combine(&near, CTS_BITS_OR, inside);
    for (int t = 0; t < scene->n_threads; t++)
        if ((st = slice_new(&slices[t], body, err)))
            goto end;
    if ((st = cts_block_change_new(&change, volume->blocks, err)))
        goto end;
    cts_block_change_keep(&change, 0, scene->first_slice);
    cts_block_change_keep(&change, scene->end_slice, volume->dims[2]);
    keep_contested(scene, g, &near, &shapes);
#pragma omp parallel for schedule(dynamic, CTS_FINE_BLOCK) num_threads(scene->n_threads) reduction(+ : n)
    for (int k = scene->first_slice; k < scene->end_slice; k++) {
        Slice *s = &slices[omp_get_thread_num()];
        grow_rim(&shapes, k, &rim, s);
        n += clear_slice(volume, k, s, g, inside, &change);
    }
    cts_block_change_apply(&change, volume, scene->n_threads);
    *n_cleared = n;
end:
    for (int t = 0; slices && t < scene->n_threads; t++)
        slice_free(&slices[t]);
    cts_free(&slices);
    cts_bits_free(&near);
    cts_free(&shapes.body_rows);
    cts_free(&shapes.rival_rows);
    cts_block_change_free(&change);
    return st;
}
