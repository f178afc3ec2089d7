/* The largest, smallest and mean HU along a ray, exactly: extremes and means of cubics. */
#include "base/mutation.h"
#include "raycast/cubic.h"
#include "raycast/raycaster.h"
#include <math.h>

static double mean_hu(const CtsRaycaster *caster, CtsRayWalk *walk)
{
    CtsRayPiece piece;
    double sum = 0;
    while (caster->field->next(caster->field, walk, &piece))
        sum += (piece.t1_mm - piece.t0_mm) * cts_cubic_mean(piece.hu);
    return sum / (walk->ray->t1_mm - walk->ray->t0_mm);
}

double cts_raycast_extreme(const CtsRaycaster *caster, const CtsRay *ray)
{
    const CtsMode mode = caster->preset->mode;
    CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRayPiece piece;
    double best = caster->field->value(caster->field, ray, ray->t0_mm);
    if (!(ray->t1_mm > ray->t0_mm))
        return best;
    if (mode == CTS_MODE_AVERAGE)
        return mean_hu(caster, &walk);
    do {
        if (mode == CTS_MODE_MIP)
            wanted.range[0].low = nextafter(best, INFINITY);
        else
            wanted.range[0].high = best;
        if (!caster->field->next(caster->field, &walk, &piece))
            break;
        double low, high;
        cts_cubic_range(piece.hu, &low, &high);
        if (CTS_MUTATED(MODE_EXTREMES))
            low = high = piece.hu[0];
        best = mode == CTS_MODE_MIP ? fmax(best, high) : fmin(best, low);
    } while (true);
    return best;
}
