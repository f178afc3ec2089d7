/* For qsort(): numbers, rising; and the extremes of many. */
#pragma once

static inline int cts_compare_double(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static inline int cts_compare_int(const void *a, const void *b)
{
    const int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

/* Extremes of a loop's values, NaN left out as by fmax() and fmin(): where gcc 12 vectorises these as reductions for
 * AArch64, it ends with an internal error. */
static inline void cts_raise_to(double *largest, double v)
{
    if (v > *largest)
        *largest = v;
}

static inline void cts_lower_to(double *smallest, double v)
{
    if (v < *smallest)
        *smallest = v;
}
