#include "core/volume/shape_interpolation.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include "core/volume/shape_move.h"
#include <assert.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* The surfaces that are followed: of the body and of its air, halfway from air to water, and of bone, above the blood
 * of vessels with contrast agent and below the thinnest cortex. */
static const double SURFACE_HU[] = {-500, 300};
enum { N_SURFACES = SHAPE_SURFACES, BLOCK = SHAPE_BLOCK, SIDE = SHAPE_SIDE, FAR = SHAPE_FAR };
static_assert(sizeof SURFACE_HU / sizeof *SURFACE_HU == SHAPE_SURFACES, "a field for each surface");
/* A diagonal step, where one to the side has 12 (Borgefors 1986). */
enum { CORNER = 17 };

/* ALIKE_HU: smaller differences between slices are texture and noise, which blending handles well. A displacement is
 * accepted if the values it matches are similar: half as different as without it, or within EDGES_HU, the difference of
 * two edges half a pixel apart. */
static const double ALIKE_HU = 100, EDGES_HU = 300;

#define INLINE __attribute__((always_inline)) static inline

/* One slice as blocks: grey levels, then for each surface how far it lies off, positive inside. */
typedef struct SliceField {
    uint16_t *grey;
    int16_t *distance[N_SURFACES];
} SliceField;

typedef struct Shaping {
    const CtsShapeStack *stack;
    int n_blocks[2];
    uint16_t level[N_SURFACES];
    float alike, edges; /* grey levels */
    cts_shape_find_fn find;
    cts_shape_write_fn write;
    atomic_ullong n_voxels, n_moved, sum_of_differences;
    atomic_int n_failed;
} Shaping;

/* Distances side by side. */
enum { EIGHT = 8 };

/* Scratch memory of one thread. */
typedef struct Scratch {
    SliceField field[2];
    ShapeGap gap;
    uint16_t *grey, *row; /* of both fields; two rows of blocks, and two blocks */
    /* For one gap: blocks that move, as bytes and as bits, and those that do or whose neighbours in the row do. */
    uint8_t *moves;
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

static void blocks_free(ShapeBlocks *b)
{
    cts_free(&b->at);
    cts_free(&b->row);
}

static CtsStatus blocks_new(ShapeBlocks *b, size_t n, CtsError *err)
{
    CtsStatus st;
    (void)((st = cts_alloc_array(&b->at, n, err)) || (st = cts_alloc_array(&b->row, n, err)));
    return st;
}

static void scratch_free(Scratch *c)
{
    blocks_free(&c->gap.moving);
    blocks_free(&c->gap.written);
    cts_free(&c->distance);
    cts_free(&c->grey);
    cts_free(&c->row);
    cts_free(&c->move);
    cts_free(&c->moves);
    cts_free(&c->bits);
    cts_free(&c->near);
}

static CtsStatus scratch_new(const Shaping *s, Scratch *c, CtsError *err)
{
    const size_t n = n_all_blocks(s), n_bits = (size_t)s->n_blocks[1] * n_row_words(s);
    const size_t n_moves = shape_place(0, (size_t)s->n_blocks[1]) + n;
    CtsStatus st;
    *c = (Scratch){.gap = {.stack = s->stack, .n_blocks = {s->n_blocks[0], s->n_blocks[1]}, .edges = s->edges}};
    if ((st = cts_alloc_array(&c->distance, 2 * N_SURFACES * n + SHAPE_LANES + 1, err)) ||
        (st = cts_alloc_array(&c->grey, 2 * n, err)) ||
        (st = cts_alloc_array(&c->row, 2 * (size_t)s->n_blocks[0] + 2, err)) ||
        (st = cts_alloc_zeroed(&c->move, SHAPE_NUMBERS * n_moves + SHAPE_LANES, err)) ||
        (st = cts_alloc_array(&c->moves, n, err)) || (st = cts_alloc_array(&c->bits, n_bits, err)) ||
        (st = cts_alloc_array(&c->near, n_bits, err)) || (st = blocks_new(&c->gap.moving, n, err)) ||
        (st = blocks_new(&c->gap.written, n, err))) {
        scratch_free(c);
        return st;
    }
    for (int i = 0; i < 2 * N_SURFACES; i++)
        c->field[i / N_SURFACES].distance[i % N_SURFACES] = c->distance + (size_t)i * n;
    for (int i = 0; i < 2; i++)
        c->field[i].grey = c->grey + (size_t)i * n;
    for (int i = 0; i < SHAPE_NUMBERS; i++)
        c->gap.move[i] = c->move + (size_t)i * n_moves;
    return CTS_OK;
}

INLINE int least(int a, int b)
{
    return a < b ? a : b;
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

/* Half of the middle one, a quarter of either of the others. */
INLINE void smooth_row(const uint16_t *before, const uint16_t *own, const uint16_t *behind, int n,
                       uint16_t *restrict to)
{
    for (int i = 0; i < n; i++)
        to[i] = (uint16_t)((before[i] + 2U * own[i] + behind[i] + 2) / 4);
}

/* Means of blocks, with a quarter of the adjacent pixels along rows and columns: smoothing suppresses noise. */
INLINE void read_blocks(const Shaping *s, const uint16_t *slice, uint16_t *rows, uint16_t *grey)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    for (int j = 0; j < ny; j++) {
        uint16_t *const bins = rows + 1; /* with its ends once more */
        bin_row(s->stack, slice, j, nx, bins);
        rows[0] = bins[0];
        bins[nx] = bins[nx - 1];
        smooth_row(rows, bins, bins + 1, nx, grey + (size_t)j * (size_t)nx);
    }
    uint16_t *above = rows, *own = rows + nx;
    memcpy(above, grey, (size_t)nx * sizeof *above);
    for (int j = 0; j < ny; j++) {
        uint16_t *const row = grey + (size_t)j * (size_t)nx;
        const uint16_t *const below = j + 1 < ny ? row + nx : row;
        memcpy(own, row, (size_t)nx * sizeof *own);
        smooth_row(above, own, below == row ? own : below, nx, row);
        uint16_t *const t = above;
        above = own;
        own = t;
    }
}

/* Distance from a block's centre to where the grey level passes the surface's towards a neighbour; FAR where it does
 * not. */
INLINE int to_crossing(uint16_t own, uint16_t other, uint16_t level)
{
    if ((own >= level) == (other >= level))
        return FAR;
    return (int)(SIDE * (own - (level - 0.5F)) / ((float)own - other) + 0.5F);
}

INLINE int16_t begin_distance(const uint16_t *at, const uint16_t *above, const uint16_t *below, int to_left,
                              int to_right, uint16_t level)
{
    return (int16_t)least(least(to_crossing(*at, at[to_left], level), to_crossing(*at, at[to_right], level)),
                          least(to_crossing(*at, *above, level), to_crossing(*at, *below, level)));
}

/* Blocks i to i + n - 1 of a row, neither the first nor the last one: FAR where a block is on the same side of the
 * level as all its neighbours, as most are, else 0. Returns whether any is 0. */
INLINE bool mark_crossings(const uint16_t *row, const uint16_t *above, const uint16_t *below, int i, int n,
                           uint16_t level, int16_t *restrict d)
{
    int16_t any = 0;
    for (const int end = i + n; i < end; i++) {
        const bool in = row[i] >= level;
        const bool alike = (in == (row[i - 1] >= level)) & (in == (row[i + 1] >= level)) & (in == (above[i] >= level)) &
                           (in == (below[i] >= level));
        d[i] = alike ? FAR : 0;
        any |= alike ? 0 : 1;
    }
    return any;
}

INLINE void begin_distances(const Shaping *s, const uint16_t *grey, uint16_t level, int16_t *d)
{
    enum { CHUNK = 32 };
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    for (int j = 0; j < ny; j++, d += nx) {
        const uint16_t *const row = grey + (size_t)j * (size_t)nx, *const above = j > 0 ? row - nx : row;
        const uint16_t *const below = j + 1 < ny ? row + nx : row;
        for (int first = 1; first + 1 < nx; first += CHUNK) {
            const int n = least(nx - 1 - first, CHUNK);
            if (n == CHUNK ? mark_crossings(row, above, below, first, CHUNK, level, d)
                           : mark_crossings(row, above, below, first, n, level, d))
                for (int i = first; i < first + n; i++)
                    if (!d[i])
                        d[i] = begin_distance(row + i, above + i, below + i, -1, 1, level);
        }
        d[nx - 1] = begin_distance(row + nx - 1, above + nx - 1, below + nx - 1, nx > 1 ? -1 : 0, 0, level);
        d[0] = begin_distance(row, above, below, 0, nx > 1, level);
    }
}

INLINE int16_t nearer(int16_t a, int16_t b)
{
    return a < b ? a : b;
}

/* Distances of a row from those of the row visited before. */
INLINE void reach_row(int16_t *restrict d, const int16_t *restrict known, int n)
{
    for (int i = 1; i + 1 < n; i++)
        d[i] = nearer(nearer(d[i], (int16_t)(known[i] + SIDE)), (int16_t)(nearer(known[i - 1], known[i + 1]) + CORNER));
    for (int i = 0; i<n; i += n> 1 ? n - 1 : 1) {
        d[i] = nearer(d[i], (int16_t)(known[i] + SIDE));
        if (n > 1)
            d[i] = nearer(d[i], (int16_t)(known[i > 0 ? i - 1 : 1] + CORNER));
    }
}

INLINE i16x8 nearest(i16x8 a, i16x8 b)
{
#if defined(__SSE2__)
    return (i16x8)_mm_min_epi16((__m128i)a, (__m128i)b);
#else
    return a + ((b - a) & (i16x8)(b < a));
#endif
}

/* The distances of a row from those to the left: within eight by doubling steps, then from the eight before. The
 * next eight wait for the last of these alone. */
INLINE void reach_right(int16_t *row, int n)
{
    const i16x8 far = (i16x8){0} + (int16_t)FAR, steps = {1, 2, 3, 4, 5, 6, 7, 8};
    int16_t v = FAR;
    int i = 0;
    for (; i + EIGHT <= n; i += EIGHT) {
        i16x8 x;
        memcpy(&x, row + i, sizeof x);
        x = nearest(x, SIDE + __builtin_shufflevector(far, x, 0, 8, 9, 10, 11, 12, 13, 14));
        x = nearest(x, 2 * SIDE + __builtin_shufflevector(far, x, 0, 1, 8, 9, 10, 11, 12, 13));
        x = nearest(x, 4 * SIDE + __builtin_shufflevector(far, x, 0, 1, 2, 3, 8, 9, 10, 11));
        const int16_t last = x[EIGHT - 1];
        x = nearest(x, v + SIDE * steps);
        memcpy(row + i, &x, sizeof x);
        v = nearer(last, (int16_t)(v + EIGHT * SIDE));
    }
    for (; i < n; i++)
        row[i] = v = nearer(row[i], (int16_t)(v + SIDE));
}

/* The same from those to the right. */
INLINE void reach_left(int16_t *row, int n)
{
    const i16x8 far = (i16x8){0} + (int16_t)FAR, steps = {8, 7, 6, 5, 4, 3, 2, 1};
    int16_t v = FAR;
    int i = n;
    for (; i >= EIGHT; i -= EIGHT) {
        i16x8 x;
        memcpy(&x, row + i - EIGHT, sizeof x);
        x = nearest(x, SIDE + __builtin_shufflevector(x, far, 1, 2, 3, 4, 5, 6, 7, 8));
        x = nearest(x, 2 * SIDE + __builtin_shufflevector(x, far, 2, 3, 4, 5, 6, 7, 8, 9));
        x = nearest(x, 4 * SIDE + __builtin_shufflevector(x, far, 4, 5, 6, 7, 8, 9, 10, 11));
        const int16_t last = x[0];
        x = nearest(x, v + SIDE * steps);
        memcpy(row + i - EIGHT, &x, sizeof x);
        v = nearer(last, (int16_t)(v + EIGHT * SIDE));
    }
    while (i-- > 0)
        row[i] = v = nearer(row[i], (int16_t)(v + SIDE));
}

/* One pass over the blocks, row by row: from the previous row, then within the row. */
INLINE void sweep_blocks(const Shaping *s, int16_t *d, int way)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    for (int j = way > 0 ? 0 : ny - 1; j >= 0 && j < ny; j += way) {
        int16_t *const row = d + (size_t)j * (size_t)nx;
        if (j - way >= 0 && j - way < ny)
            reach_row(row, row - way * nx, nx);
        if (way > 0)
            reach_right(row, nx);
        else
            reach_left(row, nx);
    }
}

INLINE void find_distances(const Shaping *s, const uint16_t *grey, uint16_t level, int16_t *d)
{
    begin_distances(s, grey, level, d);
    sweep_blocks(s, d, 1);
    sweep_blocks(s, d, -1);
    for (size_t i = 0; i < n_all_blocks(s); i++)
        d[i] = (int16_t)(grey[i] < level ? -d[i] : d[i]);
}

INLINE void read_any_field(const Shaping *s, int slice, Scratch *c, SliceField *field)
{
    read_blocks(s, s->stack->slices + (size_t)slice * s->stack->slice_step, c->row, field->grey);
    for (int l = 0; l < N_SURFACES; l++)
        find_distances(s, field->grey, s->level[l], field->distance[l]);
}

CTS_CPU_VARIANTS(void, read_field, (const Shaping *s, int slice, Scratch *c, SliceField *field),
                 read_any_field(s, slice, c, field))

/* Flags blocks that are displaced at any position between the slices and that differ by more than noise; displacements
 * of all others are 0. */
INLINE void find_any_moves(const Shaping *s, Scratch *c)
{
    const uint16_t *const a = c->field[0].grey, *const b = c->field[1].grey;
    const int alike = (int)s->alike;
    uint8_t *restrict const moves = c->moves;
    const size_t n = n_all_blocks(s);
    memset(moves, 0, n);
    for (int l = 0; l < N_SURFACES; l++) {
        const int16_t *const d = c->field[0].distance[l], *const e = c->field[1].distance[l];
        for (size_t i = 0; i < n; i++) {
            const int moved = abs(e[i] - d[i]), off = least(abs(d[i]), abs(e[i]));
            moves[i] |= (moved > SHAPE_MOVES_FROM) & (abs(b[i] - a[i]) > alike) &
                        (((d[i] ^ e[i]) < 0) | (off < SHAPE_GOES_WITH * moved + 2 * SIDE));
        }
    }
}

CTS_CPU_VARIANTS(void, find_moves, (const Shaping *s, Scratch *c), find_any_moves(s, c))

/* Flags of a row as bits: of eight bytes at once where any is set. */
static void pack_row(const uint8_t *flags, int n, uint64_t *bits)
{
    memset(bits, 0, ((size_t)n / 64 + 1) * sizeof *bits);
    int i = 0;
    for (; i + EIGHT <= n; i += EIGHT) {
        uint64_t eight;
        memcpy(&eight, flags + i, sizeof eight);
        if (eight)
            for (int k = 0; k < EIGHT; k++)
                bits[i / 64] |= (uint64_t)flags[i + k] << (i + k) % 64;
    }
    for (; i < n; i++)
        bits[i / 64] |= (uint64_t)flags[i] << i % 64;
}

/* Lists the blocks whose bit is set. */
static void list_flagged(const Shaping *s, const uint64_t *bits, ShapeBlocks *list)
{
    const size_t nx = (size_t)s->n_blocks[0], ny = (size_t)s->n_blocks[1], n = n_row_words(s);
    list->n = 0;
    for (size_t j = 0; j < ny; j++)
        for (size_t w = 0; w < n; w++)
            for (uint64_t left = bits[j * n + w]; left; left &= left - 1) {
                list->at[list->n] = (uint32_t)(j * nx + 64 * w + (size_t)__builtin_ctzll(left));
                list->row[list->n++] = (uint32_t)j;
            }
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
    const size_t nx = (size_t)s->n_blocks[0], ny = (size_t)s->n_blocks[1], n = n_row_words(s);
    CTS_CPU_CHOICE(cts_cpu_flags(), find_moves)(s, c);
    for (size_t j = 0; j < ny; j++) {
        pack_row(c->moves + j * nx, (int)nx, c->bits + j * n);
        widen_row(c->bits + j * n, (int)nx, c->near + j * n);
    }
    list_flagged(s, c->bits, &c->gap.moving);
    for (size_t j = 0; j < ny; j++) {
        const uint64_t *const own = c->near + j * n, *const above = j > 0 ? own - n : own;
        const uint64_t *const below = j + 1 < ny ? own + n : own;
        for (size_t w = 0; w < n; w++)
            c->bits[j * n + w] = above[w] | own[w] | below[w];
    }
    list_flagged(s, c->bits, &c->gap.written);
}

/* Clears the displacements of listed blocks and of their neighbours in the row, run by run. */
static void clear_moves(const ShapeGap *g)
{
    const ShapeBlocks *const b = &g->moving;
    for (size_t first = 0, end; first < b->n; first = end) {
        for (end = first + 1; end < b->n && b->at[end] == b->at[end - 1] + 1 && b->row[end] == b->row[first];)
            end++;
        for (int k = 0; k < SHAPE_NUMBERS; k++)
            memset(g->move[k] + shape_place(b->at[first], b->row[first]) - 1, 0, (end - first + 2) * sizeof(float));
    }
}

static double place_of_slice(const CtsShapeStack *t, int slice)
{
    return t->layer ? t->layer[slice] : (double)slice * t->n_parts;
}

static void shape_gap(const Shaping *s, Scratch *c, int gap, ShapeSums *sums)
{
    const CtsShapeStack *const t = s->stack;
    const double from = place_of_slice(t, gap), to = place_of_slice(t, gap + 1);
    const size_t layer = (size_t)t->n_columns * (size_t)t->n_rows;
    const uint16_t *const slice = t->slices + (size_t)gap * t->slice_step;
    list_blocks(s, c);
    for (int i = 0; i < 2 * N_SURFACES; i++)
        c->gap.distance[i / N_SURFACES][i % N_SURFACES] = c->field[i / N_SURFACES].distance[i % N_SURFACES];
    for (int j = (int)floor(from) + 1; j < to && j < t->n_layers; j++) {
        const ShapeLayer made = {
            {slice, slice + t->slice_step}, t->layers + (size_t)j * layer, (float)((j - from) / (to - from))};
        sums->n_voxels += layer;
        s->find(&c->gap, made.part);
        s->write(&c->gap, &made, sums);
    }
    clear_moves(&c->gap);
}

/* Gaps between slices; a field is read once for the two gaps at a slice. */
static void shape_gaps(void *context, int worker, size_t first, size_t end)
{
    Shaping *const s = context;
    Scratch c;
    ShapeSums sums = {0, 0, 0};
    (void)worker;
    const unsigned cpu = cts_cpu_flags();
    if (scratch_new(s, &c, NULL)) {
        atomic_fetch_add(&s->n_failed, 1);
        return;
    }
    CTS_CPU_CHOICE(cpu, read_field)(s, (int)first, &c, &c.field[0]);
    for (size_t gap = first; gap < end; gap++) {
        CTS_CPU_CHOICE(cpu, read_field)(s, (int)gap + 1, &c, &c.field[1]);
        shape_gap(s, &c, (int)gap, &sums);
        const SliceField t = c.field[0];
        c.field[0] = c.field[1];
        c.field[1] = t;
    }
    scratch_free(&c);
    atomic_fetch_add(&s->n_voxels, sums.n_voxels);
    atomic_fetch_add(&s->n_moved, sums.n_moved);
    atomic_fetch_add(&s->sum_of_differences, sums.differences);
}

static uint16_t level_of_hu(const CtsShapeStack *t, double hu)
{
    const double level = ceil((hu - t->hu_offset) / t->hu_step);
    return (uint16_t)(level < 1 ? 1 : level > UINT16_MAX ? UINT16_MAX : level);
}

void cts_shape_interpolate_layers(const CtsShapeStack *stack, int n_threads, CtsInterpolationCounts *made)
{
    const unsigned cpu = cts_cpu_flags();
    Shaping s = {.stack = stack, .n_blocks = {(stack->n_columns + 1) / BLOCK, (stack->n_rows + 1) / BLOCK}};
    if (stack->n_slices < 2 || stack->n_columns < 2 || stack->n_rows < 2)
        return;
    for (int l = 0; l < N_SURFACES; l++)
        s.level[l] = level_of_hu(stack, SURFACE_HU[l]);
    s.alike = (float)(ALIKE_HU / stack->hu_step);
    s.edges = (float)(EDGES_HU / stack->hu_step);
    s.find = cpu & CTS_CPU_AVX512 ? cts_shape_find_moves_avx512
             : cpu & CTS_CPU_AVX2 ? cts_shape_find_moves_avx2
                                  : cts_shape_find_moves_c;
    s.write = cpu & CTS_CPU_AVX512 ? cts_shape_write_layer_avx512
              : cpu & CTS_CPU_AVX2 ? cts_shape_write_layer_avx2
                                   : cts_shape_write_layer_c;
    /* A chunk of gaps reads one more slice than it has gaps. */
    const int threads = cts_threads(n_threads);
    const size_t n_gaps = (size_t)stack->n_slices - 1;
    cts_parallel(threads, n_gaps, threads == 1 ? n_gaps : 0, shape_gaps, &s);
    made->n_voxels += atomic_load(&s.n_voxels);
    made->n_moved += atomic_load(&s.n_moved);
    made->sum_of_differences_hu += (double)atomic_load(&s.sum_of_differences) * stack->hu_step;
    made->no_memory |= atomic_load(&s.n_failed) > 0;
}
