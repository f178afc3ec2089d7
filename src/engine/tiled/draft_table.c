#include "engine/tiled/draft_table.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>

enum { N = CTS_DRAFT_LEVELS, OUTER = N / 8 /* levels before, and behind, what changes */ };

typedef struct Means {
    const CtsSlabTable *table;
    double at[N]; /* levels as places in the table, which may lie outside of it */
    float (*mean)[4];
} Means;

/* Integral over entries up to `at`; beyond the table nothing is visible. */
static double sum_to(const CtsSlabTable *t, double at, int channel)
{
    if (at <= 0)
        return 0;
    if (at >= t->n)
        return t->sum[t->n][channel];
    const int i = (int)at;
    return t->sum[i][channel] + (at - i) * (t->sum[i + 1][channel] - t->sum[i][channel]);
}

/* The mean over what lies between two levels, and of one level over what is nearest to it. */
static void find_mean(const Means *m, int from, int to, float mean[4])
{
    const CtsSlabTable *t = m->table;
    double low = fmin(m->at[from], m->at[to]), high = fmax(m->at[from], m->at[to]);
    if (from == to) {
        low -= 0.5 * (from > 0 ? m->at[from] - m->at[from - 1] : 0);
        high += 0.5 * (to < N - 1 ? m->at[to + 1] - m->at[to] : 0);
    }
    if (!(high > low)) { /* one level is all that there is */
        const float *here = t->here[low > 0 ? (low < t->n ? (int)low : t->n - 1) : 0];
        for (int c = 0; c < 3; c++)
            mean[c] = here[3] > 0 ? here[c] / here[3] : 0;
        mean[3] = here[3];
        return;
    }
    const double extinction = sum_to(t, high, 3) - sum_to(t, low, 3);
    for (int c = 0; c < 3; c++)
        mean[c] = extinction > 0 ? (float)((sum_to(t, high, c) - sum_to(t, low, c)) / extinction) : 0;
    mean[3] = (float)(extinction / (high - low));
}

static void find_means(void *context, int worker, size_t first, size_t end)
{
    const Means *const m = context;
    (void)worker;
    for (size_t from = first; from < end; from++)
        for (int to = 0; to < N; to++)
            find_mean(m, (int)from, to, m->mean[from * N + (size_t)to]);
}

/* The entries between which the transfer function changes. */
static void find_changing(const CtsSlabTable *t, double *low, double *high)
{
    const float *const at_end = t->change[t->n];
    int first = 0, last = t->n;
    while (last > 0 && t->change[last - 1][0] == at_end[0] && t->change[last - 1][1] == at_end[1])
        last--;
    while (first < last && t->change[first + 1][0] == 0 && t->change[first + 1][1] == 0)
        first++;
    *low = first;
    *high = last;
}

/* What changes gets most of the levels. */
static void lay_ranges(CtsDraftTable *d, const CtsSlabTable *t, CtsRange range, double at[N])
{
    double inner[2];
    find_changing(t, &inner[0], &inner[1]);
    const double low = (double)range.low, high = (double)range.high;
    const double a = fmin(fmax(t->grey_low + inner[0] / t->per_grey, low), high);
    const double b = fmin(fmax(t->grey_low + inner[1] / t->per_grey, a), high);
    const double start[3] = {low, a, b}, end[3] = {a, b, high};
    int levels[3] = {a > low ? OUTER : 0, N - 1, b < high ? OUTER : 0}, n = 0;
    levels[1] = b > a ? levels[1] - levels[0] - levels[2] : 0;
    for (int i = 0; i < CTS_DRAFT_RANGES; i++) {
        const double length = end[i] - start[i];
        d->start[i] = (float)start[i];
        d->length[i] = (float)length;
        d->per_grey[i] = length > 0 ? (float)(levels[i] / length) : 0;
        for (int k = 0; k < levels[i]; k++)
            at[n++] = (start[i] + length * k / levels[i] - (double)t->grey_low) * (double)t->per_grey;
    }
    while (n < N)
        at[n++] = (high - (double)t->grey_low) * (double)t->per_grey;
}

CtsStatus cts_draft_table_init(CtsDraftTable *draft, const CtsSlabTable *table, CtsRange range, int n_threads,
                               CtsError *err)
{
    CtsStatus st;
    *draft = (CtsDraftTable){0};
    if ((st = cts_alloc_array(&draft->mean, (size_t)N * N, err)))
        return st;
    Means means = {.table = table, .mean = draft->mean};
    lay_ranges(draft, table, range, means.at);
    cts_parallel(n_threads, N, 0, find_means, &means);
    return CTS_OK;
}

void cts_draft_table_free(CtsDraftTable *draft)
{
    cts_free(&draft->mean);
}
