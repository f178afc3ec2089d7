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

static int one_in(const CtsScene *scene)
{
    const double pieces = (double)scene->view.width * scene->view.height / CTS_DRAWN_PIXELS;
    return (int)fmin(pieces / CTS_DRAFT_PIECES, CTS_DRAFT_ONE_IN);
}

CtsStatus cts_draft_try(const CtsEngine *engine, const CtsScene *scene, const CtsPicture *band, int first, int end,
                        double *mean_square, CtsError *err)
{
    const size_t width = (size_t)band->width, n = width * (size_t)(end - first);
    CtsScene fine = finer(scene);
    CtsPicture drawn = *band;
    double sum = 0;
    size_t n_drawn = 0;
    CtsStatus st;
    fine.plan.one_in = one_in(scene);
    drawn.first_row += first;
    drawn.height = end - first;
    drawn.pixels = drawn.bound = drawn.depth_mm = NULL;
    if ((st = cts_alloc_zeroed(&drawn.pixels, 4 * n, err)) || (st = cts_alloc_array(&drawn.bound, n, err)) ||
        (st = engine->render(&fine, &drawn, NULL, err)))
        goto end;
    for (size_t i = 0; i < n; i++) {
        if (!cts_plan_draws(&fine.plan, (int)(i % width), drawn.first_row + (int)(i / width)))
            continue;
        const float *p = drawn.pixels + 4 * i;
        const double rgba[4] = {(double)p[0], (double)p[1], (double)p[2], (double)p[3]};
        sum += cts_square_of_error(scene->preset, band->pixels + 4 * ((size_t)first * width + i), rgba);
        n_drawn++;
    }
    *mean_square = n_drawn > 0 ? sum / (double)n_drawn : 0;
end:
    cts_free(&drawn.pixels);
    cts_free(&drawn.bound);
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
