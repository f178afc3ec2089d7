#include "core/scene/openness.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "core/model/macrocells.h"
#include "core/model/voxel_labels.h"
#include "core/scene/openness_beams.h"
#include <math.h>
#include <string.h>

/* Edge of a block, and the reach of openness. A block is larger where a volume would have more than MAX_BLOCKS. */
#define BLOCK_MM 2.5
#define REACH_MM 35.0
#define MAX_BLOCKS 0x1p22

/* Extinction of grey levels, in whole numbers, so that sums do not depend on their order: 65535 is the largest. */
#define EXTINCTION_UNIT (CTS_MAX_EXTINCTION_PER_MM / UINT16_MAX)

enum {
    N_LEVELS = UINT16_MAX + 1,
    MAX_EDGE = 256,                   /* voxels of a block's edge: sums over a block's rows stay below 2^32 */
    N_AXES = OPENNESS_DIRECTIONS / 2, /* directions of which none is another's opposite */
    /* Blocks of a tile along y and z, and along x. The steps of a tile's rows along a direction are rows of the next
     * ones, so that the first cache has them. */
    TILE_ROWS = 8,
    TILE_LAYERS = 16,
    TILE_WIDTH = 128
};

/* A direction and its opposite. */
typedef struct Axis {
    int step[3];
    int n_steps; /* K */
    int length;  /* of a step: which of Making.length_mm */
} Axis;

typedef struct Making {
    CtsOpenness *open;
    const CtsVolume *volume, *shown;
    const CtsVoxelLabels *voxel_labels;
    const CtsMacrocells *macrocells; /* of shown; NULL: unknown */
    uint16_t *extinction;            /* by appearance and grey level, in EXTINCTION_UNIT */
    uint32_t *visible_below; /* by grey level: lower ones that have an extinction; NULL where appearances differ */
    uint8_t *visible_cell;   /* by fine macro-cell: 1 where a voxel may have an extinction; NULL: unknown */
    uint32_t *row_sums;      /* by worker and voxel of a row: sum of extinctions over a block's rows */
    uint16_t *row_means;     /* by worker and block of a row: mean extinction */
    uint8_t *row_cells; /* by worker and macro-cell of a row: 1 where one of the block's rows of cells is visible */
    Axis axis[N_AXES];
    int n_lengths;
    double length_mm[N_AXES];
    uint16_t *passed[N_AXES]; /* transmittance of a mean extinction for each length, in 2^-16 */
    /* Transmittance of blocks, rows of them, each with a margin where nothing absorbs between it and the next. */
    uint16_t *transmittance[N_AXES];
    int margin, row;   /* blocks of it; of a row with it */
    uint8_t *openness; /* by block */
} Making;

static void size_blocks(CtsOpenness *o, const CtsVolume *v)
{
    double mm3 = 1;
    for (int a = 0; a < 3; a++)
        mm3 *= cts_volume_spacing_mm(v, a) * v->dims[a];
    const double edge_mm = fmax(BLOCK_MM, cbrt(mm3 / MAX_BLOCKS));
    for (int a = 0; a < 3; a++) {
        const double voxels = floor(edge_mm / cts_volume_spacing_mm(v, a) + 0.5);
        const int most = v->dims[a] < MAX_EDGE ? v->dims[a] : MAX_EDGE;
        o->size[a] = voxels < 1 ? 1 : voxels > most ? most : (int)voxels;
        o->n[a] = (v->dims[a] - 1) / o->size[a] + 1;
        o->scale[a] = 1.0 / o->size[a];
        o->shift[a] = CTS_MUTATED(OPEN_PLACE) ? 0 : -0.5 * (o->size[a] - 1) / o->size[a];
    }
    o->plane = o->n[2] > 1 ? o->n[0] * o->n[1] : 0;
}

static double step_mm(const Making *m, const int step[3])
{
    double square = 0;
    for (int c = 0; c < 3; c++) {
        double along = 0;
        for (int a = 0; a < 3; a++)
            along += step[a] * m->open->size[a] * m->volume->step_lps[a][c];
        square += along * along;
    }
    return sqrt(square);
}

/* Lengths that differ by rounding alone share their table. */
static int find_length(Making *m, double mm)
{
    int i = 0;
    while (i < m->n_lengths && fabs(m->length_mm[i] - mm) > 1e-9 * mm)
        i++;
    if (i == m->n_lengths)
        m->length_mm[m->n_lengths++] = mm;
    return i;
}

static void find_light_axes(Making *m)
{
    int n = 0;
    for (int code = 14; code < 27; code++) { /* the later half of 27 neighbours */
        Axis *const axis = &m->axis[n++];
        for (int a = 0, rest = code; a < 3; a++, rest /= 3)
            axis->step[a] = rest % 3 - 1;
        const double mm = step_mm(m, axis->step), steps = floor(REACH_MM / mm + 0.5) - 1;
        axis->n_steps = steps < 0 ? 0 : steps > OPENNESS_MAX_STEPS ? OPENNESS_MAX_STEPS : (int)steps;
        axis->length = find_length(m, mm);
        m->margin = axis->n_steps > m->margin ? axis->n_steps : m->margin;
    }
    m->row = m->open->n[0] + m->margin;
}

static void fill_extinction(uint16_t *extinction, const CtsPreset *preset, const CtsVolume *v)
{
    /* Beyond the last point all levels are alike. */
    const double last_hu = preset->n_opacity > 0 ? preset->opacity[preset->n_opacity - 1].hu : 0;
    for (int g = 0; g < N_LEVELS; g++)
        extinction[g] =
            g > 0 && cts_volume_hu(v, (uint16_t)(g - 1)) > last_hu
                ? extinction[g - 1]
                : (uint16_t)(cts_preset_extinction_per_mm(preset, cts_volume_hu(v, (uint16_t)g)) / EXTINCTION_UNIT +
                             0.5);
}

static CtsStatus fill_tables(Making *m, const CtsPreset *preset, CtsError *err)
{
    const CtsVoxelLabels *const o = m->voxel_labels;
    const int n_appearances = cts_voxel_labels_coloured(o) ? o->n_appearances : CTS_APPEARANCE_PRESET + 1;
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&m->extinction, (size_t)n_appearances * N_LEVELS, err)))
        return st;
    for (int l = CTS_APPEARANCE_PRESET; l < n_appearances; l++) {
        CtsPreset own = *preset;
        if (cts_voxel_labels_coloured(o))
            cts_appearance_preset(&o->appearances[l], preset, &own);
        fill_extinction(m->extinction + (size_t)l * N_LEVELS, &own, m->volume);
    }
    if (!cts_voxel_labels_coloured(o)) {
        if ((st = cts_alloc_array(&m->visible_below, N_LEVELS + 1, err)))
            return st;
        m->visible_below[0] = 0;
        for (int g = 0; g < N_LEVELS; g++)
            m->visible_below[g + 1] = m->visible_below[g] + (m->extinction[CTS_APPEARANCE_PRESET * N_LEVELS + g] > 0);
    }
    for (int i = 0; i < m->n_lengths; i++) {
        if ((st = cts_alloc_zeroed(&m->passed[i], N_LEVELS, err)))
            return st;
        for (int e = 0; e < N_LEVELS; e++) {
            const double passes = exp(-EXTINCTION_UNIT * e * m->length_mm[i]) * N_LEVELS;
            if (passes < 1)
                break;
            m->passed[i][e] = (uint16_t)fmin(passes, UINT16_MAX);
        }
    }
    return CTS_OK;
}

/* Rows of fine macro-cells. */
static void find_visible_cells(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const size_t n = (size_t)m->macrocells->n_fine[0];
    (void)worker;
    for (size_t c = first * n; c < end * n; c++) {
        const CtsRange r = m->macrocells->fine[c];
        m->visible_cell[c] = m->visible_below[r.high + 1] > m->visible_below[r.low];
    }
}

/* Voxels of a block from first on, along an axis. */
static int voxels_of(const Making *m, int axis, int first)
{
    const int left = m->volume->dims[axis] - first;
    return m->open->size[axis] < left ? m->open->size[axis] : left;
}

/* Sets row_cells of the worker for the voxel rows (first + 0..n - 1 along y and z). */
static const uint8_t *visible_cells_of_row(const Making *m, int worker, const int first[3], const int n[3])
{
    const CtsMacrocells *const c = m->macrocells;
    const size_t n_cells = (size_t)c->n_fine[0];
    uint8_t *const cells = m->row_cells + (size_t)worker * n_cells;
    int low[3], high[3];
    for (int a = 1; a < 3; a++) {
        low[a] = first[a] / CTS_FINE_MACROCELL;
        high[a] = (first[a] + n[a] - 1) / CTS_FINE_MACROCELL;
        low[a] = low[a] < c->n_fine[a] ? low[a] : c->n_fine[a] - 1;
        high[a] = high[a] < c->n_fine[a] ? high[a] : c->n_fine[a] - 1;
    }
    memset(cells, 0, n_cells);
    for (int k = low[2]; k <= high[2]; k++)
        for (int j = low[1]; j <= high[1]; j++) {
            const uint8_t *const of_row = m->visible_cell + ((size_t)k * (size_t)c->n_fine[1] + (size_t)j) * n_cells;
            for (size_t i = 0; i < n_cells; i++)
                cells[i] |= of_row[i];
        }
    return cells;
}

/* Adds the extinctions of voxels begin to end - 1 of each row of a row of blocks. */
static void sum_voxels(const Making *m, const int first[3], const int n[3], int begin, int end, uint32_t *sums)
{
    const uint16_t *const extinction = m->extinction + (size_t)CTS_APPEARANCE_PRESET * N_LEVELS;
    const size_t nx = (size_t)m->volume->dims[0], ny = (size_t)m->volume->dims[1];
    for (int k = first[2]; k < first[2] + n[2]; k++)
        for (int j = first[1]; j < first[1] + n[1]; j++) {
            const uint16_t *const row = m->shown->grey + ((size_t)k * ny + (size_t)j) * nx;
            for (int i = begin; i < end; i++)
                sums[i] += extinction[row[i]];
        }
}

/* The same, each voxel by its own appearance. */
static void sum_labelled_voxels(const Making *m, const int first[3], const int n[3], uint32_t *sums)
{
    const int *const d = m->volume->dims;
    for (int k = first[2]; k < first[2] + n[2]; k++)
        for (int j = first[1]; j < first[1] + n[1]; j++)
            for (int i = 0; i < d[0]; i++) {
                const int appearance = cts_appearance_of_voxel(m->voxel_labels, i, j, k);
                const uint16_t g = m->volume->grey[((size_t)k * (size_t)d[1] + (size_t)j) * (size_t)d[0] + (size_t)i];
                sums[i] += m->extinction[(size_t)appearance * N_LEVELS + g];
            }
}

/* Sums of extinctions of the voxels of a row of blocks over y and z; false where all are 0. A macro-cell contains the
 * voxels of its lower faces, and those at the volume's last face. */
static bool sum_rows(const Making *m, int worker, const int first[3], const int n[3], uint32_t *sums)
{
    const int nx = m->volume->dims[0];
    if (!m->visible_below || !m->visible_cell) {
        memset(sums, 0, (size_t)nx * sizeof *sums);
        if (m->visible_below)
            sum_voxels(m, first, n, 0, nx, sums);
        else
            sum_labelled_voxels(m, first, n, sums);
        return true;
    }
    const uint8_t *const cells = visible_cells_of_row(m, worker, first, n);
    const int n_cells = m->macrocells->n_fine[0];
    if (!memchr(cells, 1, (size_t)n_cells))
        return false;
    memset(sums, 0, (size_t)nx * sizeof *sums);
    for (int c = 0; c < n_cells; c++) {
        const int begin = c;
        while (c < n_cells && cells[c])
            c++;
        if (c > begin)
            sum_voxels(m, first, n, begin * CTS_FINE_MACROCELL, c < n_cells ? c * CTS_FINE_MACROCELL : nx, sums);
    }
    return true;
}

/* n_area: voxels that each of the sums has. */
static inline void divide_sums(const uint32_t *sums, int n_blocks, int size, int n_area, uint16_t *means)
{
    const double scale = 1 / ((double)size * n_area);
    for (int i = 0; i < n_blocks; i++) {
        uint64_t sum = 0;
        for (int x = 0; x < size; x++)
            sum += sums[i * size + x];
        means[i] = (uint16_t)((double)(int64_t)sum * scale + 0.5);
    }
}

/* Mean extinctions of a row of blocks, whose voxels along y and z are n; false where all are 0. */
static bool find_block_means(const Making *m, int worker, const int first[3], const int n[3], uint16_t *means)
{
    const int nx = m->volume->dims[0], size = m->open->size[0], n_whole = nx / size, n_area = n[1] * n[2];
    uint32_t *const sums = m->row_sums + (size_t)worker * (size_t)nx;
    if (!sum_rows(m, worker, first, n, sums))
        return false;
    if (size == 3) /* the size of most blocks: unrolled */
        divide_sums(sums, n_whole, 3, n_area, means);
    else
        divide_sums(sums, n_whole, size, n_area, means);
    if (n_whole < m->open->n[0])
        divide_sums(sums + n_whole * size, 1, nx - n_whole * size, n_area, means + n_whole);
    return true;
}

/* Rows of blocks. */
static void fill_rows(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const int *const n = m->open->n, *const size = m->open->size;
    uint16_t *const means = m->row_means + (size_t)worker * (size_t)n[0];
    for (size_t r = first; r < end; r++) {
        const int at[3] = {0, (int)(r % (size_t)n[1]) * size[1], (int)(r / (size_t)n[1]) * size[2]};
        const int voxels[3] = {size[0], voxels_of(m, 1, at[1]), voxels_of(m, 2, at[2])};
        const bool absorbs = find_block_means(m, worker, at, voxels, means);
        for (int l = 0; l < m->n_lengths; l++) {
            uint16_t *const row = m->transmittance[l] + (size_t)m->margin + r * (size_t)m->row;
            for (int i = 0; i < n[0] && absorbs; i++)
                row[i] = m->passed[l][means[i]];
            const int filled = absorbs ? n[0] : 0;
            memset(row + filled, 255, (size_t)(m->row - filled) * sizeof *row);
        }
    }
}

/* The margin before the first row, and what vectors read beyond the last one. */
static void fill_ends(const Making *m, size_t n_rows)
{
    for (int l = 0; l < m->n_lengths; l++) {
        memset(m->transmittance[l], 255, (size_t)m->margin * sizeof **m->transmittance);
        memset(m->transmittance[l] + (size_t)m->margin + n_rows * (size_t)m->row, 255,
               OPENNESS_LANES * sizeof **m->transmittance);
    }
}

/* Blocks from a place to the end of the volume along an axis, in the direction of a step. */
static int room(const Making *m, int axis, int step, int at)
{
    return step > 0 ? m->open->n[axis] - 1 - at : step < 0 ? at : OPENNESS_MAX_STEPS;
}

static const OpennessKernels *choose_openness_kernels(void)
{
    const unsigned cpu = cts_cpu_flags();
    return cpu & CTS_CPU_AVX512 ? &cts_openness_kernels_avx512
           : cpu & CTS_CPU_AVX2 ? &cts_openness_kernels_avx2
                                : &cts_openness_kernels_c;
}

typedef struct OpenTile {
    int first[3], end[3];
    int n_lanes;
    uint16_t sums[TILE_LAYERS][TILE_ROWS][TILE_WIDTH];
} OpenTile;

static bool is_in_tile(const OpenTile *t, int j, int k)
{
    return j >= t->first[1] && j < t->end[1] && k >= t->first[2] && k < t->end[2];
}

/* Adds a direction, row after row along it. */
static void add_direction(const Making *m, const OpennessKernels *kernels, const Axis *axis, int sign, OpenTile *t)
{
    const int dj = sign * axis->step[1], dk = sign * axis->step[2];
    const uint16_t *const rows = m->transmittance[axis->length] + m->margin + t->first[0];
    const unsigned mean = (1u << 16) / (unsigned)(axis->n_steps + 1);
    OpennessBeams beams = {
        .step = sign * (((ptrdiff_t)axis->step[2] * m->open->n[1] + axis->step[1]) * m->row + axis->step[0]),
        .mean = (uint16_t)(mean < UINT16_MAX ? mean : UINT16_MAX)};
    for (int k = t->first[2]; k < t->end[2]; k++)
        for (int j = t->first[1]; j < t->end[1]; j++) {
            if ((dj || dk) && is_in_tile(t, j - dj, k - dk))
                continue;
            for (int at_j = j, at_k = k; is_in_tile(t, at_j, at_k); at_j += dj, at_k += dk) {
                const int room_j = room(m, 1, dj, at_j), room_k = room(m, 2, dk, at_k);
                const int inside = room_j < room_k ? room_j : room_k;
                beams.n_inside = inside < axis->n_steps ? inside : axis->n_steps;
                beams.n_beyond = CTS_MUTATED(OPEN_BEYOND) ? 0 : (uint16_t)(axis->n_steps - beams.n_inside);
                beams.from = rows + ((size_t)at_k * (size_t)m->open->n[1] + (size_t)at_j) * (size_t)m->row;
                kernels->add_beams(&beams, t->n_lanes, t->sums[at_k - t->first[2]][at_j - t->first[1]]);
                if (!dj && !dk)
                    break;
            }
        }
}

static void find_openness_of_tile(const Making *m, const OpennessKernels *kernels, OpenTile *t)
{
    const size_t width = (size_t)(t->end[0] - t->first[0]);
    t->n_lanes = ((int)width + OPENNESS_LANES - 1) / OPENNESS_LANES * OPENNESS_LANES;
    memset(t->sums, 0, sizeof t->sums);
    for (int d = 0; d < OPENNESS_DIRECTIONS; d++)
        add_direction(m, kernels, &m->axis[d / 2], d % 2 ? -1 : 1, t);
    for (int k = t->first[2]; k < t->end[2]; k++)
        for (int j = t->first[1]; j < t->end[1]; j++) {
            uint8_t found[TILE_WIDTH];
            kernels->scale(t->sums[k - t->first[2]][j - t->first[1]], t->n_lanes, found);
            memcpy(m->openness + ((size_t)k * (size_t)m->open->n[1] + (size_t)j) * (size_t)m->open->n[0] + t->first[0],
                   found, width);
        }
}

static const int tile_size[3] = {TILE_WIDTH, TILE_ROWS, TILE_LAYERS};

static void follow_beams_from_tiles(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const OpennessKernels *const kernels = choose_openness_kernels();
    (void)worker;
    for (size_t at = first; at < end; at++) {
        OpenTile t;
        size_t rest = at;
        for (int a = 0; a < 3; a++) {
            const int n_tiles = (m->open->n[a] - 1) / tile_size[a] + 1;
            t.first[a] = (int)(rest % (size_t)n_tiles) * tile_size[a];
            t.end[a] = t.first[a] + tile_size[a] < m->open->n[a] ? t.first[a] + tile_size[a] : m->open->n[a];
            rest /= (size_t)n_tiles;
        }
        find_openness_of_tile(m, kernels, &t);
    }
}

static void pack_rows(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const size_t nx = (size_t)m->open->n[0], ny = (size_t)m->open->n[1];
    (void)worker;
    for (size_t r = first; r < end; r++) {
        const uint8_t *const row = m->openness + r * nx, *const next = row + (r % ny + 1 < ny ? nx : 0);
        for (size_t i = 0; i < nx; i++) {
            const size_t beside = i + 1 < nx ? i + 1 : i;
            m->open->square[r * nx + i] =
                row[i] | (uint32_t)row[beside] << 8 | (uint32_t)next[i] << 16 | (uint32_t)next[beside] << 24;
        }
    }
}

static CtsStatus alloc(Making *m, int n_threads, CtsError *err)
{
    const size_t n_rows = (size_t)m->open->n[1] * (size_t)m->open->n[2], n_blocks = n_rows * (size_t)m->open->n[0];
    CtsStatus st;
    if ((st = cts_alloc_array(&m->openness, n_blocks, err)) ||
        (st = cts_alloc_array(&m->open->square, n_blocks, err)) ||
        (st = cts_alloc_array(&m->row_sums, (size_t)n_threads * (size_t)m->volume->dims[0], err)) ||
        (st = cts_alloc_array(&m->row_means, (size_t)n_threads * (size_t)m->open->n[0], err)))
        return st;
    for (int l = 0; l < m->n_lengths && !st; l++)
        st = cts_alloc_array(&m->transmittance[l], (size_t)m->margin + n_rows * (size_t)m->row + OPENNESS_LANES, err);
    if (st || !m->macrocells || !m->visible_below)
        return st;
    const int *const n_cells = m->macrocells->n_fine;
    st = cts_alloc_array(&m->row_cells, (size_t)n_threads * (size_t)n_cells[0], err);
    return st ? st
              : cts_alloc_array(&m->visible_cell, (size_t)n_cells[0] * (size_t)n_cells[1] * (size_t)n_cells[2], err);
}

static CtsStatus make_openness_field(Making *m, const CtsPreset *preset, int n_threads, CtsError *err)
{
    CtsStatus st;
    const int *const n = m->open->n;
    const size_t n_rows = (size_t)n[1] * (size_t)n[2];
    size_t n_tiles = 1;
    n_threads = cts_threads(n_threads);
    find_light_axes(m);
    if ((st = fill_tables(m, preset, err)) || (st = alloc(m, n_threads, err)))
        return st;
    if (m->visible_cell)
        cts_parallel(n_threads, (size_t)m->macrocells->n_fine[1] * (size_t)m->macrocells->n_fine[2], 0,
                     find_visible_cells, m);
    fill_ends(m, n_rows);
    cts_parallel(n_threads, n_rows, 0, fill_rows, m);
    for (int a = 0; a < 3; a++)
        n_tiles *= (size_t)((n[a] - 1) / tile_size[a] + 1);
    cts_parallel(n_threads, n_tiles, 1, follow_beams_from_tiles, m);
    cts_parallel(n_threads, n_rows, 0, pack_rows, m);
    return CTS_OK;
}

CtsStatus cts_openness_new(CtsOpenness **openness, const CtsModel *model, const CtsPreset *preset, int n_threads,
                           CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(openness, 1, err);
    if (st)
        return st;
    const CtsModel *const shown = cts_model_shown(model);
    Making m = {.open = *openness,
                .volume = model->volume,
                .voxel_labels = model->voxel_labels,
                .shown = shown->volume,
                .macrocells = shown->macrocells};
    size_blocks(m.open, model->volume);
    st = make_openness_field(&m, preset, n_threads, err);
    cts_free(&m.extinction);
    cts_free(&m.visible_below);
    cts_free(&m.visible_cell);
    cts_free(&m.row_sums);
    cts_free(&m.row_means);
    cts_free(&m.row_cells);
    for (int l = 0; l < N_AXES; l++) {
        cts_free(&m.passed[l]);
        cts_free(&m.transmittance[l]);
    }
    cts_free(&m.openness);
    if (st)
        cts_openness_free(openness);
    return st;
}

void cts_openness_free(CtsOpenness **openness)
{
    if (!*openness)
        return;
    cts_free(&(*openness)->square);
    cts_free(openness);
}

CtsStatus cts_openness_of_scene(CtsOpenness **openness, const CtsModel *model, const CtsPreset *preset, int n_threads,
                                CtsReport *report, CtsError *err)
{
    *openness = NULL;
    if (!cts_openness_counts(preset))
        return CTS_OK;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const CtsStatus st = cts_openness_new(openness, model, preset, n_threads, err);
    if (!st)
        cts_report_stage(report, CTS_STAGE_OCCLUSION, cts_wall_ms() - wall, cts_cpu_ms() - cpu,
                         (uint64_t)(*openness)->n[0] * (uint64_t)(*openness)->n[1] * (uint64_t)(*openness)->n[2], 0);
    return st;
}

double cts_openness_at(const CtsOpenness *o, const double vox[3])
{
    int at[3];
    double share[3], plane[2];
    for (int a = 0; a < 3; a++) {
        const int last = o->n[a] - 1;
        const double block = fmin(fmax(vox[a] * o->scale[a] + o->shift[a], 0), last);
        at[a] = (int)block < last ? (int)block : last > 0 ? last - 1 : 0;
        share[a] = block - at[a];
    }
    for (int k = 0; k < 2; k++) {
        const uint32_t s = o->square[(ptrdiff_t)at[2] * o->plane + k * o->plane + (ptrdiff_t)at[1] * o->n[0] + at[0]];
        const double low = (s & 255) + ((double)(s >> 8 & 255) - (s & 255)) * share[0];
        const double high = (s >> 16 & 255) + ((double)(s >> 24) - (s >> 16 & 255)) * share[0];
        plane[k] = low + (high - low) * share[1];
    }
    return (plane[0] + (plane[1] - plane[0]) * share[2]) / 255;
}
