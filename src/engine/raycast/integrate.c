/* Emission and absorption along one cubic segment of a ray: C = integral of c t exp(-integral of t). */
#include "base/compare.h"
#include "base/mutation.h"
#include "base/vec3.h"
#include "core/scene/openness.h"
#include "engine/raycast/cubic.h"
#include "engine/raycast/raycaster.h"
#include <math.h>
#include <stdlib.h>

/* Largest change by refining an interval, in display values: many intervals add up to 1e-7 at most along a ray, and the
 * finer rule, which is used, has a far smaller error than the difference of the two rules. A ray ends at transmittance
 * MIN_TRANSMITTANCE. */
#define TOLERANCE 1e-9
#define MIN_TRANSMITTANCE 1e-12

/* An interval of larger optical depth is halved before evaluation, so that a ray ends near its front. */
#define DEEP 8.0

typedef struct Interval {
    const CtsRaycaster *caster;
    const CtsTransfer *transfer;
    const CtsRay *ray;
    const CtsRaySegment *segment;
    const double (*gradient)[4]; /* NULL unlit */
    double framed[3][4];         /* the gradient in the caster's frame */
    const CtsSpan *span;         /* HU stays within it */
    CtsRaySum *light;
} Interval;

typedef struct Sum {
    double rgb[3], depth;
} Sum;

static double extinction_at(const Interval *s, double hu)
{
    const CtsSpan *span = s->span;
    if (span->flat_extinction)
        return span->extinction_per_mm;
    return cts_transfer_extinction(s->transfer, span->opacity + (hu - span->at_hu) * span->opacity_slope);
}

static double interval_openness_at(const Interval *s, double u)
{
    const double t_mm = s->segment->t0_mm + u * (s->segment->t1_mm - s->segment->t0_mm);
    double vox[3];
    if (!s->caster->openness)
        return 1;
    for (int axis = 0; axis < 3; axis++)
        vox[axis] = s->ray->start_vox[axis] + t_mm * s->ray->step_vox[axis];
    return cts_openness_at(s->caster->openness, vox);
}

static void colour_at(const Interval *s, double u, double hu, double rgb[3])
{
    const CtsSpan *span = s->span;
    for (int c = 0; c < 3; c++)
        rgb[c] = span->rgb[c] + (hu - span->at_hu) * span->rgb_slope[c];
    if (s->gradient) {
        double g[3];
        for (int axis = 0; axis < 3; axis++)
            g[axis] = cts_cubic_at(s->gradient[axis], u);
        cts_raycast_shade(s->caster, g, interval_openness_at(s, u), rgb);
    }
}

/* Extinction times length at the rule's nodes on a..b; returns the optical depth. */
static double depth_of(const Interval *s, const CtsGauss *rule, double a, double b, double hu[], double density[])
{
    const double mm = (b - a) * (s->segment->t1_mm - s->segment->t0_mm);
    double depth = 0;
    for (int k = 0; k < rule->n; k++) {
        hu[k] = cts_cubic_at(s->segment->hu, a + (b - a) * rule->node[k]);
        density[k] = extinction_at(s, hu[k]) * mm;
        depth += rule->weight[k] * density[k];
    }
    return depth;
}

static void sum_colour(const Interval *s, const CtsGauss *rule, double a, double b, const double hu[],
                       const double density[], Sum *sum)
{
    sum->rgb[0] = sum->rgb[1] = sum->rgb[2] = 0;
    for (int k = 0; k < rule->n; k++) {
        double before = 0, rgb[3];
        for (int j = 0; j < rule->n; j++)
            before += rule->upto[k][j] * density[j];
        const double share = rule->weight[k] * density[k] * exp(-before);
        colour_at(s, a + (b - a) * rule->node[k], hu[k], rgb);
        for (int c = 0; c < 3; c++)
            sum->rgb[c] += share * rgb[c];
    }
}

/* Interval a..b of the segment. Depth of the surface: where half of the light is absorbed, or else the first visible
 * point. */
static bool add_light(const Interval *s, double a, double b, const double rgb[3], double depth)
{
    CtsRaySum *light = s->light;
    if (light->depth < M_LN2 && light->depth + depth >= M_LN2) {
        const double at = a + (b - a) * ((M_LN2 - light->depth) / depth);
        light->surface_mm = s->segment->t0_mm + at * (s->segment->t1_mm - s->segment->t0_mm);
    }
    for (int c = 0; c < 3; c++)
        light->rgb[c] += light->transmittance * rgb[c];
    light->depth += depth;
    light->transmittance = exp(-light->depth);
    return light->transmittance >= MIN_TRANSMITTANCE;
}

/* One colour and one extinction: the closed form. */
static bool add_uniform(const Interval *s, double a, double b)
{
    const double depth = s->span->extinction_per_mm * (b - a) * (s->segment->t1_mm - s->segment->t0_mm);
    const double alpha = -expm1(-depth);
    double rgb[3];
    for (int c = 0; c < 3; c++)
        rgb[c] = alpha * s->span->rgb[c];
    return add_light(s, a, b, rgb, depth);
}

/* Two rules may agree because both missed a highlight between their nodes, or a normal that reverses where the gradient
 * nearly vanishes: excluded where the normal varies little, or where the largest possible highlight is negligible. */
static bool resolves_shading(const Interval *s, double a, double b, double depth)
{
    const CtsPreset *p = s->caster->preset;
    return !s->gradient || depth * s->light->transmittance * (p->ambient + p->diffuse + p->specular) <= TOLERANCE ||
           cts_raycast_normal_is_steady(s->caster, s->framed, a, b);
}

/* a..b of the segment, halved until two rules agree. False when the ray has ended. */
static bool add_to_tolerance(const Interval *s, double a, double b)
{
    const CtsRaycaster *caster = s->caster;
    double hu[CTS_GAUSS_FINE], density[CTS_GAUSS_FINE];
    Sum coarse, fine;
    const bool halve = b - a > 1e-14;
    coarse.depth = depth_of(s, &caster->coarse, a, b, hu, density);
    if (!(coarse.depth > DEEP && halve)) {
        const double left = s->light->transmittance;
        sum_colour(s, &caster->coarse, a, b, hu, density, &coarse);
        fine.depth = depth_of(s, &caster->fine, a, b, hu, density);
        sum_colour(s, &caster->fine, a, b, hu, density, &fine);
        double change = fabs(fine.depth - coarse.depth);
        for (int c = 0; c < 3; c++)
            change = fmax(change, fabs(fine.rgb[c] - coarse.rgb[c]));
        if ((change * left <= TOLERANCE && resolves_shading(s, a, b, fine.depth)) || !halve)
            return add_light(s, a, b, fine.rgb, fine.depth);
    }
    const double middle = 0.5 * (a + b);
    return add_to_tolerance(s, a, middle) && add_to_tolerance(s, middle, b);
}

static bool add_span(const Interval *s, double a, double b)
{
    if (!(b > a) || !s->span->visible)
        return true;
    if (s->light->surface_mm == INFINITY)
        s->light->surface_mm = s->segment->t0_mm + a * (s->segment->t1_mm - s->segment->t0_mm);
    if (s->span->flat_extinction && s->span->flat_colour && !s->gradient)
        return add_uniform(s, a, b);
    return add_to_tolerance(s, a, b);
}

/* a..b, on which HU is monotone: from span to span. The next span is found by counting, not by looking up a rounded HU,
 * so that a step is crossed exactly once. */
static bool add_monotone(Interval *s, double a, double b)
{
    const CtsTransfer *transfer = s->transfer;
    const double *hu = s->segment->hu;
    const double from = cts_cubic_at(hu, a), to = cts_cubic_at(hu, b);
    const bool falls = to < from;
    int i = falls ? cts_transfer_find_below(transfer, from) : cts_transfer_find(transfer, from);
    for (;;) {
        s->span = &transfer->spans[i];
        const double control_point = falls ? s->span->low_hu : s->span->high_hu;
        if (CTS_MUTATED(CONTROL_POINTS) || (falls ? control_point <= to : control_point >= to))
            return add_span(s, a, b);
        const double split = cts_cubic_solve(hu, control_point, a, b);
        if (!add_span(s, a, split))
            return false;
        a = split;
        i += falls ? -1 : 1;
    }
}

/* Boundaries between blocks of the openness, where its slope changes; at most one along each axis, as within a cell.
 * The quadrature rules find those that longer segments cross besides. */
static int split_at_blocks(const Interval *s, double *split)
{
    const CtsOpenness *const o = s->caster->openness;
    const double length_mm = s->segment->t1_mm - s->segment->t0_mm;
    int n = 0;
    for (int axis = 0; axis < 3 && o; axis++) {
        const double from =
            (s->ray->start_vox[axis] + s->segment->t0_mm * s->ray->step_vox[axis]) * o->scale[axis] + o->shift[axis];
        const double along = s->ray->step_vox[axis] * length_mm * o->scale[axis];
        const double at = (along > 0 ? floor(from) + 1 - from : ceil(from) - 1 - from) / along;
        if (along != 0 && at > 0 && at < 1)
            split[n++] = at;
    }
    return n;
}

/* Positions at which the segment is split: extremes of HU, changes of the side that faces the camera and of the
 * openness's slope. */
enum { MAX_SPLITS = 1 + 2 + 3 + 3 + 1 };
static int find_interval_splits(const Interval *s, double split[MAX_SPLITS])
{
    int n = 0;
    split[n++] = 0;
    n += CTS_MUTATED(TURNS) ? 0 : cts_cubic_turns(s->segment->hu, split + n);
    if (s->gradient) {
        n += cts_cubic_sign_changes(s->framed[2], split + n);
        n += split_at_blocks(s, split + n);
        qsort(split, (size_t)n, sizeof *split, cts_compare_double);
    }
    split[n] = 1;
    return n;
}

bool cts_raycast_segment(const CtsRaycaster *caster, const CtsTransfer *transfer, const CtsRay *ray,
                         const CtsRaySegment *segment, const double (*gradient)[4], CtsRaySum *light)
{
    Interval s = {
        .caster = caster, .transfer = transfer, .ray = ray, .segment = segment, .gradient = gradient, .light = light};
    double split[MAX_SPLITS];
    for (int i = 0; i < 4 && gradient; i++) {
        const double g[3] = {gradient[0][i], gradient[1][i], gradient[2][i]};
        for (int axis = 0; axis < 3; axis++)
            s.framed[axis][i] = cts_dot3(caster->frame[axis], g);
    }
    const int n = find_interval_splits(&s, split);
    for (int i = 0; i < n; i++)
        if (!add_monotone(&s, split[i], split[i + 1]))
            return false;
    return true;
}
