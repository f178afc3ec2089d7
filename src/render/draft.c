#include "render/draft.h"

#include "base/mem.h"
#include <math.h>
#include <string.h>

double cts_square_of_error(const CtsPreset *preset, const float *pixel, const double rgba[4])
{
    double square = 0;
    for (int c = 0; c < 3; c++) {
        const double behind = preset->background_none ? 0 : preset->background[c];
        const double off = (double)pixel[c] - rgba[c] + (rgba[3] - (double)pixel[3]) * behind;
        square += off * off / 3;
    }
    return square;
}

static CtsScene finer(const CtsScene *scene)
{
    CtsScene s = *scene;
    s.plan = cts_scene_finer(scene);
    return s;
}

/* A row of its view, the same for bands of any size (the finaliser of MurmurHash3). */
static int draw_row(int first, int end, int number)
{
    uint32_t h = (uint32_t)first * 64 + (uint32_t)number + 1;
    h = (h ^ h >> 16) * 0x85ebca6bu;
    h = (h ^ h >> 13) * 0xc2b2ae35u;
    return first + (int)((h ^ h >> 16) % (uint32_t)(end - first));
}

static int n_tried(const CtsScene *scene, int n_rows)
{
    enum { MOST = 8 };
    const int strips = (scene->view.height + CTS_BAND_ROWS - 1) / CTS_BAND_ROWS;
    const int n = (CTS_DRAFT_ROWS + strips - 1) / strips, most = n < MOST ? n : MOST;
    return most < n_rows ? most : n_rows;
}

CtsStatus cts_draft_try(const CtsEngine *engine, const CtsScene *scene, const CtsPicture *band, int first, int end,
                        double *mean_square, CtsError *err)
{
    const CtsScene fine = finer(scene);
    const size_t width = (size_t)band->width;
    const int n = n_tried(scene, end - first);
    float *pixels = NULL, *bound = NULL;
    double sum = 0;
    CtsStatus st;
    if ((st = cts_alloc_array(&pixels, 4 * width, err)) || (st = cts_alloc_array(&bound, width, err)))
        goto end;
    for (int i = 0; i < n && !st; i++) {
        const int row = draw_row(first + band->first_row, end + band->first_row, i) - band->first_row;
        const float *drawn = band->pixels + 4 * (size_t)row * width;
        CtsPicture one = *band;
        one.first_row += row;
        one.height = 1;
        one.pixels = pixels;
        one.bound = bound;
        one.depth_mm = NULL;
        memset(pixels, 0, 4 * width * sizeof *pixels);
        st = engine->render(&fine, &one, NULL, err);
        for (size_t x = 0; x < width && !st; x++) {
            const float *p = pixels + 4 * x;
            const double rgba[4] = {(double)p[0], (double)p[1], (double)p[2], (double)p[3]};
            sum += cts_square_of_error(scene->preset, drawn + 4 * x, rgba);
        }
    }
    *mean_square = sum / ((double)n * (double)width);
end:
    cts_free(&pixels);
    cts_free(&bound);
    return st;
}

CtsStatus cts_draft_redraw(const CtsEngine *engine, const CtsScene *scene, CtsPicture *band, int first, int end,
                           CtsError *err)
{
    const CtsScene fine = finer(scene);
    const size_t from = (size_t)first * (size_t)band->width, n = (size_t)(end - first) * (size_t)band->width;
    CtsPicture rows = *band;
    rows.first_row += first;
    rows.height = end - first;
    rows.pixels += 4 * from;
    rows.bound += from;
    memset(rows.pixels, 0, 4 * n * sizeof *rows.pixels);
    memset(rows.bound, 0, n * sizeof *rows.bound);
    if (rows.depth_mm)
        rows.depth_mm += from;
    for (size_t i = 0; i < n && rows.depth_mm; i++)
        rows.depth_mm[i] = INFINITY;
    return engine->render(&fine, &rows, NULL, err);
}
