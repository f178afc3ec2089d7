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
    if ((st = cts_alloc_array(&w->marks, n_marks, err)) || (st = cts_alloc_zeroed(&w->taken, n_marks, err)) ||
        (st = cts_alloc_array(&w->changed, n_marks, err)) ||
        (st = cts_alloc_array(&w->needed, n_words * NEEDED_ROWS, err)) ||
        (st = cts_alloc_zeroed(&w->low, (size_t)p->stack.n[0] + 4 * CTS_PATCH, err)) ||
        (st = cts_alloc_zeroed(&w->high, (size_t)p->stack.n[0] + 4 * CTS_PATCH, err)))
        return st;
    return cts_alloc_array(&w->row, n_words, err);
}

void cts_swath_work_free(CtsSwathWork *w)
{
    cts_free(&w->marks);
    cts_free(&w->taken);
    cts_free(&w->changed);
    cts_free(&w->needed);
    cts_free(&w->row);
    cts_free(&w->low);
    cts_free(&w->high);
}

static void take_all(CtsSwathWork *w, int n_words)
{
    memset(w->needed, 255, (size_t)NEEDED_ROWS * (size_t)n_words * sizeof *w->needed);
}

static bool any_bits(const uint64_t *bits, int n_words)
{
    uint64_t any = 0;
    for (int i = 0; i < n_words; i++)
        any |= bits[i];
    return any != 0;
}

/* The patches that the sheet must hold, of the swath's rows and, where another swath has their edge, of the row before;
 * true when there are any. */
static bool find_needed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const int n_words = p->patches.n_words, first = p->by_swaths ? 1 : 0;
    memset(w->needed, 0, (size_t)NEEDED_ROWS * (size_t)n_words * sizeof *w->needed);
    for (int r = first; r <= CTS_SWATH; r++)
        cts_paper_needed(p, s, swath * CTS_SWATH - 1 + r, w->needed + (size_t)r * (size_t)n_words);
    return any_bits(w->needed, NEEDED_ROWS * n_words);
}

/* Clear the bits of a row of patches that show nothing on the step's layer itself, which macro-cells know only with
 * those before and behind and all around. */
static void judge(const CtsPaperPlan *p, CtsSwathWork *w, int s, int patch_v, uint64_t *row)
{
    enum { MOST_ROWS = 3 * CTS_PATCH };
    const int apron = p->rule.apron, width = CTS_PATCH + 1 + 2 * apron, n = p->stack.n[0];
    const int v0 = patch_v * CTS_PATCH - apron;
    const uint16_t *rows[MOST_ROWS];
    uint16_t *const low = w->low + CTS_PATCH, *const high = w->high + CTS_PATCH;
    int n_rows = 0;
    for (int v = v0; v < v0 + width; v++)
        if (v >= 0 && v < p->stack.n[1])
            rows[n_rows++] = cts_paper_row(p, w->store, s, v);
    const bool air = n_rows < width;
    for (int t = 0, past; cts_next_run(row, p->patches.n[0], &t, &past); t = past) {
        const int u0 = t * CTS_PATCH - apron, u1 = past * CTS_PATCH + apron + 1;
        p->simd.column_range(rows, n_rows, u0 > 0 ? u0 : 0, u1 < n ? u1 : n, low, high);
        for (int i = t; i < past; i++) {
            CtsRange range = {air ? 0 : UINT16_MAX, 0};
            for (int u = i * CTS_PATCH - apron; u < i * CTS_PATCH - apron + width; u++)
                range = cts_range_union(range, (CtsRange){low[u], high[u]});
            if (!cts_range_visible(&p->rule, range))
                row[i / 64] &= ~(UINT64_C(1) << (i & 63));
        }
    }
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

/* Mark the voxels that reach into a needed patch of rows[0]..rows[1]. */
static void mark_needed(const CtsPaperPlan *p, CtsSwathWork *w, int swath, const int rows[2])
{
    const int n = p->stack.n[0], beside = p->footprint.apron;
    needed_rows(p, w, swath, rows[0], rows[1]);
    memset(w->marks, 0, ((size_t)n / 64 + 1) * sizeof *w->marks);
    for (int t = 0, past; cts_next_run(w->row, p->patches.n[0], &t, &past); t = past) {
        const int i0 = t * CTS_PATCH - beside, i1 = past * CTS_PATCH + beside + 1;
        cts_bits_fill(w->marks, i0 > 0 ? i0 : 0, i1 < n ? i1 : n);
    }
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

/* Of the marked voxels of a row those that add anything, into w->taken; returns how many. */
static uint64_t take_marked(const CtsPaperPlan *p, CtsSwathWork *w, const uint16_t *row)
{
    const int n = p->stack.n[0];
    for (int i = 0; i < n; i += 64) {
        uint64_t *const taken = &w->taken[i / 64], marks = w->marks[i / 64];
        *taken = marks;
        if (!marks || !p->skip_void)
            continue;
        p->simd.mark(row + i, NULL, n - i < 64 ? n - i : 64, taken);
        *taken &= marks;
    }
    return cts_bits_count_run(w->taken, 0, n);
}

/* Take what changed since the sheet was made; returns how many voxels. */
static uint64_t take_changes(const CtsPaperPlan *p, CtsSwathWork *w, const CtsScatter *job)
{
    const int n = p->stack.n[0];
    p->simd.mark(job->value, job->old, n, w->taken);
    for (int i = 0; i < n / 64 + 1; i++)
        w->changed[i] |= w->taken[i];
    return cts_bits_count_run(w->taken, 0, n);
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
    uint64_t n_taken = 0;
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
            n_taken = take_changes(p, w, &job);
        } else if (reaches) {
            rows_around(p, j, v0, v1, rows);
            if (rows[0] != marked[0] || rows[1] != marked[1])
                mark_needed(p, w, swath, rows);
            memcpy(marked, rows, sizeof marked);
            n_taken = take_marked(p, w, job.value);
        }
        if (!reaches || n_taken == 0)
            continue;
        p->simd.scatter(&job, w->taken, p->stack.n[0]);
        if (j >= own0 && j < own1)
            w->splatted += n_taken;
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

/* The patches that the one plane of a step looks at, which are known once all swaths are splatted. */
static bool take_shown(const CtsPaperPlan *p, CtsSwathWork *w, int swath)
{
    const int n_words = p->patches.n_words, before = swath * CTS_SWATH - 1;
    memset(w->needed, 0, (size_t)NEEDED_ROWS * (size_t)n_words * sizeof *w->needed);
    for (int r = p->by_swaths || swath == 0 ? 1 : 0; r <= CTS_SWATH && before + r < p->patches.n[1]; r++)
        memcpy(w->needed + (size_t)r * (size_t)n_words, p->shown + (size_t)(before + r) * (size_t)n_words,
               (size_t)n_words * sizeof *w->needed);
    return any_bits(w->needed, NEEDED_ROWS * n_words);
}

void cts_swath_gradients(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const bool far_edge = p->by_swaths && swath < p->patches.n_swaths - 1;
    const bool needed = p->shown && p->samples == 1 ? take_shown(p, w, swath) : find_needed(p, w, s, swath);
    const int past = needed ? cts_swath_start(&p->patches, swath + 1, 1) + far_edge : 0;
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

/* Ask early for the next layer's voxels where something may show: of a layer's rows little is read, too little for the
 * processor to see where it goes on. */
static void ask_for_next(const CtsPaperPlan *p, const CtsSwathWork *w, int s, int patch_v, const uint64_t *shown)
{
    for (int v = patch_v * CTS_PATCH; v < (patch_v + 1) * CTS_PATCH && v < p->stack.n[1]; v++) {
        const uint16_t *row = cts_paper_row(p, w->store, s + 1, v);
        for (int t = 0, past; cts_next_run(shown, p->patches.n[0], &t, &past); t = past)
            for (int u = t * CTS_PATCH; u < past * CTS_PATCH && u < p->stack.n[0]; u += 32)
                __builtin_prefetch(row + u);
    }
}

/* What is to be composited of the swath, and with void skipping by itself what the sheet must hold of it. */
static void find_shown(CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const size_t n_words = (size_t)p->patches.n_words;
    for (int i = 0; i < CTS_SWATH && swath * CTS_SWATH + i < p->patches.n[1]; i++) {
        const int r = swath * CTS_SWATH + i;
        uint64_t *const shown = p->shown + (size_t)r * n_words;
        cts_paper_shown(p, s, r, shown);
        if (p->skip_void && s + 1 < p->stack.n_layers)
            ask_for_next(p, w, s, r, shown);
        if (!p->skip_void || p->samples > 1)
            continue;
        judge(p, w, s, r, shown);
        memcpy(w->needed + (size_t)(i + 1) * n_words, shown, n_words * sizeof *shown);
    }
}

bool cts_swath_splat(CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    int *const holds = &w->store->sheet[s % p->n_sheets].step[swath];
    const bool held = p->reuse && *holds == s - p->n_sheets && *holds >= 0;
    bool needed = find_needed(p, w, s, swath);
    if (p->skip_void)
        find_shown(p, w, s, swath);
    /* A sheet keeps account by whole swaths, and lasts longest where nothing is left out. */
    if (p->reuse)
        take_all(w, p->patches.n_words);
    else
        needed = needed && any_bits(w->needed, NEEDED_ROWS * p->patches.n_words);
    if (needed) {
        splat(p, w, s, swath, held);
        *holds = s;
    }
    if (p->reuse && !p->skip_void) {
        cts_quiet_swath(p, w->store, s, swath, held ? w->changed : NULL);
        find_shown(p, w, s, swath);
    }
    return needed;
}
