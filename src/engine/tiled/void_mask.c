#include "engine/tiled/void_mask.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "engine/tiled/cell_distance.h"
#include <stdatomic.h>
#include <string.h>

/* Range of visible levels. */
typedef struct Bracket {
    int low, high;
} Bracket;

typedef struct BlockTest {
    TiledMask *mask;
    const CtsVolume *volume;
    const CtsMacrocells *macrocells;
    const CtsLut *lut;
    const TiledAppearances *appearances; /* NULL: one appearance for all */
    Bracket *brackets;                   /* of each appearance */
    int n_cells[3];
    ptrdiff_t stride[3]; /* to the next voxel; 0 along an axis of one */
    ptrdiff_t n_voxels;
    uint8_t *distance; /* of each block, to the nearest potentially visible one */
    _Atomic int64_t n_visible;
} BlockTest;

#define INLINE __attribute__((always_inline)) static inline
/* Levels of a row of voxels, those of a block's cells first. */
typedef uint16_t Row __attribute__((vector_size(16)));

/* By how much a exceeds b, or 0. */
INLINE Row excess(Row a, Row b)
{
    return (a - b) & (Row)(a > b);
}

INLINE Row smaller_row(Row a, Row b)
{
    return a - excess(a, b);
}

INLINE Row larger_row(Row a, Row b)
{
    return b + excess(a, b);
}

INLINE Row next_lane(Row row)
{
    return __builtin_shufflevector(row, row, 1, 2, 3, 4, 5, 6, 7, 7);
}

INLINE Row load_row(const BlockTest *t, ptrdiff_t at, int n)
{
    Row row = {0};
    if (t->stride[0] == 1 && at + (ptrdiff_t)(sizeof row / sizeof row[0]) <= t->n_voxels)
        memcpy(&row, t->volume->grey + at, sizeof row);
    else
        for (int i = 0; i <= n; i++)
            row[i] = t->volume->grey[at + i * t->stride[0]];
    return row;
}

/* All bits of element i are set if cell i may have values above b->low and below b->high, by its voxels' levels. */
INLINE Row row_shows(const Bracket *b, Row low, Row high)
{
    const Row from = (Row){0} + (uint16_t)(b->low + 1), to = (Row){0} + (uint16_t)(b->high - 1);
    const Row most = CTS_MUTATED(MASK_NEIGHBOUR) ? high : larger_row(high, next_lane(high));
    return (Row)(most >= from) & (Row)(smaller_row(low, next_lane(low)) <= to);
}

INLINE void any_block_bits(const BlockTest *t, const Bracket *b, const int block[3], uint32_t cells[2])
{
    int n[3];
    ptrdiff_t at = 0;
    Row low[TILED_BLOCK + 1][TILED_BLOCK], high[TILED_BLOCK + 1][TILED_BLOCK]; /* of two rows each */
    for (int a = 0; a < 3; a++) {
        const int rest = t->n_cells[a] - block[a] * TILED_BLOCK;
        n[a] = rest < TILED_BLOCK ? rest : TILED_BLOCK;
        at += block[a] * TILED_BLOCK * t->stride[a];
    }
    for (int k = 0; k <= n[2]; k++) {
        Row row = load_row(t, at + k * t->stride[2], n[0]);
        for (int j = 0; j < n[1]; j++) {
            const Row below = load_row(t, at + k * t->stride[2] + (j + 1) * t->stride[1], n[0]);
            low[k][j] = smaller_row(row, below);
            high[k][j] = larger_row(row, below);
            row = below;
        }
    }
    const Row cell = {1, 2, 4, 8};
    const uint16_t in_row = (uint16_t)((1U << n[0]) - 1);
    cells[0] = cells[1] = 0;
    for (int k = 0; k < n[2]; k++) {
        Row shows = {0};
        for (int j = 0; j < n[1]; j++)
            shows |= (row_shows(b, smaller_row(low[k][j], low[k + 1][j]), larger_row(high[k][j], high[k + 1][j])) &
                      cell & in_row)
                     << 4 * j;
        const uint16_t in_layer = shows[0] | shows[1] | shows[2] | shows[3];
        cells[k / 2] |= (uint32_t)in_layer << 16 * (k % 2);
    }
}

CTS_CPU_VARIANTS(void, block_bits, (const BlockTest *t, const Bracket *b, const int block[3], uint32_t cells[2]),
                 any_block_bits(t, b, block, cells))

/* NULL: the appearance is invisible. */
static const CtsLut *lut_of(const BlockTest *t, int appearance)
{
    return t->appearances ? cts_tiled_appearance_lut(t->appearances, t->lut, appearance) : t->lut;
}

/* True if a block of one appearance is potentially visible. */
static bool block_shows(const BlockTest *t, int appearance, CtsRange r)
{
    const CtsLut *const lut = lut_of(t, appearance);
    const Bracket *const b = &t->brackets[appearance];
    return lut && r.high > b->low && r.low < b->high &&
           cts_lut_visible(lut, r.low, CTS_MUTATED(SKIP_RANGE) ? r.low : r.high);
}

/* Tests the cells of a potentially visible block of one appearance. */
static void test_block_cells(const BlockTest *t, int appearance, const int block[3], CtsRange r, uint32_t cells[2])
{
    const Bracket *const b = &t->brackets[appearance];
    cells[0] = cells[1] = UINT32_MAX;
    if (r.low <= b->low || r.high >= b->high)
        CTS_CPU_CHOICE(cts_cpu_flags(), block_bits)(t, b, block, cells);
}

/* Appearances of a cell's voxels: bit l for appearance l. */
static void mark_appearances(const CtsVoxelLabels *voxel_labels, const int cell[3], uint64_t appearances[4])
{
    CtsCellLabels in_cell;
    const int one = cts_appearance_of_cell(voxel_labels, cell);
    if (one != CTS_APPEARANCES_DIFFER) {
        appearances[one / 64] |= UINT64_C(1) << one % 64;
        return;
    }
    cts_cell_labels(voxel_labels, cell, &in_cell);
    for (int i = 0; i < in_cell.n; i++) {
        const int appearance = voxel_labels->appearance[in_cell.voxel_label[i]];
        appearances[appearance / 64] |= UINT64_C(1) << appearance % 64;
    }
}

/* True if these levels are visible in any appearance. */
static bool any_appearance_shows(const BlockTest *t, CtsRange r)
{
    bool shows = false;
    for (int appearance = CTS_APPEARANCE_PRESET; appearance < t->appearances->n && !shows; appearance++)
        shows = cts_lut_visible(lut_of(t, appearance), r.low, r.high);
    return shows;
}

/* Cells of a block with several appearances: those that are potentially visible in one of their own. */
static bool test_mixed_block(const BlockTest *t, const int block[3], CtsRange r, uint32_t cells[2])
{
    const CtsVoxelLabels *const voxel_labels = t->appearances->voxel_labels;
    uint64_t of_cell[TILED_BLOCK * TILED_BLOCK * TILED_BLOCK][4] = {{0}}, all[4] = {0};
    cells[0] = cells[1] = 0;
    if (!any_appearance_shows(t, r))
        return false;
    for (int n = 0; n < TILED_BLOCK * TILED_BLOCK * TILED_BLOCK; n++) {
        const int cell[3] = {block[0] * TILED_BLOCK + n % 4, block[1] * TILED_BLOCK + n / 4 % 4,
                             block[2] * TILED_BLOCK + n / 16};
        if (cell[0] >= t->n_cells[0] || cell[1] >= t->n_cells[1] || cell[2] >= t->n_cells[2])
            continue;
        mark_appearances(voxel_labels, cell, of_cell[n]);
        for (int w = 0; w < 4; w++)
            all[w] |= of_cell[n][w];
    }
    for (int appearance = CTS_APPEARANCE_PRESET; appearance < t->appearances->n; appearance++) {
        uint32_t own[2], of_appearance[2] = {0, 0};
        if (!(all[appearance / 64] >> appearance % 64 & 1) || !block_shows(t, appearance, r))
            continue;
        test_block_cells(t, appearance, block, r, own);
        for (int n = 0; n < 64; n++)
            of_appearance[n / 32] |= (uint32_t)(of_cell[n][appearance / 64] >> appearance % 64 & 1) << n % 32;
        for (int w = 0; w < 2; w++)
            cells[w] |= own[w] & of_appearance[w];
    }
    return cells[0] | cells[1];
}

/* A block's appearance, or CTS_APPEARANCES_DIFFER. */
static int appearance_of_block(const BlockTest *t, size_t at)
{
    return t->appearances ? t->appearances->voxel_labels->block[at] : CTS_APPEARANCE_PRESET;
}

/* cells: all of a visible block's, unless its appearances differ. */
static bool test_block(const BlockTest *t, size_t at, const int block[3], uint32_t cells[2])
{
    const CtsRange r = t->macrocells->fine[at];
    const int appearance = appearance_of_block(t, at);
    cells[0] = cells[1] = UINT32_MAX;
    return appearance == CTS_APPEARANCES_DIFFER ? test_mixed_block(t, block, r, cells) : block_shows(t, appearance, r);
}

static uint32_t distinct_from_distance(uint32_t bits)
{
    return bits > 0 && bits <= TILED_FAR ? bits | UINT32_C(1) << 31 : bits;
}

static void test_rows(void *context, int worker, size_t first, size_t end)
{
    BlockTest *const t = context;
    TiledMask *const m = t->mask;
    int64_t n_visible = 0;
    (void)worker;
    for (size_t row = first; row < end; row++) {
        int block[3] = {0, (int)(row % (size_t)m->n[1]), (int)(row / (size_t)m->n[1])};
        for (; block[0] < m->n[0]; block[0]++) {
            const size_t at = row * (size_t)m->n[0] + (size_t)block[0];
            uint32_t cells[2];
            const bool visible = test_block(t, at, block, cells);
            t->distance[at] = visible ? 0 : CTS_CELL_FAR;
            if (!visible) /* its words are its distance */
                continue;
            for (int half = 0; half < 2; half++)
                m->words[2 * at + (size_t)half] = distinct_from_distance(cells[half]);
            n_visible++;
        }
    }
    atomic_fetch_add(&t->n_visible, n_visible);
}

static void note_distances(void *context, int worker, size_t first, size_t end)
{
    const BlockTest *const t = context;
    const size_t n = (size_t)t->mask->n[0];
    (void)worker;
    for (size_t at = first * n; at < end * n; at++)
        if (t->distance[at] > 0)
            t->mask->words[2 * at] = t->mask->words[2 * at + 1] = t->distance[at];
}

static void test_cells_of_rows(void *context, int worker, size_t first, size_t end)
{
    const BlockTest *const t = context;
    const TiledMask *const m = t->mask;
    (void)worker;
    for (size_t row = first; row < end; row++) {
        int block[3] = {0, (int)(row % (size_t)m->n[1]), (int)(row / (size_t)m->n[1])};
        for (; block[0] < m->n[0]; block[0]++) {
            const size_t at = row * (size_t)m->n[0] + (size_t)block[0];
            const int appearance = appearance_of_block(t, at);
            uint32_t *const words = m->words + 2 * at, cells[2];
            if (words[0] != UINT32_MAX || words[1] != UINT32_MAX || appearance == CTS_APPEARANCES_DIFFER)
                continue;
            test_block_cells(t, appearance, block, t->macrocells->fine[at], cells);
            for (int half = 0; half < 2; half++)
                words[half] = distinct_from_distance(cells[half]);
        }
    }
}

static Bracket bracket_of(const CtsLut *lut)
{
    Bracket b = {-1, CTS_N_GREY};
    if (!lut)
        return b;
    cts_lut_visible_levels(lut, &b.low, &b.high);
    b.low = b.low > 0 ? b.low : -1;
    b.high = b.high < CTS_N_GREY - 1 ? b.high - 2 * CTS_MUTATED(QUIET_HIGH) : CTS_N_GREY;
    return b;
}

static void block_test_free(BlockTest *t)
{
    cts_free(&t->brackets);
    cts_free(&t->distance);
}

static CtsStatus block_test_new(BlockTest *t, TiledMask *mask, const CtsScene *scene,
                                const TiledAppearances *appearances, CtsError *err)
{
    const int n = appearances ? appearances->n : CTS_APPEARANCE_PRESET + 1;
    *t = (BlockTest){.mask = mask,
                     .volume = scene->volume,
                     .macrocells = scene->model->macrocells,
                     .lut = scene->lut,
                     .appearances = appearances};
    cts_volume_cells(scene->volume, t->n_cells, t->stride);
    t->n_voxels = (ptrdiff_t)cts_volume_n_voxels(scene->volume);
    const CtsStatus st = cts_alloc_array(&t->brackets, (size_t)n, err);
    for (int appearance = 0; !st && appearance < n; appearance++)
        t->brackets[appearance] = bracket_of(lut_of(t, appearance));
    return st;
}

CtsStatus cts_tiled_mask_init(TiledMask *mask, const CtsScene *scene, const TiledAppearances *appearances,
                              CtsError *err)
{
    BlockTest l;
    const int *const n = scene->model->macrocells->n_fine;
    const size_t rows = (size_t)n[1] * (size_t)n[2], n_blocks = rows * (size_t)n[0];
    *mask = (TiledMask){.n = {n[0], n[1], n[2]}};
    CtsStatus st = block_test_new(&l, mask, scene, appearances, err);
    if (st || (st = cts_alloc_array(&mask->words, 2 * n_blocks, err)) ||
        (st = cts_alloc_array(&l.distance, n_blocks, err)))
        goto end;
    cts_parallel(scene->settings->n_threads, rows, 16, test_rows, &l);
    mask->n_visible = atomic_load(&l.n_visible);
    cts_cell_distance(l.distance, n[0], n[1], n[2]);
    cts_parallel(scene->settings->n_threads, rows, 16, note_distances, &l);
end:
    block_test_free(&l);
    if (st)
        cts_tiled_mask_free(mask);
    return st;
}

CtsStatus cts_tiled_mask_refine(TiledMask *mask, const CtsScene *scene, const TiledAppearances *appearances,
                                CtsError *err)
{
    BlockTest l;
    const CtsStatus st = block_test_new(&l, mask, scene, appearances, err);
    if (!st)
        cts_parallel(scene->settings->n_threads, (size_t)mask->n[1] * (size_t)mask->n[2], 16, test_cells_of_rows, &l);
    block_test_free(&l);
    mask->refined = !st;
    return st;
}

void cts_tiled_mask_free(TiledMask *mask)
{
    cts_free(&mask->words);
}
