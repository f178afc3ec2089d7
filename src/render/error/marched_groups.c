#include "render/error/marched_groups.h"

#include "base/compare.h"
#include "base/mem.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Share of a pixel's error that those beside it are expected to have: errors come in clumps, such as a body's edge that
 * samples miss. As that of contrast (engine/sheets/contrast.c), which was found before the error was. */
#define SHARE_BESIDE (1.0F / 16)

_Static_assert(CTS_BAND_ROWS % CTS_GROUP_SIDE == 0, "a strip is whole groups, or the picture would depend on bands");

static int by_group(const void *a, const void *b)
{
    const CtsGroupSample *const p = a, *const q = b;
    if (p->group != q->group)
        return (p->group > q->group) - (p->group < q->group);
    return (p->terms.sum > q->terms.sum) - (p->terms.sum < q->terms.sum);
}

float cts_group_threshold(CtsGroupSample *samples, size_t n, cts_group_accept_fn accept, void *context)
{
    CtsTerms terms = {0};
    float threshold = 0;
    qsort(samples, n, sizeof *samples, by_group);
    for (size_t i = 0; i < n; i++) {
        cts_terms_add(&terms, &samples[i].terms);
        if ((i + 1 == n || samples[i + 1].group > samples[i].group) && accept(context, &terms))
            threshold = samples[i].group;
    }
    return threshold;
}

float cts_group_indicator(const float *indicator, const uint8_t *origin, int width, int height, int x, int y)
{
    float largest = 0;
    for (int j = y; j < cts_smaller_int(y + CTS_GROUP_SIDE, height); j++)
        for (int i = x; i < cts_smaller_int(x + CTS_GROUP_SIDE, width); i++) {
            const size_t at = (size_t)j * (size_t)width + (size_t)i;
            if (!origin || origin[at] == CTS_PIXEL_RENDERED)
                largest = fmaxf(largest, indicator[at]);
        }
    return largest;
}

size_t cts_list_groups(const CtsPicture *band, const CtsErrorMap *errors, int y0, int y1, float from, uint32_t *place,
                       size_t n)
{
    for (int y = y0; y < y1; y += CTS_GROUP_SIDE)
        for (int x = 0; x < band->width; x += CTS_GROUP_SIDE) {
            if (cts_group_indicator(errors->indicator, errors->origin, band->width, y1, x, y) <= from)
                continue;
            for (int j = y; j < cts_smaller_int(y + CTS_GROUP_SIDE, y1); j++)
                for (int i = x; i < cts_smaller_int(x + CTS_GROUP_SIDE, band->width); i++) {
                    const size_t at = (size_t)j * (size_t)band->width + (size_t)i;
                    if (errors->origin[at] == CTS_PIXEL_RENDERED)
                        place[n++] = (uint32_t)at;
                }
        }
    return n;
}

void cts_expect_error_beside(const CtsPicture *band, CtsErrorMap *errors, size_t at, float error)
{
    const int width = band->width, x = (int)(at % (size_t)width), y = (int)(at / (size_t)width),
              rows = cts_strip_rows(width), first = y / rows * rows, end = cts_smaller_int(first + rows, band->height);
    for (int j = cts_larger_int(y - 1, first); j <= cts_smaller_int(y + 1, end - 1); j++)
        for (int i = cts_larger_int(x - 1, 0); i <= cts_smaller_int(x + 1, width - 1); i++) {
            const size_t beside = (size_t)j * (size_t)width + (size_t)i;
            if (errors->origin[beside] == CTS_PIXEL_RENDERED)
                errors->indicator[beside] = fmaxf(errors->indicator[beside], SHARE_BESIDE * error);
        }
}

CtsStatus cts_march_groups(const CtsEngine *march, const CtsScene *scene, const uint32_t *place, size_t n,
                           CtsPicture *band, CtsErrorMap *errors, CtsError *err)
{
    float(*rgba)[4] = NULL, *bound = NULL;
    CtsStatus st;
    if ((st = cts_alloc_array(&rgba, n, err)) || (st = cts_alloc_array(&bound, n, err)) ||
        (st = march->render_pixels(scene, band, place, n, cts_scene_requested_error(scene), rgba, bound, err)))
        goto end;
    for (size_t i = 0; i < n; i++) {
        float *const pixel = band->pixels + 4 * (size_t)place[i];
        const double square = cts_scene_square_of_error(scene, pixel, rgba[i]);
        memcpy(pixel, rgba[i], sizeof rgba[i]);
        errors->origin[place[i]] = CTS_PIXEL_MARCHED;
        errors->indicator[place[i]] = bound[i];
        bound[i] = (float)sqrt(square);
    }
    for (size_t i = 0; i < n; i++)
        cts_expect_error_beside(band, errors, place[i], bound[i]);
end:
    cts_free(&rgba);
    cts_free(&bound);
    return st;
}
