#include "table/couch_rim.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "table/block_change.h"
#include "table/couch_grow.h"
#include <omp.h>
#include <stdbool.h>
#include <string.h>

/* Rows first <= j < end. */
typedef struct Range {
    int first, end;
} Range;

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

int couch_rim_first(const CouchScene *scene)
{
    return scene->first_slice > COUCH_MAX_RIM ? scene->first_slice - COUCH_MAX_RIM : 0;
}

int couch_rim_end(const CouchScene *scene)
{
    const int n = scene->volume->dims[2];
    return n - scene->end_slice > COUCH_MAX_RIM ? scene->end_slice + COUCH_MAX_RIM : n;
}

/* What grows: the body, and those foreign voxels that are near enough to it for the rims to meet. As columns, for the
 * slices that a rim may come from, and as cells. */
typedef struct Shapes {
    CouchColumns body, rivals;
    CtsBits body_cells, rival_cells;
} Shapes;

static CtsStatus shapes_new(Shapes *shapes, const CouchGrid *g, const CtsBits *like, CtsError *err)
{
    CtsStatus st;
    const int n_slices = like->dims[2];
    if ((st = couch_columns_new(&shapes->body, like, n_slices, err)) ||
        (st = couch_columns_new(&shapes->rivals, like, n_slices, err)) ||
        (st = cts_bits_new(&shapes->body_cells, g->dims, err)) ||
        (st = cts_bits_new(&shapes->rival_cells, g->dims, err)))
        return st;
    return CTS_OK;
}

static void shapes_free(Shapes *shapes)
{
    couch_columns_free(&shapes->body);
    couch_columns_free(&shapes->rivals);
    cts_bits_free(&shapes->body_cells);
    cts_bits_free(&shapes->rival_cells);
}

/* Set the cells that a row of voxels has some of. */
static void add_cells(const CouchGrid *g, const uint64_t *row, size_t n_words, uint64_t *cells)
{
    for (size_t w = 0; w < n_words; w++)
        for (uint64_t set = row[w], run; set; set &= ~run) {
            run = set & ~(set + (set & -set)); /* the lowest ones that follow each other */
            const int first = (int)(64 * w) + __builtin_ctzll(run), last = first + cts_popcount(run) - 1;
            cts_bits_fill(cells, couch_cell(g, 0, first), couch_cell(g, 0, last) + 1);
        }
}

/* The rows of one row of cells in one slice; near: the cells that rivals are wanted of. */
static void take_rows(const CouchGrid *g, const CtsBits *body, const CtsBits *foreign, const CtsBits *near, int cj,
                      int k, Shapes *shapes)
{
    const int ck = couch_cell(g, 2, k), j0 = couch_cell_end(g, 1, cj - 1), end = couch_cell_end(g, 1, cj);
    const int j1 = end < body->dims[1] ? end : body->dims[1];
    const size_t n_words = body->row_words;
    uint64_t any[CTS_BITS_ROW_WORDS], rival[CTS_BITS_ROW_WORDS], here[CTS_BITS_ROW_WORDS], found = 0;
    memset(any, 0, n_words * sizeof *any);
    for (int j = j0; j < j1; j++) {
        const uint64_t *row = cts_bits_row(body, j, k), *other = cts_bits_row(foreign, j, k);
        for (size_t w = 0; w < n_words; w++) {
            any[w] |= row[w];
            found |= other[w];
        }
    }
    add_cells(g, any, n_words, cts_bits_row(&shapes->body_cells, cj, ck));
    if (!found)
        return;
    memset(rival, 0, n_words * sizeof *rival);
    couch_expand_cells(g, near, cj, ck, body, here);
    for (int j = j0; j < j1; j++) {
        const uint64_t *other = cts_bits_row(foreign, j, k);
        for (size_t w = 0; w < n_words; w++)
            if (other[w] & here[w]) {
                couch_column(&shapes->rivals, (int)w, k)[j] = other[w] & here[w];
                rival[w] |= other[w] & here[w];
            }
    }
    add_cells(g, rival, n_words, cts_bits_row(&shapes->rival_cells, cj, ck));
}

static void take_shapes(const CouchScene *scene, const CouchGrid *g, const CtsBits *body, const CtsBits *foreign,
                        const CtsBits *near, Shapes *shapes)
{
    const int first = couch_rim_first(scene), end = couch_rim_end(scene);
#pragma omp parallel for schedule(dynamic) num_threads(scene->n_threads)
    for (int ck = couch_cell(g, 2, first); ck <= couch_cell(g, 2, end - 1); ck++) {
        const int from = couch_cell_end(g, 2, ck - 1), to = couch_cell_end(g, 2, ck);
        for (int k = from > first ? from : first; k < to && k < end; k++) {
            const Range rows = rows_of_slice(body, k);
            couch_columns_take(&shapes->body, body, k, rows.first, rows.end);
            for (int cj = 0; cj < g->dims[1]; cj++)
                take_rows(g, body, foreign, near, cj, k, shapes);
        }
    }
}

/* Where the rim has to be worked out voxel by voxel. */
typedef struct Shell {
    CtsBits open;          /* cells of which some voxels may stay and others go */
    CtsBits body, foreign; /* cells in which the two grow so that open ones come out right */
} Shell;

static void shell_free(Shell *shell)
{
    cts_bits_free(&shell->open);
    cts_bits_free(&shell->body);
    cts_bits_free(&shell->foreign);
}

/* Add all cells within so many cells along each axis. */
static void reach_out(CtsBits *cells, CtsBits *scratch, const int reach[3], int n_threads)
{
    for (int n = 1; n <= reach[0] || n <= reach[1] || n <= reach[2]; n++) {
        const unsigned axes =
            (unsigned)(n <= reach[0]) | (unsigned)(n <= reach[1]) << 1 | (unsigned)(n <= reach[2]) << 2;
        cts_bits_dilate(cells, scratch, CTS_BOX, axes, n_threads);
        const CtsBits t = *cells;
        *cells = *scratch;
        *scratch = t;
    }
}

/* A cell is settled when no body can reach it from outside and it has none: all goes; or when it is inside and no rival
 * can reach it: all stays. A voxel n steps away may still matter, for growth may come from there. */
static CtsStatus shell_new(Shell *shell, const CouchScene *scene, const CouchGrid *g, const CouchRim *rim,
                           const Shapes *shapes, const CtsBits *inside, CtsError *err)
{
    CtsStatus st;
    CtsBits wide = {0}, scratch = {0};
    int reach[3];
    for (int axis = 0; axis < 3; axis++)
        reach[axis] = ((axis < 2 ? rim->n_steps : rim->n_slices) + g->block[axis] - 1) / g->block[axis];
    const int reach_in_slice[3] = {reach[0], reach[1], 0};
    if ((st = cts_bits_copy(&shell->body, &shapes->body_cells, err)) ||
        (st = cts_bits_copy(&shell->foreign, &shapes->rival_cells, err)) || (st = cts_bits_new(&scratch, g->dims, err)))
        goto end;
    reach_out(&shell->body, &scratch, reach, scene->n_threads);
    reach_out(&shell->foreign, &scratch, reach, scene->n_threads);
    cts_bits_combine(&scratch, CTS_BITS_COPY, &shell->body);
    cts_bits_combine(&scratch, CTS_BITS_AND_NOT, inside);
    if ((st = cts_bits_copy(&shell->open, &shell->foreign, err)))
        goto end;
    cts_bits_combine(&shell->open, CTS_BITS_AND, inside);
    cts_bits_combine(&shell->open, CTS_BITS_OR, &scratch);
    if ((st = cts_bits_copy(&wide, &shell->open, err)))
        goto end;
    reach_out(&wide, &scratch, reach_in_slice, scene->n_threads);
    cts_bits_combine(&shell->body, CTS_BITS_AND, &wide);
    cts_bits_combine(&shell->foreign, CTS_BITS_AND, &wide);
end:
    cts_bits_free(&wide);
    cts_bits_free(&scratch);
    return st;
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

/* How many bits from the lowest on are set; not all. */
static int run_length(uint64_t bits)
{
    return __builtin_ctzll(~bits);
}

/* Add the voxels of one word and count them. */
static uint64_t add_word(Span *span, uint16_t *grey, uint64_t gone)
{
    if (gone == ~UINT64_C(0)) {
        add_span(span, grey, 64);
        return 64;
    }
    uint64_t n = 0;
    for (uint64_t run; gone; gone &= ~run) {
        const int first = __builtin_ctzll(gone), n_run = run_length(gone >> first);
        run = ((UINT64_C(1) << n_run) - 1) << first;
        add_span(span, grey + first, n_run);
        n += (uint64_t)n_run;
    }
    return n;
}

/* The rows of cells of one layer: what goes of a cell's rows unless a shape has grown there, and the words in which one
 * may have. */
typedef struct Layer {
    size_t n_words;
    uint64_t *gone;
    int *open, *n_open;
} Layer;

/* One thread's view of the layer at hand. */
typedef struct Worker {
    CouchGrower grower;
    Layer layer;
    uint64_t *gone; /* what goes of the rows of one row of cells */
} Worker;

static CtsStatus worker_new(Worker *worker, const CouchGrid *g, const CtsBits *like, const Shapes *shapes,
                            CtsError *err)
{
    CtsStatus st;
    const size_t n_cells = (size_t)g->dims[1];
    Layer *layer = &worker->layer;
    layer->n_words = like->row_words;
    if ((st = couch_grower_new(&worker->grower, g, like, &shapes->body, &shapes->rivals, err)) ||
        (st = cts_alloc_array(&layer->gone, n_cells * layer->n_words, err)) ||
        (st = cts_alloc_array(&layer->open, n_cells * layer->n_words, err)) ||
        (st = cts_alloc_array(&layer->n_open, n_cells, err)) ||
        (st = cts_alloc_array(&worker->gone, (size_t)g->block[1] * layer->n_words, err)))
        return st;
    return CTS_OK;
}

static void worker_free(Worker *worker)
{
    couch_grower_free(&worker->grower);
    cts_free(&worker->layer.gone);
    cts_free(&worker->layer.open);
    cts_free(&worker->layer.n_open);
    cts_free(&worker->gone);
}

static void look_at_layer(const CouchGrid *g, const CtsBits *inside, const Shell *shell, int ck, const CtsBits *like,
                          Layer *layer)
{
    uint64_t open[CTS_BITS_ROW_WORDS];
    for (int cj = 0; cj < g->dims[1]; cj++) {
        uint64_t *gone = layer->gone + (size_t)cj * layer->n_words;
        int *words = layer->open + (size_t)cj * layer->n_words, n = 0;
        couch_expand_cells(g, inside, cj, ck, like, gone);
        couch_expand_cells(g, &shell->open, cj, ck, like, open);
        for (size_t w = 0; w < layer->n_words; w++) {
            gone[w] = ~gone[w] & cts_bits_mask(like, w);
            if (open[w])
                words[n++] = (int)w;
        }
        layer->n_open[cj] = n;
    }
}

/* What goes of the n_rows rows from row j on, those of the cells cj: neither body nor in it. */
static void find_gone(const CouchGrower *grower, const Layer *layer, int cj, int j, int n_rows, uint64_t *gone)
{
    const CouchSide *body = &grower->body, *foreign = &grower->foreign;
    const size_t n = layer->n_words;
    const int *open = layer->open + (size_t)cj * n;
    for (int r = 0; r < n_rows; r++)
        memcpy(gone + (size_t)r * n, layer->gone + (size_t)cj * n, n * sizeof *gone);
    for (int i = 0; i < layer->n_open[cj]; i++) {
        const uint64_t *is_body = (body->spans.n ? couch_column(&body->grown, open[i], 0) : grower->zeros + 1) + j;
        const uint64_t *rival = (foreign->spans.n ? couch_column(&foreign->grown, open[i], 0) : grower->zeros + 1) + j;
        const uint64_t voxels = (size_t)open[i] + 1 < n ? ~UINT64_C(0) : grower->last_word;
        for (int r = 0; r < n_rows; r++) {
            uint64_t *word = gone + (size_t)r * n + open[i];
            *word = (*word | (rival[r] & voxels)) & ~is_body[r];
        }
    }
}

static uint64_t clear_slice(CtsVolume *v, int k, Worker *worker, const CouchGrid *g, CtsBlockChange *change)
{
    const size_t n_words = worker->layer.n_words;
    uint64_t n_gone = 0;
    Span span = {NULL, NULL};
    CtsBlockRows rows;
    for (int cj = 0; cj < g->dims[1]; cj++) {
        const int first = couch_cell_end(g, 1, cj - 1), next = couch_cell_end(g, 1, cj);
        const int end = next < v->dims[1] ? next : v->dims[1];
        find_gone(&worker->grower, &worker->layer, cj, first, end - first, worker->gone);
        for (int j = first; j < end; j++) {
            const uint64_t *gone = worker->gone + (size_t)(j - first) * n_words;
            uint16_t *grey = v->grey + ((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)v->dims[0];
            for (size_t w = 0; w < n_words; w++)
                if (gone[w])
                    n_gone += add_word(&span, grey + 64 * w, gone[w]);
            cts_block_change_row(change, &rows, gone, j, k);
        }
    }
    flush(&span);
    return n_gone;
}

/* Each thread takes some slices in a row, whose cells are mostly the same. */
static uint64_t clear_slices(const CouchScene *scene, CtsVolume *volume, const CouchGrid *g, const CouchRim *rim,
                             Worker *workers, const CtsBits *inside, const Shell *shell, const CtsBits *like,
                             CtsBlockChange *change)
{
    uint64_t n = 0;
#pragma omp parallel num_threads(scene->n_threads) reduction(+ : n)
    {
        Worker *worker = &workers[omp_get_thread_num()];
        int aimed_at = -1;
#pragma omp for schedule(dynamic, CTS_FINE_BLOCK)
        for (int k = scene->first_slice; k < scene->end_slice; k++) {
            const int ck = couch_cell(g, 2, k);
            if (ck != aimed_at) {
                couch_grower_aim(&worker->grower, g, &shell->body, &shell->foreign, ck, like);
                look_at_layer(g, inside, shell, ck, like, &worker->layer);
            }
            aimed_at = ck;
            couch_grow(&worker->grower, rim, k);
            n += clear_slice(volume, k, worker, g, change);
        }
    }
    return n;
}

CtsStatus couch_clear(const CouchScene *scene, CtsVolume *volume, const CtsBits *body, const CtsBits *foreign,
                      const CouchGrid *g, const CtsBits *body_cells, const CtsBits *inside, uint64_t *n_cleared,
                      CtsError *err)
{
    CtsStatus st = CTS_OK;
    Worker *workers = NULL;
    CtsBits near = {0};
    Shapes shapes = {0};
    Shell shell = {0};
    CtsBlockChange change = {0};
    const CouchRim rim = couch_rim(scene);
    if ((st = couch_near(scene, g, body_cells, 2 * rim.reach_mm, &near, err)) ||
        (st = shapes_new(&shapes, g, body, err)) || (st = cts_alloc_zeroed(&workers, (size_t)scene->n_threads, err)))
        goto end;
    cts_bits_combine(&near, CTS_BITS_OR, inside);
    for (int t = 0; t < scene->n_threads; t++)
        if ((st = worker_new(&workers[t], g, body, &shapes, err)))
            goto end;
    if ((st = cts_block_change_new(&change, volume->blocks, err)))
        goto end;
    cts_block_change_keep(&change, 0, scene->first_slice);
    cts_block_change_keep(&change, scene->end_slice, volume->dims[2]);
    take_shapes(scene, g, body, foreign, &near, &shapes);
    if ((st = shell_new(&shell, scene, g, &rim, &shapes, inside, err)))
        goto end;
    *n_cleared = clear_slices(scene, volume, g, &rim, workers, inside, &shell, body, &change);
    cts_block_change_apply(&change, volume, scene->n_threads);
end:
    for (int t = 0; workers && t < scene->n_threads; t++)
        worker_free(&workers[t]);
    cts_free(&workers);
    cts_bits_free(&near);
    shapes_free(&shapes);
    shell_free(&shell);
    cts_block_change_free(&change);
    return st;
}
