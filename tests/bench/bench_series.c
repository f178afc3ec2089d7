#include "bench_series.h"

#include <stdio.h>
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

static CtsStatus load(const char *folder, CtsModel *model, CtsError *err)
{
    CtsSeriesList *list = NULL;
    const CtsSeries *series;
    const char *const paths[] = {folder};
    CtsStatus st = cts_series_find(paths, 1, 0, &list, NULL, err);
    if (!st && !(st = cts_series_choose(list, NULL, &series, err)) &&
        !(st = cts_series_load(series, 0, NULL, &model->volume, NULL, err)))
        st = cts_model_prepare(model, 0, err);
    if (st)
        cts_model_free(model);
    cts_series_list_free(&list);
    return st;
}

int bench_main(int argc, char **argv, const char *name, int (*measure)(const CtsModel *model, int rounds))
{
    CtsModel model = {.volume = NULL};
    CtsError err = {0};
    if (argc < 2 || argc > 3) {
        fprintf(stderr, "usage: %s FOLDER [ROUNDS]\n", name);
        return 2;
    }
    if (load(argv[1], &model, &err)) {
        fprintf(stderr, "%s: %s\n", name, err.text);
        return 1;
    }
    const int rounds = argc > 2 ? atoi(argv[2]) : 5;
    printf("%d x %d x %d voxels\n", model.volume->dims[0], model.volume->dims[1], model.volume->dims[2]);
    const int result = measure(&model, rounds < 1 ? 1 : rounds > BENCH_MAX_ROUNDS ? BENCH_MAX_ROUNDS : rounds);
    cts_model_free(&model);
    return result;
}
