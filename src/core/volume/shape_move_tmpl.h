/* The kernels of shape-based interpolation, included once for each SIMD path. */
#include "base/simd.h"
#include "core/volume/shape_move.h"

static const float BLOCK_OF_UNIT = 1.0F / SHAPE_SIDE;

/* Displacements in blocks: from MOVES_FROM to MOVES_ALL displaced pixels replace blended ones. Measured
 * (shape_interpolation.c): 0.3 to 1.5 blocks for MOVES_ALL change the error by less than 0.4 %. */
static const float MOVES_FROM = (float)SHAPE_MOVES_FROM / SHAPE_SIDE, MOVES_ALL = 3.0F * SHAPE_MOVES_FROM / SHAPE_SIDE;
static const float GOES_WITH = SHAPE_GOES_WITH;
/* Shortest gradient over two blocks, in units, whose direction is used: a quarter of the 2 * SHAPE_SIDE beside one
 * surface. Midway between two surfaces the distance has no direction. Measured (shape_interpolation.c): 1 to 12 change
 * the error by less than 0.6 %. */
static const float SHORTEST = SHAPE_SIDE / 2;

INLINE vf within(vf x, float low, float high)
{
    return vf_min(vf_max(x, vf_of(low)), vf_of(high));
}

/* LANES blocks of a row side by side, from block x on, and what lies beside them. */
typedef struct Places {
    size_t at;              /* place of the first one */
    ptrdiff_t above, below; /* to the neighbours; 0 at the borders of the picture */
    bool is_first;          /* the first one is the row's first */
    vmask last;             /* the row's last one */
} Places;

INLINE Places places_of(const ShapeGap *g, int x, int row)
{
    const int nx = g->n_blocks[0], ny = g->n_blocks[1], to_last = nx - 1 - x;
    return (Places){.at = (size_t)row * (size_t)nx + (size_t)x,
                    .above = row > 0 ? -nx : 0,
                    .below = row + 1 < ny ? nx : 0,
                    .is_first = x == 0,
                    .last = mask_of_bits(to_last < LANES ? 1U << to_last : 0)};
}

/* Distances of the neighbours to the left; the row's first block is its own. */
INLINE vi to_left(const int16_t *d, const Places *p)
{
    if (!p->is_first)
        return vi_load_shorts(d + p->at - 1);
    const vi own = vi_load_shorts(d + p->at);
    vi left = own;
    for (int l = 1; l < LANES; l++)
        left[l] = own[l - 1];
    return left;
}

INLINE vi to_right(const int16_t *d, const Places *p)
{
    return vi_select(p->last, vi_load_shorts(d + p->at), vi_load_shorts(d + p->at + 1));
}

/* Adds a displacement, in blocks, along the gradient of the distances to x and y. */
INLINE void go(const int16_t *d, const Places *p, vf blocks, vf *x, vf *y)
{
    const vf along_x = to_float(to_right(d, p) - to_left(d, p));
    const vf along_y = to_float(vi_load_shorts(d + p->at + p->below) - vi_load_shorts(d + p->at + p->above));
    const vf length = vf_sqrt(along_x * along_x + along_y * along_y), pixels = (float)SHAPE_BLOCK * blocks;
    const vmask leads = vf_gt(length, vf_of(SHORTEST));
    *x += vf_select(leads, pixels * along_x / length, vf_of(0));
    *y += vf_select(leads, pixels * along_y / length, vf_of(0));
}

/* Displacements by the body's surface first, then by bone's where that gives none. */
INLINE void find_some(const ShapeGap *g, const Places *p, vf part, vmask moving, vf move[SHAPE_NUMBERS])
{
    vf rest = vf_of(1); /* without displacement so far */
    for (int number = 0; number < SHAPE_NUMBERS; number++)
        move[number] = vf_of(0);
    for (int s = 0; s < SHAPE_SURFACES; s++) {
        const int16_t *const first = g->field[0].distance[s], *const second = g->field[1].distance[s];
        const vi d = vi_load_shorts(first + p->at), e = vi_load_shorts(second + p->at), far = vi_of(SHAPE_FAR / 2);
        const vmask known = vi_lt(vi_max(d, -d), far) & vi_lt(vi_max(e, -e), far);
        const vf before = to_float(d) * BLOCK_OF_UNIT, difference = to_float(e - d) * BLOCK_OF_UNIT;
        const vf moved = vf_abs(difference), off = vf_abs(before + part * difference);
        const vf with = rest * within(1 - (off - 1) / (GOES_WITH * moved + 1), 0, 1);
        const vf goes = vf_select(known & moving, with, vf_of(0));
        const vf share = goes * within((moved - MOVES_FROM) / (MOVES_ALL - MOVES_FROM), 0, 1);
        rest -= goes;
        if (!mask_any(vf_gt(share, vf_of(0))))
            continue;
        go(first, p, share * part * difference, &move[0], &move[1]);
        go(second, p, -share * (1 - part) * difference, &move[2], &move[3]);
        move[SHAPE_SHARE] += share;
    }
    move[SHAPE_SHARE] = within(4 * move[SHAPE_SHARE], 0, 1);
}

/* Stores the numbers of the blocks in the mask, and copies beyond the row's ends. */
INLINE void store_moves(const ShapeGap *g, int x, int row, vmask moving, const vf move[SHAPE_NUMBERS])
{
    const int to_last = g->n_blocks[0] - 1 - x;
    const unsigned bits = mask_bits(moving);
    for (int k = 0; k < SHAPE_NUMBERS; k++) {
        float *const to = g->move[k] + shape_place((ShapeBlock){(uint32_t)(row * g->n_blocks[0] + x), (uint32_t)row});
        vf_store(to, vf_select(moving, move[k], vf_load(to)));
        if (x == 0 && bits & 1)
            to[-1] = to[0];
        if (to_last < LANES && bits >> to_last & 1)
            to[to_last + 1] = to[to_last];
    }
}

/* Each vector begins with the next listed block; blocks between listed ones have none. */
INLINE void find_moves(const ShapeGap *g, float part)
{
    const ShapeBlocks *const b = &g->moving;
    for (size_t k = 0; k < b->n;) {
        const uint32_t row = b->items[k].row, first = b->items[k].at;
        const int x = (int)(first - row * (uint32_t)g->n_blocks[0]);
        unsigned listed = 0;
        for (; k < b->n && b->items[k].row == row && b->items[k].at - first < LANES; k++)
            listed |= 1U << (b->items[k].at - first);
        const vmask moving = mask_of_bits(listed);
        const Places places = places_of(g, x, (int)row);
        vf move[SHAPE_NUMBERS];
        find_some(g, &places, vf_of(part), moving, move);
        store_moves(g, x, (int)row, moving, move);
    }
}

enum { ROWS = SHAPE_BLOCK };

/* LANES pixels side by side in each of the rows of a block: from pixel x of row y on, in the first n_rows of them.
 * near: place of the first block in arrays of displacements; far: of the block above it and of the one below, of which
 * each is nearer to one of the rows. */
typedef struct Pixels {
    int x, y, n_rows;
    size_t near, far[ROWS];
} Pixels;

/* Displacements of pixels from those of the four blocks around each: it lies a quarter of a block from the nearest. */
INLINE void between_blocks(const float *numbers, const Pixels *p, vf made[ROWS])
{
    vi own, beside;
    for (int l = 0; l < LANES; l++) {
        own[l] = l / 2 + 1;
        beside[l] = l / 2 + (l % 2 ? 2 : 0);
    }
    const float *const near = numbers + p->near - 1;
    const vf half = 9.0F / 16 * vf_look_up(near, LANES, own) + 3.0F / 16 * vf_look_up(near, LANES, beside);
    for (int v = 0; v < ROWS; v++) {
        const float *const far = numbers + p->far[v] - 1;
        made[v] = half + 3.0F / 16 * vf_look_up(far, LANES, own) + 1.0F / 16 * vf_look_up(far, LANES, beside);
    }
}

/* Grey levels of a slice at displaced positions: bilinear between four pixels. */
INLINE void displaced(const CtsShapeStack *t, const uint16_t *slice, const Pixels *p, const vf dx[ROWS],
                      const vf dy[ROWS], vf made[ROWS])
{
    const vi last_x = vi_of(t->n_columns - 1), last_y = vi_of(t->n_rows - 1);
    const uint16_t *const row = slice + (size_t)p->y * (size_t)t->n_columns;
    vi lane, above[ROWS], below[ROWS];
    vf u[ROWS], w[ROWS];
    for (int l = 0; l < LANES; l++)
        lane[l] = l;
    for (int v = 0; v < ROWS; v++) {
        const vf x = vf_min(vf_max(to_float(p->x + lane) + dx[v], vf_of(0)), to_float(last_x));
        const vf y = vf_min(vf_max((float)(p->y + v) + dy[v], vf_of(0)), to_float(last_y));
        /* The last pixel is the end of the last cell. */
        const vi cx = vi_min(to_int(x), last_x - 1), cy = vi_min(to_int(y), last_y - 1);
        const vi at = (cy - p->y) * t->n_columns + cx;
        u[v] = x - to_float(cx), w[v] = y - to_float(cy);
        above[v] = vi_take_pairs(row, at), below[v] = vi_take_pairs(row + t->n_columns, at);
    }
    for (int v = 0; v < ROWS; v++) {
        const vf a = to_float(lower_half(above[v])), b = to_float(upper_half(above[v]));
        const vf d = to_float(lower_half(below[v])), e = to_float(upper_half(below[v]));
        const vf ab = a + u[v] * (b - a), de = d + u[v] * (e - d);
        made[v] = ab + w[v] * (de - ab);
    }
}

typedef uint16_t Words __attribute__((vector_size(LANES * sizeof(uint16_t))));

/* LANES grey levels, or the first n. */
INLINE vi words_load(const uint16_t *from, size_t n)
{
    uint16_t words[LANES] = {0};
    if (n == LANES)
        return vi_load_words(from);
    memcpy(words, from, n * sizeof *from);
    return vi_load_words(words);
}

/* A memcpy() of constant size is one instruction. */
INLINE void words_store(uint16_t *to, vi levels, size_t n)
{
    const Words words = __builtin_convertvector(levels, Words);
    if (n == LANES)
        memcpy(to, &words, sizeof words);
    else
        memcpy(to, &words, n * sizeof *to);
}

/* Numbers of moved pixels and their differences from straight lines, in each lane. */
typedef struct LaneSums {
    vi n_moved, differences;
} LaneSums;

/* Grey levels from `at` on that may be read or written as a vector. */
INLINE size_t n_left(size_t n_voxels, size_t at)
{
    return n_voxels - at < LANES ? n_voxels - at : LANES;
}

/* The first n of LANES pixels of each row. The others are read and written unchanged as far as the layer has them. */
INLINE void write_some(const ShapeGap *g, const ShapeLayer *l, const Pixels *p, size_t n, LaneSums *sums)
{
    const CtsShapeStack *const t = g->stack;
    const vmask some = mask_of_bits((1U << n) - 1);
    const size_t n_columns = (size_t)(t->end[0] - t->low[0]), n_rows = (size_t)(t->end[1] - t->low[1]);
    vf share[ROWS], move[SHAPE_SHARE][ROWS], first[ROWS], second[ROWS];
    between_blocks(g->move[SHAPE_SHARE], p, share);
    if (!mask_any((vf_gt(share[0], vf_of(0)) | vf_gt(share[1], vf_of(0))) & some))
        return;
    for (int k = 0; k < SHAPE_SHARE; k++)
        between_blocks(g->move[k], p, move[k]);
    displaced(t, l->slices[0], p, move[0], move[1], first);
    displaced(t, l->slices[1], p, move[2], move[3], second);
    for (int v = 0; v < p->n_rows; v++) {
        const size_t in_slice = (size_t)(p->y + v) * (size_t)t->n_columns + (size_t)p->x;
        const size_t at = (size_t)(p->y + v - t->low[1]) * n_columns + (size_t)(p->x - t->low[0]);
        const size_t n_in_slice = n_left((size_t)t->n_columns * (size_t)t->n_rows, in_slice);
        const size_t n_in_layer = n_left(n_columns * n_rows, at);
        const vf part = vf_of(l->part), a = first[v], b = second[v];
        const vf own = to_float(words_load(l->slices[0] + in_slice, n_in_slice)),
                 other = to_float(words_load(l->slices[1] + in_slice, n_in_slice));
        const vi before = words_load(l->grey + at, n_in_layer);
        const vf blended = to_float(before), straight = own + part * (other - own), half = vf_abs(other - own) / 2;
        const vf alike = within(2 - vf_abs(b - a) / vf_max(half, vf_of(g->edges)), 0, 1);
        const vf made = blended + share[v] * alike * (a + part * (b - a) - blended);
        const vi level = vi_select(vf_gt(share[v], vf_of(0)) & some, to_int(made + 0.5F), before);
        const vi difference = to_int(vf_abs(to_float(level) - straight) + 0.5F);
        const vmask same = vi_eq(level, before);
        sums->n_moved += vi_select(same, vi_of(0), vi_of(1));
        sums->differences += vi_select(same, vi_of(0), difference);
        words_store(l->grey + at, level, n_in_layer);
    }
}

/* Listed blocks of one row of blocks, from entry k on. Each vector begins with the next listed block; blocks between
 * listed ones stay unchanged. Returns the end of the row's entries. */
INLINE size_t write_row(const ShapeGap *g, const ShapeLayer *l, size_t k, ShapeSums *sums)
{
    const CtsShapeStack *const t = g->stack;
    const ShapeBlocks *const b = &g->written;
    const int row = (int)b->items[k].row;
    const ptrdiff_t stride = g->n_blocks[0] + 2;
    LaneSums all = {vi_of(0), vi_of(0)};
    while (k < b->n && b->items[k].row == (uint32_t)row) {
        const size_t place = shape_place(b->items[k]);
        const uint32_t first = b->items[k].at - (uint32_t)row * (uint32_t)g->n_blocks[0],
                       end = b->items[k].at + LANES / SHAPE_BLOCK;
        const int x = SHAPE_BLOCK * (int)first, n = t->end[0] - x < LANES ? t->end[0] - x : LANES;
        const int y = SHAPE_BLOCK * row, to_above = row > 0 ? -1 : 0, to_below = row + 1 < g->n_blocks[1];
        const Pixels p = {.x = x,
                          .y = y,
                          .n_rows = t->end[1] - y < ROWS ? t->end[1] - y : ROWS,
                          .near = place,
                          .far = {place + (size_t)(to_above * stride), place + (size_t)(to_below * stride)}};
        write_some(g, l, &p, (size_t)n, &all);
        while (k < b->n && b->items[k].at < end && b->items[k].row == (uint32_t)row)
            k++;
    }
    for (int lane = 0; lane < LANES; lane++) {
        sums->n_moved += (uint64_t)all.n_moved[lane];
        sums->differences += (uint64_t)all.differences[lane];
    }
    return k;
}

INLINE void write_layer(const ShapeGap *g, const ShapeLayer *l, ShapeSums *sums)
{
    for (size_t k = 0; k < g->written.n;)
        k = write_row(g, l, k, sums);
}
