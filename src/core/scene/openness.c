#include "core/scene/openness.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "core/scene/openness_beams.h"
#include "core/volume/macrocells.h"
#include "core/volume/voxel_labels.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Edge of a block, and the reach of openness. A block is larger where a volume would have more than MAX_BLOCKS. */
#define BLOCK_MM 2.5
#define REACH_MM 35.0
#define MAX_BLOCKS 0x1p22

/* Extinction of grey levels, in whole numbers, so that sums do not depend on their order: 65535 is the largest. */
#define EXTINCTION_UNIT (CTS_MAX_EXTINCTION_PER_MM / UINT16_MAX)

enum {
    N_LEVELS = UINT16_MAX + 1,
    N_AXES = OPENNESS_DIRECTIONS / 2, /* directions of which none is another's opposite */
    TILE_ROWS = 16
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
    const CtsMacrocells *macrocells; /* of shown; NULL: unknown */
    uint16_t *extinction;            /* by appearance and grey level, in EXTINCTION_UNIT */
    uint32_t *visible_below; /* by grey level: lower ones that have an extinction; NULL where appearances differ */
    Axis axis[N_AXES];
    int n_lengths;
    double length_mm[N_AXES];
    uint16_t *passed[N_AXES];        /* transmittance of a mean extinction for each length, in 2^-16 */
    uint16_t *transmittance[N_AXES]; /* of blocks, rows of them with a margin on both sides where nothing absorbs */
    int margin, row;                 /* blocks of it; of a row with both */
    uint8_t *openness;               /* by block */
} Making;

static void size_blocks(CtsOpenness *o, const CtsVolume *v)
{
    double mm3 = 1;
    for (int a = 0; a < 3; a++)
        mm3 *= cts_volume_spacing_mm(v, a) * v->dims[a];
    const double edge_mm = fmax(BLOCK_MM, cbrt(mm3 / MAX_BLOCKS));
    for (int a = 0; a < 3; a++) {
        const double voxels = floor(edge_mm / cts_volume_spacing_mm(v, a) + 0.5);
        o->size[a] = voxels < 1 ? 1 : voxels > v->dims[a] ? v->dims[a] : (int)voxels;
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

static void find_axes(Making *m)
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
    m->row = m->open->n[0] + OPENNESS_CHUNK + 2 * m->margin;
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
    const CtsVoxelLabels *const o = m->volume->voxel_labels;
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

/* True where no voxel of the block has an extinction, as macro-cells have it. */
static bool is_void(const Making *m, const int first[3], const int end[3])
{
    const CtsMacrocells *const c = m->macrocells;
    if (!c || !m->visible_below)
        return false;
    int low[3], high[3];
    for (int a = 0; a < 3; a++) {
        low[a] = first[a] / CTS_FINE_MACROCELL;
        high[a] = (end[a] - 1) / CTS_FINE_MACROCELL;
        low[a] = low[a] < c->n_fine[a] ? low[a] : c->n_fine[a] - 1;
        high[a] = high[a] < c->n_fine[a] ? high[a] : c->n_fine[a] - 1;
    }
    for (int k = low[2]; k <= high[2]; k++)
        for (int j = low[1]; j <= high[1]; j++)
            for (int i = low[0]; i <= high[0]; i++) {
                const CtsRange r =
                    c->fine[((size_t)k * (size_t)c->n_fine[1] + (size_t)j) * (size_t)c->n_fine[0] + (size_t)i];
                if (m->visible_below[r.high + 1] > m->visible_below[r.low])
                    return false;
            }
    return true;
}

/* Sum of the voxels' extinctions, each by its own appearance. */
static uint64_t sum_labelled(const Making *m, const int first[3], const int end[3])
{
    const int *const d = m->volume->dims;
    uint64_t sum = 0;
    for (int k = first[2]; k < end[2]; k++)
        for (int j = first[1]; j < end[1]; j++)
            for (int i = first[0]; i < end[0]; i++) {
                const int follow_beams = cts_appearance_of_voxel(m->volume->voxel_labels, i, j, k);
                const uint16_t g = m->volume->grey[((size_t)k * (size_t)d[1] + (size_t)j) * (size_t)d[0] + (size_t)i];
                sum += m->extinction[(size_t)follow_beams * N_LEVELS + g];
            }
    return sum;
}

static uint64_t sum_block(const Making *m, const int first[3], const int end[3])
{
    const uint16_t *const extinction = m->extinction + (size_t)CTS_APPEARANCE_PRESET * N_LEVELS;
    const size_t nx = (size_t)m->volume->dims[0], ny = (size_t)m->volume->dims[1];
    uint64_t sum = 0;
    for (int k = first[2]; k < end[2]; k++)
        for (int j = first[1]; j < end[1]; j++) {
            const uint16_t *const row = m->shown->grey + ((size_t)k * ny + (size_t)j) * nx;
            uint32_t of_row = 0;
            for (int i = first[0]; i < end[0]; i++)
                of_row += extinction[row[i]];
            sum += of_row;
        }
    return sum;
}

static uint16_t mean_extinction(const Making *m, const int block[3])
{
    int first[3], end[3];
    uint64_t n = 1;
    for (int a = 0; a < 3; a++) {
        first[a] = block[a] * m->open->size[a];
        end[a] = first[a] + m->open->size[a];
        end[a] = end[a] < m->volume->dims[a] ? end[a] : m->volume->dims[a];
        n *= (uint64_t)(end[a] - first[a]);
    }
    if (is_void(m, first, end))
        return 0;
    const uint64_t sum = m->visible_below ? sum_block(m, first, end) : sum_labelled(m, first, end);
    return (uint16_t)((sum + n / 2) / n);
}

/* Rows of blocks. */
static void fill_rows(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    (void)worker;
    for (size_t r = first; r < end; r++) {
        const int j = (int)(r % (size_t)m->open->n[1]), k = (int)(r / (size_t)m->open->n[1]);
        const size_t at = r * (size_t)m->row;
        for (int l = 0; l < m->n_lengths; l++)
            memset(m->transmittance[l] + at, 255, (size_t)m->row * sizeof **m->transmittance);
        for (int i = 0; i < m->open->n[0]; i++) {
            const uint16_t mean = mean_extinction(m, (const int[]){i, j, k});
            for (int l = 0; l < m->n_lengths && mean > 0; l++)
                m->transmittance[l][at + (size_t)(m->margin + i)] = m->passed[l][mean];
        }
    }
}

static OpennessBeams beams_of(const Making *m, const Axis *axis, int sign, int j, int k)
{
    const int *const n = m->open->n, at[3] = {0, j, k};
    int n_inside = axis->n_steps;
    for (int a = 1; a < 3; a++) {
        const int step = sign * axis->step[a], room = step > 0 ? n[a] - 1 - at[a] : at[a];
        n_inside = step && room < n_inside ? room : n_inside;
    }
    const unsigned mean = (1u << 16) / (unsigned)(axis->n_steps + 1);
    return (OpennessBeams){.from = m->transmittance[axis->length] +
                                   ((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)m->row + m->margin,
                           .step = sign * (((ptrdiff_t)axis->step[2] * n[1] + axis->step[1]) * m->row + axis->step[0]),
                           .n_inside = n_inside,
                           .n_beyond = CTS_MUTATED(OPEN_BEYOND) ? 0 : (uint16_t)(axis->n_steps - n_inside),
                           .mean = (uint16_t)(mean < UINT16_MAX ? mean : UINT16_MAX)};
}

static cts_openness_beams_fn choose_beams(void)
{
    const unsigned cpu = cts_cpu_flags();
    return cpu & CTS_CPU_AVX512 ? cts_openness_beams_avx512
           : cpu & CTS_CPU_AVX2 ? cts_openness_beams_avx2
                                : cts_openness_beams_c;
}

/* Tiles of TILE_ROWS rows, a chunk wide, through all layers of blocks, so that what a tile sees stays in the cache. */
static void follow_beams_from_tiles(void *context, int worker, size_t first, size_t end)
{
    const Making *const m = context;
    const int *const n = m->open->n;
    const int n_chunks = (n[0] - 1) / OPENNESS_CHUNK + 1;
    const cts_openness_beams_fn follow_beams = choose_beams();
    (void)worker;
    for (size_t t = first; t < end; t++) {
        const int i = (int)(t % (size_t)n_chunks) * OPENNESS_CHUNK, j0 = (int)(t / (size_t)n_chunks) * TILE_ROWS;
        const int left = n[0] - i < OPENNESS_CHUNK ? n[0] - i : OPENNESS_CHUNK;
        for (int k = 0; k < n[2]; k++)
            for (int j = j0; j < j0 + TILE_ROWS && j < n[1]; j++) {
                OpennessBeams beams[OPENNESS_DIRECTIONS];
                uint8_t found[OPENNESS_CHUNK];
                for (int d = 0; d < OPENNESS_DIRECTIONS; d++)
                    beams[d] = beams_of(m, &m->axis[d / 2], d % 2 ? -1 : 1, j, k);
                follow_beams(beams, i, found);
                memcpy(m->openness + ((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0] + i, found, (size_t)left);
            }
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

static CtsStatus make(Making *m, const CtsPreset *preset, int n_threads, CtsError *err)
{
    CtsStatus st;
    const int *const n = m->open->n;
    const size_t n_rows = (size_t)n[1] * (size_t)n[2];
    find_axes(m);
    if ((st = fill_tables(m, preset, err)) || (st = cts_alloc_array(&m->openness, n_rows * (size_t)n[0], err)) ||
        (st = cts_alloc_array(&m->open->square, n_rows * (size_t)n[0], err)))
        return st;
    for (int l = 0; l < m->n_lengths && !st; l++)
        st = cts_alloc_array(&m->transmittance[l], n_rows * (size_t)m->row, err);
    if (st)
        return st;
    cts_parallel(n_threads, n_rows, 0, fill_rows, m);
    const size_t n_tiles = ((size_t)(n[0] - 1) / OPENNESS_CHUNK + 1) * ((size_t)(n[1] - 1) / TILE_ROWS + 1);
    cts_parallel(n_threads, n_tiles, 1, follow_beams_from_tiles, m);
    cts_parallel(n_threads, n_rows, 0, pack_rows, m);
    return CTS_OK;
}

CtsStatus cts_openness_new(CtsOpenness **openness, const CtsVolume *volume, const CtsPreset *preset, int n_threads,
                           CtsError *err)
{
    CtsStatus st = cts_alloc_zeroed(openness, 1, err);
    if (st)
        return st;
    const CtsVolume *const shown =
        volume->voxel_labels && volume->voxel_labels->shown ? volume->voxel_labels->shown : volume;
    Making m = {.open = *openness, .volume = volume, .shown = shown, .macrocells = shown->macrocells};
    size_blocks(m.open, volume);
    st = make(&m, preset, n_threads, err);
    cts_free(&m.extinction);
    cts_free(&m.visible_below);
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

CtsStatus cts_openness_of_scene(CtsOpenness **openness, const CtsVolume *volume, const CtsPreset *preset, int n_threads,
                                CtsReport *report, CtsError *err)
{
    *openness = NULL;
    if (!cts_openness_counts(preset))
        return CTS_OK;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const CtsStatus st = cts_openness_new(openness, volume, preset, n_threads, err);
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
