#include "engine/raycast/raycaster.h"

#include <math.h>

/* Legendre polynomial of degree n at x in -1..1, and its derivative. */
static double legendre(int n, double x, double *derivative)
{
    double p = 1, before = 0;
    for (int k = 1; k <= n; k++) {
        const double p_next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p;
        p = p_next;
    }
    *derivative = n * (x * p - before) / (x * x - 1);
    return p;
}

/* Value at x of the Lagrange polynomial that is 1 at node j and 0 at the others. */
static double lagrange(const CtsGauss *rule, int j, double x)
{
    double value = 1;
    for (int i = 0; i < rule->n; i++)
        if (i != j)
            value *= (x - rule->node[i]) / (rule->node[j] - rule->node[i]);
    return value;
}

void cts_gauss_init(CtsGauss *rule, int n)
{
    rule->n = n;
    for (int i = 0; i < n; i++) {
        double x = -cos(M_PI * (i + 0.75) / (n + 0.5)), slope;
        for (int step = 0; step < 20; step++)
            x -= legendre(n, x, &slope) / slope;
        legendre(n, x, &slope);
        rule->node[i] = 0.5 * (1 + x);
        rule->weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
    /* The rule itself, squeezed to 0..node k, integrates the Lagrange polynomials exactly. */
    for (int k = 0; k < n; k++)
        for (int j = 0; j < n; j++) {
            double sum = 0;
            for (int i = 0; i < n; i++)
                sum += rule->weight[i] * lagrange(rule, j, rule->node[k] * rule->node[i]);
            rule->upto[k][j] = sum * rule->node[k];
        }
}
