#include "volume/couch_rim.h"

#include "base/mem.h"
#include "volume/blocks.h"
#include <math.h>
#include <omp.h>
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

/* One thread's masks of one slice. */
typedef struct Slice {
    CtsBits body, foreign; /* grown so far; never in common */
    CtsBits scratch;
} Slice;

static void slice_free(Slice *s)
{
    cts_bits_free(&s->body);
    cts_bits_free(&s->foreign);
    cts_bits_free(&s->scratch);
}

static CtsStatus slice_new(Slice *s, const CtsBits *like, CtsError *err)
{
    const int dims[3] = {like->dims[0], like->dims[1], 1};
    CtsStatus st;
    if ((st = cts_bits_new(&s->body, dims, err)) || (st = cts_bits_new(&s->foreign, dims, err)) ||
        (st = cts_bits_new(&s->scratch, dims, err)))
        return st;
    return CTS_OK;
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

/* The rows that hold a bit in one of the slices k - rim to k + rim. */
static Range rows_of(const CtsBits *bits, int k, int rim)
{
    Range r = {bits->dims[1], 0};
    for (int other = k > rim ? k - rim : 0; other <= k + rim && other < bits->dims[2]; other++) {
        int first = 0, end = bits->dims[1];
        while (first < r.first && row_is_empty(bits, first, other))
            first++;
        while (end > r.end && end > first && row_is_empty(bits, end - 1, other))
            end--;
        r.first = first < r.first ? first : r.first;
        r.end = end > r.end ? end : r.end;
    }
    return r;
}

/* to |= from in rows, less what the rival holds now and what is rightly its own. */
static void join(const CtsBits *from, int k, Range rows, const CtsBits *rival, const uint64_t *rival_own, CtsBits *to)
{
    const size_t first = (size_t)rows.first * to->row_words, end = (size_t)rows.end * to->row_words;
    const uint64_t *words = cts_bits_row(from, 0, k);
    for (size_t w = first; w < end; w++)
        to->words[w] |= words[w] & ~rival->words[w] & ~rival_own[w];
}

static void join_neighbours(const CtsBits *from, int k, int d, Range rows, const CtsBits *rival,
                            const uint64_t *rival_own, CtsBits *to)
{
    if (rows.first >= rows.end)
        return;
    if (k >= d)
        join(from, k - d, rows, rival, rival_own, to);
    if (k + d < from->dims[2])
        join(from, k + d, rows, rival, rival_own, to);
}

static void grow(Slice *s, CtsBits *grown, Range rows, const CtsBits *rival, const uint64_t *rival_own, int step)
{
    if (rows.first >= rows.end)
        return;
    cts_bits_dilate_rows(grown, &s->scratch, step % 2 ? CTS_BOX : CTS_CROSS, rows.first, rows.end);
    join(&s->scratch, 0, rows, rival, rival_own, grown);
}

/* Body and foreign grow by turns, each only over what the other does not hold; the body comes first. */
static void grow_rim(const CtsBits *body, const CtsBits *foreign, int k, const Rim *rim, Slice *s)
{
    const int ny = body->dims[1];
    const uint64_t *own = cts_bits_row(body, 0, k), *foreign_own = cts_bits_row(foreign, 0, k);
    const Range rows = widen(rows_of(body, k, rim->n_slices), rim->n_steps, ny);
    const Range near = rows_of(foreign, k, rim->n_slices), foreign_rows = widen(near, rim->n_steps, ny);
    memcpy(s->body.words, own, cts_bits_n_words(&s->body) * sizeof *own);
    memcpy(s->foreign.words, foreign_own, cts_bits_n_words(&s->body) * sizeof *own);
    for (int step = 0; step < rim->n_steps; step++) {
        for (int d = 1; d <= rim->n_slices; d++)
            if (rim->first_step[d] == step) {
                join_neighbours(body, k, d, rows, &s->foreign, foreign_own, &s->body);
                join_neighbours(foreign, k, d, foreign_rows, &s->body, own, &s->foreign);
            }
        grow(s, &s->body, rows, &s->foreign, foreign_own, step);
        grow(s, &s->foreign, foreign_rows, &s->body, own, step);
    }
}

/* A row of cells as a row of voxels of a mask like `like`. */
static void expand_cells(const CouchGrid *g, const CtsBits *cells, int cj, int ck, const CtsBits *like, uint64_t *row)
{
    const int nx = like->dims[0];
    const uint64_t *from = cts_bits_row(cells, cj, ck);
    memset(row, 0, like->row_words * sizeof *row);
    for (size_t w = 0; w < cells->row_words; w++)
        for (uint64_t set = from[w]; set; set &= set - 1) {
            const int first = ((int)(64 * w) + __builtin_ctzll(set)) * g->block[0], end = first + g->block[0];
            cts_bits_fill(row, first, end < nx ? end : nx);
        }
}

/* The foreign voxels in cells near enough to the body for the rims to meet; those of the rest leave the rim alone. */
static CtsStatus contested(const CouchScene *scene, const CtsBits *foreign, const CouchGrid *g, const CtsBits *near,
                           CtsBits *found, CtsError *err)
{
    const CtsStatus st = cts_bits_new(found, foreign->dims, err);
    if (st)
        return st;
#pragma omp parallel for schedule(static) num_threads(scene->n_threads)
    for (int k = 0; k < foreign->dims[2]; k++) {
        uint64_t here[CTS_BITS_ROW_WORDS];
        for (int j = 0; j < foreign->dims[1]; j++) {
            if (j % g->block[1] == 0)
                expand_cells(g, near, couch_cell(g, 1, j), couch_cell(g, 2, k), foreign, here);
            const uint64_t *from = cts_bits_row(foreign, j, k);
            uint64_t *to = cts_bits_row(found, j, k);
            for (size_t w = 0; w < foreign->row_words; w++)
                to[w] = from[w] & here[w];
        }
    }
    return CTS_OK;
}

static uint64_t clear_word(uint16_t *grey, uint64_t gone)
{
    if (gone == ~UINT64_C(0)) {
        memset(grey, 0, 64 * sizeof *grey);
        return 64;
    }
    const uint64_t n = (uint64_t)cts_popcount(gone);
    for (; gone; gone &= gone - 1)
        grey[__builtin_ctzll(gone)] = 0;
    return n;
}

static uint64_t clear_slice(CtsVolume *v, int k, const Slice *s, const CouchGrid *g, const CtsBits *inside)
{
    uint64_t n_gone = 0, here[CTS_BITS_ROW_WORDS];
    for (int j = 0; j < v->dims[1]; j++) {
        if (j % g->block[1] == 0)
            expand_cells(g, inside, couch_cell(g, 1, j), couch_cell(g, 2, k), &s->body, here);
        const uint64_t *body = cts_bits_row(&s->body, j, 0), *rival = cts_bits_row(&s->foreign, j, 0);
        uint16_t *grey = v->grey + ((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)v->dims[0];
        for (size_t w = 0; w < s->body.row_words; w++)
            n_gone += clear_word(grey + 64 * w, ~(body[w] | (here[w] & ~rival[w])) & cts_bits_mask(&s->body, w));
    }
    return n_gone;
}

CtsStatus couch_clear(const CouchScene *scene, CtsVolume *volume, const CtsBits *body, const CtsBits *foreign,
                      const CouchGrid *g, const CtsBits *body_cells, const CtsBits *inside, uint64_t *n_cleared,
                      CtsError *err)
{
    CtsStatus st = CTS_OK;
    Slice *slices = NULL;
    CtsBits near = {0}, rivals = {0};
    CtsBlocks *blocks = NULL;
    const Rim rim = rim_of(scene);
    uint64_t n = 0;
    if ((st = couch_near(scene, g, body_cells, 2 * rim.reach_mm, &near, err)))
        goto end;
    cts_bits_combine(&near, CTS_BITS_OR, inside);
    if ((st = contested(scene, foreign, g, &near, &rivals, err)) ||
        (st = cts_alloc_zeroed(&slices, (size_t)scene->n_threads, err)))
        goto end;
    for (int t = 0; t < scene->n_threads; t++)
        if ((st = slice_new(&slices[t], body, err)))
            goto end;
    if (volume->blocks && (st = cts_blocks_begin(&blocks, volume->dims, err)))
        goto end;
#pragma omp parallel for schedule(dynamic, CTS_FINE_BLOCK) num_threads(scene->n_threads) reduction(+ : n)
    for (int k = 0; k < volume->dims[2]; k++) {
        Slice *s = &slices[omp_get_thread_num()];
        grow_rim(body, &rivals, k, &rim, s);
        n += clear_slice(volume, k, s, g, inside);
        if (blocks)
            cts_blocks_add(blocks, k, volume->grey + (size_t)k * (size_t)volume->dims[0] * (size_t)volume->dims[1]);
    }
    if (blocks)
        cts_blocks_end(blocks);
    cts_volume_changed(volume);
    volume->blocks = blocks;
    blocks = NULL;
    *n_cleared = n;
end:
    for (int t = 0; slices && t < scene->n_threads; t++)
        slice_free(&slices[t]);
    cts_free(&slices);
    cts_bits_free(&near);
    cts_bits_free(&rivals);
    cts_blocks_free(&blocks);
    return st;
}
