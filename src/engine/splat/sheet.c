#include "engine/splat/sheet.h"

#include "base/mem.h"
#include "base/mutation.h"
#include "base/bits.h"
#include <string.h>

enum { LEFT_MARGIN = 16, MARGINS = 64 };

CtsStatus cts_sheet_init(CtsSheet *s, const CtsPatches *patches, CtsError *err)
{
    CtsStatus st;
    *s = (CtsSheet){.step = -1};
    for (int c = 0; c < 2; c++)
        s->last[c] = patches->last_voxel[c] * patches->density[c];
    s->stride = ((size_t)s->last[0] + 1 + MARGINS + 15) / 16 * 16;
    /* Rows a large power of two apart would fall on the same cache lines. */
    if (s->stride % 512 == 0)
        s->stride += 16;
    size_t n;
    if (cts_mul_overflows(s->stride, (size_t)s->last[1] + 2, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a layer's sheet is too large");
    if ((st = cts_alloc_zeroed(&s->memory, n, err)))
        return st;
    s->origin = s->memory + LEFT_MARGIN;
    return cts_alloc_zeroed(&s->holds, (size_t)patches->n_swaths * (size_t)patches->n_words, err);
}

void cts_sheet_free(CtsSheet *s)
{
    cts_free(&s->memory);
    cts_free(&s->holds);
}

static int floor_div(int a, int b)
{
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

/* Voxels whose centres lie on lattice points lo..hi, within 0..n-1. */
static void voxels_on(int lo, int hi, int density, int n, int *i0, int *i1)
{
    const int first = -floor_div(-lo, density), last = floor_div(hi, density);
    *i0 = first > 0 ? first : 0;
    *i1 = last < n - 1 ? last + 1 : n;
    if (*i1 < *i0)
        *i1 = *i0;
}

/* One voxel's footprint, kept within lattice columns u0..u1-1. */
static void scatter_clipped(const CtsScatter *job, int i, int u0, int u1)
{
    const CtsFootprint *f = job->footprint;
    const int at = i * f->density[0] - f->reach[0], n_taps = 2 * f->reach[0] + 1;
    const int first = u0 > at ? u0 - at : 0, past = u1 - at < n_taps ? u1 - at : n_taps;
    const uint32_t change = (uint32_t)job->value[i] - (job->old ? (uint32_t)job->old[i] : job->base);
    uint32_t *to = job->sheet + (size_t)i * (size_t)f->density[0];
    if (change == 0)
        return;
    for (int v = job->tap0; v < job->tap1; v++, to += job->stride)
        for (int u = first; u < past; u++)
            to[u] += change * f->weight[v][u];
}

/* A swath's lattice rows v0..v1-1, columns u0..u1-1 of them. */
typedef struct LatticeRect {
    int u0, u1, v0, v1;
} LatticeRect;

/* The rows of a footprint that voxel row j has in lattice rows v0..v1-1; sheet at that of tap row tap0. */
static CtsScatter scatter_row(const CtsSplat *s, int j, int v0, int v1)
{
    const CtsFootprint *f = s->footprint;
    const int reach = f->reach[1], at = j * f->density[1];
    const int first = v0 - at > -reach ? v0 - at : -reach, past = v1 - at < reach + 1 ? v1 - at : reach + 1;
    return (CtsScatter){.footprint = f,
                        .sheet = s->sheet->origin + (size_t)(at + first) * s->sheet->stride - f->reach[0],
                        .stride = s->sheet->stride,
                        .tap0 = first + reach,
                        .tap1 = past + reach,
                        .value = s->row_of(s->rows, j),
                        .base = s->base};
}

static void clear(const CtsSplat *s, int v, int u0, int u1)
{
    const uint32_t start = s->base << CTS_WEIGHT_BITS;
    uint32_t *row = s->sheet->origin + (size_t)v * s->sheet->stride;
    if (start == 0)
        memset(row + u0, 0, (size_t)(u1 - u0) * sizeof *row);
    for (int u = u0; u < u1 && start != 0; u++)
        row[u] = start;
}

static bool stands_in(const CtsSplat *s, int swath, int j)
{
    return j >= cts_swath_start(s->patches, swath, 1) && j < cts_swath_start(s->patches, swath + 1, 1);
}

/* Columns of voxels: those that touch the patch, those whose footprint lies inside it, those that stand in it. */
typedef struct Columns {
    int touch0, touch1, inner0, inner1, own0, own1;
    int u0, u1; /* lattice columns that may be written */
} Columns;

static Columns columns_of(const CtsSplat *s, const LatticeRect *p)
{
    const CtsFootprint *f = s->footprint;
    const int reach = f->reach[0];
    Columns c;
    /* At the sheet's ends footprints may run out into the margin. */
    c.u0 = p->u0 == 0 ? -reach : p->u0;
    c.u1 = p->u1 == s->sheet->last[0] + 1 ? p->u1 + reach : p->u1;
    voxels_on(p->u0 - reach, p->u1 - 1 + reach, f->density[0], s->n[0], &c.touch0, &c.touch1);
    voxels_on(c.u0 + reach, c.u1 - 1 - reach, f->density[0], s->n[0], &c.inner0, &c.inner1);
    voxels_on(p->u0, p->u1 - 1, f->density[0], s->n[0], &c.own0, &c.own1);
    if (c.inner1 == c.inner0)
        c.inner0 = c.inner1 = c.touch1;
    return c;
}

/* Returns how many of the voxels that stand in the patch were splatted. */
static uint64_t splat_columns(const CtsSplat *s, const Columns *c, const CtsScatter *job)
{
    for (int i = c->touch0; i < c->inner0; i++)
        scatter_clipped(job, i, c->u0, c->u1);
    if (job->old) {
        const int word0 = c->touch0 / 64, i0 = word0 * 64;
        s->simd->mark(job->value + i0, job->old + i0, 0, c->touch1 - i0, s->marks + word0);
        s->simd->scatter_marked(job, s->marks, c->inner0, c->inner1);
    } else {
        s->simd->scatter(job, c->inner0, c->inner1);
    }
    for (int i = c->inner1; i < c->touch1; i++)
        scatter_clipped(job, i, c->u0, c->u1);
    if (c->own0 == c->own1)
        return 0;
    return job->old ? cts_bits_count_run(s->marks, c->own0, c->own1) : (uint64_t)(c->own1 - c->own0);
}

/* One patch: changes of what the sheet holds, or all of it anew. */
static CtsSplatCount splat_rect(const CtsSplat *s, int swath, const LatticeRect *p, bool from_old)
{
    const CtsFootprint *f = s->footprint;
    const int reach = f->reach[1], density = f->density[1];
    const Columns columns = columns_of(s, p);
    CtsSplatCount count = {0};
    int j0, j1;
    for (int v = p->v0; v < p->v1 && !from_old; v++)
        clear(s, v, p->u0, p->u1);
    voxels_on(p->v0 - reach, p->v1 - 1 + reach, density, s->n[1], &j0, &j1);
    for (int j = j0; j < j1; j++) {
        CtsScatter job = scatter_row(s, j, p->v0, p->v1);
        job.old = from_old ? s->row_of(s->old_rows, j) : NULL;
        const uint64_t splatted = splat_columns(s, &columns, &job);
        if (stands_in(s, swath, j)) {
            count.splatted += splatted;
            count.reused += (uint64_t)(columns.own1 - columns.own0) - splatted;
        }
    }
    if (CTS_MUTATED(FLOAT_DRIFT) && from_old)
        for (int v = p->v0; v < p->v1; v++)
            for (int u = p->u0; u < p->u1; u++)
                s->sheet->origin[(size_t)v * s->sheet->stride + (size_t)u] =
                    (uint32_t)(float)s->sheet->origin[(size_t)v * s->sheet->stride + (size_t)u];
    return count;
}

/* The needed patches in runs that start from the same state; of two runs side by side the one that the sheet holds has
 * their edge. */
static CtsSplatCount splat_changes(const CtsSplat *s, int swath, int v0, int v1)
{
    const int n = s->patches->n[0], lattice = CTS_PATCH * s->patches->density[0], last = s->sheet->last[0];
    uint64_t *holds = s->sheet->holds + (size_t)swath * (size_t)s->patches->n_words;
    CtsSplatCount count = {0};
    for (int a = 0, past; cts_next_run(s->needed, n, &a, &past); a = past)
        for (int from = a, to; from < past; from = to) {
            const bool held = s->old_rows && cts_next_bit(holds, from, n, true) == from;
            to = s->old_rows ? cts_next_bit(holds, from, past, !held) : past;
            const int end = to * lattice < last ? to * lattice : last;
            const LatticeRect p = {
                .u0 = from * lattice + (from > a && !held), .u1 = end + (to == past || held), .v0 = v0, .v1 = v1};
            if (p.u0 >= p.u1)
                continue;
            const CtsSplatCount one = splat_rect(s, swath, &p, held);
            count.splatted += one.splatted;
            count.reused += one.reused;
        }
    for (int w = 0; w < s->patches->n_words; w++)
        holds[w] = s->needed[w];
    return count;
}

/* The patches that any row of lattice rows v0..v1-1 within `reach` of row `at` belongs to: first to last row of them.
 */
static void rows_around(const CtsSplat *s, int at, int reach, int v0, int v1, int rows[2])
{
    const int density = s->footprint->density[1];
    int unused;
    cts_patch_rows(s->patches, at - reach > v0 ? at - reach : v0, density, &rows[0], &unused);
    cts_patch_rows(s->patches, at + reach < v1 - 1 ? at + reach : v1 - 1, density, &unused, &rows[1]);
}

/* Mark the voxels that reach into a needed patch of rows[0]..rows[1]; returns how many. */
static uint64_t mark_needed(const CtsSplat *s, int swath, const int rows[2])
{
    const int n = s->patches->n[0], beside = s->footprint->reach[0] / s->footprint->density[0];
    cts_needed_rows(s->patches, s->needed, swath, rows[0], rows[1], s->row);
    memset(s->marks, 0, ((size_t)s->n[0] / 64 + 1) * sizeof *s->marks);
    for (int t = 0, past; cts_next_run(s->row, n, &t, &past); t = past) {
        const int i0 = t * CTS_PATCH - beside, i1 = past * CTS_PATCH + beside + 1;
        cts_bits_fill(s->marks, i0 > 0 ? i0 : 0, i1 < s->n[0] ? i1 : s->n[0]);
    }
    return cts_bits_count_run(s->marks, 0, s->n[0]);
}

/* Ask early for the marked voxels of a row, in the layer that comes next: of a layer's rows little is read, too little
 * for the processor to see where it goes on. */
static void ask_for_row(const CtsSplat *s, int j)
{
    const uint16_t *row = s->row_of(s->next_rows, j);
    for (int i = 0; i < s->n[0]; i += 64) {
        const uint64_t marks = s->marks[i / 64];
        if (marks & UINT32_MAX)
            __builtin_prefetch(row + i);
        if (marks >> 32)
            __builtin_prefetch(row + i + 32);
    }
}

static void clear_needed(const CtsSplat *s, int swath, int v0, int v1)
{
    const CtsPatches *patches = s->patches;
    const int n = patches->n[0], lattice = CTS_PATCH * patches->density[0], end = s->sheet->last[0];
    for (int from = v0, to; from < v1; from = to) {
        int first, last;
        cts_patch_rows(patches, from, patches->density[1], &first, &last);
        /* An edge between two rows of patches, or all up to the next one. */
        const int edge = (last + 1) * CTS_PATCH * patches->density[1];
        to = first < last ? from + 1 : last < patches->n[1] - 1 && edge < v1 ? edge : v1;
        cts_needed_rows(patches, s->needed, swath, first, last, s->row);
        for (int t = 0, past; cts_next_run(s->row, n, &t, &past); t = past)
            for (int v = from; v < to; v++)
                clear(s, v, t * lattice, (past * lattice < end ? past * lattice : end) + 1);
    }
}

/* Whole footprints of every voxel that reaches into a needed patch: what falls beside needed points does no harm, as
 * nobody reads it. */
static CtsSplatCount splat_anew(const CtsSplat *s, int swath, int v0, int v1)
{
    const int reach = s->footprint->reach[1], density = s->footprint->density[1];
    CtsSplatCount count = {0};
    uint64_t n_marked = 0;
    int j0, j1, marked[2] = {-1, -1};
    clear_needed(s, swath, v0, v1);
    voxels_on(v0 - reach, v1 - 1 + reach, density, s->n[1], &j0, &j1);
    for (int j = j0; j < j1; j++) {
        int rows[2];
        rows_around(s, j * density, reach, v0, v1, rows);
        if (rows[0] != marked[0] || rows[1] != marked[1])
            n_marked = mark_needed(s, swath, rows);
        memcpy(marked, rows, sizeof marked);
        if (n_marked == 0)
            continue;
        if (s->next_rows)
            ask_for_row(s, j);
        const CtsScatter job = scatter_row(s, j, v0, v1);
        s->simd->scatter_marked(&job, s->marks, 0, s->n[0]);
        if (stands_in(s, swath, j))
            count.splatted += n_marked;
    }
    return count;
}

CtsSplatCount cts_splat_swath(const CtsSplat *s, int swath, bool far_edge)
{
    const int density = s->footprint->density[1];
    const int v0 = cts_swath_start(s->patches, swath, density);
    const int v1 = cts_swath_start(s->patches, swath + 1, density) + (far_edge && swath < s->patches->n_swaths - 1);
    return s->reuse ? splat_changes(s, swath, v0, v1) : splat_anew(s, swath, v0, v1);
}
