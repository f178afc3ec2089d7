#include "engine/project/project_ray.h"

#include <math.h>

bool cts_project_clip(const CtsView *view, double x, double y, CtsProjectedRay *ray)
{
    const double hair_vox = 1e-9; /* rounding must not lose a ray that runs along a face */
    cts_view_ray(view, x, y, ray->start);
    ray->t0 = -INFINITY;
    ray->t1 = INFINITY;
    double fastest = 0;
    for (int a = 0; a < 3; a++) {
        const double last = view->dims[a] - 1, step = ray->step[a] = view->forward_vox[a];
        if (step == 0) {
            if (ray->start[a] < -hair_vox || ray->start[a] > last + hair_vox)
                return false;
            continue;
        }
        const double in = (0 - ray->start[a]) / step, out = (last - ray->start[a]) / step;
        ray->t0 = fmax(ray->t0, fmin(in, out));
        ray->t1 = fmin(ray->t1, fmax(in, out));
        fastest = fmax(fastest, fabs(step));
    }
    if (ray->t1 < ray->t0 && (ray->t0 - ray->t1) * fastest <= hair_vox)
        ray->t1 = ray->t0;
    ray->t0 = fmax(ray->t0, view->near_mm);
    ray->t1 = fmin(ray->t1, view->far_mm);
    return ray->t1 >= ray->t0;
}

/* The eight corners of a cell; an axis of one voxel repeats it. */
static void corners(const CtsProjector *p, const int cell[3], double value[8])
{
    const uint16_t *base = p->volume->grey + cell[0] + cell[1] * p->stride[1] + cell[2] * p->stride[2];
    for (int c = 0; c < 8; c++) {
        ptrdiff_t at = 0;
        for (int a = 0; a < 3; a++)
            at += c >> a & 1 ? p->stride[a] : 0;
        value[c] = base[at];
    }
}

static inline double clamp01(double x)
{
    x = x > 0 ? x : 0;
    return x < 1 ? x : 1;
}

/* Trilinear between eight corners. */
static inline double between(const double v[8], const double f[3])
{
    const double y0 = (v[0] + f[0] * (v[1] - v[0])) * (1 - f[1]) + (v[2] + f[0] * (v[3] - v[2])) * f[1];
    const double y1 = (v[4] + f[0] * (v[5] - v[4])) * (1 - f[1]) + (v[6] + f[0] * (v[7] - v[6])) * f[1];
    return y0 + f[2] * (y1 - y0);
}

static double field_at(const CtsProjectedRay *ray, const int cell[3], const double v[8], double t)
{
    double f[3];
    for (int a = 0; a < 3; a++)
        f[a] = clamp01(ray->start[a] + t * ray->step[a] - cell[a]);
    return between(v, f);
}

/* Inside a cell the field is a cubic in t: its ends and, where its derivative vanishes, its turning points. */
static double cell_extreme(const CtsProjectedRay *ray, const int cell[3], const double v[8], double from, double to,
                           double sign)
{
    const double d = to - from;
    const double a = field_at(ray, cell, v, from), b = field_at(ray, cell, v, from + d / 3);
    const double c = field_at(ray, cell, v, to - d / 3), e = field_at(ray, cell, v, to);
    double best = sign > 0 ? fmax(a, e) : fmin(a, e);
    /* c0 + c1 s + c2 s^2 + c3 s^3 through the four. */
    const double c1 = (-11 * a + 18 * b - 9 * c + 2 * e) / 2, c2 = (18 * a - 45 * b + 36 * c - 9 * e) / 2;
    const double c3 = (-9 * a + 27 * b - 27 * c + 9 * e) / 2;
    const double half = c2 * c2 - 3 * c1 * c3;
    if (half < 0)
        return best;
    const double q = -(c2 + copysign(sqrt(half), c2)), turn[2] = {q / (3 * c3), c1 / q};
    for (int i = 0; i < 2; i++)
        if (turn[i] > 0 && turn[i] < 1) {
            const double at = field_at(ray, cell, v, from + turn[i] * d);
            best = sign > 0 ? fmax(best, at) : fmin(best, at);
        }
    return best;
}

/* Where a ray enters a cell and leaves it, 0 to 1. */
static void way_through(const CtsProjectedRay *ray, const int cell[3], double from, double to, double enter[3],
                        double leave[3])
{
    for (int a = 0; a < 3; a++) {
        enter[a] = clamp01(ray->start[a] + from * ray->step[a] - cell[a]);
        leave[a] = clamp01(ray->start[a] + to * ray->step[a] - cell[a]);
    }
}

/* A way through a cell as one through the body's mask, between eight of its nodes. */
typedef struct BodyWay {
    double corner[8], begin[3], end[3];
} BodyWay;

static BodyWay body_way(const CtsBodyMask *body, const int cell[3], const double enter[3], const double leave[3])
{
    BodyWay w;
    cts_body_mask_corners(body, cell, w.corner);
    for (int a = 0; a < 3; a++) {
        w.begin[a] = cts_body_mask_place(body, a, cell[a], enter[a]);
        w.end[a] = cts_body_mask_place(body, a, cell[a], leave[a]);
    }
    return w;
}

/* Most ways do not cross the body's edge, and by how far their middle is off it that is told. */
static CtsSees body_sees(const BodyWay *w)
{
    double least = w->corner[0], most = least, reach = 0, middle[3];
    for (int i = 1; i < 8; i++) {
        least = w->corner[i] < least ? w->corner[i] : least;
        most = w->corner[i] > most ? w->corner[i] : most;
    }
    for (int a = 0; a < 3; a++) {
        middle[a] = 0.5 * (w->begin[a] + w->end[a]);
        reach += 0.5 * fabs(w->end[a] - w->begin[a]) * (most - least);
    }
    const double off =
        (least > CTS_BODY_LEVEL || most < CTS_BODY_LEVEL ? least : between(w->corner, middle)) - CTS_BODY_LEVEL;
    if (least < CTS_BODY_LEVEL && most > CTS_BODY_LEVEL && fabs(off) <= reach + 1e-9)
        return CTS_SEES_SOME;
    return off > 0 ? CTS_SEES_ALL : CTS_SEES_NONE;
}

CtsSees cts_project_sees_way(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from,
                             double to)
{
    const int look = p->owners ? cts_look_of_cell(p->owners, cell) : CTS_LOOK_PRESET;
    double enter[3], leave[3];
    CtsSees body = CTS_SEES_ALL;
    if (look == CTS_LOOK_HIDDEN)
        return CTS_SEES_NONE;
    if (p->body) {
        way_through(ray, cell, from, to, enter, leave);
        const BodyWay w = body_way(p->body, cell, enter, leave);
        body = body_sees(&w);
    }
    return look == CTS_LOOKS_DIFFER && body == CTS_SEES_ALL ? CTS_SEES_SOME : body;
}

static int body_stretches(const CtsBodyMask *body, const int cell[3], const double enter[3], const double leave[3],
                          CtsStretch stretch[CTS_CELL_STRETCHES])
{
    const BodyWay w = body_way(body, cell, enter, leave);
    return cts_level_stretches(w.corner, CTS_BODY_LEVEL, w.begin, w.end, stretch);
}

/* The stretches of a ray in a cell: from stretch i - 1's end (from) to its own. Owners divide what lies in the body. */
static int stretches_in(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from, double to,
                        CtsStretch stretch[CTS_CELL_STRETCHES])
{
    CtsStretch body[CTS_CELL_STRETCHES], part[CTS_CELL_STRETCHES];
    double enter[3], leave[3], begin[3], end[3];
    way_through(ray, cell, from, to, enter, leave);
    if (!p->owners)
        return body_stretches(p->body, cell, enter, leave, stretch);
    if (!p->body)
        return cts_owner_stretches(p->owners, cell, enter, leave, stretch);
    const int n_body = body_stretches(p->body, cell, enter, leave, body);
    int n = 0;
    for (int b = 0; b < n_body; b++) {
        const double first = b ? body[b - 1].end : 0, length = body[b].end - first;
        int n_parts = 1;
        part[0] = (CtsStretch){1, body[b].look};
        for (int a = 0; a < 3; a++) {
            begin[a] = enter[a] + first * (leave[a] - enter[a]);
            end[a] = enter[a] + body[b].end * (leave[a] - enter[a]);
        }
        if (body[b].look != CTS_LOOK_HIDDEN)
            n_parts = cts_owner_stretches(p->owners, cell, begin, end, part);
        for (int i = 0; i < n_parts && n < CTS_CELL_STRETCHES; i++)
            stretch[n++] = (CtsStretch){first + part[i].end * length, part[i].look};
    }
    return n;
}

bool cts_project_extreme_in(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from,
                            double to, CtsSees sees, double sign, double *best)
{
    CtsStretch stretch[CTS_CELL_STRETCHES];
    double v[8], begin = from;
    stretch[0] = (CtsStretch){1, CTS_LOOK_PRESET};
    bool seen = false;
    corners(p, cell, v);
    const int n = sees == CTS_SEES_ALL ? 1 : stretches_in(p, ray, cell, from, to, stretch);
    for (int i = 0; i < n; i++) {
        const double end = i + 1 < n ? from + stretch[i].end * (to - from) : to;
        if (stretch[i].look != CTS_LOOK_HIDDEN) {
            *best = fmax(*best, sign * cell_extreme(ray, cell, v, begin, end, sign));
            seen = true;
        }
        begin = end;
    }
    return seen;
}

void cts_project_mean_in(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from, double to,
                         CtsSees sees, double *sum, double *length)
{
    CtsStretch stretch[CTS_CELL_STRETCHES];
    double v[8], begin = from;
    stretch[0] = (CtsStretch){1, CTS_LOOK_PRESET};
    corners(p, cell, v);
    const int n = sees == CTS_SEES_ALL ? 1 : stretches_in(p, ray, cell, from, to, stretch);
    for (int i = 0; i < n; i++) {
        const double end = i + 1 < n ? from + stretch[i].end * (to - from) : to;
        if (stretch[i].look != CTS_LOOK_HIDDEN) {
            *length += end - begin;
            *sum += (end - begin) / 6 *
                    (field_at(ray, cell, v, begin) + 4 * field_at(ray, cell, v, (begin + end) / 2) +
                     field_at(ray, cell, v, end));
        }
        begin = end;
    }
}

double cts_project_point(const CtsProjector *p, const CtsProjectedRay *ray)
{
    int cell[3];
    double best = -INFINITY;
    for (int a = 0; a < 3; a++) {
        const int last = p->view->dims[a] > 1 ? p->view->dims[a] - 2 : 0;
        cell[a] = (int)fmin(fmax(ray->start[a] + ray->t0 * ray->step[a], 0), last);
    }
    const CtsSees sees = cts_project_sees_way(p, ray, cell, ray->t0, ray->t0);
    return sees != CTS_SEES_NONE && cts_project_extreme_in(p, ray, cell, ray->t0, ray->t0, sees, 1, &best) ? best
                                                                                                           : INFINITY;
}
