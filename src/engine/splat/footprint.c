#include "engine/splat/footprint.h"

#include "base/enum_table.h"
#include "base/mutation.h"
#include "core/scene/kernel.h"
#include <math.h>

/* Kernels by distance in voxels; the radius is where they end. */
static double tent(double u, double v, double radius)
{
    return fmax(0, 1 - fabs(u) / radius) * fmax(0, 1 - fabs(v) / radius);
}

static double cone(double u, double v, double radius)
{
    return fmax(0, 1 - hypot(u, v) / radius);
}

/* As in the paper: of unit volume, not normalised on the grid, and therefore with ripple. */
static double cone_paper(double u, double v, double radius)
{
    return cone(u, v, radius) * 3 / (M_PI * radius * radius);
}

/* Sigma 0.3 radius: at radius 2 the smallest ripple before normalisation. */
static double gaussian(double u, double v, double radius)
{
    const double sigma = 0.3 * radius, rr = u * u + v * v;
    return rr < radius * radius ? exp(-rr / (2 * sigma * sigma)) : 0;
}

static double bspline_1d(double x)
{
    x = fabs(x);
    if (x < 1)
        return 2.0 / 3 - x * x + x * x * x / 2;
    return x < 2 ? (2 - x) * (2 - x) * (2 - x) / 6 : 0;
}

static double bspline(double u, double v, double radius)
{
    return bspline_1d(2 * u / radius) * bspline_1d(2 * v / radius);
}

typedef double (*Weight)(double u, double v, double radius);

static CTS_ENUM_TABLE(Weight, weights, CTS_N_KERNELS, [CTS_KERNEL_TENT] = tent, [CTS_KERNEL_GAUSSIAN] = gaussian,
                      [CTS_KERNEL_CONE] = cone, [CTS_KERNEL_BSPLINE] = bspline, [CTS_KERNEL_CONE_PAPER] = cone_paper);

typedef struct Phase {
    int n;
    uint32_t *weight[(2 * CTS_MAX_KERNEL_RADIUS) * (2 * CTS_MAX_KERNEL_RADIUS)];
    double unrounded[(2 * CTS_MAX_KERNEL_RADIUS) * (2 * CTS_MAX_KERNEL_RADIUS)];
    double sum;
} Phase;

static void collect_phase(CtsFootprint *f, CtsKernelId kernel, double radius, int phase_u, int phase_v, Phase *phase)
{
    const int mu = f->density[0], mv = f->density[1];
    *phase = (Phase){0};
    for (int v = -f->reach[1]; v <= f->reach[1]; v++)
        for (int u = -f->reach[0]; u <= f->reach[0]; u++) {
            if ((u & (mu - 1)) != phase_u || (v & (mv - 1)) != phase_v)
                continue;
            const double w = weights[kernel]((double)u / mu, (double)v / mv, radius);
            if (w <= 0)
                continue;
            phase->weight[phase->n] = &f->weight[v + f->reach[1]][u + f->reach[0]];
            phase->unrounded[phase->n++] = w;
            phase->sum += w;
        }
}

/* Round down, then give the missing units to the largest remainders, the first of equal ones. */
static void normalise_phase(Phase *p)
{
    uint32_t missing = CTS_WEIGHT_ONE;
    for (int i = 0; i < p->n; i++) {
        p->unrounded[i] *= CTS_WEIGHT_ONE / p->sum;
        *p->weight[i] = (uint32_t)p->unrounded[i];
        missing -= *p->weight[i];
        p->unrounded[i] -= *p->weight[i];
    }
    for (; missing > 0; missing--) {
        int most = 0;
        for (int i = 1; i < p->n; i++)
            most = p->unrounded[i] > p->unrounded[most] + 1e-9 ? i : most;
        ++*p->weight[most];
        p->unrounded[most] -= 1;
    }
}

CtsStatus cts_footprint_init(CtsFootprint *f, CtsKernelId kernel, double radius, const int density[2], CtsError *err)
{
    radius = cts_kernel_radius(kernel, radius);
    const CtsStatus st = cts_setting_check(CTS_SETTING_KERNEL_RADIUS, radius, err);
    if (st)
        return st;
    *f = (CtsFootprint){.density = {density[0], density[1]}, .apron = (int)ceil(radius) - 1};
    for (int c = 0; c < 2; c++)
        f->reach[c] = (int)ceil(radius * density[c]) - 1;
    f->sum_low = UINT32_MAX;
    for (int pv = 0; pv < density[1]; pv++)
        for (int pu = 0; pu < density[0]; pu++) {
            Phase phase;
            uint32_t sum = 0;
            collect_phase(f, kernel, radius, pu, pv, &phase);
            if (kernel != CTS_KERNEL_CONE_PAPER && !CTS_MUTATED(FOOTPRINT_SUM))
                normalise_phase(&phase);
            for (int i = 0; i < phase.n; i++) {
                if (kernel == CTS_KERNEL_CONE_PAPER || CTS_MUTATED(FOOTPRINT_SUM))
                    *phase.weight[i] = (uint32_t)floor(phase.unrounded[i] * CTS_WEIGHT_ONE + 0.5);
                sum += *phase.weight[i];
            }
            f->sum_low = sum < f->sum_low ? sum : f->sum_low;
            f->sum_high = sum > f->sum_high ? sum : f->sum_high;
        }
    return CTS_OK;
}
