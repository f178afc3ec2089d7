/* The largest, smallest and mean HU along a ray, exactly: extremes and means of cubics. */
#include "base/mutation.h"
#include "core/model/body_mask.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/raycaster.h"
#include <math.h>

/* The visible part of a segment: n cubics, of this share of its length each. */
typedef struct VisibleParts {
    int n;
    double hu[CTS_MAX_RAY_INTERVALS][4], share[CTS_MAX_RAY_INTERVALS];
} VisibleParts;

/* The crossings of a segment with the body's boundary, and its ends; the body's mask minus its level there, as a cubic.
 * Returns the number of intervals. */
static int body_splits(const CtsRaycaster *caster, const CtsRay *ray, const CtsRaySegment *segment, double above[4],
                       double split[5])
{
    double corner[8], from[3], to[3];
    int cell[3], n = 0;
    split[0] = 0;
    above[0] = 1;
    for (int m = 1; m < 4; m++)
        above[m] = 0;
    for (int a = 0; a < 3 && caster->body; a++) {
        const double start = ray->start_vox[a] + segment->t0_mm * ray->step_vox[a];
        const double end = ray->start_vox[a] + segment->t1_mm * ray->step_vox[a];
        cell[a] = (int)fmin(fmax(floor(0.5 * (start + end)), 0), fmax(caster->view.dims[a] - 2, 0));
        from[a] = cts_body_mask_place(caster->body, a, cell[a], start - cell[a]);
        to[a] = cts_body_mask_place(caster->body, a, cell[a], end - cell[a]);
    }
    if (caster->body) {
        cts_body_mask_corners(caster->body, cell, corner);
        cts_cubic_in_cell(corner, from, to, above);
        above[0] -= CTS_BODY_THRESHOLD;
        n = cts_cubic_sign_changes(above, split + 1);
    }
    split[n + 1] = 1;
    return n + 1;
}

static void add_segment(const CtsRaycaster *caster, const CtsRayWalk *walk, const CtsRaySegment *segment,
                        VisibleParts *visible)
{
    CtsRayInterval interval[CTS_MAX_RAY_INTERVALS] = {{0, 1, CTS_APPEARANCE_PRESET}};
    double above[4], split[5];
    const int n_body = body_splits(caster, walk->ray, segment, above, split);
    const int n = caster->voxel_labels ? cts_raycast_label_intervals(caster->voxel_labels, walk, interval) : 1;
    visible->n = 0;
    for (int i = 0; i < n; i++)
        for (int b = 0; b < n_body && visible->n < CTS_MAX_RAY_INTERVALS; b++) {
            const double from = fmax(interval[i].from, split[b]), to = fmin(interval[i].to, split[b + 1]);
            const bool body = cts_cubic_at(above, 0.5 * (split[b] + split[b + 1])) > 0;
            if (interval[i].appearance == CTS_APPEARANCE_HIDDEN || !body || from >= to)
                continue;
            cts_cubic_part(segment->hu, from, to, visible->hu[visible->n]);
            visible->share[visible->n++] = to - from;
        }
}

bool cts_raycast_extreme(const CtsRaycaster *caster, const CtsRay *ray, double *hu)
{
    const CtsMode mode = caster->preset->mode;
    const bool is_mean = mode == CTS_MODE_AVERAGE && ray->t1_mm > ray->t0_mm, largest = mode == CTS_MODE_MIP;
    CtsHuRanges wanted = {.n = 1, .range = {{-INFINITY, INFINITY}}};
    CtsRayWalk walk = {.ray = ray, .wanted = &wanted, .t_mm = ray->t0_mm};
    CtsRaySegment segment;
    double sum = 0, length = 0, best = largest ? -INFINITY : INFINITY;
    while (caster->field->next(caster->field, &walk, &segment)) {
        VisibleParts visible;
        add_segment(caster, &walk, &segment, &visible);
        for (int i = 0; i < visible.n; i++) {
            const double part = visible.share[i] * (segment.t1_mm - segment.t0_mm);
            double low, high;
            length += part;
            if (is_mean) {
                sum += part * cts_cubic_mean(visible.hu[i]);
                continue;
            }
            cts_cubic_range(visible.hu[i], &low, &high);
            if (CTS_MUTATED(MODE_EXTREMES))
                low = high = visible.hu[i][0];
            best = largest ? fmax(best, high) : fmin(best, low);
        }
        if (largest)
            wanted.range[0].low = nextafter(best, INFINITY);
        else if (!is_mean)
            wanted.range[0].high = best;
    }
    *hu = is_mean ? sum / length : best;
    return is_mean ? length > 0 : isfinite(best);
}
