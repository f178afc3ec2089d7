#include "render/error/reference_samples.h"

#include "base/mem.h"
#include "base/random.h"
#include "core/scene/openness.h"
#include "core/scene/resolve.h"
#include "engine/raycast/raycast.h"
#include "render/framing/framing.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static uint64_t mix(uint64_t hash, const void *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ ((const unsigned char *)bytes)[i]) * 0x100000001b3u;
    return hash;
}

uint64_t cts_reference_seed(const CtsScene *scene)
{
    const CtsView *view = &scene->view;
    const int numbers[] = {view->width, view->height, view->dims[0], view->dims[1], view->dims[2], scene->preset->mode};
    const double reals[] = {view->mm_per_pixel, view->azimuth_deg, view->elevation_deg};
    uint64_t hash = mix(0xcbf29ce484222325u, numbers, sizeof numbers);
    hash = mix(hash, reals, sizeof reals);
    hash = mix(hash, view->centre_lps, sizeof view->centre_lps);
    return mix(hash, scene->preset->name, strlen(scene->preset->name));
}

typedef struct SamplePlacing {
    uint64_t random;
    double picture_area;
    int (*xy)[2];
    double *weight;
} SamplePlacing;

/* Place n pixels, one or two different ones, at random in a box. */
static void place_in(SamplePlacing *p, const int box[4], size_t n)
{
    const uint64_t width = (uint64_t)box[2], area = width * (uint64_t)box[3];
    const uint64_t first = cts_random_next(&p->random) % area;
    uint64_t at = first;
    for (size_t i = 0; i < n; i++) {
        if (i == 1) {
            at = cts_random_next(&p->random) % (area - 1);
            at += at >= first;
        }
        (*p->xy)[0] = box[0] + (int)(at % width);
        (*p->xy)[1] = box[1] + (int)(at / width);
        p->xy++;
        *p->weight++ = (double)area / p->picture_area / (double)n;
    }
}

/* n pixels in box x, y, width, height: halves share them by area. */
static void place(SamplePlacing *p, const int box[4], size_t n)
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

void cts_reference_free(CtsReference **reference)
{
    if (!*reference)
        return;
    cts_free(&(*reference)->xy);
    cts_free(&(*reference)->weight);
    cts_free(&(*reference)->rgba);
    free(*reference);
    *reference = NULL;
}

CtsStatus cts_reference_empty(CtsReference **reference, const CtsScene *scene, size_t n, CtsError *err)
{
    CtsStatus st;
    CtsReference *r = *reference = calloc(1, sizeof *r);
    if (!r)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st = cts_alloc_array(&r->xy, n, err)) || (st = cts_alloc_array(&r->weight, n, err)) ||
        (st = cts_alloc_zeroed(&r->rgba, n, err))) {
        cts_reference_free(reference);
        return st;
    }
    r->width = scene->view.width;
    r->height = scene->view.height;
    r->n = n;
    for (int c = 0; c < 3; c++)
        r->background[c] = scene->preset->background_none ? 0 : scene->preset->background[c];
    return CTS_OK;
}

CtsStatus cts_reference_place(CtsReference **reference, const CtsScene *scene, size_t n, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_reference_empty(reference, scene, n, err)))
        return st;
    CtsReference *r = *reference;
    const int box[4] = {0, 0, r->width, r->height};
    SamplePlacing p = {cts_reference_seed(scene), (double)r->width * r->height, r->xy, r->weight};
    place(&p, box, n);
    return CTS_OK;
}

static double shown(double value, double alpha, double background)
{
    return fmin(fmax(value + (1 - alpha) * background, 0), 1);
}

bool cts_reference_find(const CtsReference *r, const CtsPicture *picture, size_t i, float rgba[4])
{
    const int x = r->xy[i][0], y = r->xy[i][1] - picture->first_row;
    if (y < 0 || y >= picture->height)
        return false;
    const int n = picture->n_channels;
    const float *pixel = picture->pixels + ((size_t)y * (size_t)picture->width + (size_t)x) * (size_t)n;
    for (int c = 0; c < 4; c++)
        rgba[c] = n == 4 ? pixel[c] : c == 3 ? 1 : pixel[0];
    return true;
}

/* Squared difference over the three colours of pixel i, and the largest difference. */
static double difference2(const CtsReference *r, size_t i, const float pixel[4], double *largest)
{
    const double *truth = r->rgba[i];
    double sum = 0;
    *largest = 0;
    for (int c = 0; c < 3; c++) {
        const double background = r->background[c];
        const double found = shown((double)pixel[c], (double)pixel[3], background);
        const double d = fabs(found - shown(truth[c], truth[3], background));
        sum += d * d;
        *largest = fmax(*largest, d);
    }
    return sum / 3;
}

/* Student's t for 95 % and so many degrees of freedom, 2 or more, by its series about the normal
 * distribution (3 % low at 2, 0.7 % at 3). */
static double student_t(double freedom)
{
    const double z = 1.959963985, z2 = z * z, each = 1 / freedom;
    return z * (1 + each * ((z2 + 1) / 4 + each * (((5 * z2 + 16) * z2 + 3) / 96 +
                                                   each * (((3 * z2 + 19) * z2 + 17) * z2 - 15) / 384)));
}

/* Mean of squares, and its margin of error (95 %). If a part has a single pixel, its neighbour in order replaces the
 * other. If a few pixels make most of the error, there are as few degrees of freedom (Satterthwaite 1946). */
static void mean_with_margin(const CtsReference *r, const double *square, double *mean, double *margin)
{
    double variance = 0, fourth = 0;
    *mean = 0;
    for (size_t i = 0; i < r->n; i++)
        *mean += r->weight[i] * square[i];
    for (size_t i = 0; i + 1 < r->n; i += 2) {
        const double d = 0.5 * (r->weight[i] + r->weight[i + 1]) * (square[i] - square[i + 1]);
        variance += d * d;
        fourth += d * d * d * d;
    }
    const double freedom = variance > 0 ? variance * variance / fourth : 2;
    *margin = student_t(fmax(freedom, 2)) * sqrt(variance);
}

/* A pixel's largest difference, and the share of the picture that it represents. */
typedef struct Weighed {
    double value, weight;
} Weighed;

static int by_value(const void *a, const void *b)
{
    const double x = ((const Weighed *)a)->value, y = ((const Weighed *)b)->value;
    return (x > y) - (x < y);
}

/* The value that all but a thousandth of the picture stays below. */
static double all_but_a_thousandth(Weighed *of, size_t n)
{
    double rest = 0;
    qsort(of, n, sizeof *of, by_value);
    for (size_t i = 0; i < n; i++)
        rest += of[i].weight;
    rest *= 0.001;
    size_t i = n - 1;
    while (i > 0 && (rest -= of[i].weight) >= 0)
        i--;
    return of[i].value;
}

CtsStatus cts_reference_evaluate(const CtsReference *r, const float (*found)[4], CtsVerified *v, CtsError *err)
{
    double *square = NULL;
    Weighed *largest = NULL;
    CtsStatus st;
    *v = (CtsVerified){.pixels = r->n, .unit = r->unit};
    if (r->n == 0)
        return CTS_OK;
    if ((st = cts_alloc_array(&square, r->n, err)) || (st = cts_alloc_array(&largest, r->n, err)))
        goto end;
    double whole = 0, above = 0;
    for (size_t i = 0; i < r->n; i++) {
        double most;
        square[i] = difference2(r, i, found[i], &most);
        if (i == 0 || most > v->max) {
            v->max = most;
            v->worst_x = r->xy[i][0];
            v->worst_y = r->xy[i][1];
        }
        largest[i] = (Weighed){most, r->weight[i]};
        whole += r->weight[i];
        above += most > 1.0 / 255 ? r->weight[i] : 0;
    }
    v->share_above = above / whole;
    double mean, margin;
    mean_with_margin(r, square, &mean, &margin);
    v->rmse = sqrt(mean);
    /* Normal in the logarithm, as squares are skewed; a sample that is the whole picture has no error. */
    const double spread = mean > 0 && (double)r->n < (double)r->width * r->height ? margin / mean : 0;
    v->rmse_low = v->rmse * exp(-0.5 * spread);
    v->rmse_high = v->rmse * exp(0.5 * spread);
    v->p999 = all_but_a_thousandth(largest, r->n);
end:
    cts_free(&square);
    cts_free(&largest);
    return st;
}

CtsStatus cts_reference_compare(const CtsReference *r, const CtsPicture *picture, CtsVerified *v, CtsError *err)
{
    float(*found)[4] = NULL;
    *v = (CtsVerified){0};
    if (picture->width != r->width || picture->height != r->height)
        return cts_fail(err, CTS_ERR_USAGE, "a picture of %d x %d pixels against a reference of %d x %d",
                        picture->width, picture->height, r->width, r->height);
    CtsStatus st = cts_alloc_zeroed(&found, r->n, err);
    for (size_t i = 0; i < r->n && !st; i++)
        cts_reference_find(r, picture, i, found[i]);
    if (!st)
        st = cts_reference_evaluate(r, (const float(*)[4])found, v, err);
    cts_free(&found);
    return st;
}

static CtsStatus place_most(CtsReference **reference, const CtsScene *scene, size_t n, CtsError *err)
{
    const size_t area = (size_t)scene->view.width * (size_t)scene->view.height;
    return cts_reference_place(reference, scene, n < area ? n : area, err);
}

CtsStatus cts_reference_cast(CtsReference *r, const CtsScene *scene, CtsError *err)
{
    return cts_raycast_pixels(scene, (const int(*)[2])r->xy, r->n, r->rgba, err);
}

CtsStatus cts_reference_new(CtsReference **reference, const CtsModel *model, const CtsPreset *preset,
                            const CtsRenderSettings *settings, size_t n, CtsError *err)
{
    CtsSceneStore store;
    CtsRenderSettings framed = *settings;
    CtsOpenness *openness = NULL;
    *reference = NULL;
    CtsStatus st;
    if ((st = cts_framing_settle(model, preset, &framed, err)) ||
        (st = cts_scene_init(&store, model, preset, &framed, err)) ||
        (st = cts_openness_of_scene(&openness, model, &store.preset, store.settings.n_threads, NULL, err)))
        return st;
    store.scene.openness = openness;
    if ((st = place_most(reference, &store.scene, n, err)) || (st = cts_reference_cast(*reference, &store.scene, err)))
        cts_reference_free(reference);
    cts_openness_free(&openness);
    return st;
}
