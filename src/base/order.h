/* For qsort(): numbers, rising. */
#ifndef CTS_BASE_ORDER_H
#define CTS_BASE_ORDER_H

static inline int cts_by_double(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static inline int cts_by_int(const void *a, const void *b)
{
    const int x = *(const int *)a, y = *(const int *)b;
    return (x > y) - (x < y);
}

#endif
