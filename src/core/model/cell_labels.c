/* Labels within one cell. Along a line their fields are cubics; the Bernstein coefficients show where one exceeds
 * another; elsewhere the line is split, at the root where only two are left. */
#include "core/model/voxel_labels.h"
#include <math.h>
#include <stdlib.h>

/* Largest number of bisections of a line. */
enum { HALVINGS = 24 };

static void add_share(CtsCellLabels *c, int voxel_label, int corner, double share)
{
    int at = 0;
    while (at < c->n && c->voxel_label[at] < voxel_label)
        at++;
    if (at == c->n || c->voxel_label[at] != voxel_label) {
        if (c->n == CTS_MAX_CELL_LABELS)
            return;
        for (int i = c->n++; i > at; i--) {
            c->voxel_label[i] = c->voxel_label[i - 1];
            for (int m = 0; m < 8; m++)
                c->corner[i][m] = c->corner[i - 1][m];
        }
        c->voxel_label[at] = voxel_label;
        for (int m = 0; m < 8; m++)
            c->corner[at][m] = 0;
    }
    c->corner[at][corner] += share;
}

/* NULL where a scanned voxel has one label only. */
static const CtsFractionalVoxel *shared_at(const CtsVoxelLabels *l, size_t at)
{
    if (!l->is_shared || !(l->is_shared[at / 64] >> at % 64 & 1))
        return NULL;
    const size_t in_plane = (size_t)l->dims[0] * (size_t)l->dims[1];
    const CtsFractionalPlane *const plane = &l->shared[at / in_plane];
    const CtsFractionalVoxel key = {.at = (uint32_t)(at % in_plane)};
    return bsearch(&key, plane->items, plane->n, sizeof key, cts_fractional_by_place);
}

static void add_voxel(const CtsVoxelLabels *l, CtsCellLabels *c, size_t at, int corner, double weight)
{
    const CtsFractionalVoxel *const v = shared_at(l, at);
    if (!v)
        add_share(c, l->voxel_label[at], corner, weight);
    for (int i = 0; v && i < CTS_MAX_FRACTIONS && v->share[i]; i++)
        add_share(c, v->voxel_label[i], corner, weight * v->share[i] / CTS_WHOLE_SHARE);
}

/* The scanned voxel at a vertex of a cell: in one slice, or for an interpolated layer also in the next one, in_plane
 * further. */
static size_t corner_of(const CtsVoxelLabels *l, const int cell[3], int corner, size_t *in_plane, double *share)
{
    int at[3];
    for (int a = 0; a < 3; a++)
        at[a] = cell[a] + ((corner >> a & 1) && l->dims[a] > 1);
    *in_plane = (size_t)l->dims[0] * (size_t)l->dims[1];
    *share = l->share[at[2]];
    return (size_t)l->plane[at[2]] * *in_plane + (size_t)at[1] * (size_t)l->dims[0] + (size_t)at[0];
}

void cts_cell_labels(const CtsVoxelLabels *l, const int cell[3], CtsCellLabels *c)
{
    c->n = 0;
    for (int m = 0; m < 8; m++) {
        size_t in_plane;
        double share;
        const size_t at = corner_of(l, cell, m, &in_plane, &share);
        add_voxel(l, c, at, m, 1 - share);
        if (share > 0)
            add_voxel(l, c, at + in_plane, m, share);
    }
}

int cts_label_of_voxel(const CtsVoxelLabels *l, int i, int j, int k)
{
    const int cell[3] = {i, j, k};
    size_t in_plane;
    double share;
    CtsCellLabels c;
    int most = 0;
    const size_t at = corner_of(l, cell, 0, &in_plane, &share);
    if (share == 0 || (l->voxel_label[at] == l->voxel_label[at + in_plane] && !l->is_shared))
        return l->voxel_label[at];
    c.n = 0;
    add_voxel(l, &c, at, 0, 1 - share);
    add_voxel(l, &c, at + in_plane, 0, share);
    for (int n = 1; n < c.n; n++)
        most = c.corner[n][0] > c.corner[most][0] ? n : most;
    return c.voxel_label[most];
}

int cts_appearance_of_scanned_voxel(const CtsVoxelLabels *l, size_t at)
{
    const CtsFractionalVoxel *const v = shared_at(l, at);
    const int appearance = l->appearance[l->voxel_label[at]];
    for (int i = 0; v && i < CTS_MAX_FRACTIONS && v->share[i]; i++)
        if (l->appearance[v->voxel_label[i]] != appearance)
            return CTS_APPEARANCES_DIFFER;
    return appearance;
}

/* Fields along a line, as Bernstein coefficients. */
typedef struct Fields {
    int n, appearance[CTS_MAX_CELL_LABELS];
    double b[CTS_MAX_CELL_LABELS][4];
} Fields;

double cts_cell_at(const double v[8], double x, double y, double z)
{
    const double near = (v[0] + x * (v[1] - v[0])) * (1 - y) + (v[2] + x * (v[3] - v[2])) * y;
    const double far = (v[4] + x * (v[5] - v[4])) * (1 - y) + (v[6] + x * (v[7] - v[6])) * y;
    return near + z * (far - near);
}

static void field_along(const double v[8], const double p[3], const double q[3], double b[4])
{
    b[0] = cts_cell_at(v, p[0], p[1], p[2]);
    b[1] = (cts_cell_at(v, q[0], p[1], p[2]) + cts_cell_at(v, p[0], q[1], p[2]) + cts_cell_at(v, p[0], p[1], q[2])) / 3;
    b[2] = (cts_cell_at(v, q[0], q[1], p[2]) + cts_cell_at(v, q[0], p[1], q[2]) + cts_cell_at(v, p[0], q[1], q[2])) / 3;
    b[3] = cts_cell_at(v, q[0], q[1], q[2]);
}

static bool lies_above(const double p[4], const double q[4])
{
    return p[0] >= q[0] && p[1] >= q[1] && p[2] >= q[2] && p[3] >= q[3];
}

/* Removes fields that lie below another everywhere; of equal ones the first is kept. */
static void drop_hidden(Fields *f)
{
    int n = 0;
    for (int i = 0; i < f->n; i++) {
        bool below = false;
        for (int k = 0; k < n && !below; k++)
            below = lies_above(f->b[k], f->b[i]);
        for (int k = i + 1; k < f->n && !below; k++)
            below = lies_above(f->b[k], f->b[i]) && !lies_above(f->b[i], f->b[k]);
        if (below)
            continue;
        f->appearance[n] = f->appearance[i];
        for (int m = 0; m < 4; m++)
            f->b[n][m] = f->b[i][m];
        n++;
    }
    f->n = n;
}

static bool have_one_appearance(const Fields *f)
{
    for (int i = 1; i < f->n; i++)
        if (f->appearance[i] != f->appearance[0])
            return false;
    return true;
}

/* Of two fields that cross once: where, by regula falsi with halved ends (Illinois). */
static double crossing(const double b[4])
{
    double low = 0, high = 1, f_low = b[0], f_high = b[3], s = 0.5;
    for (int i = 0; i < 60 && high - low > 1e-12; i++) {
        s = low + (high - low) * (f_low / (f_low - f_high));
        const double r = 1 - s, f = r * r * r * b[0] + 3 * r * s * (r * b[1] + s * b[2]) + s * s * s * b[3];
        if (fabs(f) < 1e-14)
            break;
        if ((f < 0) == (f_low < 0)) {
            low = s;
            f_low = f;
            f_high *= 0.5;
        } else {
            high = s;
            f_high = f;
            f_low *= 0.5;
        }
    }
    return s;
}

/* True where two are left that change places once, at *s. */
static bool cross_once(const Fields *f, double *s)
{
    double apart[4];
    int n_changes = 0;
    if (f->n != 2)
        return false;
    for (int m = 0; m < 4; m++) {
        apart[m] = f->b[0][m] - f->b[1][m];
        n_changes += m > 0 && (apart[m] < 0) != (apart[m - 1] < 0);
    }
    if (n_changes != 1 || apart[0] == 0 || apart[3] == 0)
        return false;
    *s = crossing(apart);
    return true;
}

static Fields half(const Fields *f, bool second)
{
    Fields h = {.n = f->n};
    for (int i = 0; i < f->n; i++) {
        const double *const b = f->b[i];
        const double u0 = (b[0] + b[1]) / 2, u1 = (b[1] + b[2]) / 2, u2 = (b[2] + b[3]) / 2;
        const double v0 = (u0 + u1) / 2, v1 = (u1 + u2) / 2, middle = (v0 + v1) / 2;
        const double parts[2][4] = {{b[0], u0, v0, middle}, {middle, v1, u2, b[3]}};
        h.appearance[i] = f->appearance[i];
        for (int m = 0; m < 4; m++)
            h.b[i][m] = parts[second][m];
    }
    return h;
}

typedef struct Splitting {
    CtsLineInterval *interval;
    int n;
} Splitting;

static void add_interval(Splitting *c, double end, int appearance)
{
    if (c->n > 0 && (c->interval[c->n - 1].appearance == appearance || c->n == CTS_MAX_CELL_INTERVALS))
        c->interval[c->n - 1].end = end;
    else
        c->interval[c->n++] = (CtsLineInterval){end, appearance};
}

static void split_line(Splitting *c, Fields f, double from, double to, int depth)
{
    double s;
    drop_hidden(&f);
    if (have_one_appearance(&f)) {
        add_interval(c, to, f.appearance[0]);
    } else if (cross_once(&f, &s)) {
        const bool first = f.b[0][0] < f.b[1][0];
        add_interval(c, from + s * (to - from), f.appearance[first]);
        add_interval(c, to, f.appearance[!first]);
    } else if (depth == HALVINGS) {
        int most = 0;
        for (int i = 1; i < f.n; i++)
            most = f.b[i][0] > f.b[most][0] ? i : most;
        add_interval(c, to, f.appearance[most]);
    } else {
        const double middle = (from + to) / 2;
        split_line(c, half(&f, false), from, middle, depth + 1);
        split_line(c, half(&f, true), middle, to, depth + 1);
    }
}

int cts_label_intervals(const CtsVoxelLabels *l, const int cell[3], const double from[3], const double to[3],
                        CtsLineInterval interval[CTS_MAX_CELL_INTERVALS])
{
    CtsCellLabels in_cell;
    Fields f;
    Splitting c = {interval, 0};
    const int appearance = cts_appearance_of_cell(l, cell);
    if (appearance != CTS_APPEARANCES_DIFFER) {
        interval[0] = (CtsLineInterval){1, appearance};
        return 1;
    }
    cts_cell_labels(l, cell, &in_cell);
    f.n = in_cell.n;
    for (int i = 0; i < f.n; i++) {
        f.appearance[i] = l->appearance[in_cell.voxel_label[i]];
        field_along(in_cell.corner[i], from, to, f.b[i]);
    }
    split_line(&c, f, 0, 1, 0);
    interval[c.n - 1].end = 1;
    return c.n;
}

int cts_threshold_intervals(const double corner[8], double threshold, const double from[3], const double to[3],
                            CtsLineInterval interval[CTS_MAX_CELL_INTERVALS])
{
    Fields f = {.n = 2,
                .appearance = {CTS_APPEARANCE_PRESET, CTS_APPEARANCE_HIDDEN},
                .b = {{0}, {threshold, threshold, threshold, threshold}}};
    Splitting c = {interval, 0};
    field_along(corner, from, to, f.b[0]);
    split_line(&c, f, 0, 1, 0);
    interval[c.n - 1].end = 1;
    return c.n;
}
