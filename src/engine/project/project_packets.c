/* Packets of rays in double precision. */
#define SIMD_DOUBLE
#include "engine/project/project_packets.h"
#include "base/simd.h"

#include "base/mutation.h"
#include <math.h>

/* Rays of neighbouring pixels of one row. */
typedef struct ProjectionPacket {
    vf start[3], t0, t1;
    vmask inside; /* rays with some length in the box */
} ProjectionPacket;

/* The rays of a tile's row. Macro-cells are taken whole for all of them or for none, so that sums are rounded alike
 * whatever the number of lanes. */
enum { ROW_PARTS = CTS_PROJECT_TILE / LANES };
typedef struct PacketRow {
    ProjectionPacket part[ROW_PARTS];
    int first, last;        /* macro-cells along axes[2] that they cross */
    double low[2], high[2]; /* extent of the rays' intersections with layer 0, along axes[0] and [1] */
} PacketRow;

/* Parameters common to all rays. */
typedef struct RaySlopes {
    double step[3], per_step[3];
    double slope[2]; /* along axes[0] and [1] for a layer of axes[2] */
} RaySlopes;

static RaySlopes way_of(const CtsProjection *p)
{
    RaySlopes w;
    const double *forward = p->projector.view->forward_vox;
    for (int a = 0; a < 3; a++) {
        w.step[a] = forward[a];
        w.per_step[a] = forward[a] == 0 ? 0 : 1 / forward[a];
    }
    for (int n = 0; n < 2; n++)
        w.slope[n] = forward[p->axes[n]] / forward[p->axes[2]];
    return w;
}

static int clamp_macrocell(double at_vox, int n)
{
    const double at = floor(at_vox / CTS_FINE_MACROCELL);
    return at < 0 ? 0 : at < n - 1 ? (int)at : n - 1;
}

static PacketRow rays_of_row(const CtsProjection *p, const RaySlopes *w, int x, int y, int width, double *grey)
{
    PacketRow r = {.first = INT32_MAX, .last = -1};
    const int k = p->axes[2], n = p->projector.macrocells->n_fine[k];
    for (int i = 0; i < CTS_PROJECT_TILE; i++) {
        ProjectionPacket *const part = &r.part[i / LANES];
        const int l = i % LANES;
        CtsProjectedRay ray;
        part->t0[l] = 1;
        if (i >= width)
            continue;
        grey[i] = INFINITY;
        memcpy(ray.step, w->step, sizeof ray.step);
        const bool hits = cts_view_clip(p->projector.view, x + i, y, ray.start, &ray.t0, &ray.t1);
        if (hits && !(ray.t1 > ray.t0))
            grey[i] = cts_project_point(&p->projector, &ray);
        for (int a = 0; a < 3; a++)
            part->start[a][l] = ray.start[a];
        for (int m = 0; m < 2; m++) {
            const double at = ray.start[p->axes[m]] - ray.start[k] * w->slope[m];
            r.low[m] = i == 0 || at < r.low[m] ? at : r.low[m];
            r.high[m] = i == 0 || at > r.high[m] ? at : r.high[m];
        }
        if (!hits || !(ray.t1 > ray.t0))
            continue;
        part->inside[l] = -1;
        part->t0[l] = ray.t0;
        part->t1[l] = ray.t1;
        const double from = ray.start[k] + ray.t0 * ray.step[k], to = ray.start[k] + ray.t1 * ray.step[k];
        const int first = clamp_macrocell(fmin(from, to) - 1e-6, n), last = clamp_macrocell(fmax(from, to) + 1e-6, n);
        r.first = first < r.first ? first : r.first;
        r.last = last > r.last ? last : r.last;
    }
    return r;
}

/* Properties common to the macro-cells of a layer that rays may cross. */
typedef struct BoxContents {
    CtsRange range;
    bool some_visible, all_visible;
} BoxContents;

/* low, high: as in PacketRow. */
INLINE BoxContents contents_of(const CtsProjection *p, const RaySlopes *w, const double low[2], const double high[2],
                               int layer)
{
    const CtsMacrocells *m = p->projector.macrocells;
    const size_t stride[3] = {1, (size_t)m->n_fine[0], (size_t)m->n_fine[0] * (size_t)m->n_fine[1]};
    const size_t su = stride[p->axes[0]], sv = stride[p->axes[1]], at = (size_t)layer * stride[p->axes[2]];
    BoxContents c = {{65535, 0}, false, true};
    int from[2], to[2];
    for (int n = 0; n < 2; n++) {
        const double near = layer * CTS_FINE_MACROCELL * w->slope[n];
        const double far = (layer + 1) * CTS_FINE_MACROCELL * w->slope[n];
        from[n] = clamp_macrocell(low[n] + (near < far ? near : far) - 1e-6, m->n_fine[p->axes[n]]);
        to[n] = clamp_macrocell(high[n] + (near > far ? near : far) + 1e-6, m->n_fine[p->axes[n]]);
    }
    for (int v = from[1]; v <= to[1]; v++)
        for (int u = from[0]; u <= to[0]; u++) {
            const size_t i = at + (size_t)u * su + (size_t)v * sv;
            const int visibility = p->visibility ? p->visibility[i] : CTS_ALL_CELLS;
            c.all_visible &= visibility == CTS_ALL_CELLS;
            if (visibility == CTS_NO_CELL)
                continue;
            c.some_visible = true;
            c.range.low = m->fine[i].low < c.range.low ? m->fine[i].low : c.range.low;
            c.range.high = m->fine[i].high > c.range.high ? m->fine[i].high : c.range.high;
        }
    return c;
}

/* The cell of axis a that holds this place, the nearest one for places outside. */
INLINE vn cell_at(const CtsProjection *p, int a, vf place)
{
    return __builtin_convertvector(vf_min(vf_max(place, vf_of(0)), vf_of(p->projector.n_cells[a] - 1)), vn);
}

/* Splits the rays within layer k of cells where they cross from cell to cell: t[0] to t[1] in the first, to t[2] in the
 * second, to t[3] in the third. No ray moves by more than a cell along the other axes. */
INLINE void cut_layer(const CtsProjection *p, const RaySlopes *w, const ProjectionPacket *r, int k, vf t[4])
{
    const int axis = p->axes[2];
    const vf in = (vf_of(k) - r->start[axis]) * w->per_step[axis];
    const vf out = (vf_of(k + 1) - r->start[axis]) * w->per_step[axis];
    t[0] = vf_max(vf_min(in, out), r->t0);
    t[3] = vf_min(vf_max(in, out), r->t1);
    t[1] = t[2] = t[3];
    if (w->slope[0] == 0 && w->slope[1] == 0) /* straight along an axis, as many views are */
        return;
    vf cut[2];
    for (int n = 0; n < 2; n++) {
        const int a = p->axes[n];
        const vn from = cell_at(p, a, r->start[a] + t[0] * w->step[a]);
        const vn to = cell_at(p, a, r->start[a] + t[3] * w->step[a]);
        const vf face = vf_max(vn_to_float(from), vn_to_float(to));
        const vf at = vf_min(vf_max((face - r->start[a]) * w->per_step[a], t[0]), t[3]);
        cut[n] = vf_select(__builtin_convertvector(from != to, vmask), at, t[3]);
    }
    t[1] = vf_min(cut[0], cut[1]);
    t[2] = vf_max(cut[0], cut[1]);
}

/* The cells in which the rays are at time t, of layer k. */
INLINE void cells_at(const CtsProjection *p, const RaySlopes *w, const ProjectionPacket *r, vf t, int k, vn cell[3])
{
    for (int n = 0; n < 2; n++)
        cell[p->axes[n]] = cell_at(p, p->axes[n], r->start[p->axes[n]] + t * w->step[p->axes[n]]);
    cell[p->axes[2]] = vn_of(k);
}

/* Their eight voxels, bit a of the index for axis a. */
INLINE void load_packet_corners(const CtsProjection *p, const vn cell[3], vf value[8])
{
    const uint16_t *grey = p->projector.volume->grey;
    const ptrdiff_t row = p->projector.stride[1], slice = p->projector.stride[2];
    uint32_t pair[4][LANES];
    const bool alone = !p->projector.stride[0]; /* no voxel lies beside another */
    for (int l = 0; l < LANES && alone; l++)
        for (int n = 0; n < 4; n++)
            pair[n][l] = UINT32_C(0x10001) * grey[(cell[1][l] + (n & 1)) * row + (cell[2][l] + (n >> 1)) * slice];
    for (int l = 0; l < LANES && !alone; l++) {
        const uint16_t *const at = grey + cell[0][l] + cell[1][l] * row + cell[2][l] * slice;
        memcpy(&pair[0][l], at, sizeof **pair);
        memcpy(&pair[1][l], at + row, sizeof **pair);
        memcpy(&pair[2][l], at + slice, sizeof **pair);
        memcpy(&pair[3][l], at + row + slice, sizeof **pair);
    }
    for (int n = 0; n < 4; n++) {
        vn words;
        memcpy(&words, pair[n], sizeof words);
        const vf even = vn_to_float(words & 0xffff), odd = vn_to_float((words >> 16) & 0xffff);
        value[2 * n] = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? even : odd;
        value[2 * n + 1] = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? odd : even;
    }
}

INLINE vf field_at(const RaySlopes *w, const ProjectionPacket *r, const vn cell[3], const vf v[8], vf t)
{
    vf f[3];
    for (int a = 0; a < 3; a++)
        f[a] = vf_min(vf_max(r->start[a] + t * w->step[a] - vn_to_float(cell[a]), vf_of(0)), vf_of(1));
    const vf y0 = (v[0] + f[0] * (v[1] - v[0])) * (1 - f[1]) + (v[2] + f[0] * (v[3] - v[2])) * f[1];
    const vf y1 = (v[4] + f[0] * (v[5] - v[4])) * (1 - f[1]) + (v[6] + f[0] * (v[7] - v[6])) * f[1];
    return y0 + f[2] * (y1 - y0);
}

/* Visible intervals of the rays through their cells, as many as the ray with most intervals has; from first to last,
 * empty where a ray has fewer. */
typedef struct VisibleInterval {
    int n;
    vf first[CTS_MAX_CELL_INTERVALS], last[CTS_MAX_CELL_INTERVALS];
} VisibleInterval;

static CtsVisibleCells visible_cells_of(const CtsProjection *p, const int cell[3], int *bit)
{
    const int *const n = p->projector.macrocells->n_fine;
    size_t at = 0;
    *bit = 0;
    for (int a = 2; a >= 0; a--) {
        at = at * (size_t)n[a] + (size_t)(cell[a] / CTS_FINE_MACROCELL);
        *bit = *bit * CTS_FINE_MACROCELL + cell[a] % CTS_FINE_MACROCELL;
    }
    const int32_t place = p->visibility[at];
    const uint64_t all = place == CTS_ALL_CELLS ? UINT64_MAX : 0;
    return place >= 0 ? p->cells[place] : (CtsVisibleCells){all, all};
}

/* Of the lanes in the mask, between two times. */
static void find_visible_values(const CtsProjection *p, const RaySlopes *w, const ProjectionPacket *r, vmask mask,
                                const vn cell[3], const vf t[2], bool all_visible, VisibleInterval *visible)
{
    visible->n = 1;
    visible->first[0] = t[0];
    visible->last[0] = t[1];
    for (int l = 0; l < LANES && !all_visible; l++) {
        double first[CTS_MAX_CELL_INTERVALS], last[CTS_MAX_CELL_INTERVALS];
        const int at[3] = {cell[0][l], cell[1][l], cell[2][l]};
        int bit, n = 0;
        if (!mask[l])
            continue;
        const CtsVisibleCells cells = visible_cells_of(p, at, &bit);
        if (cells.all >> bit & 1)
            continue;
        visible->last[0][l] = t[0][l];
        if (cells.some >> bit & 1) {
            CtsProjectedRay ray = {.start = {r->start[0][l], r->start[1][l], r->start[2][l]}};
            memcpy(ray.step, w->step, sizeof ray.step);
            n = cts_project_stretches(&p->projector, &ray, at, t[0][l], t[1][l], first, last);
        }
        for (; visible->n < n; visible->n++)
            visible->first[visible->n] = visible->last[visible->n] = t[0];
        for (int i = 0; i < n; i++) {
            visible->first[i][l] = first[i];
            visible->last[i][l] = last[i];
        }
    }
}

/* Inside a cell the field is a cubic in t, here c0 + c1 s + c2 s^2 + c3 s^3 through four of its values: the largest
 * between two times is that at an end or, where the derivative vanishes, at a turning point. */
INLINE vf largest_between(const RaySlopes *w, const ProjectionPacket *r, const vn cell[3], const vf v[8], vf from,
                          vf to)
{
    const vf d = to - from;
    const vf a = field_at(w, r, cell, v, from), b = field_at(w, r, cell, v, from + d / 3);
    const vf c = field_at(w, r, cell, v, to - d / 3), e = field_at(w, r, cell, v, to);
    vf best = vf_max(a, e);
    const vf c1 = (-11 * a + 18 * b - 9 * c + 2 * e) / 2, c2 = (18 * a - 45 * b + 36 * c - 9 * e) / 2;
    const vf c3 = (-9 * a + 27 * b - 27 * c + 9 * e) / 2;
    const vf half = c2 * c2 - 3 * c1 * c3;
    const vmask turns = half >= 0;
    const vf root = vf_sqrt(vf_select(turns, half, vf_of(0)));
    const vf q = -(c2 + vf_select(c2 < 0, -root, root)), turn[2] = {q / (3 * c3), c1 / q};
    for (int n = 0; n < 2; n++) {
        const vmask between = turns & (turn[n] > 0) & (turn[n] < 1);
        if (!mask_any(between))
            continue;
        const vf at = field_at(w, r, cell, v, vf_select(between, from + turn[n] * d, from));
        best = vf_select(between, vf_max(best, at), best);
    }
    return best;
}

/* Results of a packet. */
typedef struct PacketResult {
    vf best; /* times sign */
    vmask visible;
} PacketResult;

/* Updates the results in layer k of cells; with all_visible false only whether rays without any visible interval so far
 * have one. */
static void march_layer(const CtsProjection *p, const RaySlopes *w, const ProjectionPacket *r, int k, bool all_visible,
                        PacketResult *found)
{
    vf t[4];
    VisibleInterval visible;
    cut_layer(p, w, r, k, t);
    for (int n = 0; n < 3; n++) {
        vmask some = r->inside & (t[n] < t[n + 1]);
        vn cell[3];
        vf v[8];
        if (!mask_any(some))
            continue;
        cells_at(p, w, r, (t[n] + t[n + 1]) / 2, k, cell);
        load_packet_corners(p, cell, v);
        for (int c = 0; c < 8; c++)
            v[c] *= p->sign;
        const vf most =
            vf_max(vf_max(vf_max(v[0], v[1]), vf_max(v[2], v[3])), vf_max(vf_max(v[4], v[5]), vf_max(v[6], v[7])));
        some &= (most > found->best) | ~found->visible;
        if (!mask_any(some))
            continue;
        find_visible_values(p, w, r, some, cell, t + n, all_visible, &visible);
        for (int i = 0; i < visible.n; i++) {
            const vmask here = some & (visible.first[i] < visible.last[i]), may = here & (most > found->best);
            found->visible |= here;
            if (!mask_any(may))
                continue;
            const vf largest = vf_min(largest_between(w, r, cell, v, visible.first[i], visible.last[i]), most);
            found->best = vf_select(may, vf_max(found->best, largest), found->best);
        }
    }
}

static int layer_end(const CtsProjection *p, int layer)
{
    const int n = p->projector.view->dims[p->axes[2]] - 1, end = (layer + 1) * CTS_FINE_MACROCELL;
    return end < n ? end : n;
}

static void march_macrocells(const CtsProjection *p, const RaySlopes *w, const PacketRow *r, int layer,
                             bool all_visible, PacketResult found[ROW_PARTS])
{
    for (int i = 0; i < ROW_PARTS; i++)
        for (int k = layer * CTS_FINE_MACROCELL; k < layer_end(p, layer); k++)
            march_layer(p, w, &r->part[i], k, all_visible, &found[i]);
}

static int32_t bound_of(const CtsProjection *p, const BoxContents *c)
{
    return !c->some_visible ? INT32_MIN : p->sign > 0 ? c->range.high : -(int32_t)c->range.low;
}

/* The smallest result of the rays that could still change; infinite when none could. */
INLINE double least_found(const CtsProjection *p, const PacketRow *r, const PacketResult found[ROW_PARTS])
{
    vf least = vf_of(INFINITY);
    for (int i = 0; i < ROW_PARTS; i++)
        least = vf_min(least, vf_select(r->part[i].inside & (found[i].best < p->enough), found[i].best, least));
    for (int l = 1; l < LANES; l++)
        least[0] = least[l] < least[0] ? least[l] : least[0];
    return least[0];
}

/* The layers of macro-cells that the tile's rays cross, in falling order of their bounds, as far as requested. */
typedef struct Layers {
    CtsProjectedLayer *ranked;
    int n, n_sorted;
} Layers;

static CtsProjectedLayer layer_of_rank(Layers *l, int rank)
{
    for (; l->n_sorted <= rank; l->n_sorted++) {
        CtsProjectedLayer *const next = &l->ranked[l->n_sorted], *most = next;
        for (int i = l->n_sorted + 1; i < l->n; i++)
            most = l->ranked[i].bound > most->bound ? &l->ranked[i] : most;
        const CtsProjectedLayer found = *most;
        *most = *next;
        *next = found;
    }
    return l->ranked[rank];
}

/* True where each ray has a visible interval, or misses the box. */
static bool all_rays_visible(const PacketRow *r, const PacketResult found[ROW_PARTS])
{
    vmask invisible = mask_of_bits(0);
    for (int i = 0; i < ROW_PARTS; i++)
        invisible |= r->part[i].inside & ~found[i].visible;
    return !mask_any(invisible);
}

static void find_extremes(const CtsProjection *p, const RaySlopes *w, const PacketRow *r, Layers *layers, double *grey)
{
    PacketResult found[ROW_PARTS];
    for (int i = 0; i < ROW_PARTS; i++)
        found[i] = (PacketResult){vf_of(p->least), p->visibility ? mask_of_bits(0) : r->part[i].inside};
    for (int rank = 0; rank < layers->n; rank++) {
        const CtsProjectedLayer ranked = layer_of_rank(layers, rank);
        const int layer = ranked.layer;
        const double least = least_found(p, r, found);
        if (!(ranked.bound > least))
            break;
        if (layer < r->first || layer > r->last)
            continue;
        const BoxContents c = contents_of(p, w, r->low, r->high, layer);
        if (c.some_visible && bound_of(p, &c) > least)
            march_macrocells(p, w, r, layer, c.all_visible, found);
    }
    /* Rays whose result does not show whether they have one. */
    for (int layer = r->first; layer <= r->last && !all_rays_visible(r, found); layer++) {
        const BoxContents c = contents_of(p, w, r->low, r->high, layer);
        if (c.some_visible)
            march_macrocells(p, w, r, layer, c.all_visible, found);
    }
    for (int i = 0; i < CTS_PROJECT_TILE; i++)
        if (found[i / LANES].visible[i % LANES])
            grey[i] = p->sign * found[i / LANES].best[i % LANES];
}

/* Sum and length of a packet's visible intervals. */
typedef struct Summed {
    vf sum, length;
} Summed;

/* Two points of Gauss's rule are exact for a cubic. */
INLINE void sum_layer(const CtsProjection *p, const RaySlopes *w, const ProjectionPacket *r, int k, bool all_visible,
                      Summed *s)
{
    const double apart = 0.57735026918962576451; /* 1 / sqrt(3) */
    vf t[4];
    VisibleInterval visible;
    cut_layer(p, w, r, k, t);
    for (int n = 0; n < 3; n++) {
        const vmask some = r->inside & (t[n] < t[n + 1]);
        vn cell[3];
        vf v[8];
        if (!mask_any(some))
            continue;
        cells_at(p, w, r, (t[n] + t[n + 1]) / 2, k, cell);
        load_packet_corners(p, cell, v);
        find_visible_values(p, w, r, some, cell, t + n, all_visible, &visible);
        for (int i = 0; i < visible.n; i++) {
            const vf middle = (visible.first[i] + visible.last[i]) / 2, half = (visible.last[i] - visible.first[i]) / 2;
            const vf one = field_at(w, r, cell, v, middle - half * apart);
            const vf two = field_at(w, r, cell, v, middle + half * apart);
            s->sum += vf_select(some, half * (one + two), vf_of(0));
            s->length += vf_select(some, 2 * half, vf_of(0));
        }
    }
}

static void sum_uniform(const CtsProjection *p, const RaySlopes *w, const ProjectionPacket *r, int layer,
                        uint16_t level, Summed *s)
{
    const int axis = p->axes[2];
    const vf in = (vf_of(layer * CTS_FINE_MACROCELL) - r->start[axis]) * w->per_step[axis];
    const vf out = (vf_of(layer_end(p, layer)) - r->start[axis]) * w->per_step[axis];
    const vf from = vf_max(vf_min(in, out), r->t0), to = vf_min(vf_max(in, out), r->t1);
    const vf length = vf_select(r->inside & (from < to), to - from, vf_of(0));
    s->sum += length * (level * (CTS_MUTATED(AVERAGE_BLOCK) ? 0.98 : 1));
    s->length += length;
}

static void find_means(const CtsProjection *p, const RaySlopes *w, const PacketRow *r, double *grey)
{
    Summed s[ROW_PARTS];
    for (int i = 0; i < ROW_PARTS; i++)
        s[i] = (Summed){vf_of(0), vf_of(0)};
    for (int layer = r->first; layer <= r->last; layer++) {
        const BoxContents c = contents_of(p, w, r->low, r->high, layer);
        if (!c.some_visible)
            continue;
        for (int i = 0; i < ROW_PARTS; i++)
            if (c.all_visible && c.range.low == c.range.high)
                sum_uniform(p, w, &r->part[i], layer, c.range.low, &s[i]);
            else
                for (int k = layer * CTS_FINE_MACROCELL; k < layer_end(p, layer); k++)
                    sum_layer(p, w, &r->part[i], k, c.all_visible, &s[i]);
    }
    for (int i = 0; i < CTS_PROJECT_TILE; i++)
        if (s[i / LANES].length[i % LANES] > 0)
            grey[i] = s[i / LANES].sum[i % LANES] / s[i / LANES].length[i % LANES];
}

/* Upper limits of the tile's rays in each layer. */
static Layers bound_layers(const CtsProjection *p, const RaySlopes *w, const PacketRow *rows, int n,
                           CtsProjectedLayer *ranked)
{
    int first = INT32_MAX, last = -1;
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < n; i++) {
        for (int a = 0; a < 2; a++) {
            low[a] = fmin(low[a], rows[i].low[a]);
            high[a] = fmax(high[a], rows[i].high[a]);
        }
        first = rows[i].first < first ? rows[i].first : first;
        last = rows[i].last > last ? rows[i].last : last;
    }
    for (int layer = first; layer <= last; layer++) {
        const BoxContents c = contents_of(p, w, low, high, layer);
        ranked[layer - first] = (CtsProjectedLayer){bound_of(p, &c), layer};
    }
    return (Layers){ranked, last - first + 1, 0};
}

void CTS_ON_PATH(cts_project_tile)(const CtsProjection *p, CtsProjectedLayer *ranked, int x, int y, int width,
                                   int height, double *grey)
{
    const RaySlopes w = way_of(p);
    PacketRow rows[CTS_PROJECT_TILE];
    for (int row = 0; row < height && row < CTS_PROJECT_TILE; row++)
        rows[row] = rays_of_row(p, &w, x, y + row, width, grey + CTS_PROJECT_TILE * row);
    if (p->projector.mode == CTS_MODE_AVERAGE) {
        for (int row = 0; row < height; row++)
            find_means(p, &w, &rows[row], grey + CTS_PROJECT_TILE * row);
        return;
    }
    Layers layers = bound_layers(p, &w, rows, height, ranked);
    for (int row = 0; row < height; row++)
        find_extremes(p, &w, &rows[row], &layers, grey + CTS_PROJECT_TILE * row);
}
