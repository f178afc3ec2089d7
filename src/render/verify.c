#include "render/verify.h"

#include "base/clock.h"
#include "base/mem.h"
#include "raycast/raycast.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Steele, Lea, Flood 2014: SplitMix64. */
static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint64_t mix(uint64_t hash, const void *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ ((const unsigned char *)bytes)[i]) * 0x100000001b3u;
    return hash;
}

static uint64_t scene_seed(const CtsScene *scene)
{
    const CtsView *view = &scene->view;
    const int numbers[] = {view->width, view->height, view->dims[0], view->dims[1], view->dims[2], scene->preset->mode};
    const double reals[] = {view->mm_per_pixel, view->azimuth_deg, view->elevation_deg};
    uint64_t hash = mix(0xcbf29ce484222325u, numbers, sizeof numbers);
    hash = mix(hash, reals, sizeof reals);
    hash = mix(hash, view->centre_lps, sizeof view->centre_lps);
    return mix(hash, scene->preset->name, strlen(scene->preset->name));
}

typedef struct Placing {
    uint64_t random;
    double picture_area;
    int (*xy)[2];
    double *weight;
} Placing;

/* One or two pixels, never the same twice. */
static void place_in(Placing *p, const int box[4], size_t n)
{
    const uint64_t width = (uint64_t)box[2], area = width * (uint64_t)box[3];
    const uint64_t first = next_random(&p->random) % area;
    uint64_t at = first;
    for (size_t i = 0; i < n; i++) {
        if (i == 1) {
            at = next_random(&p->random) % (area - 1);
            at += at >= first;
        }
        (*p->xy)[0] = box[0] + (int)(at % width);
        (*p->xy)[1] = box[1] + (int)(at / width);
        p->xy++;
        *p->weight++ = (double)area / p->picture_area / (double)n;
    }
}

/* n pixels in box x, y, width, height: halves share them by area. */
static void place(Placing *p, const int box[4], size_t n)
{
    if (n == 0)
        return;
    if (n <= 2) {
        place_in(p, box, n);
        return;
    }
    const int along = box[2] >= box[3] ? 0 : 1;
    int first[4], second[4];
    memcpy(first, box, sizeof first);
    memcpy(second, box, sizeof second);
    const size_t pairs = (n + 1) / 2, across = (size_t)box[3 - along];
    size_t n_first = pairs / 2 * 2;
    int cut = (int)floor(box[2 + along] * ((double)n_first / (double)n) + 0.5);
    cut = cut < 1 ? 1 : cut > box[2 + along] - 1 ? box[2 + along] - 1 : cut;
    first[2 + along] = cut;
    second[along] += cut;
    second[2 + along] -= cut;
    /* Never more than a part holds. */
    if (n_first > (size_t)cut * across)
        n_first = (size_t)cut * across;
    const size_t room = (size_t)second[2 + along] * across;
    if (n - n_first > room)
        n_first = n - room;
    place(p, first, n_first);
    place(p, second, n - n_first);
}

void cts_verify_places(const CtsScene *scene, size_t n, int (*xy)[2], double *weight)
{
    const int box[4] = {0, 0, scene->view.width, scene->view.height};
    Placing p = {scene_seed(scene), (double)box[2] * box[3], xy, weight};
    place(&p, box, n);
}

static double shown(double value, double alpha, double background)
{
    return fmin(fmax(value + (1 - alpha) * background, 0), 1);
}

/* Squared difference over the three colours, and the largest difference. */
static double difference2(const CtsScene *scene, const CtsPicture *picture, const int xy[2], const double rgba[4],
                          double *largest)
{
    const CtsPreset *preset = scene->preset;
    const size_t at = ((size_t)xy[1] * (size_t)picture->width + (size_t)xy[0]) * (size_t)picture->n_channels;
    const float *pixel = picture->pixels + at;
    double sum = 0;
    *largest = 0;
    for (int c = 0; c < 3; c++) {
        const double background = preset->background_none ? 0 : preset->background[c];
        const double found = picture->n_channels == 4 ? shown((double)pixel[c], (double)pixel[3], background)
                                                      : fmin(fmax((double)pixel[0], 0), 1);
        const double d = fabs(found - shown(rgba[c], rgba[3], background));
        sum += d * d;
        *largest = fmax(*largest, d);
    }
    return sum / 3;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Mean of squares and its standard error, from the pairs that share a part. Where a part gave one pixel alone, its
 * neighbour in order stands in for the other. */
static void weigh(const double *square, const double *weight, size_t n, double *mean, double *standard_error)
{
    double variance = 0;
    *mean = 0;
    for (size_t i = 0; i < n; i++)
        *mean += weight[i] * square[i];
    for (size_t i = 0; i + 1 < n; i += 2) {
        const double d = square[i] - square[i + 1], w = 0.5 * (weight[i] + weight[i + 1]);
        variance += w * w * d * d;
    }
    *standard_error = sqrt(variance);
}

CtsStatus cts_verify_against(const CtsScene *scene, const CtsPicture *picture, size_t n, const int (*xy)[2],
                             const double *weight, const double (*rgba)[4], CtsVerified *v, CtsError *err)
{
    double *square = NULL, *largest = NULL;
    CtsStatus st;
    *v = (CtsVerified){.pixels = n};
    if ((st = cts_alloc_array(&square, n, err)) || (st = cts_alloc_array(&largest, n, err)))
        goto end;
    for (size_t i = 0; i < n; i++) {
        square[i] = difference2(scene, picture, xy[i], rgba[i], &largest[i]);
        if (i == 0 || largest[i] > v->max) {
            v->max = largest[i];
            v->worst_x = xy[i][0];
            v->worst_y = xy[i][1];
        }
        v->share_above += largest[i] > 1.0 / 255 ? weight[i] : 0;
    }
    double mean, error;
    weigh(square, weight, n, &mean, &error);
    v->rmse = sqrt(mean);
    /* Normal in the logarithm, as squares are skewed; a sample that is the whole picture has no error. */
    const double spread = mean > 0 && (double)n < (double)picture->width * picture->height ? 1.96 * error / mean : 0;
    v->rmse_low = v->rmse * exp(-0.5 * spread);
    v->rmse_high = v->rmse * exp(0.5 * spread);
    qsort(largest, n, sizeof *largest, by_value);
    const size_t rank = (size_t)ceil(0.999 * (double)n);
    v->p999 = largest[rank > 0 ? rank - 1 : 0];
end:
    cts_free(&square);
    cts_free(&largest);
    return st;
}

CtsStatus cts_verify(const CtsScene *scene, const CtsPicture *picture, CtsReport *report, CtsError *err)
{
    const double start = cts_wall_ms();
    const size_t area = (size_t)picture->width * (size_t)picture->height;
    size_t n = (size_t)scene->settings->verify;
    n = n < area ? n : area;
    int(*xy)[2] = NULL;
    double(*rgba)[4] = NULL, *weight = NULL;
    CtsVerified verified;
    CtsStatus st;
    if ((st = cts_alloc_array(&xy, n, err)) || (st = cts_alloc_array(&rgba, n, err)) ||
        (st = cts_alloc_array(&weight, n, err)))
        goto end;
    cts_verify_places(scene, n, xy, weight);
    if ((st = cts_raycast_pixels(scene, (const int(*)[2])xy, n, rgba, err)) ||
        (st = cts_verify_against(scene, picture, n, (const int(*)[2])xy, weight, (const double(*)[4])rgba, &verified,
                                 err)))
        goto end;
    verified.wall_ms = cts_wall_ms() - start;
    if (report)
        report->verified = verified;
end:
    cts_free(&xy);
    cts_free(&rgba);
    cts_free(&weight);
    return st;
}
