#include "lab/bench/bench_parts.h"

#include <math.h>
#include <stdlib.h>

/* Random pixels: enough for some 5 % of the rmse where errors are spread like those of real heads. */
enum { PIXELS_TRILINEAR = 4000, PIXELS_KERNEL = 1500 };

enum { COARSE = 64 }; /* steps of the grid on which the thumbnails' frame is found */

/* The pixel of the picture under (x, y) of nx by ny places in the frame. */
static void place(const int frame[4], int x, int y, int nx, int ny, int pixel[2])
{
    pixel[0] = frame[0] + (int)((x + 0.5) * frame[2] / nx);
    pixel[1] = frame[1] + (int)((y + 0.5) * frame[3] / ny);
}

/* The trilinear integral at nx by ny places in the frame; rgba is malloc'd. */
static CtsStatus integrate(const CtsBenchSettings *settings, const int frame[4], int nx, int ny, double (**rgba)[4],
                           CtsError *err)
{
    const size_t n = (size_t)nx * (size_t)ny;
    int(*xy)[2] = malloc(n * sizeof *xy);
    *rgba = malloc(n * sizeof **rgba);
    CtsStatus st = xy && *rgba ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < n && !st; i++)
        place(frame, (int)(i % (size_t)nx), (int)(i / (size_t)nx), nx, ny, xy[i]);
    if (!st)
        st = cts_reference_pixels(settings->volume, settings->preset, &settings->render, (const int(*)[2])xy, n, *rgba,
                                  err);
    free(xy);
    return st;
}

/* The part of the picture that shows something, found on a coarse grid, with a grid step around it. */
static CtsStatus find_frame(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsError *err)
{
    const int size[2] = {settings->render.width, settings->render.height};
    const int whole[4] = {0, 0, size[0], size[1]};
    int n[2], low[2] = {COARSE, COARSE}, high[2] = {-1, -1};
    double(*rgba)[4] = NULL;
    for (int a = 0; a < 2; a++)
        n[a] = size[a] < COARSE ? size[a] : COARSE;
    const CtsStatus st = integrate(settings, whole, n[0], n[1], &rgba, err);
    for (int i = 0; i < n[0] * n[1] && !st; i++)
        for (int a = 0; a < 2 && rgba[i][3] > 0.01; a++) {
            const int at = a ? i / n[0] : i % n[0];
            low[a] = at < low[a] ? at : low[a];
            high[a] = at > high[a] ? at : high[a];
        }
    free(rgba);
    for (int a = 0; a < 2; a++) {
        const int first = high[a] < 0 || low[a] == 0 ? 0 : low[a] - 1;
        const int past = high[a] < 0 || high[a] + 2 > n[a] ? n[a] : high[a] + 2;
        truth->frame[a] = first * size[a] / n[a];
        truth->frame[2 + a] = past * size[a] / n[a] - truth->frame[a];
    }
    return st;
}

static CtsStatus make_thumb(CtsBenchTruth *truth, const CtsBenchSettings *settings, CtsError *err)
{
    const CtsStatus st = find_frame(truth, settings, err);
    if (st)
        return st;
    const int *frame = truth->frame, side = frame[2] > frame[3] ? frame[2] : frame[3];
    const double shrink = side > CTS_THUMB_SIDE ? (double)CTS_THUMB_SIDE / side : 1;
    truth->thumb_width = (int)fmax(floor(frame[2] * shrink), 1);
    truth->thumb_height = (int)fmax(floor(frame[3] * shrink), 1);
    return integrate(settings, frame, truth->thumb_width, truth->thumb_height, &truth->thumb, err);
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
            int pixel[2];
            place(truth->frame, x, y, width, height, pixel);
            const float *found = picture->pixels + 4 * ((size_t)pixel[1] * (size_t)picture->width + (size_t)pixel[0]);
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
