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

/* Whether the cell that the middle of a piece lies in is looked at. */
static bool in_body(const CtsRaycaster *caster, const CtsRay *ray, const CtsRayPiece *piece)
{
    int cell[3];
    for (int a = 0; a < 3; a++) {
        const double middle = ray->start_vox[a] + 0.5 * (piece->t0_mm + piece->t1_mm) * ray->step_vox[a];
        cell[a] = (int)fmin(fmax(floor(middle), 0), fmax(caster->view.dims[a] - 2, 0));
    }
    return !caster->body || cts_body_mask_has(caster->body, cell);
}

static void see(const CtsRaycaster *caster, const CtsRayWalk *walk, const CtsRayPiece *piece, Seen *seen)
{
    CtsOwnedStretch stretch[CTS_OWNED_STRETCHES] = {{0, 1, CTS_LOOK_PRESET}};
    const int n = !in_body(caster, walk->ray, piece) ? 0
                  : caster->owners                   ? cts_raycast_owned(caster->owners, walk, stretch)
                                                     : 1;
    seen->n = 0;
    for (int i = 0; i < n; i++)
        if (stretch[i].look != CTS_LOOK_HIDDEN) {
            cts_cubic_part(piece->hu, stretch[i].from, stretch[i].to, seen->hu[seen->n]);
            seen->share[seen->n++] = stretch[i].to - stretch[i].from;
        }
}

static bool mean(const CtsRaycaster *caster, const CtsRay *ray, double *hu)
{
    CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRayPiece piece;
    double sum = 0, length = 0;
    while (caster->field->next(caster->field, &walk, &piece)) {
        Seen seen;
        see(caster, &walk, &piece, &seen);
        for (int i = 0; i < seen.n; i++) {
            sum += seen.share[i] * (piece.t1_mm - piece.t0_mm) * cts_cubic_mean(seen.hu[i]);
            length += seen.share[i] * (piece.t1_mm - piece.t0_mm);
        }
    }
    *hu = sum / length;
    return length > 0;
}

static bool extreme(const CtsRaycaster *caster, const CtsRay *ray, bool largest, double *hu)
{
    CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRayPiece piece;
    double best = largest ? -INFINITY : INFINITY;
    while (caster->field->next(caster->field, &walk, &piece)) {
        Seen seen;
        see(caster, &walk, &piece, &seen);
        for (int i = 0; i < seen.n; i++) {
            double low, high;
            cts_cubic_range(seen.hu[i], &low, &high);
            if (CTS_MUTATED(MODE_EXTREMES))
                low = high = seen.hu[i][0];
            best = largest ? fmax(best, high) : fmin(best, low);
        }
        if (largest)
            wanted.range[0].low = nextafter(best, INFINITY);
        else
            wanted.range[0].high = best;
    }
    *hu = best;
    return isfinite(best);
}

bool cts_raycast_extreme(const CtsRaycaster *caster, const CtsRay *ray, double *hu)
{
    const CtsMode mode = caster->preset->mode;
    const bool average = mode == CTS_MODE_AVERAGE && ray->t1_mm > ray->t0_mm;
    return average ? mean(caster, ray, hu) : extreme(caster, ray, mode == CTS_MODE_MIP, hu);
}
