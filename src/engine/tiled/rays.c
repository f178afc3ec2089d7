#include "engine/tiled/cells.h"

#include "base/mutation.h"
#include <math.h>

/* As a ray that misses a face by rounding is still in the box. */
#define SLACK_VOX 1e-9

static inline double smaller(double a, double b)
{
    return a < b ? a : b;
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

void cts_tiled_add_ray(const TiledJob *j, TiledRays *rays, int x, int y)
{
    double start[3], from = j->view.near_mm, to = j->view.far_mm;
    cts_view_ray(&j->view, x, y, start);
    for (int a = 0; a < 3; a++) {
        const double last = j->dims[a] - 1, step = j->step[a];
        if (step == 0) {
            if (start[a] < -SLACK_VOX || start[a] > last + SLACK_VOX)
                return;
            continue;
        }
        const double p = -start[a] / step, q = (last - start[a]) / step;
        from = larger(from, smaller(p, q));
        to = smaller(to, larger(p, q));
    }
    from += CTS_MUTATED(START_LATE);
    to -= CTS_MUTATED(LAST_PIECE);
    if (!(from < to))
        return;
    const int i = rays->n++;
    rays->x[i] = (uint16_t)x;
    rays->y[i] = (uint16_t)y;
    rays->start_mm[i] = from;
    rays->length_mm[i] = to - from;
    for (int a = 0; a < 3; a++)
        rays->start_vox[a][i] = smaller(larger(start[a] + from * j->step[a], 0), j->dims[a] - 1);
}
