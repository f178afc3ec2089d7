#include "engine/splat/swath.h"

#include "base/bits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "engine/splat/layers.h"
#include <string.h>

enum { NEEDED_ROWS = CTS_SWATH + 2 }; /* a swath's rows of patches, and those at either side */

CtsStatus cts_swath_work_init(CtsSwathWork *w, const CtsPaperPlan *p, CtsError *err)
{
    const size_t n_marks = (size_t)p->stack.n[0] / 64 + 1, n_words = (size_t)p->patches.n_words;
    CtsStatus st;
    if ((st = cts_alloc_array(&w->marks, n_marks, err)) || (st = cts_alloc_array(&w->changed, n_marks, err)) ||
        (st = cts_alloc_array(&w->needed, n_words * NEEDED_ROWS, err)))
        return st;
    return cts_alloc_array(&w->row, n_words, err);
}

void cts_swath_work_free(CtsSwathWork *w)
{
    cts_free(&w->marks);
    cts_free(&w->changed);
    cts_free(&w->needed);
    cts_free(&w->row);
}

/* The patches that the sheet must hold, of the swath's rows and, where another swath has their edge, of the row before;
 * true when there are any. */
static bool find_needed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const int n_words = p->patches.n_words, first = p->by_swaths ? 1 : 0;
    const size_t n = (size_t)NEEDED_ROWS * (size_t)n_words;
    uint64_t any = 0;
    memset(w->needed, 0, n * sizeof *w->needed);
    for (int r = first; r <= CTS_SWATH; r++)
        cts_paper_needed(p, s, swath * CTS_SWATH - 1 + r, w->needed + (size_t)r * (size_t)n_words);
    for (size_t i = 0; i < n; i++)
        any |= w->needed[i];
    /* With reuse a sheet keeps account by whole swaths. */
    if (p->reuse && any)
        memset(w->needed, 255, n * sizeof *w->needed);
    return any != 0;
}

/* w->row becomes the patches of rows first..last, of those found, that any of them needs. */
static void needed_rows(const CtsPaperPlan *p, CtsSwathWork *w, int swath, int first, int last)
{
    const int n_words = p->patches.n_words;
    const uint64_t *from = w->needed + (size_t)(first - (CTS_SWATH * swath - 1)) * (size_t)n_words;
    for (int i = 0; i < n_words; i++) {
        w->row[i] = from[i];
        for (int r = 1; r <= last - first; r++)
            w->row[i] |= from[r * n_words + i];
    }
}

static int floor_div(int a, int b)
{
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

/* The rows of a footprint that voxel row j has in lattice rows v0..v1-1; sheet at that of tap row tap0. */
static CtsScatter scatter_row(const CtsPaperPlan *p, const CtsPaperStore *store, int s, int j, int v0, int v1)
{
    const CtsFootprint *f = &p->footprint;
    const CtsSheet *sheet = &store->sheet[s % p->n_sheets];
    const int reach = f->reach[1], at = j * f->density[1];
    const int first = v0 - at > -reach ? v0 - at : -reach, past = v1 - at < reach + 1 ? v1 - at : reach + 1;
    return (CtsScatter){.footprint = f,
                        .sheet = sheet->origin + (ptrdiff_t)(at + first) * (ptrdiff_t)sheet->stride - f->reach[0],
                        .stride = sheet->stride,
                        .tap0 = first + reach,
                        .tap1 = past + reach,
                        .value = cts_paper_row(p, store, s, j)};
}

static void clear_needed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath, int v0, int v1)
{
    const CtsSheet *sheet = &w->store->sheet[s % p->n_sheets];
    const int lattice = CTS_PATCH * p->patches.density[0], end = sheet->last[0];
    for (int v = v0, known = -1; v < v1; v++) {
        int first, last;
        cts_patch_rows(&p->patches, v, p->patches.density[1], &first, &last);
        if (first != known || first != last)
            needed_rows(p, w, swath, first, last);
        known = first == last ? first : -1;
        for (int t = 0, past; cts_next_run(w->row, p->patches.n[0], &t, &past); t = past) {
            const int u0 = t * lattice, u1 = past * lattice < end ? past * lattice : end;
            memset(sheet->origin + (size_t)v * sheet->stride + u0, 0, (size_t)(u1 + 1 - u0) * sizeof *sheet->origin);
        }
    }
}

/* Mark the voxels that reach into a needed patch of rows[0]..rows[1]; returns how many. */
static uint64_t mark_needed(const CtsPaperPlan *p, CtsSwathWork *w, int swath, const int rows[2])
{
    const int n = p->stack.n[0], beside = p->footprint.apron;
    needed_rows(p, w, swath, rows[0], rows[1]);
    memset(w->marks, 0, ((size_t)n / 64 + 1) * sizeof *w->marks);
    for (int t = 0, past; cts_next_run(w->row, p->patches.n[0], &t, &past); t = past) {
        const int i0 = t * CTS_PATCH - beside, i1 = past * CTS_PATCH + beside + 1;
        cts_bits_fill(w->marks, i0 > 0 ? i0 : 0, i1 < n ? i1 : n);
    }
    return cts_bits_count_run(w->marks, 0, n);
}

/* The patches that any row of lattice rows v0..v1-1 within reach of voxel row j belongs to: first to last row of them.
 */
static void rows_around(const CtsPaperPlan *p, int j, int v0, int v1, int rows[2])
{
    const int density = p->footprint.density[1], at = j * density, reach = p->footprint.reach[1];
    int unused;
    cts_patch_rows(&p->patches, at - reach > v0 ? at - reach : v0, density, &rows[0], &unused);
    cts_patch_rows(&p->patches, at + reach < v1 - 1 ? at + reach : v1 - 1, density, &unused, &rows[1]);
}

/* Ask early for the marked voxels of a row, in the layer that comes next: of a layer's rows little is read, too little
 * for the processor to see where it goes on. */
static void ask_for_row(const CtsPaperPlan *p, const CtsSwathWork *w, int s, int j)
{
    const uint16_t *row = cts_paper_row(p, w->store, s + 1, j);
    for (int i = 0; i < p->stack.n[0]; i += 64) {
        const uint64_t marks = w->marks[i / 64];
        if (marks & UINT32_MAX)
            __builtin_prefetch(row + i);
        if (marks >> 32)
            __builtin_prefetch(row + i + 32);
    }
}

/* Mark what changed since the sheet was made; returns how many voxels. */
static uint64_t mark_changes(const CtsPaperPlan *p, CtsSwathWork *w, const CtsScatter *job)
{
    const int n = p->stack.n[0];
    p->simd.mark(job->value, job->old, n, w->marks);
    for (int i = 0; i < n / 64 + 1; i++)
        w->changed[i] |= w->marks[i];
    return cts_bits_count_run(w->marks, 0, n);
}

/* Sums of changes kept in float, to prove that it would be noticed. */
static void drift(const CtsSheet *sheet, int v0, int v1)
{
    for (int v = v0; v < v1; v++)
        for (int u = 0; u <= sheet->last[0]; u++)
            sheet->origin[(size_t)v * sheet->stride + (size_t)u] =
                (uint32_t)(float)sheet->origin[(size_t)v * sheet->stride + (size_t)u];
}

/* Whole footprints of every voxel that reaches into a needed patch: what falls beside needed points does no harm, as
 * nobody reads it. Where the sheet holds the swath, the changes of all voxels instead. */
static void splat(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath, bool held)
{
    const int reach = p->footprint.reach[1], density = p->footprint.density[1];
    const int v0 = cts_swath_start(&p->patches, swath, density);
    const int v1 = cts_swath_start(&p->patches, swath + 1, density) + (p->by_swaths && swath < p->patches.n_swaths - 1);
    const int own0 = cts_swath_start(&p->patches, swath, 1), own1 = cts_swath_start(&p->patches, swath + 1, 1);
    /* The far edge's voxels too, which change what lies before it. */
    const int j0 = -floor_div(reach - v0, density), j1 = floor_div(v1 + reach, density) + 1;
    int marked[2] = {-1, -1};
    uint64_t n_marked = 0;
    const uint64_t before = w->splatted;
    memset(w->changed, 0, ((size_t)p->stack.n[0] / 64 + 1) * sizeof *w->changed);
    if (!held)
        clear_needed(p, w, s, swath, v0, v1);
    for (int j = j0 > 0 ? j0 : 0; j < j1 && j < p->stack.n[1]; j++) {
        CtsScatter job = scatter_row(p, w->store, s, j, v0, v1);
        const bool reaches = job.tap0 < job.tap1;
        int rows[2];
        if (held) {
            job.old = cts_paper_row(p, w->store, s - p->n_sheets, j);
            n_marked = mark_changes(p, w, &job);
        } else if (reaches) {
            rows_around(p, j, v0, v1, rows);
            if (rows[0] != marked[0] || rows[1] != marked[1])
                n_marked = mark_needed(p, w, swath, rows);
            memcpy(marked, rows, sizeof marked);
        }
        if (!reaches || n_marked == 0)
            continue;
        if (p->skip_void && s + 1 < p->stack.n_layers)
            ask_for_row(p, w, s, j);
        p->simd.scatter(&job, w->marks, p->stack.n[0]);
        if (j >= own0 && j < own1)
            w->splatted += n_marked;
    }
    if (held)
        w->reused += (uint64_t)(own1 - own0) * (uint64_t)p->stack.n[0] - (w->splatted - before);
    if (CTS_MUTATED(FLOAT_DRIFT) && held)
        drift(&w->store->sheet[s % p->n_sheets], v0, v1);
}

/* Gradients at voxels u0..u1-1 of row v of layer k. */
static void gradient_row(const CtsPaperPlan *p, const CtsStack *s, int k, int v, int u0, int u1, float (*field)[4])
{
    const int dv = p->shade.step[1], dk = p->shade.step[2];
    const bool ends[2][2] = {{v < dv, v >= s->n[1] - dv}, {k < dk, k >= s->n_layers - dk}};
    CtsGradientRows rows = {.row = cts_stack_row(s, k, v), .n = s->n[0], .air_beyond = p->shade.air_beyond};
    const uint16_t *const beyond = p->air ? p->air : rows.row;
    for (int i = 0; i < 2; i++) {
        const int u = i == 0 ? dv : 0, q = i == 0 ? 0 : dk;
        rows.before[i] = ends[i][0] ? beyond : cts_stack_row(s, k - q, v - u);
        rows.after[i] = ends[i][1] ? beyond : cts_stack_row(s, k + q, v + u);
        rows.scale[i] = !p->air && (ends[i][0] || ends[i][1]) ? 2 : 1;
    }
    p->simd.gradient(&rows, u0, u1, field + (size_t)v * p->gradient_stride);
}

void cts_swath_gradients(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const bool far_edge = p->by_swaths && swath < p->patches.n_swaths - 1;
    const int past = find_needed(p, w, s, swath) ? cts_swath_start(&p->patches, swath + 1, 1) + far_edge : 0;
    for (int v = cts_swath_start(&p->patches, swath, 1); v < past; v++) {
        int first, last;
        cts_patch_rows(&p->patches, v, 1, &first, &last);
        needed_rows(p, w, swath, first, last);
        for (int t = 0, end; cts_next_run(w->row, p->patches.n[0], &t, &end); t = end) {
            const int u1 = end * CTS_PATCH < p->stack.n[0] ? end * CTS_PATCH + 1 : p->stack.n[0];
            gradient_row(p, &w->store->stack, cts_paper_layer(p, s), v, t * CTS_PATCH, u1,
                         w->store->gradient[s % p->n_sheets]);
        }
    }
}

bool cts_swath_splat(CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    int *const holds = &w->store->sheet[s % p->n_sheets].step[swath];
    const bool held = p->reuse && *holds == s - p->n_sheets && *holds >= 0, needed = find_needed(p, w, s, swath);
    if (needed) {
        splat(p, w, s, swath, held);
        *holds = s;
    }
    if (p->reuse && !p->skip_void)
        cts_quiet_swath(p, w->store, s, swath, held ? w->changed : NULL);
    for (int r = swath * CTS_SWATH; r < (swath + 1) * CTS_SWATH && r < p->patches.n[1] && p->shown; r++)
        cts_paper_shown(p, s, r, p->shown + (size_t)r * (size_t)p->patches.n_words);
    return needed;
}
