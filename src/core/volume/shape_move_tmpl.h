/* The kernels of shape-based interpolation, included once for each SIMD path. */
#include "base/simd.h"
#include "core/volume/shape_move.h"

static const float BLOCK_OF_UNIT = 1.0F / SHAPE_SIDE;

/* Displacements in blocks: from three times SHAPE_MOVES_FROM on, all that there is moves with a surface. */
static const float MOVES_FROM = (float)SHAPE_MOVES_FROM / SHAPE_SIDE, MOVES_ALL = 3.0F * SHAPE_MOVES_FROM / SHAPE_SIDE;
static const float GOES_WITH = SHAPE_GOES_WITH;
/* Midway between two surfaces the distance has no direction: its gradient over two blocks is shorter than this, in
 * units. */
static const float SHORTEST = SHAPE_SIDE / 2;

INLINE vf within(vf x, float low, float high)
{
    return vf_min(vf_max(x, vf_of(low)), vf_of(high));
}

typedef int16_t Shorts __attribute__((vector_size(LANES * sizeof(int16_t))));

INLINE vi distances(const int16_t *d)
{
    Shorts shorts;
    memcpy(&shorts, d, sizeof shorts);
    return __builtin_convertvector(shorts, vi);
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
        return distances(d + p->at - 1);
    const vi own = distances(d + p->at);
    vi left = own;
    for (int l = 1; l < LANES; l++)
        left[l] = own[l - 1];
    return left;
}

INLINE vi to_right(const int16_t *d, const Places *p)
{
    return vi_select(p->last, distances(d + p->at), distances(d + p->at + 1));
}

/* Adds a displacement of so many blocks, along the gradient of the distances, to x and y. */
INLINE void go(const int16_t *d, const Places *p, vf blocks, vf *x, vf *y)
{
    const vf along_x = to_float(to_right(d, p) - to_left(d, p));
    const vf along_y = to_float(distances(d + p->at + p->below) - distances(d + p->at + p->above));
    const vf length = vf_sqrt(along_x * along_x + along_y * along_y), pixels = (float)SHAPE_BLOCK * blocks;
    const vmask leads = vf_gt(length, vf_of(SHORTEST));
    *x += vf_select(leads, pixels * along_x / length, vf_of(0));
    *y += vf_select(leads, pixels * along_y / length, vf_of(0));
}

/* Displacements by the body's surface first, then by bone's where that gives none. */
INLINE void find_some(const ShapeGap *g, const Places *p, vf part, vf move[SHAPE_NUMBERS])
{
    vf rest = vf_of(1); /* without displacement so far */
    for (int number = 0; number < SHAPE_NUMBERS; number++)
        move[number] = vf_of(0);
    for (int s = 0; s < SHAPE_SURFACES; s++) {
        const int16_t *const first = g->distance[0][s], *const second = g->distance[1][s];
        const vi d = distances(first + p->at), e = distances(second + p->at), far = vi_of(SHAPE_FAR / 2);
        const vmask known = vi_lt(vi_max(d, -d), far) & vi_lt(vi_max(e, -e), far);
        const vf before = to_float(d) * BLOCK_OF_UNIT, difference = to_float(e - d) * BLOCK_OF_UNIT;
        const vf moved = vf_abs(difference), off = vf_abs(before + part * difference);
        const vf with = rest * within(1 - (off - 1) / (GOES_WITH * moved + 1), 0, 1);
        const vf goes = vf_select(known, with, vf_of(0));
        const vf share = goes * within((moved - MOVES_FROM) / (MOVES_ALL - MOVES_FROM), 0, 1);
        go(first, p, share * part * difference, &move[0], &move[1]);
        go(second, p, -share * (1 - part) * difference, &move[2], &move[3]);
        move[SHAPE_SHARE] += share;
        rest -= goes;
    }
    move[SHAPE_SHARE] = within(4 * move[SHAPE_SHARE], 0, 1);
}

/* Stores the numbers of the blocks in the mask, and copies beyond the row's ends. */
INLINE void store_moves(const ShapeGap *g, int x, int row, vmask moving, const vf move[SHAPE_NUMBERS])
{
    const int to_last = g->n_blocks[0] - 1 - x;
    const unsigned bits = mask_bits(moving);
    for (int k = 0; k < SHAPE_NUMBERS; k++) {
        float *const to = g->move[k] + shape_place((size_t)row * (size_t)g->n_blocks[0] + (size_t)x, (size_t)row);
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
        const uint32_t row = b->row[k], first = b->at[k];
        const int x = (int)(first - row * (uint32_t)g->n_blocks[0]);
        unsigned moving = 0;
        for (; k < b->n && b->row[k] == row && b->at[k] - first < LANES; k++)
            moving |= 1U << (b->at[k] - first);
        const Places places = places_of(g, x, (int)row);
        vf move[SHAPE_NUMBERS];
        find_some(g, &places, vf_of(part), move);
        store_moves(g, x, (int)row, mask_of_bits(moving), move);
    }
}

/* LANES pixels of a row side by side, which begin with block `near` of its row of blocks; `far`: the block above or
 * below, whichever is nearer to these pixels. Numbers: places in arrays of displacements. */
typedef struct Pixels {
    int x, y;
    size_t near, far;
} Pixels;

/* A pixel's displacement from those of the four blocks around it: it lies a quarter of a block from the nearest. */
INLINE vf between_blocks(const float *numbers, const Pixels *p)
{
    vi own, beside;
    for (int l = 0; l < LANES; l++) {
        own[l] = l / 2 + 1;
        beside[l] = l / 2 + (l % 2 ? 2 : 0);
    }
    const float *const near = numbers + p->near - 1, *const far = numbers + p->far - 1;
    return 9.0F / 16 * vf_look_up(near, LANES, own) + 3.0F / 16 * vf_look_up(near, LANES, beside) +
           3.0F / 16 * vf_look_up(far, LANES, own) + 1.0F / 16 * vf_look_up(far, LANES, beside);
}

/* Grey levels of a slice at displaced positions: bilinear between four pixels. */
INLINE vf displaced(const CtsShapeStack *t, const uint16_t *slice, const Pixels *p, vf dx, vf dy)
{
    const vi last_x = vi_of(t->n_columns - 1), last_y = vi_of(t->n_rows - 1);
    const vmask all = mask_of_bits((1U << LANES) - 1);
    const uint16_t *const row = slice + (size_t)p->y * (size_t)t->n_columns;
    vi lane;
    for (int l = 0; l < LANES; l++)
        lane[l] = l;
    const vf x = vf_min(vf_max(to_float(p->x + lane) + dx, vf_of(0)), to_float(last_x));
    const vf y = vf_min(vf_max((float)p->y + dy, vf_of(0)), to_float(last_y));
    const vi whole_x = to_int(x), whole_y = to_int(y);
    /* The last pixel is the end of the last cell. */
    const vi cx = whole_x - vi_select(vi_eq(whole_x, last_x), vi_of(1), vi_of(0));
    const vi cy = whole_y - vi_select(vi_eq(whole_y, last_y), vi_of(1), vi_of(0));
    const vf u = x - to_float(cx), v = y - to_float(cy);
    const vi at = (cy - p->y) * t->n_columns + cx;
    const vi above = vi_gather_pairs(row, at, all), below = vi_gather_pairs(row + t->n_columns, at, all);
    const vf a = to_float(lower_half(above)), b = to_float(upper_half(above));
    const vf d = to_float(lower_half(below)), e = to_float(upper_half(below));
    const vf ab = a + u * (b - a), de = d + u * (e - d);
    return ab + v * (de - ab);
}

typedef uint16_t Words __attribute__((vector_size(LANES * sizeof(uint16_t))));

/* LANES grey levels, or the first n. A memcpy() of constant size is one instruction. */
INLINE vi words_load(const uint16_t *from, size_t n)
{
    Words words = {0};
    if (n == LANES)
        memcpy(&words, from, sizeof words);
    else
        memcpy(&words, from, n * sizeof *from);
    return __builtin_convertvector(words, vi);
}

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

/* The first n of LANES pixels. The others are read and written unchanged as far as the layer has them. */
INLINE void write_some(const ShapeGap *g, const ShapeLayer *l, const Pixels *p, size_t n, LaneSums *sums)
{
    const CtsShapeStack *const t = g->stack;
    const vf share = between_blocks(g->move[SHAPE_SHARE], p), part = vf_of(l->part);
    const vmask shares = vf_gt(share, vf_of(0)) & mask_of_bits((1U << n) - 1);
    if (!mask_any(shares))
        return;
    const size_t at = (size_t)p->y * (size_t)t->n_columns + (size_t)p->x;
    const size_t left = (size_t)t->n_columns * (size_t)t->n_rows - at, n_read = left < LANES ? left : LANES;
    const vf a = displaced(t, l->slices[0], p, between_blocks(g->move[0], p), between_blocks(g->move[1], p));
    const vf b = displaced(t, l->slices[1], p, between_blocks(g->move[2], p), between_blocks(g->move[3], p));
    const vf own = to_float(words_load(l->slices[0] + at, n_read)),
             other = to_float(words_load(l->slices[1] + at, n_read));
    const vi before = words_load(l->grey + at, n_read);
    const vf blended = to_float(before), straight = own + part * (other - own), half = vf_abs(other - own) / 2;
    const vf alike = within(2 - vf_abs(b - a) / vf_max(half, vf_of(g->edges)), 0, 1);
    const vf made = blended + share * alike * (a + part * (b - a) - blended);
    const vi level = vi_select(shares, to_int(made + 0.5F), before);
    const vi difference = to_int(vf_abs(to_float(level) - straight) + 0.5F);
    const vmask same = vi_eq(level, before);
    sums->n_moved += vi_select(same, vi_of(0), vi_of(1));
    sums->differences += vi_select(same, vi_of(0), difference);
    words_store(l->grey + at, level, n_read);
}

/* Listed blocks of one row of blocks, from entry k on. Each vector begins with the next listed block; blocks between
 * listed ones stay unchanged. Returns the end of the row's entries. */
INLINE size_t write_row(const ShapeGap *g, const ShapeLayer *l, size_t k, ShapeSums *sums)
{
    const CtsShapeStack *const t = g->stack;
    const ShapeBlocks *const b = &g->written;
    const int row = (int)b->row[k];
    const size_t stride = (size_t)g->n_blocks[0] + 2;
    LaneSums all = {vi_of(0), vi_of(0)};
    while (k < b->n && b->row[k] == (uint32_t)row) {
        const uint32_t first = b->at[k] - (uint32_t)row * (uint32_t)g->n_blocks[0],
                       end = b->at[k] + LANES / SHAPE_BLOCK;
        const int x = SHAPE_BLOCK * (int)first, n = t->n_columns - x < LANES ? t->n_columns - x : LANES;
        for (int v = 0; v < SHAPE_BLOCK && SHAPE_BLOCK * row + v < t->n_rows; v++) {
            const int beside = row + 2 * v - 1, far_row = beside < 0 || beside >= g->n_blocks[1] ? row : beside;
            const Pixels p = {x, SHAPE_BLOCK * row + v, shape_place(b->at[k], b->row[k]),
                              (size_t)far_row * stride + first + 1};
            write_some(g, l, &p, (size_t)n, &all);
        }
        while (k < b->n && b->at[k] < end && b->row[k] == (uint32_t)row)
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
