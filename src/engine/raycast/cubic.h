/* Cubic polynomials on 0..1, the form of a trilinear field along a ray inside one cell: c[0] + c[1] u + c[2] u^2 + c[3]
 * u^3. */
#pragma once

static inline double cts_cubic_at(const double c[4], double u)
{
    return ((c[3] * u + c[2]) * u + c[1]) * u + c[0];
}

/* Mean over 0..1. */
static inline double cts_cubic_mean(const double c[4])
{
    return c[0] + c[1] / 2 + c[2] / 3 + c[3] / 4;
}

/* Turning points strictly inside 0..1 in rising order; returns how many (0 to 2). */
int cts_cubic_turns(const double c[4], double u[2]);

/* Smallest and largest value on 0..1. */
void cts_cubic_range(const double c[4], double *low, double *high);

/* The root of polynomial = value on [a, b], on which it is monotone and whose end values lie on either side. */
double cts_cubic_solve(const double c[4], double value, double a, double b);

/* Zeros strictly inside 0..1 at which the sign changes, in rising order; returns how many (0 to 3). */
int cts_cubic_sign_changes(const double c[4], double u[3]);

/* The four Bezier points of the polynomial on a..b: it stays within their hull. */
void cts_cubic_bezier(const double c[4], double a, double b, double point[4]);

/* The restriction to a..b as a cubic on 0..1. */
void cts_cubic_part(const double c[4], double a, double b, double part[4]);

/* Trilinear interpolation of a cell's eight voxels along a line from -> to within it: a cubic, exactly. Bit a of a
 * voxel's number is its position along axis a. */
void cts_cubic_in_cell(const double corner[8], const double from[3], const double to[3], double c[4]);

/* The cubic through value[i] at u = at[i]. */
void cts_cubic_through(const double at[4], const double value[4], double c[4]);
