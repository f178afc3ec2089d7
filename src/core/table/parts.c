#include "core/table/parts.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <string.h>

/* Slices joined by one thread before the bands are joined in order; fixed, so that threads change nothing. */
enum { BAND = 16 };

/* A start sets one bit and an end, one past the last voxel, sets another; both come in turn. */
static void list_row(const uint64_t *row, size_t n_words, int nx, CtsRun *run)
{
    uint64_t before = 0;
    bool inside = false;
    for (size_t w = 0; w < n_words; w++) {
        uint64_t edges = row[w] ^ (row[w] << 1 | before);
        before = row[w] >> 63;
        for (; edges; edges &= edges - 1) {
            const uint32_t at = (uint32_t)(64 * w) + (uint32_t)__builtin_ctzll(edges);
            if (!inside)
                run->first = at;
            else
                run++->end = at;
            inside = !inside;
        }
    }
    if (inside)
        run->end = (uint32_t)nx;
}

/* CtsRun.part serves as the parent link until the labels are known: a run's parent never comes after it. */
static uint32_t root(CtsRun *runs, uint32_t n)
{
    while (runs[n].part != n) {
        runs[n].part = runs[runs[n].part].part;
        n = runs[n].part;
    }
    return n;
}

static void join_rows(CtsParts *p, size_t row_a, size_t row_b)
{
    uint32_t a = p->row_start[row_a], b = p->row_start[row_b];
    const uint32_t end_a = p->row_start[row_a + 1], end_b = p->row_start[row_b + 1];
    while (a < end_a && b < end_b) {
        /* Most that meet have met before, and know it without a look at their roots. */
        if (p->runs[a].first < p->runs[b].end && p->runs[b].first < p->runs[a].end &&
            p->runs[a].part != p->runs[b].part) {
            const uint32_t ra = root(p->runs, a), rb = root(p->runs, b);
            if (ra < rb)
                p->runs[rb].part = ra;
            else
                p->runs[ra].part = rb;
        }
        if (p->runs[a].end < p->runs[b].end)
            a++;
        else
            b++;
    }
}

static void join_slices(CtsParts *p, int k)
{
    const size_t ny = (size_t)p->dims[1];
    for (size_t j = 0; j < ny; j++)
        join_rows(p, ((size_t)k - 1) * ny + j, (size_t)k * ny + j);
}

typedef struct Joining {
    CtsParts *parts;
    bool across_slices;
} Joining;

static void join_band(void *context, int worker, size_t first, size_t end)
{
    const Joining *const joining = context;
    CtsParts *p = joining->parts;
    const size_t ny = (size_t)p->dims[1];
    (void)worker;
    for (size_t k = first; k < end; k++) {
        for (size_t j = 1; j < ny; j++)
            join_rows(p, k * ny + j - 1, k * ny + j);
        if (joining->across_slices && k % BAND)
            join_slices(p, (int)k);
    }
}

static void join_bands(CtsParts *p, bool across_slices, int n_threads)
{
    const int n_bands = (p->dims[2] + BAND - 1) / BAND;
    Joining joining = {p, across_slices};
    cts_parallel(n_threads, (size_t)p->dims[2], BAND, join_band, &joining);
    for (int band = 1; across_slices && band < n_bands; band++)
        join_slices(p, band * BAND);
}

/* Runs come in order of slices. */
static void add_run(CtsPart *part, const CtsRun *run, int j, int k)
{
    const int first = (int)run->first, last = (int)run->end - 1;
    if (!part->n_voxels)
        *part = (CtsPart){.lo = {first, j, k}, .hi = {last, j, k}};
    part->lo[0] = first < part->lo[0] ? first : part->lo[0];
    part->hi[0] = last > part->hi[0] ? last : part->hi[0];
    part->lo[1] = j < part->lo[1] ? j : part->lo[1];
    part->hi[1] = j > part->hi[1] ? j : part->hi[1];
    part->hi[2] = k;
    part->n_voxels += run->end - run->first;
}

/* Groups of rows whose parts are numbered by themselves: slices, or all together. */
typedef struct Labelling {
    CtsParts *parts;
    size_t group_rows;
    uint32_t *first; /* of each group: how many parts it has, then the number of its first */
} Labelling;

static void count_parts(void *context, int worker, size_t first, size_t end)
{
    const Labelling *const l = context;
    const CtsParts *p = l->parts;
    (void)worker;
    for (size_t g = first; g < end; g++) {
        l->first[g] = 0;
        for (uint32_t r = p->row_start[g * l->group_rows]; r < p->row_start[(g + 1) * l->group_rows]; r++)
            l->first[g] += p->runs[r].part == r;
    }
}

/* Runs come in order and a parent before its children, so one pass is enough. */
static void number_parts(void *context, int worker, size_t first, size_t end)
{
    const Labelling *const l = context;
    CtsParts *const p = l->parts;
    const size_t ny = (size_t)p->dims[1];
    (void)worker;
    for (size_t g = first; g < end; g++) {
        uint32_t next = l->first[g];
        for (size_t row = g * l->group_rows; row < (g + 1) * l->group_rows; row++)
            for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++) {
                CtsRun *run = &p->runs[r];
                run->part = run->part == r ? next++ : p->runs[run->part].part;
                add_run(&p->parts[run->part], run, (int)(row % ny), (int)(row / ny));
            }
    }
}

static CtsStatus label(CtsParts *p, bool across_slices, int n_threads, CtsError *err)
{
    const size_t n_rows = (size_t)p->dims[1] * (size_t)p->dims[2];
    const size_t n_groups = across_slices ? 1 : (size_t)p->dims[2];
    Labelling labelling = {.parts = p, .group_rows = n_rows / n_groups};
    CtsStatus st = cts_alloc_array(&labelling.first, n_groups, err);
    if (st)
        return st;
    cts_parallel(n_threads, n_groups, 0, count_parts, &labelling);
    p->n_parts = 0;
    for (size_t g = 0; g < n_groups; g++) {
        const uint32_t n = labelling.first[g];
        labelling.first[g] = p->n_parts;
        p->n_parts += n;
    }
    if (!(st = cts_alloc_zeroed(&p->parts, p->n_parts, err)))
        cts_parallel(n_threads, n_groups, 0, number_parts, &labelling);
    cts_free(&labelling.first);
    return st;
}

/* A mask and its runs. */
typedef struct Rows {
    CtsParts *parts;
    const CtsBits *bits;
} Rows;

static void count_rows(void *context, int worker, size_t first, size_t end)
{
    const Rows *const r = context;
    const size_t n_words = r->bits->row_words;
    (void)worker;
    for (size_t row = first; row < end; row++)
        r->parts->row_start[row + 1] = cts_bits_count_runs(r->bits->words + row * n_words, n_words);
}

static void list_rows(void *context, int worker, size_t first, size_t end)
{
    const Rows *const r = context;
    const CtsParts *p = r->parts;
    const size_t n_words = r->bits->row_words;
    (void)worker;
    for (size_t row = first; row < end; row++) {
        list_row(r->bits->words + row * n_words, n_words, r->bits->dims[0], p->runs + p->row_start[row]);
        for (uint32_t run = p->row_start[row]; run < p->row_start[row + 1]; run++)
            p->runs[run].part = run;
    }
}

/* A small mask is not worth waking anybody. */
static int threads_for(const CtsBits *bits, int n_threads)
{
    return cts_bits_is_large(bits) ? n_threads : 1;
}

static CtsStatus count(CtsParts *p, const CtsBits *bits, int n_threads, CtsError *err)
{
    const size_t n_rows = (size_t)bits->dims[1] * (size_t)bits->dims[2];
    cts_parts_free(p);
    *p = (CtsParts){.dims = {bits->dims[0], bits->dims[1], bits->dims[2]}};
    const CtsStatus st = cts_alloc_array(&p->row_start, n_rows + 1, err);
    if (st)
        return st;
    Rows rows = {p, bits};
    cts_parallel(threads_for(bits, n_threads), n_rows, 0, count_rows, &rows);
    p->n_runs = p->row_start[0] = 0;
    for (size_t row = 0; row < n_rows; row++) {
        p->n_runs += p->row_start[row + 1];
        p->row_start[row + 1] = (uint32_t)p->n_runs;
    }
    return CTS_OK;
}

static CtsStatus find(CtsParts *p, const CtsBits *bits, bool across_slices, int n_threads, CtsError *err)
{
    const size_t n_rows = (size_t)bits->dims[1] * (size_t)bits->dims[2];
    CtsStatus st = count(p, bits, n_threads, err);
    if (st)
        goto end;
    if (p->n_runs >= UINT32_MAX) {
        st = cts_fail(err, CTS_ERR_MEMORY, "a mask of %llu runs is too ragged", (unsigned long long)p->n_runs);
        goto end;
    }
    if ((st = cts_alloc_array(&p->runs, p->n_runs, err)))
        goto end;
    Rows rows = {p, bits};
    cts_parallel(threads_for(bits, n_threads), n_rows, 0, list_rows, &rows);
    join_bands(p, across_slices, threads_for(bits, n_threads));
    st = label(p, across_slices, threads_for(bits, n_threads), err);
end:
    if (st)
        cts_parts_free(p);
    return st;
}

CtsStatus cts_parts_find(CtsParts *p, const CtsBits *bits, int n_threads, CtsError *err)
{
    return find(p, bits, true, n_threads, err);
}

CtsStatus cts_parts_find_in_slices(CtsParts *p, const CtsBits *bits, int n_threads, CtsError *err)
{
    return find(p, bits, false, n_threads, err);
}

void cts_parts_free(CtsParts *p)
{
    cts_free(&p->runs);
    cts_free(&p->row_start);
    cts_free(&p->parts);
}

void cts_parts_paint_slice(const CtsParts *p, const uint8_t *flags, CtsBits *bits, int k)
{
    for (int j = 0; j < p->dims[1]; j++) {
        const size_t row = (size_t)k * (size_t)p->dims[1] + (size_t)j;
        uint64_t *words = cts_bits_row(bits, j, k);
        for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++)
            if (flags[p->runs[r].part])
                cts_bits_fill(words, (int)p->runs[r].first, (int)p->runs[r].end);
    }
}

typedef struct Painting {
    const CtsParts *parts;
    const uint8_t *flags;
    const CtsBits *under;
    CtsBits *bits;
} Painting;

static void paint_slices(void *context, int worker, size_t first, size_t end)
{
    const Painting *const p = context;
    const size_t n_bytes = p->bits->row_words * (size_t)p->bits->dims[1] * sizeof *p->bits->words;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++) {
        if (p->under)
            memcpy(cts_bits_row(p->bits, 0, k), cts_bits_row(p->under, 0, k), n_bytes);
        else
            memset(cts_bits_row(p->bits, 0, k), 0, n_bytes);
        cts_parts_paint_slice(p->parts, p->flags, p->bits, k);
    }
}

void cts_parts_paint(const CtsParts *p, const uint8_t *flags, const CtsBits *under, CtsBits *bits, int n_threads)
{
    Painting painting = {p, flags, under, bits};
    cts_parallel(threads_for(bits, n_threads), (size_t)p->dims[2], 0, paint_slices, &painting);
}
