/* 3-vectors in double. */
#pragma once

#include <math.h>

static inline double cts_dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void cts_cross3(const double a[3], const double b[3], double out[3])
{
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

static inline void cts_sub3(const double a[3], const double b[3], double out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = a[c] - b[c];
}

static inline double cts_norm3(const double a[3])
{
    return sqrt(cts_dot3(a, a));
}

/* Scales to length 1. */
static inline void cts_unit3(double a[3])
{
    const double length = cts_norm3(a);
    for (int c = 0; c < 3; c++)
        a[c] /= length;
}

/* out = M v, rows first. */
static inline void cts_apply3(const double m[3][3], const double v[3], double out[3])
{
    const double x = cts_dot3(m[0], v), y = cts_dot3(m[1], v), z = cts_dot3(m[2], v);
    out[0] = x;
    out[1] = y;
    out[2] = z;
}
