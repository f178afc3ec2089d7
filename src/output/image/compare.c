/* Comparison of two pictures. SSIM is Wang's: Gaussian windows of 11 x 11 pixels, sigma 1.5, K1 0.01, K2 0.03, range 1,
 * over the windows that lie wholly inside, as the mean of red, green and blue. */
#include "ctsplat/picture.h"

#include "base/clamp.h"
#include "base/compare.h"
#include "base/mem.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RADIUS = 5, N_MOMENTS = 5 };

/* Channel c of pixel i of a grey or colour picture. */
static float value(const CtsPicture *p, size_t i, int c)
{
    if (p->n_channels == 1)
        return c == 3 ? 1 : p->pixels[i];
    return c == 3 && !p->has_alpha ? 1 : p->pixels[4 * i + c];
}

/* Not a number against a number is as wrong as can be. */
static float gap(float a, float b)
{
    if (isnan(a) || isnan(b))
        return isnan(a) && isnan(b) ? 0 : 1;
    return (float)fabs(cts_clamp01(a) - cts_clamp01(b));
}

static bool same_value(float a, float b)
{
    return a == b || (isnan(a) && isnan(b));
}

static bool same_pictures(const CtsPicture *a, const CtsPicture *b)
{
    const size_t n = (size_t)a->width * a->height;
    for (size_t i = 0; i < n; i++) {
        for (int c = 0; c < 4; c++)
            if (!same_value(value(a, i, c), value(b, i, c)))
                return false;
        if (a->depth_mm && b->depth_mm && !same_value(a->depth_mm[i], b->depth_mm[i]))
            return false;
    }
    return true;
}

static CtsStatus errors_of(const CtsPicture *a, const CtsPicture *b, CtsDifference *d, CtsError *err)
{
    const size_t n = (size_t)a->width * a->height,
                 n_passed = 3 * n / 1000; /* of the samples by the 99.9th percentile */
    double *gaps, sum = 0;                /* above 0, as most are not */
    size_t n_gaps = 0, n_above = 0;
    const CtsStatus st = cts_alloc_array(&gaps, 3 * n, err);
    if (st)
        return st;
    for (size_t i = 0; i < n; i++) {
        double worst = 0;
        for (int c = 0; c < 3; c++) {
            const double e = gaps[n_gaps] = gap(value(a, i, c), value(b, i, c));
            n_gaps += e > 0;
            sum += e * e;
            worst = e > worst ? e : worst;
        }
        n_above += worst > 1.0f / 255;
        d->max = worst > d->max ? worst : d->max;
    }
    d->rmse = sqrt(sum / (3.0 * (double)n));
    d->psnr_db = d->rmse > 0 ? -20 * log10(d->rmse) : INFINITY;
    d->share = (double)n_above / (double)n;
    qsort(gaps, n_gaps, sizeof *gaps, cts_compare_double);
    d->p999 = n_gaps > n_passed ? gaps[n_gaps - 1 - n_passed] : 0;
    cts_free(&gaps);
    return CTS_OK;
}

/* Windows of one direction: weights, and the positions evaluated: those that fit, or, in a picture smaller than a
 * window, all, truncated at the border. */
typedef struct ComparedWindows {
    double weights[2 * RADIUS + 1];
    int size, first, last;
} ComparedWindows;

static ComparedWindows compared_windows(int size)
{
    ComparedWindows w = {.size = size, .first = 0, .last = size - 1};
    double sum = 0;
    for (int k = -RADIUS; k <= RADIUS; k++)
        sum += w.weights[k + RADIUS] = exp(-0.5 * k * k / (1.5 * 1.5));
    for (int k = 0; k <= 2 * RADIUS; k++)
        w.weights[k] /= sum;
    if (size > 2 * RADIUS) {
        w.first = RADIUS;
        w.last = size - 1 - RADIUS;
    }
    return w;
}

static int window_start(const ComparedWindows *w, int at, int *end, double *norm)
{
    const int start = at < RADIUS ? 0 : at - RADIUS;
    *end = at + RADIUS >= w->size ? w->size - 1 : at + RADIUS;
    double sum = 0;
    for (int k = start; k <= *end; k++)
        sum += w->weights[k - at + RADIUS];
    *norm = 1 / sum;
    return start;
}

static double similarity(const double m[N_MOMENTS])
{
    const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    const double var_a = m[2] - m[0] * m[0], var_b = m[3] - m[1] * m[1], covariance = m[4] - m[0] * m[1];
    return (2 * m[0] * m[1] + c1) * (2 * covariance + c2) / ((m[0] * m[0] + m[1] * m[1] + c1) * (var_a + var_b + c2));
}

/* Moments of a and b along the columns of the windows centred on row y; N_MOMENTS a column. */
static void column_moments(const CtsPicture *a, const CtsPicture *b, int c, const ComparedWindows *rows, int y,
                           double *columns)
{
    int end;
    double norm;
    const int start = window_start(rows, y, &end, &norm);
    memset(columns, 0, (size_t)a->width * N_MOMENTS * sizeof *columns);
    for (int k = start; k <= end; k++) {
        const double weight = rows->weights[k - y + RADIUS] * norm;
        double *m = columns;
        for (int x = 0; x < a->width; x++, m += N_MOMENTS) {
            const size_t i = (size_t)k * a->width + x;
            const double va = cts_clamp01(value(a, i, c)), vb = cts_clamp01(value(b, i, c));
            m[0] += weight * va;
            m[1] += weight * vb;
            m[2] += weight * va * va;
            m[3] += weight * vb * vb;
            m[4] += weight * va * vb;
        }
    }
}

static double row_similarity(const ComparedWindows *across, const double *columns)
{
    double sum = 0;
    for (int x = across->first; x <= across->last; x++) {
        int end;
        double norm, m[N_MOMENTS] = {0};
        const int start = window_start(across, x, &end, &norm);
        for (int k = start; k <= end; k++)
            for (int j = 0; j < N_MOMENTS; j++)
                m[j] += across->weights[k - x + RADIUS] * norm * columns[k * N_MOMENTS + j];
        sum += similarity(m);
    }
    return sum;
}

static CtsStatus structural_similarity(const CtsPicture *a, const CtsPicture *b, double *ssim, CtsError *err)
{
    const ComparedWindows across = compared_windows(a->width), rows = compared_windows(a->height);
    const int n_channels = a->n_channels == 1 && b->n_channels == 1 ? 1 : 3;
    double *columns = NULL, sum = 0;
    const CtsStatus st = cts_alloc_array(&columns, (size_t)a->width * N_MOMENTS, err);
    for (int y = rows.first; y <= rows.last && !st; y++) {
        double of_row = 0;
        for (int c = 0; c < n_channels; c++) {
            column_moments(a, b, c, &rows, y, columns);
            of_row += row_similarity(&across, columns);
        }
        sum += of_row;
    }
    *ssim = sum / ((double)n_channels * (rows.last - rows.first + 1) * (across.last - across.first + 1));
    cts_free(&columns);
    return st;
}

CtsStatus cts_picture_compare(const CtsPicture *a, const CtsPicture *b, CtsDifference *difference, CtsError *err)
{
    *difference = (CtsDifference){0};
    if (a->width != b->width || a->height != b->height)
        return cts_fail(err, CTS_ERR_USAGE, "the pictures differ in size: %dx%d and %dx%d", a->width, a->height,
                        b->width, b->height);
    difference->equal = same_pictures(a, b);
    const CtsStatus st = errors_of(a, b, difference, err);
    return st ? st : structural_similarity(a, b, &difference->ssim, err);
}
