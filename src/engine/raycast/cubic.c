#include "engine/raycast/cubic.h"

#include <math.h>

int cts_cubic_turns(const double c[4], double u[2])
{
    /* 3 c3 u^2 + 2 c2 u + c1 = 0, without the cancellation of the schoolbook formula. */
    const double square = c[2] * c[2] - 3 * c[3] * c[1];
    if (square < 0 || (c[1] == 0 && c[2] == 0 && c[3] == 0))
        return 0;
    const double q = -(c[2] + copysign(sqrt(square), c[2]));
    double root[2] = {c[3] != 0 ? q / (3 * c[3]) : NAN, q != 0 ? c[1] / q : NAN};
    if (root[0] > root[1]) {
        const double swap = root[0];
        root[0] = root[1];
        root[1] = swap;
    }
    int n = 0;
    for (int i = 0; i < 2; i++)
        if (root[i] > 0 && root[i] < 1 && (n == 0 || root[i] > u[0]))
            u[n++] = root[i];
    return n;
}

void cts_cubic_range(const double c[4], double *low, double *high)
{
    double turn[2];
    const double at1 = cts_cubic_at(c, 1);
    *low = fmin(c[0], at1);
    *high = fmax(c[0], at1);
    const int n = cts_cubic_turns(c, turn);
    for (int i = 0; i < n; i++) {
        const double value = cts_cubic_at(c, turn[i]);
        *low = fmin(*low, value);
        *high = fmax(*high, value);
    }
}

double cts_cubic_solve(const double c[4], double value, double a, double b)
{
    double fa = cts_cubic_at(c, a) - value, fb = cts_cubic_at(c, b) - value;
    if (fa == 0)
        return a;
    if (fb == 0 || fa == fb)
        return b;
    double u = a + (b - a) * (fa / (fa - fb));
    for (int i = 0; i < 100 && b - a > 1e-16; i++) {
        if (!(u > a && u < b))
            u = 0.5 * (a + b);
        const double f = cts_cubic_at(c, u) - value;
        if (f == 0)
            return u;
        if ((f < 0) == (fa < 0))
            a = u;
        else
            b = u;
        const double slope = (3 * c[3] * u + 2 * c[2]) * u + c[1], last = u;
        u -= f / slope;
        if (fabs(u - last) < 1e-16)
            return last;
        /* Newton may creep along one side of a flat stretch: every third step halves the bracket instead. */
        if (i % 3 == 2)
            u = 0.5 * (a + b);
    }
    return 0.5 * (a + b);
}

int cts_cubic_sign_changes(const double c[4], double u[3])
{
    double split[4] = {0}, turn[2];
    int n_splits = 1, n = 0;
    const int n_turns = cts_cubic_turns(c, turn);
    for (int i = 0; i < n_turns; i++)
        split[n_splits++] = turn[i];
    split[n_splits] = 1;
    for (int i = 0; i < n_splits; i++) {
        const double f0 = cts_cubic_at(c, split[i]), f1 = cts_cubic_at(c, split[i + 1]);
        if ((f0 < 0 && f1 > 0) || (f0 > 0 && f1 < 0)) {
            const double root = cts_cubic_solve(c, 0, split[i], split[i + 1]);
            if (root > 0 && root < 1)
                u[n++] = root;
        }
    }
    return n;
}

void cts_cubic_bezier(const double c[4], double a, double b, double point[4])
{
    const double h = b - a, first = h * ((3 * c[3] * a + 2 * c[2]) * a + c[1]), second = h * h * (3 * c[3] * a + c[2]);
    point[0] = cts_cubic_at(c, a);
    point[1] = point[0] + first / 3;
    point[2] = point[1] + (first + second) / 3;
    point[3] = point[0] + first + second + h * h * h * c[3];
}

void cts_cubic_through(const double at[4], const double value[4], double c[4])
{
    /* Newton's divided differences, then multiplied out from the innermost bracket. */
    double d[4] = {value[0], value[1], value[2], value[3]};
    for (int k = 1; k < 4; k++)
        for (int i = 3; i >= k; i--)
            d[i] = (d[i] - d[i - 1]) / (at[i] - at[i - k]);
    c[0] = d[3];
    c[1] = c[2] = c[3] = 0;
    for (int k = 2; k >= 0; k--) {
        for (int i = 3; i > 0; i--)
            c[i] = c[i - 1] - at[k] * c[i];
        c[0] = d[k] - at[k] * c[0];
    }
}

void cts_cubic_part(const double c[4], double a, double b, double part[4])
{
    const double h = b - a;
    part[0] = cts_cubic_at(c, a);
    part[1] = h * ((3 * c[3] * a + 2 * c[2]) * a + c[1]);
    part[2] = h * h * (3 * c[3] * a + c[2]);
    part[3] = h * h * h * c[3];
}

/* As a Taylor series at from. */
void cts_cubic_in_cell(const double corner[8], const double from[3], const double to[3], double c[4])
{
    const double x = from[0], y = from[1], z = from[2], dx = to[0] - x, dy = to[1] - y, dz = to[2] - z;
    const double kx = corner[1] - corner[0], ky = corner[2] - corner[0], kz = corner[4] - corner[0];
    const double kxy = corner[3] - corner[2] - kx, kxz = corner[5] - corner[4] - kx, kyz = corner[6] - corner[4] - ky;
    const double kxyz = corner[7] - corner[6] - corner[5] + corner[4] - (corner[3] - corner[2] - corner[1] + corner[0]);
    c[0] = corner[0] + kx * x + (ky + kxy * x) * y + (kz + kxz * x + (kyz + kxyz * x) * y) * z;
    c[1] = (kx + kxy * y + kxz * z + kxyz * y * z) * dx + (ky + kxy * x + kyz * z + kxyz * x * z) * dy +
           (kz + kxz * x + kyz * y + kxyz * x * y) * dz;
    c[2] = (kxy + kxyz * z) * dx * dy + (kxz + kxyz * y) * dx * dz + (kyz + kxyz * x) * dy * dz;
    c[3] = kxyz * dx * dy * dz;
}
