#include "bench_series.h"

#include <stdlib.h>

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double bench_median(double *values, int n)
{
    qsort(values, (size_t)n, sizeof *values, by_value);
    return values[n / 2];
}

int bench_rounds(const char *text, int by_default)
{
    const int asked = text ? atoi(text) : by_default;
    return asked < 1 ? 1 : asked > BENCH_MAX_ROUNDS ? BENCH_MAX_ROUNDS : asked;
}

CtsStatus bench_load(const char *folder, CtsVolume **volume, CtsError *err)
{
    CtsSeriesList *list = NULL;
    const CtsSeries *series;
    const char *const paths[] = {folder};
    CtsStatus st = cts_series_find(paths, 1, 0, &list, NULL, err);
    if (!st && !(st = cts_series_choose(list, NULL, &series, err)) &&
        !(st = cts_series_load(series, 0, NULL, volume, NULL, err)))
        st = cts_volume_prepare(*volume, 0, err);
    if (st)
        cts_volume_free(volume);
    cts_series_list_free(&list);
    return st;
}
