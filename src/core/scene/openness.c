#include "core/scene/openness.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "core/model/voxel_labels.h"
#include "core/scene/openness_beams.h"
#include <limits.h>
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
    MARGIN = 32, /* blocks on either side of a line's rows: OPENNESS_MAX_STEPS, and rows stay aligned */
    ROW_BITS = 64,
    MIN_PER_BIT = 4, /* measured: with fewer, more time for bits than it saves */
    FAR = OPENNESS_MAX_STEPS + 1
};

/* A direction and its opposite. */
typedef struct Axis {
    int step[3];
    int n_steps;   /* K */
    int length;    /* of a step: which of Making.length_mm */
    uint16_t mean; /* 2^16 / (K + 1), at most 2^16 - 1 */
} Axis;

/* First axes of bundles. Axes of a bundle have the same step along y and z, so that their beams stay within a line of
 * rows of blocks; the axis x, whose beams stay within a row, is in the first bundle. */
enum { N_BUNDLES = 4, BUNDLE_AXES = 4 /* at most */ };
static const int first_axis[N_BUNDLES + 1] = {0, 4, 7, 10, N_AXES};

typedef struct Making {
    CtsOpenness *open;
    const CtsVolume *volume, *shown;
    const CtsVoxelLabels *voxel_labels;
    uint16_t *extinction; /* by appearance and grey level, in EXTINCTION_UNIT */
    uint32_t *row_sums;   /* by worker and voxel of a row of blocks: sum of extinctions over the block's rows */
    Axis axis[N_AXES];
    int n_lengths;
    double length_mm[N_AXES];
    uint16_t *passed[N_AXES]; /* transmittance of a mean extinction for each length, in 2^-16 */
    uint64_t *absorbing; /* by row of blocks: bits of per_bit blocks each, 0 where none of these has an extinction */
    int per_bit;
    /* By block: sum of openness over directions; mean extinction; openness. They are in the memory of open->square,
     * openness where the means were. */
    uint16_t *sums, *means;
    uint8_t *openness;
    uint16_t *shared_sum; /* by row of blocks: to be added to all of its sums */
    size_t n_packed;      /* rows of open->square that are done */
    int bundle;           /* the current one */
    int row, pitch;       /* blocks of a row in a line, a multiple of OPENNESS_LANES; with its margins */
    uint16_t *lines;      /* by worker: memory of follow_beams() */
    size_t line_size;
} Making;

static void size_blocks(CtsOpenness *o, const CtsVolume *v)
{
    double mm3 = 1;
    for (int a = 0; a < 3; a++)
        mm3 *= cts_volume_spacing_mm(v, a) * cts_volume_extent(v, a);
    const double edge_mm = fmax(BLOCK_MM, cbrt(mm3 / MAX_BLOCKS));
    for (int a = 0; a < 3; a++) {
        const double voxels = floor(edge_mm / cts_volume_spacing_mm(v, a) + 0.5);
        const int extent = cts_volume_extent(v, a), most = extent < MAX_EDGE ? extent : MAX_EDGE;
        o->size[a] = voxels < 1 ? 1 : voxels > most ? most : (int)voxels;
        o->air[a] = v->air_before[a] % o->size[a];
        o->n[a] = (o->air[a] + v->dims[a] - 1) / o->size[a] + 1;
        o->scale[a] = 1.0 / o->size[a];
        o->shift[a] = CTS_MUTATED(OPEN_PLACE) ? 0 : (o->air[a] - 0.5 * (o->size[a] - 1)) / o->size[a];
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
        axis->mean = (uint16_t)fmin(N_LEVELS / (axis->n_steps + 1), UINT16_MAX);
    }
    const int n_lanes = OPENNESS_LANES, last = m->open->n[0] - 1;
    m->row = (last / n_lanes + 1) * n_lanes;
    m->pitch = m->row + 2 * MARGIN;
    m->per_bit = last / ROW_BITS < MIN_PER_BIT ? MIN_PER_BIT : last / ROW_BITS + 1;
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
    const CtsVoxelLabels *const labels = m->voxel_labels;
    const int n_appearances = cts_voxel_labels_coloured(labels) ? labels->n_appearances : CTS_APPEARANCE_PRESET + 1;
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&m->extinction, (size_t)n_appearances * N_LEVELS, err)))
        return st;
    for (int l = CTS_APPEARANCE_PRESET; l < n_appearances; l++) {
        CtsPreset own = *preset;
        if (cts_voxel_labels_coloured(labels))
            cts_appearance_preset(&labels->appearances[l], preset, &own);
        fill_extinction(m->extinction + (size_t)l * N_LEVELS, &own, m->volume);
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

/* Adds the extinctions of the voxels of each row of a box of voxels. */
static void sum_voxels(const Making *m, const int low[3], const int high[3], uint32_t *sums)
{
    enum { CACHE_LINE = 64 / sizeof(uint16_t) };
    const uint16_t *const extinction = m->extinction + (size_t)CTS_APPEARANCE_PRESET * N_LEVELS;
    const size_t nx = (size_t)m->volume->dims[0], ny = (size_t)m->volume->dims[1];
    const size_t ahead = nx * (size_t)m->open->size[1]; /* most of the same columns of the next row of blocks */
    for (int k = low[2]; k < high[2]; k++)
        for (int j = low[1]; j < high[1]; j++) {
            const uint16_t *const row = m->shown->grey + ((size_t)k * ny + (size_t)j) * nx;
            for (size_t i = 0; i < nx; i += CACHE_LINE)
                __builtin_prefetch(row + ahead + i);
            for (size_t i = 0; i < nx; i++)
                sums[i] += extinction[row[i]];
        }
}

/* The same, each voxel of rows by its own appearance. */
static void sum_labelled_voxels(const Making *m, const int low[3], const int high[3], uint32_t *sums)
{
    const int *const d = m->volume->dims;
    for (int k = low[2]; k < high[2]; k++)
        for (int j = low[1]; j < high[1]; j++)
            for (int i = 0; i < d[0]; i++) {
                const int appearance = cts_appearance_of_voxel(m->voxel_labels, i, j, k);
                const uint16_t g = m->volume->grey[((size_t)k * (size_t)d[1] + (size_t)j) * (size_t)d[0] + (size_t)i];
                sums[i] += m->extinction[(size_t)appearance * N_LEVELS + g];
            }
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

/* Voxels of a block along an axis, air around the stored ones among them; low, high: those stored, high not included.
 */
static int voxels_of_block(const Making *m, int axis, int block, int *low, int *high)
{
    const CtsVolume *const v = m->volume;
    const int size = m->open->size[axis], first = block * size - m->open->air[axis], end = first + size;
    const int behind = v->dims[axis] + v->air_behind[axis];
    *low = first > 0 ? first : 0;
    *high = end < v->dims[axis] ? end : v->dims[axis];
    return (end < behind ? end : behind) - first;
}

/* Mean extinctions of rows of blocks, which are 0 before. */
static void fill_rows(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const int *const n = m->open->n, *const size = m->open->size, *const air = m->open->air;
    const size_t n_sums = (size_t)n[0] * (size_t)size[0];
    uint32_t *const sums = m->row_sums + (size_t)worker * n_sums;
    for (size_t r = first; r < end; r++) {
        const int block[3] = {0, (int)(r % (size_t)n[1]), (int)(r / (size_t)n[1])};
        int low[3] = {0}, high[3] = {m->volume->dims[0]}, n_area = 1;
        for (int a = 1; a < 3; a++)
            n_area *= voxels_of_block(m, a, block[a], &low[a], &high[a]);
        uint16_t *const means = m->means + r * (size_t)n[0];
        memset(sums, 0, n_sums * sizeof *sums);
        m->absorbing[r] = 0;
        if (cts_voxel_labels_coloured(m->voxel_labels))
            sum_labelled_voxels(m, low, high, sums + air[0]);
        else
            sum_voxels(m, low, high, sums + air[0]);
        for (int i = 0, bit = 0; i < n[0]; i += m->per_bit, bit++) {
            const int n_blocks = m->per_bit < n[0] - i ? m->per_bit : n[0] - i;
            const uint32_t *const from = sums + i * size[0];
            uint32_t any = 0;
            for (int x = 0; x < n_blocks * size[0]; x++)
                any |= from[x];
            m->absorbing[r] |= (uint64_t)(any > 0) << bit;
            if (any && size[0] == 3) /* the size of most blocks: unrolled */
                divide_sums(from, n_blocks, 3, n_area, means + i);
            else if (any)
                divide_sums(from, n_blocks, size[0], n_area, means + i);
        }
        const int last = n[0] - 1, width = voxels_of_block(m, 0, last, &low[0], &high[0]); /* may be narrower */
        divide_sums(sums + last * size[0], 1, width, n_area, means + last);
    }
}

/* Rows of blocks, each a step of the current bundle from the one before, between two ends of the volume. */
typedef struct Line {
    size_t first_row;
    ptrdiff_t row_step;
    int n_rows;
    const uint16_t *transmittance[N_AXES]; /* by length: first block of the first row; NULL: not in the bundle */
    uint16_t *sums;                        /* of a row */
} Line;

static size_t block_row(const Line *l, int r)
{
    return l->first_row + (size_t)(r * l->row_step);
}

/* Transmittances of the rows, with their margins. */
static void load_transmittance(const Making *m, const Line *l, const uint16_t *passed, uint16_t *transmittance)
{
    const int n = m->open->n[0];
    memset(transmittance, 255, (size_t)l->n_rows * (size_t)m->pitch * sizeof *transmittance);
    for (int r = 0; r < l->n_rows; r++) {
        const uint16_t *const means = m->means + block_row(l, r) * (size_t)n;
        uint16_t *const to = transmittance + (size_t)r * (size_t)m->pitch + MARGIN;
        for (uint64_t left = m->absorbing[block_row(l, r)]; left; left &= left - 1) {
            const int begin = __builtin_ctzll(left) * m->per_bit, end = begin + m->per_bit < n ? begin + m->per_bit : n;
            for (int i = begin; i < end; i++)
                to[i] = passed[means[i]];
        }
    }
}

/* Adds openness in the bundle's directions to the sums of a row. before, after: nearest rows that absorb. */
static void add_row(const Making *m, const OpennessKernels *kernels, const Line *l, int r, int before, int after)
{
    const size_t row = block_row(l, r), n = (size_t)m->open->n[0];
    const int here = m->absorbing[row] ? 0 : FAR;
    unsigned shared = m->shared_sum[row];
    bool any = false;
    for (int d = 2 * first_axis[m->bundle]; d < 2 * first_axis[m->bundle + 1]; d++) {
        const Axis *const axis = &m->axis[d / 2];
        const int sign = d % 2 ? -1 : 1, row_step = axis->step[1] || axis->step[2] ? sign : 0, all = axis->n_steps;
        const int room = row_step < 0 ? r : row_step > 0 ? l->n_rows - 1 - r : all, inside = room < all ? room : all;
        const int rest = OPENNESS_OPEN * (CTS_MUTATED(OPEN_BEYOND) ? 1 : all - inside + 1);
        if ((row_step < 0 ? r - before : row_step > 0 ? after - r : here) > all) {
            shared += (unsigned)(rest + (OPENNESS_OPEN - 1) * inside) * axis->mean >> 16;
            continue;
        }
        if (!any)
            memset(l->sums, 0, (size_t)m->row * sizeof *l->sums);
        any = true;
        const OpennessBeams beams = {l->transmittance[axis->length] + (size_t)r * (size_t)m->pitch,
                                     row_step * m->pitch + sign * axis->step[0], inside, (uint16_t)rest, axis->mean};
        kernels->add_beams(&beams, m->row, l->sums);
    }
    m->shared_sum[row] = (uint16_t)shared;
    uint16_t *const to = m->sums + row * n;
    for (size_t x = 0; x < (any ? n : 0); x++)
        to[x] = (uint16_t)(to[x] + l->sums[x]);
}

static void follow_beams(const Making *m, const OpennessKernels *kernels, Line *l, uint16_t *memory)
{
    for (int a = first_axis[m->bundle]; a < first_axis[m->bundle + 1]; a++) {
        const int length = m->axis[a].length;
        if (l->transmittance[length])
            continue;
        load_transmittance(m, l, m->passed[length], memory);
        l->transmittance[length] = memory + MARGIN;
        memory += (size_t)l->n_rows * (size_t)m->pitch;
    }
    l->sums = memory;
    for (int r = 0, before = -FAR, after = 0; r < l->n_rows; r++) {
        while (after < l->n_rows && (after <= r || !m->absorbing[block_row(l, after)]))
            after++;
        add_row(m, kernels, l, r, before, after < l->n_rows ? after : r + FAR);
        before = m->absorbing[block_row(l, r)] ? r : before;
    }
}

/* Step along y and z of the current bundle. */
static const int *bundle_step(const Making *m)
{
    return &m->axis[first_axis[m->bundle + 1] - 1].step[1];
}

/* Lines of the current bundle: those that begin at an end of z first, then those that begin at an end of y. */
static int n_lines(const Making *m)
{
    const int ny = m->open->n[1], nz = m->open->n[2], *const step = bundle_step(m);
    return !step[1] ? nz : !step[0] ? ny : ny + nz - 1;
}

static void follow_lines(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const OpennessKernels kernels = CTS_CPU_CHOICE(cts_cpu_flags(), cts_openness_kernels);
    const int ny = m->open->n[1], nz = m->open->n[2], *const step = bundle_step(m);
    for (int i = (int)first; i < (int)end; i++) {
        const int j = step[1] && i < ny ? i : step[0] < 0 ? ny - 1 : 0;
        const int k = !step[1] ? i : i < ny ? 0 : i - ny + 1;
        const int room_j = step[0] > 0 ? ny - j : step[0] < 0 ? j + 1 : INT_MAX, room_k = step[1] ? nz - k : INT_MAX;
        Line line = {.first_row = (size_t)k * (size_t)ny + (size_t)j,
                     .row_step = (ptrdiff_t)step[1] * ny + step[0],
                     .n_rows = room_j < room_k ? room_j : room_k};
        follow_beams(m, &kernels, &line, m->lines + (size_t)worker * m->line_size);
    }
}

static void scale_rows(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const OpennessKernels kernels = CTS_CPU_CHOICE(cts_cpu_flags(), cts_openness_kernels);
    const size_t n = (size_t)m->open->n[0];
    (void)worker;
    for (size_t r = first; r < end; r++)
        kernels.scale(m->sums + r * n, m->shared_sum[r], (int)n, m->openness + r * n);
}

/* Rows of open->square from n_packed on. */
static void pack_rows(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const size_t nx = (size_t)m->open->n[0], ny = (size_t)m->open->n[1];
    (void)worker;
    for (size_t r = m->n_packed + first; r < m->n_packed + end; r++) {
        const uint8_t *const row = m->openness + r * nx, *const next = row + (r % ny + 1 < ny ? nx : 0);
        uint32_t *const square = m->open->square + r * nx, last = row[nx - 1] | (uint32_t)next[nx - 1] << 16;
        for (size_t i = 0; i < nx - 1; i++)
            square[i] = row[i] | (uint32_t)row[i + 1] << 8 | (uint32_t)next[i] << 16 | (uint32_t)next[i + 1] << 24;
        square[nx - 1] = last | last << 8;
    }
}

static CtsStatus alloc(Making *m, int n_threads, CtsError *err)
{
    const int *const n = m->open->n;
    const size_t threads = (size_t)n_threads, n_rows = (size_t)n[1] * (size_t)n[2], n_blocks = n_rows * (size_t)n[0];
    const size_t max_rows = (size_t)(n[1] > n[2] ? n[1] : n[2]);
    CtsStatus st;
    m->line_size = BUNDLE_AXES * max_rows * (size_t)m->pitch + (size_t)m->row;
    if ((st = cts_alloc_zeroed(&m->open->square, n_blocks + OPENNESS_LANES, err)) ||
        (st = cts_alloc_array(&m->row_sums, threads * (size_t)n[0] * (size_t)m->open->size[0], err)) ||
        (st = cts_alloc_zeroed(&m->shared_sum, n_rows, err)) || (st = cts_alloc_array(&m->absorbing, n_rows, err)) ||
        (st = cts_alloc_array(&m->lines, threads * m->line_size, err)))
        return st;
    m->sums = (uint16_t *)m->open->square;
    m->means = m->sums + n_blocks;
    m->openness = (uint8_t *)(m->open->square + OPENNESS_LANES) + 3 * n_blocks;
    return CTS_OK;
}

static CtsStatus make_openness_field(Making *m, const CtsPreset *preset, int n_threads, CtsError *err)
{
    CtsStatus st;
    const size_t n_rows = (size_t)m->open->n[1] * (size_t)m->open->n[2];
    n_threads = cts_threads(n_threads);
    find_light_axes(m);
    if ((st = fill_tables(m, preset, err)) || (st = alloc(m, n_threads, err)))
        return st;
    cts_parallel(n_threads, n_rows, 0, fill_rows, m);
    for (m->bundle = 0; m->bundle < N_BUNDLES; m->bundle++)
        cts_parallel(n_threads, (size_t)n_lines(m), 1, follow_lines, m);
    cts_parallel(n_threads, n_rows, 0, scale_rows, m);
    /* Rows of the result need four times the memory of their openness, whose rows end with it. */
    /* In place: row r of the result begins at 4 r rows of bytes, and its openness at 3 n_rows + r of them. Rows below
     * (3 n_rows + n_packed) / 4 replace the openness of rows that are done. */
    for (size_t end; m->n_packed < n_rows; m->n_packed = end) {
        end = (3 * n_rows + m->n_packed) / 4;
        end = end > m->n_packed ? end : n_rows;
        cts_parallel(n_threads, end - m->n_packed, 0, pack_rows, m);
    }
    return CTS_OK;
}

CtsStatus cts_openness_new(CtsOpenness **openness, const CtsModel *model, const CtsPreset *preset, int n_threads,
                           CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(openness, 1, err);
    if (st)
        return st;
    Making m = {.open = *openness,
                .volume = model->volume,
                .voxel_labels = model->voxel_labels,
                .shown = cts_model_shown(model)->volume};
    size_blocks(m.open, model->volume);
    st = make_openness_field(&m, preset, n_threads, err);
    cts_free(&m.extinction);
    for (int l = 0; l < N_AXES; l++)
        cts_free(&m.passed[l]);
    cts_free(&m.row_sums);
    cts_free(&m.shared_sum);
    cts_free(&m.absorbing);
    cts_free(&m.lines);
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
