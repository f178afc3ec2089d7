#include "engine/splat/swath.h"

#include "base/bits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include <string.h>

CtsStatus cts_swath_work_init(CtsSwathWork *w, const CtsPaperPlan *p, CtsError *err)
{
    const size_t n = (size_t)p->patches.n_cell_words;
    const CtsStatus st = cts_alloc_zeroed(&w->marks, n * (3 + CTS_SWATH_CELLS + 1 + CTS_SWATH_VOXELS), err);
    if (st)
        return st;
    w->selected = w->marks + n;
    w->row = w->selected + n;
    w->cells = w->row + n;
    w->visible = w->cells + n * (CTS_SWATH_CELLS + 1);
    return CTS_OK;
}

/* The words of rows of bits that are not 0, and one more on either side; false when all are 0. */
static bool find_words(CtsSwathWork *w, const uint64_t *rows, int n_words, int n_rows)
{
    w->first = n_words;
    w->past = 0;
    for (int r = 0; r < n_rows; r++)
        for (int i = 0; i < n_words; i++)
            if (rows[r * n_words + i]) {
                w->first = i < w->first ? i : w->first;
                w->past = i + 1 > w->past ? i + 1 : w->past;
            }
    const bool any = w->first < w->past;
    w->first = w->first > 0 ? w->first - 1 : 0;
    w->past = w->past < n_words ? w->past + 1 : n_words;
    return any;
}

/* to = rows first..past-1 of bits together; whether any is set. */
static bool join_rows_of_bits(const CtsSwathWork *w, const uint64_t *rows, int n_words, int first, int past,
                              uint64_t *to)
{
    uint64_t any = 0;
    for (int i = w->first; i < w->past; i++) {
        uint64_t bits = 0;
        for (int r = first; r < past; r++)
            bits |= rows[r * n_words + i];
        any |= to[i] = bits;
    }
    return any != 0;
}

/* Bit i of `to`: whether any of bits i + low .. i + high is set. */
static void spread_columns(const CtsSwathWork *w, const uint64_t *from, int low, int high, uint64_t *to)
{
    for (int i = w->first; i < w->past; i++) {
        const uint64_t before = i > w->first ? from[i - 1] : 0, after = i + 1 < w->past ? from[i + 1] : 0;
        uint64_t any = from[i];
        for (int k = 1; k <= high; k++)
            any |= from[i] >> k | after << (64 - k);
        for (int k = 1; k <= -low; k++)
            any |= from[i] << k | before >> (64 - k);
        to[i] = any;
    }
}

/* The cells of a row of patches. */
static void cells_of(const CtsPatches *patches, const uint64_t *row, uint64_t *cells)
{
    for (int i = 0; i < patches->n_cell_words; i++) {
        uint64_t x = i / 4 < patches->n_words ? row[i / 4] >> 16 * (i & 3) & 0xffff : 0;
        x = (x | x << 24) & UINT64_C(0x000000ff000000ff);
        x = (x | x << 12) & UINT64_C(0x000f000f000f000f);
        x = (x | x << 6) & UINT64_C(0x0303030303030303);
        x = (x | x << 3) & UINT64_C(0x1111111111111111);
        cells[i] = x * 15;
    }
}

static uint64_t *cell_row(const CtsPaperPlan *p, const CtsSwathWork *w, int v)
{
    return w->cells + (size_t)(v + 1) * (size_t)p->patches.n_cell_words;
}

/* The cells that the sheet must contain by macro-cells, of the swath's rows and, where another swath has their edge, of
 * the row before; true when there are any. */
static bool find_needed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const int n_words = p->patches.n_cell_words;
    memset(w->cells, p->skip_void ? 0 : 255, (size_t)(n_words * (CTS_SWATH_CELLS + 1)) * sizeof *w->cells);
    for (int v = p->by_swaths ? 0 : -1; v < CTS_SWATH_CELLS && p->skip_void; v++) {
        const int patch_v = swath * CTS_SWATH + (v < 0 ? -1 : v / CTS_PATCH);
        if (v > 0 && v % CTS_PATCH > 0) {
            memcpy(cell_row(p, w, v), cell_row(p, w, v - 1), (size_t)n_words * sizeof *w->cells);
            continue;
        }
        memset(w->row, 0, (size_t)p->patches.n_words * sizeof *w->row);
        if (patch_v >= 0 && patch_v < p->patches.n[1])
            cts_paper_add_open(p, s, s - 1, patch_v, w->row);
        if (patch_v >= 0 && patch_v < p->patches.n[1] && p->samples > 1)
            cts_paper_add_open(p, s, s + 1, patch_v, w->row);
        cells_of(&p->patches, w->row, cell_row(p, w, v));
    }
    return find_words(w, w->cells, n_words, CTS_SWATH_CELLS + 1);
}

/* If pixels cross rows of cells, these rows get the union of their visible cells. */
static void make_alike(const CtsPaperPlan *p, uint64_t *rows, int n_rows)
{
    const int n_words = p->patches.n_cell_words, n_alike = p->patches.row_cells;
    for (int r = 0; r < n_rows && n_alike > 1; r += n_alike)
        for (int i = 0; i < n_words; i++) {
            uint64_t any = 0;
            for (int k = r; k < r + n_alike && k < n_rows; k++)
                any |= rows[k * n_words + i];
            for (int k = r; k < r + n_alike && k < n_rows; k++)
                rows[k * n_words + i] = any;
        }
}

/* w->row becomes the union of rows first..last of the needed cells, within the swath's own; returns true if it is not
 * empty. */
static bool needed_rows(const CtsPaperPlan *p, CtsSwathWork *w, int swath, int first, int last)
{
    const int v0 = swath * CTS_SWATH_CELLS - 1, past = last + 1 - v0;
    return join_rows_of_bits(w, w->cells, p->patches.n_cell_words, first > v0 ? first - v0 : 0,
                             past < CTS_SWATH_CELLS + 1 ? past : CTS_SWATH_CELLS + 1, w->row);
}

/* Of row j the voxels of at least some level that reach into a needed cell; returns how many. */
static uint64_t select_needed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath, int j, uint16_t least,
                              uint64_t *selected)
{
    const int apron = p->footprint.apron, from = 64 * w->first;
    uint64_t n = 0;
    memset(selected + w->first, 0, (size_t)(w->past - w->first) * sizeof *selected);
    if (j < 0 || j >= p->stack.n[1] || !needed_rows(p, w, swath, j - 1 - apron, j + apron))
        return 0;
    spread_columns(w, w->row, -1 - apron, apron, w->marks);
    p->simd->mark(cts_paper_row(p, w->store, s, j) + from, NULL, least,
                  (64 * w->past < p->stack.n[0] ? 64 * w->past : p->stack.n[0]) - from, w->marks + w->first,
                  selected + w->first);
    for (int i = w->first; i < w->past; i++)
        n += (uint64_t)cts_popcount(selected[i]);
    return n;
}

/* Drops cells that no voxel of the step's own layer makes visible; macro-cells include the voxels around it. */
static void find_changed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const int n_words = p->patches.n_cell_words, apron = p->rule.apron, j0 = swath * CTS_SWATH_CELLS - apron;
    for (int r = 0; r < CTS_SWATH_CELLS + 1 + 2 * apron; r++)
        select_needed(p, w, s, swath, j0 + r, p->least, w->visible + r * n_words);
    for (int v = 0; v < CTS_SWATH_CELLS; v++) {
        join_rows_of_bits(w, w->visible, n_words, v, v + 2 + 2 * apron, w->marks);
        spread_columns(w, w->marks, -apron, 1 + apron, w->row);
        for (int i = w->first; i < w->past; i++)
            cell_row(p, w, v)[i] &= w->row[i];
    }
    make_alike(p, cell_row(p, w, 0), CTS_SWATH_CELLS);
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

/* Rows of the lattice, by words in which any point is needed. */
static void clear_needed(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath, int v0, int v1)
{
    const CtsSheet *sheet = &w->store->sheet[s % p->n_sheets];
    const int width = 64 * p->patches.density[0], shift = __builtin_ctz((unsigned)p->patches.density[1]);
    for (int v = v0; v < v1; v++) {
        uint32_t *const row = sheet->origin + (size_t)v * sheet->stride;
        const int below = v >> shift;
        needed_rows(p, w, swath, v == below << shift ? below - 1 : below, below);
        for (int first = w->first, past; first < w->past; first = past + 1) {
            for (past = first; past < w->past && w->row[past]; past++)
                ;
            const int u1 = past * width < sheet->last[0] ? past * width : sheet->last[0];
            if (past > first)
                memset(row + first * width, 0, (size_t)(u1 + 1 - first * width) * sizeof *row);
        }
    }
}

/* Row j of the layer's visible voxels in a swath, or NULL: it does not reach in. */
static uint64_t *visible_row(const CtsPaperPlan *p, int s, int swath, int j)
{
    const int apron = p->rule.apron, r = j - (swath * CTS_SWATH_CELLS - apron);
    if (r < 0 || r >= CTS_SWATH_CELLS + 1 + 2 * apron)
        return NULL;
    return p->visible[s % p->n_sheets] +
           ((size_t)swath * CTS_SWATH_VOXELS + (size_t)r) * (size_t)p->patches.n_cell_words;
}

/* Bring it up to date where voxels changed. */
static void note_visible(const CtsPaperPlan *p, const CtsSwathWork *w, const uint16_t *value, uint64_t *visible)
{
    p->simd->mark(value, NULL, (uint16_t)(p->least + CTS_MUTATED(QUIET_RANGE)), p->stack.n[0], w->selected, w->marks);
    for (int i = 0; 64 * i < p->stack.n[0]; i++)
        visible[i] = (visible[i] & ~w->selected[i]) | w->marks[i];
}

/* Sums of changes kept in float, to prove that it would be noticed. */
static void drift(const CtsSheet *sheet, int v0, int v1)
{
    for (int v = v0; v < v1; v++)
        for (int u = 0; u <= sheet->last[0]; u++)
            sheet->origin[(size_t)v * sheet->stride + (size_t)u] =
                (uint32_t)(float)sheet->origin[(size_t)v * sheet->stride + (size_t)u];
}

static void scatter_words(const CtsPaperPlan *p, const CtsSwathWork *w, CtsScatter job)
{
    const int from = 64 * w->first, past = 64 * w->past < p->stack.n[0] ? 64 * w->past : p->stack.n[0];
    job.sheet += from * p->footprint.density[0];
    job.value += from;
    if (job.old)
        job.old += from;
    p->simd->scatter(&job, w->selected + w->first, past - from);
}

/* Complete footprints of every voxel that reaches into a needed cell: contributions beside needed points are harmless,
 * as they are not read. Where the sheet contains the swath, the changes of all voxels instead. */
static void splat_swath(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath, bool held)
{
    const int reach = p->footprint.reach[1], density = p->footprint.density[1];
    const int v0 = cts_swath_start(&p->patches, swath, density);
    const int v1 = cts_swath_start(&p->patches, swath + 1, density) + (p->by_swaths && swath < p->patches.n_swaths - 1);
    const int own0 = cts_swath_start(&p->patches, swath, 1), own1 = cts_swath_start(&p->patches, swath + 1, 1);
    /* Includes the far edge's voxels, which change points before it. */
    const int j0 = -floor_div(reach - v0, density), j1 = floor_div(v1 + reach, density) + 1;
    const int n = p->stack.n[0];
    uint64_t n_selected = (uint64_t)n;
    const uint64_t before = w->splatted;
    if (!held)
        clear_needed(p, w, s, swath, v0, v1);
    if (!held && !p->skip_void) {
        memset(w->selected, 0, (size_t)p->patches.n_cell_words * sizeof *w->selected);
        cts_bits_fill(w->selected, 0, n);
    }
    for (int j = j0 > 0 ? j0 : 0; j < j1 && j < p->stack.n[1]; j++) {
        CtsScatter job = scatter_row(p, w->store, s, j, v0, v1);
        if (held) {
            job.old = cts_paper_row(p, w->store, s - p->n_sheets, j);
            p->simd->mark(job.value, job.old, 0, n, NULL, w->selected);
            n_selected = cts_bits_count_run(w->selected, 0, n);
        } else if (p->skip_void && job.tap0 < job.tap1) {
            n_selected = select_needed(p, w, s, swath, j, 1, w->selected);
        }
        if (p->visible[0] && visible_row(p, s, swath, j))
            note_visible(p, w, job.value, visible_row(p, s, swath, j));
        if (job.tap0 >= job.tap1 || n_selected == 0)
            continue;
        scatter_words(p, w, job);
        if (j >= own0 && j < own1)
            w->splatted += n_selected;
    }
    if (held)
        w->reused += (uint64_t)(own1 - own0) * (uint64_t)n - (w->splatted - before);
    if (CTS_MUTATED(FLOAT_DRIFT) && held)
        drift(&w->store->sheet[s % p->n_sheets], v0, v1);
}

/* Gradients at voxels u0..u1-1 of row v of layer k. */
static void gradient_row(const CtsPaperPlan *p, int k, int v, int u0, int u1, float (*field)[4])
{
    const CtsStack *const s = &p->stack;
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
    p->simd->gradient(&rows, u0, u1, field + (size_t)v * (size_t)s->n[0]);
}

/* The swath's rows of cells to composite, and their number. */
static uint64_t *shown_rows(const CtsPaperPlan *p, int swath, int *n_rows)
{
    const int v0 = swath * CTS_SWATH_CELLS, left = p->patches.n_cells[1] - v0;
    *n_rows = left < CTS_SWATH_CELLS ? left : CTS_SWATH_CELLS;
    return p->shown + (size_t)v0 * (size_t)p->patches.n_cell_words;
}

/* The cells that the single plane of a step samples, known once all swaths are splatted. */
static bool load_shown(const CtsPaperPlan *p, CtsSwathWork *w, int swath)
{
    const int n_words = p->patches.n_cell_words;
    int n_rows;
    const uint64_t *shown = shown_rows(p, swath, &n_rows);
    memset(w->cells, 0, (size_t)(n_words * (CTS_SWATH_CELLS + 1)) * sizeof *w->cells);
    for (int v = p->by_swaths || swath == 0 ? 0 : -1; v < n_rows; v++)
        memcpy(cell_row(p, w, v), shown + v * n_words, (size_t)n_words * sizeof *w->cells);
    return find_words(w, w->cells, n_words, CTS_SWATH_CELLS + 1);
}

void cts_swath_gradients(const CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const bool far_edge = p->by_swaths && swath < p->patches.n_swaths - 1;
    const bool needed = p->shown && p->samples == 1 ? load_shown(p, w, swath) : find_needed(p, w, s, swath);
    const int past = needed ? cts_swath_start(&p->patches, swath + 1, 1) + far_edge : 0;
    for (int v = cts_swath_start(&p->patches, swath, 1); v < past; v++) {
        memset(w->row, 0, (size_t)p->patches.n_cell_words * sizeof *w->row);
        needed_rows(p, w, swath, v - 1, v);
        for (int t = 0, end; cts_next_run(w->row, p->patches.n_cells[0], &t, &end); t = end)
            gradient_row(p, cts_paper_layer(p, s), v, t, end < p->stack.n[0] ? end + 1 : p->stack.n[0],
                         w->store->gradient[s % p->n_sheets]);
    }
}

/* The cells to composite in the swath: with void skipping the needed cells on a layer, and between two layers by
 * macro-cells; else the cells that visible voxels of the sheets reach. */
static void find_shown(CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    const int n_words = p->patches.n_cell_words, apron = p->rule.apron;
    int n_rows;
    uint64_t *const shown = shown_rows(p, swath, &n_rows);
    for (int v = 0; v < n_rows; v++) {
        uint64_t *const row = shown + v * n_words;
        if (p->skip_void && p->samples == 1) {
            memcpy(row, cell_row(p, w, v), (size_t)n_words * sizeof *row);
        } else if (p->skip_void) {
            memset(w->row, 0, (size_t)p->patches.n_words * sizeof *w->row);
            cts_paper_add_open(p, s, s - 1, swath * CTS_SWATH + v / CTS_PATCH, w->row);
            cells_of(&p->patches, w->row, row);
        } else {
            const int j0 = swath * CTS_SWATH_CELLS - apron, past = v + 2 + 2 * apron;
            join_rows_of_bits(w, visible_row(p, s, swath, j0), n_words, v, past, w->row);
            if (p->n_sheets > 1) {
                join_rows_of_bits(w, visible_row(p, s + 1, swath, j0), n_words, v, past, w->marks);
                for (int i = 0; i < n_words; i++)
                    w->row[i] |= w->marks[i];
            }
            spread_columns(w, w->row, -apron, 1 + apron, row);
        }
    }
    make_alike(p, shown, n_rows);
}

bool cts_swath_splat(CtsPaperPlan *p, CtsSwathWork *w, int s, int swath)
{
    int *const holds = &w->store->sheet[s % p->n_sheets].step[swath];
    const int n_words = p->patches.n_cell_words;
    const bool held = p->reuse && *holds == s - p->n_sheets && *holds >= 0;
    bool needed = find_needed(p, w, s, swath);
    if (p->skip_void && needed && p->samples == 1)
        find_changed(p, w, s, swath);
    if (p->skip_void)
        find_shown(p, w, s, swath);
    /* A sheet's state is kept by whole swaths, and is valid longest where nothing is skipped. */
    if (p->reuse)
        memset(w->cells, 255, (size_t)(n_words * (CTS_SWATH_CELLS + 1)) * sizeof *w->cells);
    needed = find_words(w, w->cells, n_words, CTS_SWATH_CELLS + 1) && needed;
    if (needed) {
        splat_swath(p, w, s, swath, held);
        *holds = s;
    }
    if (p->visible[0])
        find_shown(p, w, s, swath);
    return needed;
}
