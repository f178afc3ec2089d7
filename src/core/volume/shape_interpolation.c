#include "core/volume/shape_interpolation.h"

#include "base/compare.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include "core/volume/linear_layers.h"
#include "core/volume/shape_move.h"
#include "core/volume/slice_interpolation.h"
#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The surfaces that are followed: of the body and of its air, halfway from air to water, and of bone, above the blood
 * of vessels with contrast agent and below the thinnest cortex. */
static const double SURFACE_HU[] = {-500, 300};
enum { N_SURFACES = SHAPE_SURFACES, BLOCK = SHAPE_BLOCK, SIDE = SHAPE_SIDE, FAR = SHAPE_FAR };
static_assert(sizeof SURFACE_HU / sizeof *SURFACE_HU == SHAPE_SURFACES, "a field for each surface");
/* A diagonal step, where one to the side has 12: 12 * sqrt(2) = 16.97 (Borgefors 1986). */
enum { CORNER = 17 };

/* "Measured" in comments of these files: the rms error of layers in place of slices that were left out, every second
 * and three of four of a chest (2.5 mm), four of five of a skull phantom (1 mm); by cubics alone it is 6 to 12 %
 * larger. */

/* Difference between slices up to which blending handles texture and noise well; noise has standard deviations of 5 HU
 * in a head to 63 HU in a chest by a sharp kernel. Measured: 75 to 200 HU change the error by less than 1 %. */
static const double ALIKE_HU = 100;
/* Difference up to which the values that a displacement matches are similar, unless they are half as different as
 * without it: that of two edges half a pixel apart, 130 HU at the skin of the head, 410 HU of the chest. Measured: 75
 * to 600 HU change the error by less than 1 %. */
static const double EDGES_HU = 300;

#define INLINE __attribute__((always_inline)) static inline

typedef struct Shaping {
    const CtsShapeStack *stack;
    int n_blocks[2];
    uint16_t level[N_SURFACES];
    float alike, edges; /* grey levels */
    bool is_linear;
    cts_shape_find_fn find;
    cts_shape_write_fn write;
    struct Scratch *scratch; /* of each thread; NULL: no surface is followed */
    int first, end;          /* range of slices processed in parallel; those from `end` on are at their layers */
} Shaping;

/* Blocks of a row that are searched together; their flags are the bits of a word. */
enum { CHUNK = 64 };

/* Scratch memory of one thread. */
typedef struct Scratch {
    int slice; /* of the gap's second field */
    ShapeSums sums;
    bool no_memory;
    ShapeGap gap;
    uint16_t *grey, *row; /* of both fields; four rows of blocks, two blocks and a chunk */
    int16_t *known;       /* for each surface, the distances of a row and of a block beyond each end */
    int16_t *columns;     /* the distances of SHAPE_ROWS rows */
    /* For one gap: blocks that move, and blocks that move or have a neighbour in the row that moves. */
    uint64_t *bits, *near;
    float *move;
    int16_t *distance;
} Scratch;

static size_t n_all_blocks(const Shaping *s)
{
    return (size_t)s->n_blocks[0] * (size_t)s->n_blocks[1];
}

/* Words of a row's flags as bits; the last one has room for a bit beyond the row. */
static size_t n_row_words(const Shaping *s)
{
    return (size_t)s->n_blocks[0] / 64 + 1;
}

static void scratch_free(Scratch *c)
{
    cts_free(&c->gap.moving.items);
    cts_free(&c->gap.written.items);
    cts_free(&c->distance);
    cts_free(&c->grey);
    cts_free(&c->row);
    cts_free(&c->known);
    cts_free(&c->columns);
    cts_free(&c->move);
    cts_free(&c->bits);
    cts_free(&c->near);
}

static CtsStatus scratch_new(const Shaping *s, Scratch *c, CtsError *err)
{
    const size_t n = n_all_blocks(s), n_bits = (size_t)s->n_blocks[1] * n_row_words(s);
    const size_t n_moves = shape_place((ShapeBlock){(uint32_t)n, (uint32_t)s->n_blocks[1]});
    CtsStatus st;
    *c = (Scratch){.slice = -1,
                   .no_memory = c->no_memory,
                   .gap = {.stack = s->stack, .n_blocks = {s->n_blocks[0], s->n_blocks[1]}, .edges = s->edges}};
    if ((st = cts_alloc_array(&c->distance, 2 * N_SURFACES * n + SHAPE_LANES + 1, err)) ||
        (st = cts_alloc_array(&c->grey, 2 * n, err)) ||
        (st = cts_alloc_array(&c->row, 4 * (size_t)s->n_blocks[0] + 2 + CHUNK, err)) ||
        (st = cts_alloc_array(&c->known, N_SURFACES * ((size_t)s->n_blocks[0] + 2), err)) ||
        (st = cts_alloc_array(&c->columns, SHAPE_ROWS * (size_t)s->n_blocks[0], err)) ||
        (st = cts_alloc_zeroed(&c->move, SHAPE_NUMBERS * n_moves + SHAPE_LANES, err)) ||
        (st = cts_alloc_array(&c->bits, n_bits, err)) || (st = cts_alloc_array(&c->near, n_bits, err)) ||
        (st = cts_alloc_array(&c->gap.moving.items, n, err)) || (st = cts_alloc_array(&c->gap.written.items, n, err))) {
        scratch_free(c);
        *c = (Scratch){.no_memory = true};
        return st;
    }
    for (int i = 0; i < 2 * N_SURFACES; i++)
        c->gap.field[i / N_SURFACES].distance[i % N_SURFACES] = c->distance + (size_t)i * n;
    for (int i = 0; i < 2; i++)
        c->gap.field[i].grey = c->grey + (size_t)i * n;
    for (int i = 0; i < SHAPE_NUMBERS; i++)
        c->gap.move[i] = c->move + (size_t)i * n_moves;
    return CTS_OK;
}

/* Means of 2 x 2 pixels. */
INLINE void bin_row(const CtsShapeStack *t, const uint16_t *slice, int block_row, int n, uint16_t *restrict to)
{
    const uint16_t *const a = slice + (size_t)(BLOCK * block_row) * (size_t)t->n_columns;
    const uint16_t *const b = BLOCK * block_row + 1 < t->n_rows ? a + t->n_columns : a;
    for (int i = 0; i < t->n_columns / BLOCK; i++)
        to[i] = (uint16_t)(((uint32_t)a[2 * i] + a[2 * i + 1] + b[2 * i] + b[2 * i + 1] + 2) / 4);
    if (t->n_columns % BLOCK)
        to[n - 1] = (uint16_t)((2U * a[2 * n - 2] + 2U * b[2 * n - 2] + 2) / 4);
}

/* Weights: half for the row, a quarter for either neighbour. */
INLINE void smooth_row(const uint16_t *before, const uint16_t *own, const uint16_t *behind, int n,
                       uint16_t *restrict to)
{
    for (int i = 0; i < n; i++)
        to[i] = (uint16_t)((before[i] + 2U * own[i] + behind[i] + 2) / 4);
}

/* Means of blocks, smoothed along rows and columns with the weights 1/4, 1/2, 1/4: smoothing suppresses noise. */
INLINE void read_blocks(const Shaping *s, const uint16_t *slice, uint16_t *rows, uint16_t *grey)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    uint16_t *const bins = rows + 1; /* with its ends once more */
    uint16_t *const smooth[3] = {rows + nx + 2, rows + 2 * nx + 2, rows + 3 * nx + 2};
    for (int j = 0; j <= ny; j++) {
        if (j < ny) {
            bin_row(s->stack, slice, j, nx, bins);
            rows[0] = bins[0];
            bins[nx] = bins[nx - 1];
            smooth_row(rows, bins, bins + 1, nx, smooth[j % 3]);
        }
        if (j > 0)
            smooth_row(smooth[(j > 1 ? j - 2 : 0) % 3], smooth[(j - 1) % 3], smooth[(j < ny ? j : ny - 1) % 3], nx,
                       grey + (size_t)(j - 1) * (size_t)nx);
    }
}

/* Least and largest grey levels of each block's four neighbours; beyond the borders lie the same blocks once more. */
INLINE void compare_neighbours(const Shaping *s, const uint16_t *grey, int j, uint16_t *own, uint16_t *restrict low,
                               uint16_t *restrict high)
{
    const int nx = s->n_blocks[0];
    const uint16_t *const row = grey + (size_t)j * (size_t)nx, *const above = j > 0 ? row - nx : row;
    const uint16_t *const below = j + 1 < s->n_blocks[1] ? row + nx : row;
    memcpy(own + 1, row, (size_t)nx * sizeof *row);
    own[0] = row[0];
    own[nx + 1] = row[nx - 1];
    for (int i = 0; i < nx; i++) {
        const uint16_t a = above[i], b = below[i], c = own[i], d = own[i + 2];
        const uint16_t ab = a < b ? a : b, cd = c < d ? c : d, most_ab = a < b ? b : a, most_cd = c < d ? d : c;
        low[i] = ab < cd ? ab : cd;
        high[i] = most_ab < most_cd ? most_cd : most_ab;
    }
}

/* Marks by 0, else FAR, the blocks with a neighbour on the other side of the level, which few have. */
INLINE bool mark_crossings(const uint16_t *own, const uint16_t *low, const uint16_t *high, int n, uint16_t level,
                           int16_t *restrict d)
{
    int16_t any = 0;
    for (int i = 0; i < n; i++) {
        const bool in = own[i] >= level, alike = (in == (low[i] >= level)) & (in == (high[i] >= level));
        d[i] = alike ? FAR : 0;
        any |= alike ? 0 : 1;
    }
    return any;
}

/* Distances from the centres of marked blocks to where the grey level passes the surface's: nearest towards the
 * neighbour that differs most. */
INLINE void measure_crossings(const uint16_t *own, const uint16_t *low, const uint16_t *high, int n, uint16_t level,
                              int16_t *restrict d)
{
    int off[CHUNK];
    for (int i = 0; i < CHUNK; i++) {
        const int x = own[i], below = x - low[i], above = x - high[i], difference = x >= level ? below : above;
        off[i] = (int)(SIDE * ((float)x - (level - 0.5F)) / (float)(difference + (difference == 0)) + 0.5F);
    }
    for (int i = 0; i < n; i++)
        d[i] = d[i] ? d[i] : (int16_t)off[i];
}

INLINE void begin_row(const uint16_t *own, const uint16_t *low, const uint16_t *high, int nx, uint16_t level,
                      int16_t *d)
{
    for (int i = 0; i < nx; i += CHUNK) {
        const int n = cts_smaller_int(nx - i, CHUNK);
        if (n == CHUNK ? mark_crossings(own + i, low + i, high + i, CHUNK, level, d + i)
                       : mark_crossings(own + i, low + i, high + i, n, level, d + i))
            measure_crossings(own + i, low + i, high + i, n, level, d + i);
    }
}

INLINE int16_t nearer(int16_t a, int16_t b)
{
    return a < b ? a : b;
}

/* Distances of a row from those of the row visited before, which becomes this one; beyond its ends there are none. */
INLINE void reach_row(int16_t *restrict d, int16_t *restrict known, int n)
{
    for (int i = 0; i < n; i++)
        d[i] = nearer(nearer(d[i], (int16_t)(known[i + 1] + SIDE)), (int16_t)(nearer(known[i], known[i + 2]) + CORNER));
    memcpy(known + 1, d, (size_t)n * sizeof *d);
}

static inline i16x8 nearest(i16x8 a, i16x8 b)
{
    for (int l = 0; l < SHAPE_ROWS; l++)
        a[l] = nearer(a[l], b[l]);
    return a;
}

/* Eight rows side by side are a row of vectors; the last rows and columns may be among those before. */
void cts_shape_reach_rows(int16_t *distance, const int n_blocks[2], int16_t *columns)
{
    const int nx = n_blocks[0], ny = n_blocks[1];
    i16x8 *const v = (i16x8 *)columns;
    for (int n = 1; n < nx && (nx < SHAPE_ROWS || ny < SHAPE_ROWS); n++) /* a step further each time */
        for (int i = 1; i < nx * ny; i++)
            if (i % nx) {
                distance[i] = nearer(distance[i], (int16_t)(distance[i - 1] + SIDE));
                distance[i - 1] = nearer(distance[i - 1], (int16_t)(distance[i] + SIDE));
            }
    for (int j = 0; j < ny && nx >= SHAPE_ROWS && ny >= SHAPE_ROWS; j += SHAPE_ROWS) {
        uint16_t *const rows = (uint16_t *)distance + (ptrdiff_t)cts_smaller_int(j, ny - SHAPE_ROWS) * nx;
        for (int i = 0; i < nx; i += SHAPE_ROWS)
            transpose_8x8(rows + cts_smaller_int(i, nx - SHAPE_ROWS), (size_t)nx,
                          (uint16_t *)(v + cts_smaller_int(i, nx - SHAPE_ROWS)), SHAPE_ROWS);
        for (int i = 1; i < nx; i++)
            v[i] = nearest(v[i], v[i - 1] + SIDE);
        for (int i = nx - 2; i >= 0; i--)
            v[i] = nearest(v[i], v[i + 1] + SIDE);
        for (int i = 0; i < nx; i += SHAPE_ROWS)
            transpose_8x8((uint16_t *)(v + cts_smaller_int(i, nx - SHAPE_ROWS)), SHAPE_ROWS,
                          rows + cts_smaller_int(i, nx - SHAPE_ROWS), (size_t)nx);
    }
}

static size_t n_slice_voxels(const CtsShapeStack *t)
{
    return (size_t)t->n_columns * (size_t)t->n_rows;
}

static const uint16_t *stored_slice(const Shaping *s, int slice)
{
    const CtsShapeStack *const t = s->stack;
    return slice < s->end ? t->slices + (size_t)slice * n_slice_voxels(t)
                          : t->layers + (size_t)slice * (size_t)t->n_parts * n_slice_voxels(t);
}

/* Voxels of a layer, within the box. */
static size_t n_layer_voxels(const CtsShapeStack *t)
{
    return (size_t)(t->end[0] - t->low[0]) * (size_t)(t->end[1] - t->low[1]);
}

static uint16_t *stored_layer(const CtsShapeStack *t, int layer)
{
    return t->layers + (size_t)(layer - t->low[2]) * n_layer_voxels(t);
}

/* From rows above, from rows below, then within rows: a shortest path has its diagonal steps first. */
INLINE void read_any_field(const Shaping *s, int slice, Scratch *c, ShapeField *field)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    uint16_t *const own = c->row, *const low = own + nx + 2, *const high = low + nx;
    read_blocks(s, stored_slice(s, slice), c->row, field->grey);
    for (int i = 0; i < N_SURFACES * (nx + 2); i++)
        c->known[i] = FAR;
    for (int j = 0; j < ny; j++) {
        compare_neighbours(s, field->grey, j, own, low, high);
        for (int l = 0; l < N_SURFACES; l++) {
            int16_t *const d = field->distance[l] + (size_t)j * (size_t)nx;
            begin_row(own + 1, low, high, nx, s->level[l], d);
            reach_row(d, c->known + l * (nx + 2), nx);
        }
    }
    for (int l = 0; l < N_SURFACES; l++) {
        int16_t *const d = field->distance[l];
        for (int j = ny - 1; j >= 0; j--)
            reach_row(d + (size_t)j * (size_t)nx, c->known + l * (nx + 2), nx);
        cts_shape_reach_rows(d, s->n_blocks, c->columns);
        for (size_t i = 0; i < n_all_blocks(s); i++)
            d[i] = (int16_t)(field->grey[i] < s->level[l] ? -d[i] : d[i]);
    }
}

CTS_CPU_VARIANTS(void, read_field, (const Shaping *s, int slice, Scratch *c, ShapeField *field),
                 read_any_field(s, slice, c, field))

/* Bit i: block at + i, of n, is displaced at any position between the slices and differs by more than noise;
 * displacements of all others are 0. */
INLINE uint64_t flag_blocks(const Shaping *s, const Scratch *c, size_t at, int n)
{
    const uint16_t *const a = c->gap.field[0].grey + at, *const b = c->gap.field[1].grey + at;
    const int alike = (int)s->alike;
    enum { EIGHT = 8 };
    uint8_t moves[CHUNK] = {0};
    uint64_t bits = 0;
    int any = 0;
    for (int i = 0; i < n; i++)
        any |= abs(b[i] - a[i]) > alike;
    if (!any)
        return 0;
    for (int l = 0; l < N_SURFACES; l++) {
        const int16_t *const d = c->gap.field[0].distance[l] + at, *const e = c->gap.field[1].distance[l] + at;
        for (int i = 0; i < n; i++) {
            const int moved = abs(e[i] - d[i]), off = cts_smaller_int(abs(d[i]), abs(e[i]));
            moves[i] |= (moved > SHAPE_MOVES_FROM) & (abs(b[i] - a[i]) > alike) &
                        (((d[i] ^ e[i]) < 0) | (off < SHAPE_GOES_WITH * moved + 2 * SIDE));
        }
    }
    for (int i = 0; i < CHUNK; i += EIGHT) {
        uint64_t eight;
        memcpy(&eight, moves + i, sizeof eight);
        for (int k = 0; eight && k < EIGHT; k++)
            bits |= (uint64_t)moves[i + k] << (i + k);
    }
    return bits;
}

/* Blocks low[] <= n < end[]. */
typedef struct BlockBox {
    int low[2], end[2];
} BlockBox;

/* The blocks of the box, and `margin` blocks around it. */
INLINE BlockBox blocks_of_box(const Shaping *s, int margin)
{
    BlockBox box;
    for (int axis = 0; axis < 2; axis++) {
        const int low = s->stack->low[axis] / BLOCK - margin, end = (s->stack->end[axis] - 1) / BLOCK + 1 + margin;
        box.low[axis] = low > 0 ? low : 0;
        box.end[axis] = cts_smaller_int(end, s->n_blocks[axis]);
    }
    return box;
}

INLINE void find_any_moves(const Shaping *s, Scratch *c)
{
    const int nx = s->n_blocks[0];
    const BlockBox box = blocks_of_box(s, 1);
    uint64_t *bits = c->bits + (size_t)box.low[1] * n_row_words(s);
    for (int j = box.low[1]; j < box.end[1]; j++)
        for (int i = 0; i <= nx; i += CHUNK) {
            const size_t at = (size_t)j * (size_t)nx + (size_t)i;
            *bits++ = nx - i < CHUNK ? flag_blocks(s, c, at, nx - i) : flag_blocks(s, c, at, CHUNK);
        }
}

CTS_CPU_VARIANTS(void, find_moves, (const Shaping *s, Scratch *c), find_any_moves(s, c))

/* Bits of word w of a row that are columns of the box. */
static uint64_t word_of_box(const BlockBox *box, size_t w)
{
    const int low = box->low[0] - 64 * (int)w, end = box->end[0] - 64 * (int)w;
    const uint64_t from = low <= 0 ? ~UINT64_C(0) : low < 64 ? ~UINT64_C(0) << low : 0;
    return end >= 64 ? from : end > 0 ? from & ((UINT64_C(1) << end) - 1) : 0;
}

/* Lists the blocks of a box whose bit is set. */
static void list_flagged(const Shaping *s, const uint64_t *bits, const BlockBox *box, ShapeBlocks *list)
{
    const size_t nx = (size_t)s->n_blocks[0], n = n_row_words(s);
    list->n = 0;
    for (size_t j = (size_t)box->low[1]; j < (size_t)box->end[1]; j++)
        for (size_t w = 0; w < n; w++)
            for (uint64_t left = bits[j * n + w] & word_of_box(box, w); left; left &= left - 1)
                list->items[list->n++] =
                    (ShapeBlock){(uint32_t)(j * nx + 64 * w + (size_t)__builtin_ctzll(left)), (uint32_t)j};
}

/* Bits that are set in a row or beside one that is. */
static void widen_row(const uint64_t *own, int n_blocks, uint64_t *to)
{
    const int n = n_blocks / 64 + 1;
    for (int w = 0; w < n; w++)
        to[w] =
            own[w] | own[w] << 1 | own[w] >> 1 | (w > 0 ? own[w - 1] >> 63 : 0) | (w + 1 < n ? own[w + 1] << 63 : 0);
    to[n - 1] &= (UINT64_C(1) << n_blocks % 64) - 1;
}

/* Lists the blocks processed in every layer of a gap: most blocks are not displaced, or similar. Displacements of
 * adjacent blocks affect a pixel, too. */
static void list_blocks(const Shaping *s, Scratch *c)
{
    const size_t n = n_row_words(s);
    const BlockBox box = blocks_of_box(s, 0), wide = blocks_of_box(s, 1);
    CTS_CPU_CHOICE(cts_cpu_flags(), find_moves)(s, c);
    for (int j = wide.low[1]; j < wide.end[1]; j++)
        widen_row(c->bits + (size_t)j * n, s->n_blocks[0], c->near + (size_t)j * n);
    list_flagged(s, c->bits, &wide, &c->gap.moving);
    for (int j = box.low[1]; j < box.end[1]; j++) {
        const uint64_t *const own = c->near + (size_t)j * n, *const above = j > wide.low[1] ? own - n : own;
        const uint64_t *const below = j + 1 < wide.end[1] ? own + n : own;
        for (size_t w = 0; w < n; w++)
            c->bits[(size_t)j * n + w] = above[w] | own[w] | below[w];
    }
    list_flagged(s, c->bits, &box, &c->gap.written);
}

/* Clears the displacements of listed blocks and of their neighbours in the row, run by run. */
static void clear_moves(const ShapeGap *g)
{
    const ShapeBlock *const b = g->moving.items;
    for (size_t first = 0, end; first < g->moving.n; first = end) {
        for (end = first + 1; end < g->moving.n && b[end].at == b[end - 1].at + 1 && b[end].row == b[first].row;)
            end++;
        for (int k = 0; k < SHAPE_NUMBERS; k++)
            memset(g->move[k] + shape_place(b[first]) - 1, 0, (end - first + 2) * sizeof(float));
    }
}

static double place_of_slice(const CtsShapeStack *t, int slice)
{
    return t->layer ? t->layer[slice] : (double)slice * t->n_parts;
}

static void shape_gap(const Shaping *s, Scratch *c, int gap)
{
    const CtsShapeStack *const t = s->stack;
    const double from = place_of_slice(t, gap), to = place_of_slice(t, gap + 1);
    list_blocks(s, c);
    for (int j = cts_larger_int((int)floor(from) + 1, t->low[2]); j < to && j < t->end[2]; j++) {
        const ShapeLayer made = {
            {stored_slice(s, gap), stored_slice(s, gap + 1)}, stored_layer(t, j), (float)((j - from) / (to - from))};
        c->sums.n_voxels += n_layer_voxels(t);
        s->find(&c->gap, made.part);
        s->write(&c->gap, &made, &c->sums);
    }
    clear_moves(&c->gap);
}

/* Layers from a slice before the next one, or the last slice's own. */
typedef struct LayerRange {
    int first, end;
} LayerRange;

static LayerRange layers_of_gap(const CtsShapeStack *t, int gap)
{
    const double from = place_of_slice(t, gap);
    const int first = gap > 0 ? (int)ceil(from) : 0;
    const int end = gap + 1 == t->n_slices ? t->end[2] : (int)ceil(place_of_slice(t, gap + 1));
    return (LayerRange){cts_larger_int(first, t->low[2]), cts_smaller_int(end, t->end[2])};
}

/* Some rows of n voxels, the first from voxel `from` of the slices and `to` of the layers on. */
typedef struct RowGroup {
    size_t from, to, n, n_rows, stride_from, stride_to;
} RowGroup;

/* Rows of the layers from a slice to the next one: a copy of the slice, then cubics. */
static void blend_gap(const Shaping *s, int gap, const RowGroup *r)
{
    const CtsShapeStack *const t = s->stack;
    const int last = t->n_slices - 1, a = gap > 0 ? gap - 1 : gap, c = cts_smaller_int(gap + 1, last),
              d = cts_smaller_int(gap + 2, last);
    const uint16_t *const of[4] = {stored_slice(s, a), stored_slice(s, gap), stored_slice(s, c), stored_slice(s, d)};
    const double from = place_of_slice(t, gap), here = place_of_slice(t, c) - from;
    const double before = a < gap ? from - place_of_slice(t, a) : here;
    const double behind = d > c ? place_of_slice(t, d) - place_of_slice(t, c) : here;
    const double distance[3] = {before / t->n_parts, here / t->n_parts, behind / t->n_parts};
    const LayerRange made = layers_of_gap(t, gap);
    for (int j = made.first; j < made.end; j++) {
        const bool is_copy = gap == last || j <= from;
        const CtsInterpolationWeights weights =
            is_copy ? (CtsInterpolationWeights){0} : cts_slice_interpolation_weights((j - from) / here, distance);
        for (size_t row = 0; row < r->n_rows; row++) {
            const size_t at = r->from + row * r->stride_from;
            const uint16_t *const slices[4] = {of[0] + at, of[1] + at, of[2] + at, of[3] + at};
            uint16_t *const to = stored_layer(t, j) + r->to + row * r->stride_to;
            if (is_copy && to != slices[1])
                memcpy(to, slices[1], r->n * sizeof *to);
            else if (!is_copy && s->is_linear)
                cts_slice_blend_row(to, slices[1], slices[2], r->n, (float)((j - from) / here));
            else if (!is_copy)
                cts_slice_interpolation_row(to, slices, (int)r->n, &weights);
        }
    }
}

/* Some slices and the layers behind each: blended column by column, with the slices in the cache for the next gap, then
 * displaced. */
static void make_gaps(void *context, int worker, size_t first, size_t end)
{
    /* Voxels of a slice: 16 KiB of each of four slices and of their layers stay in the L2 cache. Changes no result. */
    enum { SPAN = 8192 };
    const Shaping *const s = context;
    const CtsShapeStack *const t = s->stack;
    Scratch *const c = s->scratch ? &s->scratch[worker] : NULL;
    const unsigned cpu = cts_cpu_flags();
    /* Rows of whole slices are one. */
    const bool whole = t->end[0] - t->low[0] == t->n_columns;
    const size_t nx = (size_t)t->n_columns, n = (size_t)(t->end[0] - t->low[0]), n_all = n_layer_voxels(t);
    const size_t from = (size_t)t->low[1] * nx + (size_t)t->low[0], n_rows = SPAN / n > 0 ? SPAN / n : 1;
    for (size_t at = 0; at < n_all; at += whole ? SPAN : n_rows * n) {
        const RowGroup rows =
            whole ? (RowGroup){from + at, at, n_all - at < SPAN ? n_all - at : SPAN, 1, 0, 0}
                  : (RowGroup){from + at / n * nx, at, n, (n_all - at) / n < n_rows ? (n_all - at) / n : n_rows, nx, n};
        for (size_t gap = first; gap < end; gap++)
            blend_gap(s, s->first + (int)gap, &rows);
    }
    for (int gap = s->first + (int)first; gap < s->first + (int)end; gap++) {
        const LayerRange made = layers_of_gap(t, gap);
        if (gap + 1 == t->n_slices || made.first >= made.end || !c || (!c->grey && scratch_new(s, c, NULL)))
            continue;
        ShapeField *const field = c->gap.field, first_field = field[0];
        field[0] = field[1];
        field[1] = first_field;
        if (c->slice != gap)
            CTS_CPU_CHOICE(cpu, read_field)(s, gap, c, &field[0]);
        CTS_CPU_CHOICE(cpu, read_field)(s, c->slice = gap + 1, c, &field[1]);
        shape_gap(s, c, gap);
    }
}

/* Value of another quantity for a difference of 1 HU, so that the surface of the body, its threshold against air, lies
 * as far above air. */
static double value_of_one_hu(const CtsVolume *v)
{
    const double air_hu = -1000;
    return v->quantity == CTS_QUANTITY_HU
               ? 1
               : fmax((v->air_limit - v->air_value) / (SURFACE_HU[0] - air_hu), v->hu_step / -SURFACE_HU[0]);
}

static uint16_t level_of_hu(const CtsVolume *v, double hu)
{
    const double value = v->quantity == CTS_QUANTITY_HU ? hu : v->air_limit + (hu - SURFACE_HU[0]) * value_of_one_hu(v);
    const double level = ceil((value - v->hu_offset) / v->hu_step);
    return (uint16_t)(level < 1 ? 1 : level > UINT16_MAX ? UINT16_MAX : level);
}

void cts_shape_interpolate_layers(const CtsShapeStack *stack, CtsInterpolation how, int n_threads,
                                  CtsInterpolationCounts *made)
{
    /* Gaps that one thread blends before it displaces them: two layers of 512 x 512 pixels in each are 8 MiB, which
     * stay in the last-level cache. Changes no result. */
    enum { AT_ONCE = 8 };
    const unsigned cpu = cts_cpu_flags();
    const int threads = cts_threads(n_threads);
    Shaping s = {.stack = stack,
                 .n_blocks = {(stack->n_columns + 1) / BLOCK, (stack->n_rows + 1) / BLOCK},
                 .is_linear = how == CTS_INTERPOLATION_LINEAR};
    for (int l = 0; l < N_SURFACES; l++)
        s.level[l] = level_of_hu(stack->scale, SURFACE_HU[l]);
    const double levels_of_one_hu = value_of_one_hu(stack->scale) / stack->scale->hu_step;
    s.alike = (float)(ALIKE_HU * levels_of_one_hu);
    s.edges = (float)(EDGES_HU * levels_of_one_hu);
    s.find = CTS_CPU_CHOICE(cpu, cts_shape_find_moves);
    s.write = CTS_CPU_CHOICE(cpu, cts_shape_write_layer);
    if (how == CTS_INTERPOLATION_SHAPE && stack->n_columns > 1 && stack->n_rows > 1)
        made->no_memory |= cts_alloc_zeroed(&s.scratch, (size_t)threads, NULL) != CTS_OK;
    /* In the memory of the slices, layers of a range are written behind its last slice, so that none is overwritten
     * before it is read. */
    for (s.end = stack->n_slices; s.end > 0; s.end = s.first) {
        s.first = stack->slices == stack->layers && s.end > 1 ? (s.end + stack->n_parts - 1) / stack->n_parts : 0;
        cts_parallel(threads, (size_t)(s.end - s.first), threads == 1 ? AT_ONCE : 0, make_gaps, &s);
    }
    uint64_t differences = 0;
    for (int t = 0; s.scratch && t < threads; t++) {
        made->n_voxels += s.scratch[t].sums.n_voxels;
        made->n_moved += s.scratch[t].sums.n_moved;
        differences += s.scratch[t].sums.differences;
        made->no_memory |= s.scratch[t].no_memory;
        scratch_free(&s.scratch[t]);
    }
    made->sum_of_differences_hu += (double)differences * stack->scale->hu_step;
    cts_free(&s.scratch);
}
