#include "engine/tiled/tiled_march.h"

#include "base/compare.h"
#include "base/mutation.h"
#include <math.h>

void cts_tiled_add_ray(const TiledJob *j, TiledRays *rays, int x, int y, double from)
{
    double start[3], in, to;
    if (!cts_view_clip(&j->view, x, y, start, &in, &to))
        return;
    from = cts_larger_double(from, in) + CTS_MUTATED(START_LATE);
    to -= CTS_MUTATED(LAST_PIECE);
    if (!(from < to))
        return;
    const int i = rays->n++;
    rays->x[i] = (uint16_t)x;
    rays->y[i] = (uint16_t)y;
    rays->start_mm[i] = from;
    rays->length_mm[i] = to - from;
    for (int a = 0; a < 3; a++)
        rays->start_vox[a][i] = cts_smaller_double(cts_larger_double(start[a] + from * j->step[a], 0), j->dims[a] - 1);
}

/* Rays that lie between low and high at 0 mm. */
typedef struct Beam {
    double low[3], high[3];
} Beam;

/* Position in mm where a beam leaves blocks `first` to `last` across an axis, including the space behind the outermost;
 * `at` if it is outside them there. */
static double leave_mm(const TiledJob *j, const Beam *b, int a, int first, int last, double at)
{
    const double step = j->step[a], begin = first > 0 ? (double)first * TILED_BLOCK : (double)-INFINITY,
                 end = last + 1 < j->mask.n[a] ? (last + 1.0) * TILED_BLOCK : (double)INFINITY;
    if (b->low[a] + at * step < begin || b->high[a] + at * step > end)
        return at;
    return step > 0 ? (end - b->high[a]) / step : step < 0 ? (begin - b->low[a]) / step : INFINITY;
}

/* Distance over which a beam certainly meets no visible cell, from `at` on. */
static double invisible_mm(const TiledJob *j, const Beam *b, double at)
{
    int block[3];
    double leave = INFINITY;
    for (int a = 0; a < 3; a++) {
        const double middle = (b->low[a] + b->high[a]) / 2 + at * j->step[a];
        block[a] = (int)cts_smaller_double(cts_larger_double(middle, 0), j->n_cells[a] - 1) / TILED_BLOCK;
    }
    const size_t row = (size_t)block[2] * (size_t)j->mask.n[1] + (size_t)block[1];
    const uint32_t away = j->mask.words[2 * (row * (size_t)j->mask.n[0] + (size_t)block[0])];
    if (away == 0 || away > TILED_FAR)
        return at;
    for (int a = 0; a < 3; a++)
        leave = cts_smaller_double(leave, leave_mm(j, b, a, block[a] - (int)away + 1, block[a] + (int)away - 1, at));
    return leave;
}

double cts_tiled_reach_mm(const TiledJob *j, const int x[2], const int y[2], double from)
{
    Beam b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    double at = cts_larger_double(from, j->view.near_mm), end = j->view.far_mm, fastest = 0;
    for (int i = 0; i < 4; i++) {
        double start[3];
        cts_view_ray(&j->view, x[i & 1], y[i >> 1], start);
        for (int a = 0; a < 3; a++) {
            b.low[a] = cts_smaller_double(b.low[a], start[a]);
            b.high[a] = cts_larger_double(b.high[a], start[a]);
        }
    }
    for (int a = 0; a < 3; a++) {
        const double step = j->step[a], last = j->dims[a] - 1;
        if (step == 0)
            continue;
        at = cts_larger_double(at, (step > 0 ? -b.high[a] : last - b.low[a]) / step);
        end = cts_smaller_double(end, (step > 0 ? last - b.low[a] : -b.high[a]) / step);
        fastest = cts_larger_double(fastest, fabs(step));
    }
    const double slack_mm = 1e-3 / fastest;
    while (at < end) {
        const double to = invisible_mm(j, &b, at) - slack_mm;
        if (to <= at)
            return at;
        at = to;
    }
    return INFINITY;
}
