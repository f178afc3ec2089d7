/* The largest, smallest and mean HU along a ray, exactly: extremes and means of cubics. */
#include "base/mutation.h"
#include "core/volume/body_mask.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/raycaster.h"
#include <math.h>

/* What of a piece is seen: n cubics, of this share of its length each. */
typedef struct Seen {
    int n;
    double hu[CTS_OWNED_STRETCHES][4], share[CTS_OWNED_STRETCHES];
} Seen;

static void see(const CtsRaycaster *caster, const CtsRayWalk *walk, const CtsRayPiece *piece, Seen *seen)
{
    CtsOwnedStretch stretch[CTS_OWNED_STRETCHES] = {{0, 1, CTS_LOOK_PRESET}};
    const int n = caster->owners ? cts_raycast_owned(caster->owners, walk, stretch) : 1;
    seen->n = 0;
    for (int i = 0; i < n; i++)
        if (stretch[i].look != CTS_LOOK_HIDDEN) {
            cts_cubic_part(piece->hu, stretch[i].from, stretch[i].to, seen->hu[seen->n]);
            seen->share[seen->n++] = stretch[i].to - stretch[i].from;
        }
}

/* Sum of HU times length, and length. */
static void add_mean(const CtsRaycaster *caster, const CtsRay *ray, double *sum, double *length)
{
    CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRayPiece piece;
    while (caster->field->next(caster->field, &walk, &piece)) {
        Seen seen;
        see(caster, &walk, &piece, &seen);
        for (int i = 0; i < seen.n; i++) {
            *sum += seen.share[i] * (piece.t1_mm - piece.t0_mm) * cts_cubic_mean(seen.hu[i]);
            *length += seen.share[i] * (piece.t1_mm - piece.t0_mm);
        }
    }
}

/* *best becomes the extreme of what it was and the ray, a point where it only touches the box. */
static void add_extreme(const CtsRaycaster *caster, const CtsRay *ray, double *best)
{
    const bool largest = caster->preset->mode == CTS_MODE_MIP;
    CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRayPiece piece;
    if (!caster->owners) {
        const double start = caster->field->value(caster->field, ray, ray->t0_mm);
        *best = largest ? fmax(*best, start) : fmin(*best, start);
    }
    while (caster->owners || ray->t1_mm > ray->t0_mm) {
        Seen seen;
        if (largest)
            wanted.range[0].low = nextafter(*best, INFINITY);
        else
            wanted.range[0].high = *best;
        if (!caster->field->next(caster->field, &walk, &piece))
            break;
        see(caster, &walk, &piece, &seen);
        for (int i = 0; i < seen.n; i++) {
            double low, high;
            cts_cubic_range(seen.hu[i], &low, &high);
            if (CTS_MUTATED(MODE_EXTREMES))
                low = high = seen.hu[i][0];
            *best = largest ? fmax(*best, high) : fmin(*best, low);
        }
    }
}

/* Where the ray leaves the cell that it is in behind t_mm, and the cell. */
static double leave_cell(const CtsRaycaster *caster, const CtsRay *ray, double t_mm, int cell[3])
{
    double leave_mm = ray->t1_mm;
    for (int a = 0; a < 3; a++) {
        const double step = ray->step_vox[a], at = ray->start_vox[a] + t_mm * step;
        const double face = step > 0 ? floor(at + 1e-9) + 1 : ceil(at - 1e-9) - 1;
        if (step != 0)
            leave_mm = fmin(leave_mm, (face - ray->start_vox[a]) / step);
    }
    leave_mm = fmax(leave_mm, t_mm);
    for (int a = 0; a < 3; a++) {
        const double middle = ray->start_vox[a] + 0.5 * (t_mm + leave_mm) * ray->step_vox[a];
        cell[a] = (int)fmin(fmax(floor(middle), 0), fmax(caster->view.dims[a] - 2, 0));
    }
    return leave_mm;
}

/* The next stretch of the ray from t_mm on that lies in the body; false when there is none. */
static bool next_in_body(const CtsRaycaster *caster, const CtsRay *ray, double t_mm, CtsRay *stretch)
{
    bool inside = false;
    *stretch = *ray;
    while (t_mm < ray->t1_mm) {
        int cell[3];
        const double leave_mm = leave_cell(caster, ray, t_mm, cell);
        const bool body = leave_mm > t_mm && cts_body_mask_has(caster->body, cell);
        if (inside && leave_mm > t_mm && !body)
            break;
        if (body && !inside)
            stretch->t0_mm = t_mm;
        inside = inside || body;
        t_mm = leave_mm > t_mm ? leave_mm : nextafter(t_mm + 1e-12, INFINITY);
        stretch->t1_mm = t_mm;
    }
    stretch->t1_mm = fmin(stretch->t1_mm, ray->t1_mm);
    return inside;
}

bool cts_raycast_extreme(const CtsRaycaster *caster, const CtsRay *ray, double *hu)
{
    const CtsMode mode = caster->preset->mode;
    const bool average = mode == CTS_MODE_AVERAGE && ray->t1_mm > ray->t0_mm;
    double best = mode == CTS_MODE_MIP ? -INFINITY : INFINITY, sum = 0, length = 0;
    CtsRay stretch = *ray;
    bool any = !caster->body || next_in_body(caster, ray, ray->t0_mm, &stretch);
    if (!any)
        return false;
    for (; any; any = caster->body && next_in_body(caster, ray, stretch.t1_mm, &stretch)) {
        if (average)
            add_mean(caster, &stretch, &sum, &length);
        else
            add_extreme(caster, &stretch, &best);
    }
    *hu = average ? sum / length : best;
    return average ? length > 0 : isfinite(best);
}
