/* Volumes of solids that formulas describe. */
#pragma once

#include "ctsplat/volume.h"
#include "unit.h"
#include <math.h>
#include <stdbool.h>
#include <string.h>

/* A solid is a signed distance in mm, negative inside, of a point in LPS mm. */
typedef double (*Distance)(const double p[3], const double *a);

typedef struct Solid {
    Distance distance;
    double a[8];
    double hu;
    bool patient;
} Solid;

typedef struct Scene {
    const Solid *solids;
    int n_solids;
    int dims[3];
    double step_lps[3][3], centre_lps[3];
    double hu_step;
} Scene;

/* a: centre, radii. Near the surface the value is a distance to within a few percent. */
static inline double ellipsoid(const double p[3], const double *a)
{
    double q = 0, g = 0;
    for (int c = 0; c < 3; c++) {
        const double x = (p[c] - a[c]) / a[3 + c];
        q += x * x;
        g += x * x / (a[3 + c] * a[3 + c]);
    }
    return g > 0 ? sqrt(q) * (sqrt(q) - 1) / sqrt(g) : -fmin(fmin(a[3], a[4]), a[5]);
}

/* a: centre, half sizes. */
static inline double box(const double p[3], const double *a)
{
    double d = -INFINITY;
    for (int c = 0; c < 3; c++)
        d = fmax(d, fabs(p[c] - a[c]) - a[3 + c]);
    return d;
}

/* Along z. a: x, y, outer radius, inner radius, z from, z to. */
static inline double pipe(const double p[3], const double *a)
{
    const double r = hypot(p[0] - a[0], p[1] - a[1]);
    return fmax(fmax(r - a[2], a[3] - r), fmax(a[4] - p[2], p[2] - a[5]));
}

/* The part of a pipe with y beyond a[4] (a[5] = 1) or before it (-1): a head holder. */
static inline double trough(const double p[3], const double *a)
{
    const double r = hypot(p[0] - a[0], p[1] - a[1]);
    return fmax(fmax(r - a[2], a[3] - r), a[5] * (a[4] - p[1]));
}

/* A cloth over the patient: y = a[0] + a[1] sin(x / a[2]), half as thick as a[3], |x| below a[4]. */
static inline double cloth(const double p[3], const double *a)
{
    return fmax(fabs(p[1] - a[0] - a[1] * sin(p[0] / a[2])) - a[3], fabs(p[0]) - a[4]);
}

/* A thin shell in front of a face. a: centre, radii, half its thickness, and it ends behind this y. */
static inline double mask(const double p[3], const double *a)
{
    return fmax(fabs(ellipsoid(p, a)) - a[6], p[1] - a[7]);
}

/* A table as PET scanners have it: a closed shell. a: x, y, half sizes, thickness. */
static inline double hollow(const double p[3], const double *a)
{
    const double outer = fmax(fabs(p[0] - a[0]) - a[2], fabs(p[1] - a[1]) - a[3]);
    return fmax(outer, -outer - a[4]);
}

static inline void voxel_lps(const Scene *s, int i, int j, int k, double p[3])
{
    const int at[3] = {i, j, k};
    for (int c = 0; c < 3; c++) {
        p[c] = s->centre_lps[c];
        for (int axis = 0; axis < 3; axis++)
            p[c] += (at[axis] - 0.5 * (s->dims[axis] - 1)) * s->step_lps[axis][c];
    }
}

/* The partial-volume ramp: full at 1 mm inside, air at 1 mm outside. */
static inline double solid_hu(const Solid *s, const double p[3])
{
    const double share = fmin(fmax(0.5 - 0.5 * s->distance(p, s->a), 0), 1);
    return -1000 + share * (s->hu + 1000);
}

static inline CtsVolume *make(const Scene *s)
{
    CtsVolume *v;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, s->dims[0], s->dims[1], s->dims[2], &err), CTS_OK);
    memcpy(v->step_lps, s->step_lps, sizeof v->step_lps);
    voxel_lps(s, 0, 0, 0, v->origin_lps);
    v->hu_step = s->hu_step > 0 ? s->hu_step : 1;
    uint16_t *grey = v->grey;
    for (int k = 0; k < s->dims[2]; k++)
        for (int j = 0; j < s->dims[1]; j++)
            for (int i = 0; i < s->dims[0]; i++) {
                double p[3], hu = -1000;
                voxel_lps(s, i, j, k, p);
                for (int n = 0; n < s->n_solids; n++)
                    hu = fmax(hu, solid_hu(&s->solids[n], p));
                *grey++ = (uint16_t)lround((hu - v->hu_offset) / v->hu_step);
            }
    return v;
}

static inline CtsVolume *copy(const CtsVolume *v)
{
    CtsVolume *w;
    CtsError err;
    assert_int_equal(cts_volume_new(&w, v->dims[0], v->dims[1], v->dims[2], &err), CTS_OK);
    uint16_t *grey = w->grey;
    *w = *v;
    w->grey = grey;
    memcpy(grey, v->grey, cts_volume_n_voxels(v) * sizeof *grey);
    return w;
}

/* The smallest distance to a solid that belongs to the patient, or does not. */
static inline double distance_to(const Scene *s, const double p[3], bool patient)
{
    double d = INFINITY;
    for (int n = 0; n < s->n_solids; n++)
        if (s->solids[n].patient == patient)
            d = fmin(d, s->solids[n].distance(p, s->solids[n].a));
    return d;
}
