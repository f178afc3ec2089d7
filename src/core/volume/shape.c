#include "core/volume/shape.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* The surfaces that are followed: of the body and of its air, halfway from air to water, and of bone, above the blood
 * of vessels with contrast agent and below the thinnest cortex. */
static const double SURFACE_HU[] = {-500, 300};
enum { N_SURFACES = sizeof SURFACE_HU / sizeof *SURFACE_HU };

/* Distances are found among blocks of 2 x 2 pixels, whose means have less noise: a quarter of the work. They are
 * counted in parts of a block; a way to the side has 12, one to a corner 17 (Borgefors 1986). */
enum { BLOCK = 2, SIDE = 12, CORNER = 17, FAR = 16000 };
static const float BLOCK_OF_UNIT = 1.0F / SIDE;

/* A surface that moves by less than its own edge, about a pixel, is blended well; from three times as much on all that
 * there is moves with it. In blocks. */
static const float MOVES_FROM = 0.25F, MOVES_ALL = 0.75F;
/* What is this far from the surface, in terms of how far it moves, stays where it is: nearer things move with it, and
 * none passes another, as the way back to rest is longer than the move. */
static const float GOES_WITH = 3;
/* What differs by less from slice to slice is texture and noise, which blending does well. A move is believed as far as
 * what it brings together is alike: half as different as what lies there, or no more than two edges half a pixel off
 * each other are. */
static const double ALIKE_HU = 100, EDGES_HU = 300;

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

typedef float Four __attribute__((vector_size(16)));
typedef int32_t FourInts __attribute__((vector_size(16)));

/* Where a block's grey levels come from, in pixels from there: x and y in the slice before, x and y in the one behind;
 * and how much of it does. */
typedef struct Move {
    Four from;
    float share;
} Move;

/* What one thread works with. */
typedef struct Scratch {
    Field field[2];
    uint16_t *grey, *row;       /* of both fields; two rows of blocks */
    uint8_t *moves, *near;      /* for one gap: blocks that move, and those that do or whose neighbours in the row do */
    uint32_t *moving, *written; /* blocks whose moves are wanted, and those whose pixels may be made */
    size_t n_moving, n_written;
    Move *move;
    int16_t *store;
} Scratch;

static size_t n_all_blocks(const Shaping *s)
{
    return (size_t)s->n_blocks[0] * (size_t)s->n_blocks[1];
}

static void scratch_free(Scratch *c)
{
    cts_free(&c->store);
    cts_free(&c->grey);
    cts_free(&c->row);
    cts_free(&c->move);
    cts_free(&c->moves);
    cts_free(&c->near);
    cts_free(&c->moving);
    cts_free(&c->written);
}

static CtsStatus scratch_new(const Shaping *s, Scratch *c, CtsError *err)
{
    const size_t n = n_all_blocks(s);
    CtsStatus st;
    *c = (Scratch){.grey = NULL};
    if ((st = cts_alloc_array(&c->store, 2 * N_SURFACES * n, err)) || (st = cts_alloc_array(&c->grey, 2 * n, err)) ||
        (st = cts_alloc_array(&c->row, 2 * (size_t)s->n_blocks[0], err)) || (st = cts_alloc_zeroed(&c->move, n, err)) ||
        (st = cts_alloc_array(&c->moves, n, err)) || (st = cts_alloc_array(&c->near, n, err)) ||
        (st = cts_alloc_array(&c->moving, n, err)) || (st = cts_alloc_array(&c->written, n, err))) {
        scratch_free(c);
        return st;
    }
    for (int i = 0; i < 2 * N_SURFACES; i++)
        c->field[i / N_SURFACES].distance[i % N_SURFACES] = c->store + (size_t)i * n;
    for (int i = 0; i < 2; i++)
        c->field[i].grey = c->grey + (size_t)i * n;
    return CTS_OK;
}

static int least(int a, int b)
{
    return a < b ? a : b;
}

/* Means of 2 x 2 pixels. */
static void bin_row(const CtsShapeStack *t, const uint16_t *slice, int block_row, int n, uint16_t *to)
{
    const uint16_t *const a = slice + (size_t)(BLOCK * block_row) * (size_t)t->n_columns;
    const uint16_t *const b = BLOCK * block_row + 1 < t->n_rows ? a + t->n_columns : a;
    for (int i = 0; i < n; i++) {
        const int x = BLOCK * i, next = least(x + 1, t->n_columns - 1);
        to[i] = (uint16_t)(((uint32_t)a[x] + a[next] + b[x] + b[next] + 2) / 4);
    }
}

/* Blocks, each with a quarter of what lies on either side of it, along rows and across: noise has no shape. */
static void read_blocks(const Shaping *s, const uint16_t *slice, uint16_t *rows, uint16_t *grey)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    for (int j = 0; j < ny; j++) {
        uint16_t *const to = grey + (size_t)j * (size_t)nx;
        bin_row(s->stack, slice, j, nx, rows);
        for (int i = 0; i < nx; i++)
            to[i] = (uint16_t)((rows[i > 0 ? i - 1 : 0] + 2U * rows[i] + rows[least(i + 1, nx - 1)] + 2) / 4);
    }
    uint16_t *above = rows, *own = rows + nx;
    memcpy(above, grey, (size_t)nx * sizeof *above);
    for (int j = 0; j < ny; j++) {
        uint16_t *const row = grey + (size_t)j * (size_t)nx;
        const uint16_t *const below = j + 1 < ny ? row + nx : row;
        memcpy(own, row, (size_t)nx * sizeof *own);
        for (int i = 0; i < nx; i++)
            row[i] = (uint16_t)((above[i] + 2U * own[i] + below[i] + 2) / 4);
        uint16_t *const t = above;
        above = own;
        own = t;
    }
}

/* From a block to where the grey level passes the surface's on the way to a neighbour; FAR where it does not. */
static int to_crossing(uint16_t own, uint16_t other, uint16_t level)
{
    if ((own >= level) == (other >= level))
        return FAR;
    return (int)(SIDE * (own - (level - 0.5F)) / ((float)own - other) + 0.5F);
}

static int16_t begin_distance(const uint16_t *at, const uint16_t *above, const uint16_t *below, int to_left,
                              int to_right, uint16_t level)
{
    return (int16_t)least(least(to_crossing(*at, at[to_left], level), to_crossing(*at, at[to_right], level)),
                          least(to_crossing(*at, *above, level), to_crossing(*at, *below, level)));
}

static void begin_distances(const Shaping *s, const uint16_t *grey, uint16_t level, int16_t *d)
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
        for (int i = 1; i + 1 < nx; i++)
            if (!d[i])
                d[i] = begin_distance(row + i, above + i, below + i, -1, 1, level);
        d[nx - 1] = begin_distance(row + nx - 1, above + nx - 1, below + nx - 1, nx > 1 ? -1 : 0, 0, level);
        d[0] = begin_distance(row, above, below, 0, nx > 1, level);
    }
}

static int16_t nearer(int16_t a, int16_t b)
{
    return a < b ? a : b;
}

/* The distances of a row from those of the row that was gone over before. */
static void reach_row(int16_t *restrict d, const int16_t *restrict known, int n)
{
    for (int i = 0; i < n; i++)
        d[i] = nearer(d[i], (int16_t)(known[i] + SIDE));
    for (int i = 1; i < n; i++)
        d[i] = nearer(d[i], (int16_t)(known[i - 1] + CORNER));
    for (int i = 0; i + 1 < n; i++)
        d[i] = nearer(d[i], (int16_t)(known[i + 1] + CORNER));
}

/* One way over the blocks, row by row: from the row before, and from what is known of the own one. */
static void sweep(const Shaping *s, int16_t *d, int way)
{
    const int nx = s->n_blocks[0], ny = s->n_blocks[1];
    for (int j = way > 0 ? 0 : ny - 1; j >= 0 && j < ny; j += way) {
        int16_t *const row = d + (size_t)j * (size_t)nx;
        if (j - way >= 0 && j - way < ny)
            reach_row(row, row - way * nx, nx);
        int16_t v = FAR;
        for (int i = way > 0 ? 0 : nx - 1; i >= 0 && i < nx; i += way)
            row[i] = v = nearer(row[i], (int16_t)(v + SIDE));
    }
}

static void find_distances(const Shaping *s, const uint16_t *grey, uint16_t level, int16_t *d)
{
    begin_distances(s, grey, level, d);
    sweep(s, d, 1);
    sweep(s, d, -1);
    for (size_t i = 0; i < n_all_blocks(s); i++)
        d[i] = (int16_t)(grey[i] < level ? -d[i] : d[i]);
}

static void read_field(const Shaping *s, int slice, Scratch *c, Field *field)
{
    const size_t n = (size_t)s->stack->n_columns * (size_t)s->stack->n_rows;
    read_blocks(s, s->stack->slices + (size_t)slice * n, c->row, field->grey);
    for (int l = 0; l < N_SURFACES; l++)
        find_distances(s, field->grey, s->level[l], field->distance[l]);
}

/* A way of so many blocks along the direction in which a distance rises is added to from[x] and from[x + 1]. */
static void go(const Shaping *s, const int16_t *d, int i, int j, float blocks, Four *from, int x_axis)
{
    const int nx = s->n_blocks[0];
    const int16_t *const at = d + (size_t)j * (size_t)nx + i;
    const float x = (float)(at[i + 1 < nx] - at[i > 0 ? -1 : 0]);
    const float y = (float)(at[j + 1 < s->n_blocks[1] ? nx : 0] - at[j > 0 ? -nx : 0]);
    const float length = sqrtf(x * x + y * y);
    /* Midway between two surfaces there is no such direction. */
    if (length > SIDE / 2) {
        (*from)[x_axis] += BLOCK * blocks * x / length;
        (*from)[x_axis + 1] += BLOCK * blocks * y / length;
    }
}

static float within(float x, float low, float high)
{
    return x < low ? low : x > high ? high : x;
}

/* What is at this block `at` of the way (0..1) from the one slice to the other: the body's surface first, and what does
 * not go with it may go with a bone. */
static Move move_of(const Shaping *s, const Scratch *c, uint32_t at, float way)
{
    Move m = {.share = 0};
    float rest = 1;
    const int i = (int)(at % (uint32_t)s->n_blocks[0]), j = (int)(at / (uint32_t)s->n_blocks[0]);
    for (int l = 0; l < N_SURFACES; l++) {
        const int16_t *const before = c->field[0].distance[l], *const behind = c->field[1].distance[l];
        if (abs(before[at]) >= FAR / 2 || abs(behind[at]) >= FAR / 2)
            continue;
        const float difference = (float)(behind[at] - before[at]) * BLOCK_OF_UNIT, moved = fabsf(difference);
        const float off = fabsf((float)before[at] * BLOCK_OF_UNIT + way * difference);
        const float goes = rest * within(1 - (off - 1) / (GOES_WITH * moved + 1), 0, 1);
        const float share = goes * within((moved - MOVES_FROM) / (MOVES_ALL - MOVES_FROM), 0, 1);
        if (share > 0) {
            go(s, before, i, j, share * way * difference, &m.from, 0);
            go(s, behind, i, j, -share * (1 - way) * difference, &m.from, 2);
            m.share += share;
        }
        rest -= goes;
    }
    m.share = within(4 * m.share, 0, 1);
    return m;
}

/* Blocks that move somewhere on the way from slice to slice, where move_of() lets the others rest, and differ by more
 * than noise. */
static void find_moves(const Shaping *s, Scratch *c)
{
    const uint16_t *const a = c->field[0].grey, *const b = c->field[1].grey;
    const int alike = (int)s->alike;
    memset(c->moves, 0, n_all_blocks(s));
    for (int l = 0; l < N_SURFACES; l++) {
        const int16_t *const d = c->field[0].distance[l], *const e = c->field[1].distance[l];
        for (size_t i = 0; i < n_all_blocks(s); i++) {
            const int moved = abs(e[i] - d[i]), off = least(abs(d[i]), abs(e[i]));
            c->moves[i] |= (moved > (int)(SIDE * MOVES_FROM)) & (abs(b[i] - a[i]) > alike) &
                           (((d[i] ^ e[i]) < 0) | (off < (int)GOES_WITH * moved + 2 * SIDE));
        }
    }
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

/* Lists what is looked at in every layer of a gap: most of it is at rest, or alike. A pixel's move is one of the blocks
 * around it, too. */
static void list_blocks(const Shaping *s, Scratch *c)
{
    const size_t nx = (size_t)s->n_blocks[0], ny = (size_t)s->n_blocks[1], n = n_all_blocks(s);
    find_moves(s, c);
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

/* Of a slice, between the four pixels from `p` on. */
static float grey_between(const CtsShapeStack *t, const uint16_t *p, float u, float v)
{
    const float a = p[0], b = p[1], d = p[t->n_columns], e = p[t->n_columns + 1];
    const float ab = a + u * (b - a), de = d + u * (e - d);
    return ab + v * (de - ab);
}

/* A pixel's move from those of the four blocks around it: it lies a quarter of a block from the nearest. */
static Move pixel_move(const Shaping *s, const Move *move, int x, int y)
{
    const int near_i = x / BLOCK, near_j = y / BLOCK, i = near_i + (x % BLOCK ? 1 : -1),
              j = near_j + (y % BLOCK ? 1 : -1);
    const int nx = s->n_blocks[0], far_i = i < 0 || i >= nx ? near_i : i;
    const int far_j = j < 0 || j >= s->n_blocks[1] ? near_j : j;
    const Move *const near_row = move + (size_t)near_j * (size_t)nx, *const far_row = move + (size_t)far_j * (size_t)nx;
    const Move *const a = near_row + near_i, *const b = near_row + far_i, *const c = far_row + near_i,
                      *const d = far_row + far_i;
    return (Move){.from = 9.0F / 16 * a->from + 3.0F / 16 * b->from + 3.0F / 16 * c->from + 1.0F / 16 * d->from,
                  .share = 9.0F / 16 * a->share + 3.0F / 16 * b->share + 3.0F / 16 * c->share + 1.0F / 16 * d->share};
}

static Four choose(FourInts mask, Four a, Four b)
{
    return (Four)((mask & (FourInts)a) | (~mask & (FourInts)b));
}

typedef struct Sums {
    uint64_t n_voxels, n_moved, differences;
} Sums;

/* A pixel `at` of the way between two slices; blended: what it is without a move. */
static float make_pixel(const Shaping *s, const uint16_t *const slices[2], int x, int y, const Move *m, float way,
                        float blended)
{
    const CtsShapeStack *const t = s->stack;
    const size_t at = (size_t)y * (size_t)t->n_columns + (size_t)x;
    const float differs = fabsf((float)slices[1][at] - slices[0][at]);
    const float last_x = (float)(t->n_columns - 1), last_y = (float)(t->n_rows - 1);
    const Four most = {last_x, last_y, last_x, last_y}, none = {0};
    Four place = (Four){(float)x, (float)y, (float)x, (float)y} + m->from;
    place = choose(place < none, none, place);
    place = choose(place > most, most, place);
    const FourInts cell = __builtin_convertvector(place, FourInts);
    /* The last pixel is the end of the last cell. */
    const FourInts first = cell + (cell == __builtin_convertvector(most, FourInts));
    const Four on = place - __builtin_convertvector(first, Four);
    const float a = grey_between(t, slices[0] + (size_t)first[1] * (size_t)t->n_columns + first[0], on[0], on[1]);
    const float b = grey_between(t, slices[1] + (size_t)first[3] * (size_t)t->n_columns + first[2], on[2], on[3]);
    const float believed = m->share * within(2 - fabsf(b - a) / fmaxf(differs / 2, s->edges), 0, 1);
    return blended + believed * (a + way * (b - a) - blended);
}

static void write_block(const Shaping *s, const Move *move, uint32_t block, const uint16_t *const slices[2], float way,
                        uint16_t *layer, Sums *sums)
{
    const CtsShapeStack *const t = s->stack;
    const int x0 = BLOCK * (int)(block % (uint32_t)s->n_blocks[0]),
              y0 = BLOCK * (int)(block / (uint32_t)s->n_blocks[0]);
    for (int y = y0; y < least(y0 + BLOCK, t->n_rows); y++)
        for (int x = x0; x < least(x0 + BLOCK, t->n_columns); x++) {
            const size_t at = (size_t)y * (size_t)t->n_columns + (size_t)x;
            const Move m = pixel_move(s, move, x, y);
            if (m.share == 0)
                continue;
            const uint16_t made = (uint16_t)(int32_t)(make_pixel(s, slices, x, y, &m, way, layer[at]) + 0.5F);
            const float straight = slices[0][at] + way * ((float)slices[1][at] - slices[0][at]);
            if (made != layer[at]) {
                sums->n_moved++;
                sums->differences += (uint64_t)(int32_t)(fabsf(made - straight) + 0.5F);
                layer[at] = made;
            }
        }
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
    const uint16_t *const slices[2] = {t->slices + (size_t)gap * layer, t->slices + (size_t)(gap + 1) * layer};
    list_blocks(s, c);
    for (int j = (int)floor(from) + 1; j < to && j < t->n_layers; j++) {
        const float way = (float)((j - from) / (to - from));
        sums->n_voxels += layer;
        for (size_t n = 0; n < c->n_moving; n++)
            c->move[c->moving[n]] = move_of(s, c, c->moving[n], way);
        for (size_t n = 0; n < c->n_written; n++)
            write_block(s, c->move, c->written[n], slices, way, t->layers + (size_t)j * layer, sums);
    }
    for (size_t n = 0; n < c->n_moving; n++)
        c->move[c->moving[n]] = (Move){.share = 0};
}

/* Gaps between slices; a field is read once for the two gaps at a slice. */
static void shape_gaps(void *context, int worker, size_t first, size_t end)
{
    Shaping *const s = context;
    Scratch c;
    Sums sums = {0, 0, 0};
    (void)worker;
    if (scratch_new(s, &c, NULL)) {
        atomic_fetch_add(&s->n_failed, 1);
        return;
    }
    read_field(s, (int)first, &c, &c.field[0]);
    for (size_t gap = first; gap < end; gap++) {
        read_field(s, (int)gap + 1, &c, &c.field[1]);
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
