#include "bench/parts.h"

#include <math.h>
#include <stdlib.h>

/* Random pixels: enough for some 5 % of the rmse where errors are spread like those of real heads. */
enum { PIXELS_TRILINEAR = 4000, PIXELS_KERNEL = 1500 };

static CtsStatus make_thumb(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsError *err)
{
    const CtsRenderSettings *s = &settings->render;
    const int side = s->width > s->height ? s->width : s->height;
    const double shrink = side > CTS_THUMB_SIDE ? (double)CTS_THUMB_SIDE / side : 1;
    truth->thumb_width = (int)fmax(floor(s->width * shrink), 1);
    truth->thumb_height = (int)fmax(floor(s->height * shrink), 1);
    const size_t n = (size_t)truth->thumb_width * (size_t)truth->thumb_height;
    int(*xy)[2] = malloc(n * sizeof *xy);
    truth->thumb = malloc(n * sizeof *truth->thumb);
    CtsStatus st = xy && truth->thumb ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < n && !st; i++) {
        xy[i][0] = (int)(((double)(i % (size_t)truth->thumb_width) + 0.5) * s->width / truth->thumb_width);
        xy[i][1] = (int)(((double)(i / (size_t)truth->thumb_width) + 0.5) * s->height / truth->thumb_height);
    }
    if (!st)
        st = cts_reference_pixels(settings->volume, settings->preset, s, (const int(*)[2])xy, n, truth->thumb, err);
    free(xy);
    return st;
}

CtsStatus cts_bench_truth_of(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsKernelId kernel, CtsError *err)
{
    CtsRenderSettings s = settings->render;
    s.kernel = kernel;
    if (truth->own[kernel])
        return CTS_OK;
    return cts_reference_new(&truth->own[kernel], settings->volume, settings->preset, &s,
                             kernel == CTS_KERNEL_TENT ? PIXELS_TRILINEAR : PIXELS_KERNEL, err);
}

CtsStatus cts_bench_truth_init(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsError *err)
{
    *truth = (CtsBenchTruth){.thumb_width = 0};
    const CtsStatus st = cts_bench_truth_of(truth, settings, CTS_KERNEL_TENT, err);
    return st ? st : make_thumb(truth, settings, err);
}

void cts_bench_truth_free(CtsBenchTruth *truth)
{
    for (int kernel = 0; kernel < CTS_N_KERNELS; kernel++)
        cts_reference_free(&truth->own[kernel]);
    free(truth->thumb);
}

static uint8_t byte_of(double value)
{
    return (uint8_t)floor(fmin(fmax(value, 0), 1) * 255 + 0.5);
}

void cts_bench_thumbs(const CtsBenchTruth *truth, const CtsPreset *preset, const CtsPicture *picture, CtsBenchRow *row)
{
    const int width = truth->thumb_width, height = truth->thumb_height;
    row->picture.width = row->difference.width = width;
    row->picture.height = row->difference.height = height;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const size_t at = (size_t)y * (size_t)width + (size_t)x;
            const int px = (int)((x + 0.5) * picture->width / width), py = (int)((y + 0.5) * picture->height / height);
            const float *found = picture->pixels + 4 * ((size_t)py * (size_t)picture->width + (size_t)px);
            const double *expected = truth->thumb[at];
            for (int c = 0; c < 3; c++) {
                const double behind = preset->background_none ? 0 : preset->background[c];
                const double a = fmin(fmax((double)found[c] + (1 - (double)found[3]) * behind, 0), 1);
                const double b = fmin(fmax(expected[c] + (1 - expected[3]) * behind, 0), 1);
                row->picture.rgb[3 * at + (size_t)c] = byte_of(a);
                row->difference.rgb[3 * at + (size_t)c] = byte_of(CTS_BENCH_AMPLIFIED * fabs(a - b));
            }
        }
}
