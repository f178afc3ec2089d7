/* For qsort(): numbers and texts, rising; and the extremes of two, and of many. */
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

static inline int cts_compare_text(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

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

/* cts_smaller_double() and so on: the second number unless the first is smaller, or larger, without the call that
 * fmin() and fmax() are. */
#define CTS_EXTREMES(type, name)                                                                                       \
    static inline type cts_smaller_##name(type a, type b)                                                              \
    {                                                                                                                  \
        return a < b ? a : b;                                                                                          \
    }                                                                                                                  \
    static inline type cts_larger_##name(type a, type b)                                                               \
    {                                                                                                                  \
        return a > b ? a : b;                                                                                          \
    }
CTS_EXTREMES(int, int)
CTS_EXTREMES(size_t, size)
CTS_EXTREMES(float, float)
CTS_EXTREMES(double, double)
CTS_EXTREMES(uint16_t, 16)

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
