#include "core/volume/shape.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* The surfaces that are followed: of the body and of its air, halfway from air to water, and of bone, above the blood
 * of vessels with contrast agent and below the thinnest cortex. */
static const double SURFACE_HU[] = {-500, 300};
enum { N_SURFACES = sizeof SURFACE_HU / sizeof *SURFACE_HU };

/* Distances are computed on blocks of 2 x 2 pixels, whose means have less noise: a quarter of the work. Unit: a part of
 * a block; a step to the side has 12, a diagonal one 17 (Borgefors 1986). */
enum { BLOCK = 2, SIDE = 12, CORNER = 17, FAR = 16000 };
static const float BLOCK_OF_UNIT = 1.0F / SIDE;

/* A surface that moves by less than its own edge, about a pixel, is blended well; from three times as much on all that
 * there is moves with it. In blocks. */
static const float MOVES_FROM = 0.25F, MOVES_ALL = 0.75F;
/* Factor of the displacement: pixels nearer to the surface are displaced with it, and none passes another, as the
 * transition back to zero is longer than the displacement. */
static const float GOES_WITH = 3;
/* ALIKE_HU: smaller differences between slices are texture and noise, which blending handles well. A displacement is
 * accepted if the values it matches are similar: half as different as without it, or within EDGES_HU, the difference of
 * two edges half a pixel apart. */
static const double ALIKE_HU = 100, EDGES_HU = 300;

#define INLINE __attribute__((always_inline)) static inline

/* One slice as blocks: grey levels, then for each surface how far it lies off, positive inside. */
typedef struct Field {
    uint16_t *grey;
    int16_t *distance[N_SURFACES];
} Field;

typedef struct Shaping {
    const CtsShapeStack *stack;
    int n_blocks[2];
    uint16_t level[N_SURFACES];
    float alike, edges; /* grey levels */
    atomic_ullong n_voxels, n_moved, sum_of_differences;
    atomic_int n_failed;
} Shaping;

/* Two pixels side by side. */
typedef uint32_t __attribute__((aligned(2), may_alias)) Pair;
/* Distances side by side. */
enum { EIGHT = 8 };

/* Displacement of a block's grey levels, in pixels: x and y in the slice before, x and y in the slice behind; and its
 * weight. Each number has an array of its own, each row padded with its first and last value. */
enum { MOVE_NUMBERS = 5, SHARE = 4 };
/* Pixels computed together: reading a row's displacements extends beyond its last block by as many. */
enum { VECTOR = 8 };

/* Displacements of blocks computed together; entries beyond n are unused. */
enum { BATCH = 32 };
typedef struct Direction {
    float x[BATCH], y[BATCH];
} Direction;
typedef struct Batch {
    int n, i[BATCH], j[BATCH];
    int32_t known[BATCH];                                /* a surface is near in both slices */
    float before[BATCH], difference[BATCH], rest[BATCH]; /* of a surface, in blocks; part without displacement so far */
    Direction direction[2];
    float move[MOVE_NUMBERS][BATCH];
} Batch;

/* Scratch memory of one thread. */
typedef struct Scratch {
    Field field[2];
    uint16_t *grey, *row;       /* of both fields; two rows of blocks, and two blocks */
    uint8_t *moves, *near;      /* for one gap: blocks that move, and those that do or whose neighbours in the row do */
    uint32_t *moving, *written; /* blocks with displacements, and blocks whose pixels are written */
    size_t n_moving, n_written;
    float *move[MOVE_NUMBERS], *moves_store;
    int16_t *store;
} Scratch;

static size_t n_all_blocks(const Shaping *s)
{
    return (size_t)s->n_blocks[0] * (size_t)s->n_blocks[1];
}

static size_t place_of_move(const Shaping *s, int i, int j)
{
    return (size_t)j * (size_t)(s->n_blocks[0] + 2) + (size_t)(i + 1);
}

static void scratch_free(Scratch *c)
{
    cts_free(&c->store);
    cts_free(&c->grey);
    cts_free(&c->row);
    cts_free(&c->moves_store);
    cts_free(&c->moves);
    cts_free(&c->near);
    cts_free(&c->moving);
    cts_free(&c->written);
}

static CtsStatus scratch_new(const Shaping *s, Scratch *c, CtsError *err)
{
    const size_t n = n_all_blocks(s), n_moves = place_of_move(s, -1, s->n_blocks[1]);
    CtsStatus st;
    *c = (Scratch){.grey = NULL};
    if ((st = cts_alloc_array(&c->store, 2 * N_SURFACES * n, err)) || (st = cts_alloc_array(&c->grey, 2 * n, err)) ||
        (st = cts_alloc_array(&c->row, 2 * (size_t)s->n_blocks[0] + 2, err)) ||
        (st = cts_alloc_zeroed(&c->moves_store, MOVE_NUMBERS * n_moves + VECTOR / BLOCK, err)) ||
        (st = cts_alloc_array(&c->moves, n, err)) || (st = cts_alloc_array(&c->near, n, err)) ||
        (st = cts_alloc_array(&c->moving, n, err)) || (st = cts_alloc_array(&c->written, n, err))) {
        scratch_free(c);
        return st;
    }
    for (int i = 0; i < 2 * N_SURFACES; i++)
        c->field[i / N_SURFACES].distance[i % N_SURFACES] = c->store + (size_t)i * n;
    for (int i = 0; i < 2; i++)
        c->field[i].grey = c->grey + (size_t)i * n;
    for (int i = 0; i < MOVE_NUMBERS; i++)
        c->move[i] = c->moves_store + (size_t)i * n_moves;
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

INLINE void begin_distances(const Shaping *s, const uint16_t *grey, uint16_t level, int16_t *d)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    for (int j = 0; j < ny; j++, d += nx) {
        const uint16_t *const row = grey + (size_t)j * (size_t)nx, *const above = j > 0 ? row - nx : row;
        const uint16_t *const below = j + 1 < ny ? row + nx : row;
        /* Most blocks are on the same side as all their neighbours. */
        for (int i = 1; i + 1 < nx; i++) {
            const bool in = row[i] >= level;
            const bool alike = (in == (row[i - 1] >= level)) & (in == (row[i + 1] >= level)) &
                               (in == (above[i] >= level)) & (in == (below[i] >= level));
            d[i] = alike ? FAR : 0;
        }
        for (int i = 1; i + 1 < nx; i++) {
            static const int16_t far[] = {FAR, FAR, FAR, FAR};
            if (i + 4 < nx && !memcmp(d + i, far, sizeof far))
                i += 3;
            else if (!d[i])
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
    return a + ((b - a) & (i16x8)(b < a));
}

/* The distances of a row from those to the left: within eight by doubling steps, then from the eight before. */
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
        x = nearest(x, v + SIDE * steps);
        memcpy(row + i, &x, sizeof x);
        v = x[EIGHT - 1];
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
        x = nearest(x, v + SIDE * steps);
        memcpy(row + i - EIGHT, &x, sizeof x);
        v = x[0];
    }
    while (i-- > 0)
        row[i] = v = nearer(row[i], (int16_t)(v + SIDE));
}

/* One pass over the blocks, row by row: from the previous row, then within the row. */
INLINE void sweep(const Shaping *s, int16_t *d, int way)
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
    sweep(s, d, 1);
    sweep(s, d, -1);
    for (size_t i = 0; i < n_all_blocks(s); i++)
        d[i] = (int16_t)(grey[i] < level ? -d[i] : d[i]);
}

INLINE void read_any_field(const Shaping *s, int slice, Scratch *c, Field *field)
{
    read_blocks(s, s->stack->slices + (size_t)slice * s->stack->slice_step, c->row, field->grey);
    for (int l = 0; l < N_SURFACES; l++)
        find_distances(s, field->grey, s->level[l], field->distance[l]);
}

static void read_field(const Shaping *s, int slice, Scratch *c, Field *field)
{
    read_any_field(s, slice, c, field);
}

CTS_TARGET_AVX2 static void read_field_avx2(const Shaping *s, int slice, Scratch *c, Field *field)
{
    read_any_field(s, slice, c, field);
}

INLINE float within(float x, float low, float high)
{
    return x < low ? low : x > high ? high : x;
}

/* The gradient direction of a distance map, and its length. */
INLINE void read_direction(const Shaping *s, const int16_t *d, int i, int j, Direction *to, int n)
{
    const int nx = s->n_blocks[0];
    const int16_t *const at = d + (size_t)j * (size_t)nx + i;
    to->x[n] = (float)(at[i + 1 < nx] - at[i > 0 ? -1 : 0]);
    to->y[n] = (float)(at[j + 1 < s->n_blocks[1] ? nx : 0] - at[j > 0 ? -nx : 0]);
}

/* Adds a displacement of so many blocks along a direction to x and y. Midway between two surfaces there is no
 * direction. */
INLINE void go(const Direction *d, int n, float blocks, float *x, float *y)
{
    const float length = sqrtf(d->x[n] * d->x[n] + d->y[n] * d->y[n]);
    const bool leads = length > SIDE / 2;
    *x += leads ? BLOCK * blocks * d->x[n] / length : 0;
    *y += leads ? BLOCK * blocks * d->y[n] / length : 0;
}

/* Displacements of these blocks at `way` (0..1) from one slice to the other: by the body's surface first, then by
 * bone's where that gives none. */
INLINE void find_any_batch(const Shaping *s, const Scratch *c, const uint32_t *blocks, float way, Batch *m)
{
    const uint32_t nx = (uint32_t)s->n_blocks[0];
    for (int n = 0; n < m->n; n++) {
        m->i[n] = (int)(blocks[n] % nx);
        m->j[n] = (int)(blocks[n] / nx);
    }
    memset(m->move, 0, sizeof m->move);
    for (int n = 0; n < BATCH; n++)
        m->rest[n] = 1;
    for (int l = 0; l < N_SURFACES; l++) {
        const int16_t *const before = c->field[0].distance[l], *const behind = c->field[1].distance[l];
        for (int n = 0; n < m->n; n++) {
            const int d = before[blocks[n]], e = behind[blocks[n]];
            m->known[n] = abs(d) < FAR / 2 && abs(e) < FAR / 2;
            m->before[n] = (float)d * BLOCK_OF_UNIT;
            m->difference[n] = (float)(e - d) * BLOCK_OF_UNIT;
            read_direction(s, before, m->i[n], m->j[n], &m->direction[0], n);
            read_direction(s, behind, m->i[n], m->j[n], &m->direction[1], n);
        }
        for (int n = 0; n < BATCH; n++) {
            const float difference = m->difference[n], moved = fabsf(difference);
            const float off = fabsf(m->before[n] + way * difference);
            const float with = m->rest[n] * within(1 - (off - 1) / (GOES_WITH * moved + 1), 0, 1);
            const float goes = m->known[n] ? with : 0;
            const float share = goes * within((moved - MOVES_FROM) / (MOVES_ALL - MOVES_FROM), 0, 1);
            go(&m->direction[0], n, share * way * difference, &m->move[0][n], &m->move[1][n]);
            go(&m->direction[1], n, -share * (1 - way) * difference, &m->move[2][n], &m->move[3][n]);
            m->move[SHARE][n] += share;
            m->rest[n] -= goes;
        }
    }
    for (int n = 0; n < BATCH; n++)
        m->move[SHARE][n] = within(4 * m->move[SHARE][n], 0, 1);
}

static void find_batch(const Shaping *s, const Scratch *c, const uint32_t *blocks, float way, Batch *m)
{
    find_any_batch(s, c, blocks, way, m);
}

CTS_TARGET_AVX2 static void find_batch_avx2(const Shaping *s, const Scratch *c, const uint32_t *blocks, float way,
                                            Batch *m)
{
    find_any_batch(s, c, blocks, way, m);
}

/* Lists blocks that are displaced at any position between the slices, where find_batch() leaves the others unchanged,
 * and that differ by more than noise. */
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
            moves[i] |= (moved > (int)(SIDE * MOVES_FROM)) & (abs(b[i] - a[i]) > alike) &
                        (((d[i] ^ e[i]) < 0) | (off < (int)GOES_WITH * moved + 2 * SIDE));
        }
    }
}

static void find_moves(const Shaping *s, Scratch *c)
{
    find_any_moves(s, c);
}

CTS_TARGET_AVX2 static void find_moves_avx2(const Shaping *s, Scratch *c)
{
    find_any_moves(s, c);
}

/* Adds the numbers of the blocks that are flagged to a list. */
static size_t list_flagged(const uint8_t *flags, size_t n, size_t first, uint32_t *list)
{
    size_t found = 0;
    for (size_t i = 0; i < n; i++) {
        uint64_t eight = 0;
        if (i + sizeof eight <= n && memcpy(&eight, flags + i, sizeof eight) && !eight)
            i += sizeof eight - 1;
        else if (flags[i])
            list[found++] = (uint32_t)(first + i);
    }
    return found;
}

/* Lists the blocks processed in every layer of a gap: most blocks are not displaced, or similar. Displacements of
 * adjacent blocks affect a pixel, too. */
static void list_blocks(const Shaping *s, Scratch *c)
{
    const size_t nx = (size_t)s->n_blocks[0], ny = (size_t)s->n_blocks[1], n = n_all_blocks(s);
    (cts_cpu_flags() & CTS_CPU_AVX2 ? find_moves_avx2 : find_moves)(s, c);
    c->n_moving = list_flagged(c->moves, n, 0, c->moving);
    for (size_t j = 0; j < ny; j++) {
        const uint8_t *const own = c->moves + j * nx;
        uint8_t *const near = c->near + j * nx;
        memcpy(near, own, nx);
        for (size_t i = 1; i < nx; i++)
            near[i] |= own[i - 1];
        for (size_t i = 0; i + 1 < nx; i++)
            near[i] |= own[i + 1];
    }
    c->n_written = 0;
    for (size_t j = 0; j < ny; j++) {
        const uint8_t *const own = c->near + j * nx, *const above = j > 0 ? own - nx : own;
        const uint8_t *const below = j + 1 < ny ? own + nx : own;
        uint8_t *const written = c->moves + j * nx; /* moves are listed */
        for (size_t i = 0; i < nx; i++)
            written[i] = above[i] | own[i] | below[i];
    }
    c->n_written = list_flagged(c->moves, n, 0, c->written);
}

typedef struct Sums {
    uint64_t n_voxels, n_moved, differences;
} Sums;

/* A layer to be made, at `way` (0..1) between two slices. */
typedef struct Layer {
    const uint16_t *slices[2];
    uint16_t *grey; /* blended, before anything moves */
    float way;
} Layer;

/* A run of pixels from the listed blocks of a row; computed in whole vectors, whose entries beyond n are unused. */
enum { RUN_BLOCKS = 32, RUN = BLOCK * RUN_BLOCKS };
typedef struct Run {
    int x, y, n, n_whole;
    float move[MOVE_NUMBERS][RUN], grey[2][RUN];
    uint16_t before[RUN], behind[RUN], blended[RUN];
    int32_t level[RUN], difference[RUN];
} Run;

/* A pixel's move from those of the four blocks around it: it lies a quarter of a block from the nearest. */
INLINE void between_blocks(const float *near, const float *far, int n, float *restrict to)
{
    for (int i = 0; i < n; i++) {
        to[2 * i] = 9.0F / 16 * near[i] + 3.0F / 16 * near[i - 1] + 3.0F / 16 * far[i] + 1.0F / 16 * far[i - 1];
        to[2 * i + 1] = 9.0F / 16 * near[i] + 3.0F / 16 * near[i + 1] + 3.0F / 16 * far[i] + 1.0F / 16 * far[i + 1];
    }
}

INLINE float clamped(float x, float high)
{
    return x < 0 ? 0 : x > high ? high : x;
}

INLINE float of_pair(uint32_t pair, int n)
{
    return (float)(int32_t)(pair >> 16 * (n ^ (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__)) & 0xffff);
}

/* Grey levels of a slice at the displaced positions of a run: bilinear between four pixels. */
INLINE void find_grey(const CtsShapeStack *t, const uint16_t *slice, const Run *r, const float *dx, const float *dy,
                      float *restrict grey)
{
    const int last_x = t->n_columns - 1, last_y = t->n_rows - 1;
    const uint16_t *const row = slice + (size_t)r->y * (size_t)t->n_columns;
    float u[RUN], v[RUN];
    int32_t at[RUN];
    for (int i = 0; i < r->n_whole; i++) {
        const float x = clamped((float)(r->x + i) + dx[i], (float)last_x),
                    y = clamped((float)r->y + dy[i], (float)last_y);
        /* The last pixel is the end of the last cell. */
        const int32_t cx = (int32_t)x - ((int32_t)x == last_x), cy = (int32_t)y - ((int32_t)y == last_y);
        u[i] = x - (float)cx;
        v[i] = y - (float)cy;
        at[i] = (cy - r->y) * t->n_columns + cx;
    }
    for (int i = 0; i < r->n_whole; i++) {
        const uint32_t above = *(const Pair *)(row + at[i]), below = *(const Pair *)(row + at[i] + t->n_columns);
        const float a = of_pair(above, 0), b = of_pair(above, 1), d = of_pair(below, 0), e = of_pair(below, 1);
        const float ab = a + u[i] * (b - a), de = d + u[i] * (e - d);
        grey[i] = ab + v[i] * (de - ab);
    }
}

INLINE void write_run(const Shaping *s, const Layer *l, Run *r, Sums *sums)
{
    const CtsShapeStack *const t = s->stack;
    const size_t at = (size_t)r->y * (size_t)t->n_columns + (size_t)r->x;
    const size_t n_bytes = (size_t)r->n * sizeof *l->grey;
    uint16_t *restrict const to = l->grey + at;
    const float way = l->way, edges = s->edges;
    uint32_t n_moved = 0, differences = 0;
    memcpy(r->before, l->slices[0] + at, n_bytes);
    memcpy(r->behind, l->slices[1] + at, n_bytes);
    memcpy(r->blended, to, n_bytes);
    find_grey(t, l->slices[0], r, r->move[0], r->move[1], r->grey[0]);
    find_grey(t, l->slices[1], r, r->move[2], r->move[3], r->grey[1]);
    for (int i = 0; i < r->n_whole; i++) {
        const float a = r->grey[0][i], b = r->grey[1][i], own = (float)r->before[i], other = (float)r->behind[i];
        const float straight = own + way * (other - own), half = fabsf(other - own) / 2, blended = (float)r->blended[i];
        const float alike = clamped(2 - fabsf(b - a) / (half > edges ? half : edges), 1);
        const float made = blended + r->move[SHARE][i] * alike * (a + way * (b - a) - blended);
        r->level[i] = (int32_t)(made + 0.5F);
        r->difference[i] = (int32_t)(fabsf((float)r->level[i] - straight) + 0.5F);
    }
    for (int i = 0; i < r->n; i++) {
        const int32_t moved = r->level[i] != r->blended[i];
        n_moved += (uint32_t)moved;
        differences += (uint32_t)(moved * r->difference[i]);
        to[i] = (uint16_t)r->level[i];
    }
    sums->n_moved += n_moved;
    sums->differences += differences;
}

INLINE void write_blocks(const Shaping *s, const Scratch *c, const Layer *l, int i, int j, int n, Run *r, Sums *sums)
{
    const CtsShapeStack *const t = s->stack;
    for (int v = 0; v < least(BLOCK, t->n_rows - BLOCK * j); v++) {
        r->x = BLOCK * i;
        r->y = BLOCK * j + v;
        r->n = least(BLOCK * n, t->n_columns - r->x);
        r->n_whole = (r->n + VECTOR - 1) / VECTOR * VECTOR;
        const int beside = j + 2 * v - 1, far_j = beside < 0 || beside >= s->n_blocks[1] ? j : beside;
        const size_t near = place_of_move(s, i, j), far = place_of_move(s, i, far_j);
        for (int k = 0; k < MOVE_NUMBERS; k++)
            between_blocks(c->move[k] + near, c->move[k] + far, r->n_whole / BLOCK, r->move[k]);
        write_run(s, l, r, sums);
    }
}

INLINE void write_layer(const Shaping *s, const Scratch *c, const Layer *l, Sums *sums)
{
    const uint32_t nx = (uint32_t)s->n_blocks[0];
    Run r = {.n = 0};
    size_t n;
    for (size_t k = 0; k < c->n_written; k += n) {
        const uint32_t first = c->written[k], i = first % nx;
        for (n = 1; n < RUN_BLOCKS && k + n < c->n_written && i + n < nx && c->written[k + n] == first + n;)
            n++;
        write_blocks(s, c, l, (int)i, (int)(first / nx), (int)n, &r, sums);
    }
}

CTS_TARGET_AVX2 static void write_layer_avx2(const Shaping *s, const Scratch *c, const Layer *l, Sums *sums)
{
    write_layer(s, c, l, sums);
}

static void set_move(const Shaping *s, const Scratch *c, int i, int j, int number, float value)
{
    float *const move = c->move[number] + place_of_move(s, i, j);
    move[0] = value;
    if (i == 0)
        move[-1] = value;
    if (i + 1 == s->n_blocks[0])
        move[1] = value;
}

/* The moves of all that is listed, for one layer. */
static void set_moves(const Shaping *s, const Scratch *c, float way)
{
    Batch m = {.n = 0};
    for (size_t first = 0; first < c->n_moving; first += (size_t)m.n) {
        const size_t rest = c->n_moving - first;
        m.n = rest < BATCH ? (int)rest : BATCH;
        (cts_cpu_flags() & CTS_CPU_AVX2 ? find_batch_avx2 : find_batch)(s, c, c->moving + first, way, &m);
        for (int k = 0; k < MOVE_NUMBERS; k++)
            for (int n = 0; n < m.n; n++)
                set_move(s, c, m.i[n], m.j[n], k, m.move[k][n]);
    }
}

static void forget_moves(const Shaping *s, const Scratch *c)
{
    const uint32_t nx = (uint32_t)s->n_blocks[0];
    for (size_t n = 0; n < c->n_moving; n++)
        for (int k = 0; k < MOVE_NUMBERS; k++)
            set_move(s, c, (int)(c->moving[n] % nx), (int)(c->moving[n] / nx), k, 0);
}

static double place_of(const CtsShapeStack *t, int slice)
{
    return t->layer ? t->layer[slice] : (double)slice * t->n_parts;
}

static void shape_gap(const Shaping *s, Scratch *c, int gap, Sums *sums)
{
    const CtsShapeStack *const t = s->stack;
    const double from = place_of(t, gap), to = place_of(t, gap + 1);
    const size_t layer = (size_t)t->n_columns * (size_t)t->n_rows;
    const uint16_t *const slice = t->slices + (size_t)gap * t->slice_step;
    list_blocks(s, c);
    for (int j = (int)floor(from) + 1; j < to && j < t->n_layers; j++) {
        const Layer made = {
            {slice, slice + t->slice_step}, t->layers + (size_t)j * layer, (float)((j - from) / (to - from))};
        sums->n_voxels += layer;
        set_moves(s, c, made.way);
        (cts_cpu_flags() & CTS_CPU_AVX2 ? write_layer_avx2 : write_layer)(s, c, &made, sums);
    }
    forget_moves(s, c);
}

/* Gaps between slices; a field is read once for the two gaps at a slice. */
static void shape_gaps(void *context, int worker, size_t first, size_t end)
{
    Shaping *const s = context;
    Scratch c;
    Sums sums = {0, 0, 0};
    (void)worker;
    const bool has_avx2 = cts_cpu_flags() & CTS_CPU_AVX2;
    if (scratch_new(s, &c, NULL)) {
        atomic_fetch_add(&s->n_failed, 1);
        return;
    }
    (has_avx2 ? read_field_avx2 : read_field)(s, (int)first, &c, &c.field[0]);
    for (size_t gap = first; gap < end; gap++) {
        (has_avx2 ? read_field_avx2 : read_field)(s, (int)gap + 1, &c, &c.field[1]);
        shape_gap(s, &c, (int)gap, &sums);
        const Field t = c.field[0];
        c.field[0] = c.field[1];
        c.field[1] = t;
    }
    scratch_free(&c);
    atomic_fetch_add(&s->n_voxels, sums.n_voxels);
    atomic_fetch_add(&s->n_moved, sums.n_moved);
    atomic_fetch_add(&s->sum_of_differences, sums.differences);
}

static uint16_t level_of(const CtsShapeStack *t, double hu)
{
    const double level = ceil((hu - t->hu_offset) / t->hu_step);
    return (uint16_t)(level < 1 ? 1 : level > UINT16_MAX ? UINT16_MAX : level);
}

void cts_shape_layers(const CtsShapeStack *stack, int n_threads, CtsMadeUp *made)
{
    Shaping s = {.stack = stack, .n_blocks = {(stack->n_columns + 1) / BLOCK, (stack->n_rows + 1) / BLOCK}};
    if (stack->n_slices < 2 || stack->n_columns < 2 || stack->n_rows < 2)
        return;
    for (int l = 0; l < N_SURFACES; l++)
        s.level[l] = level_of(stack, SURFACE_HU[l]);
    s.alike = (float)(ALIKE_HU / stack->hu_step);
    s.edges = (float)(EDGES_HU / stack->hu_step);
    cts_parallel(cts_threads(n_threads), (size_t)stack->n_slices - 1, 0, shape_gaps, &s);
    made->n_voxels += atomic_load(&s.n_voxels);
    made->n_moved += atomic_load(&s.n_moved);
    made->sum_of_differences_hu += (double)atomic_load(&s.sum_of_differences) * stack->hu_step;
    made->no_memory |= atomic_load(&s.n_failed) > 0;
}
