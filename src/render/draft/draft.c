#include "render/draft/draft.h"

#include "base/clock.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

/* The pieces of a band, strip by strip. */
typedef struct Pieces {
    const CtsScene *scene;
    CtsScene fine; /* the same without a draft, of which only pieces are drawn */
    const CtsPicture *band;
    size_t width, n_strips, n; /* n: their pixels */
    size_t *strip_end;
    uint32_t *place; /* in the band */
    float *pixels, *bound;
} Pieces;

static void free_pieces(Pieces *p)
{
    cts_free(&p->strip_end);
    cts_free(&p->place);
    cts_free(&p->pixels);
    cts_free(&p->bound);
}

static int first_row(size_t strip)
{
    return (int)strip * CTS_BAND_ROWS;
}

static int end_row(const Pieces *p, size_t strip)
{
    const int end = first_row(strip) + CTS_BAND_ROWS;
    return end < p->band->height ? end : p->band->height;
}

/* The pixels drawn of a strip; listed where there is a place for them. */
static size_t draw(const Pieces *p, size_t strip, uint32_t *place)
{
    size_t n = 0;
    for (int y = first_row(strip); y < end_row(p, strip); y++)
        for (size_t x = 0; x < p->width; x += CTS_DRAWN_PIXELS) {
            if (!cts_plan_draws(&p->fine.plan, (int)x, p->band->first_row + y))
                continue;
            const size_t end = x + CTS_DRAWN_PIXELS < p->width ? x + CTS_DRAWN_PIXELS : p->width;
            for (size_t i = x; place && i < end; i++)
                place[n + i - x] = (uint32_t)((size_t)y * p->width + i);
            n += end - x;
        }
    return n;
}

static void count_some(void *context, int worker, size_t first, size_t end)
{
    const Pieces *const p = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++)
        p->strip_end[strip] = draw(p, strip, NULL);
}

static void list_some(void *context, int worker, size_t first, size_t end)
{
    const Pieces *const p = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++)
        draw(p, strip, p->place + (strip > 0 ? p->strip_end[strip - 1] : 0));
}

static CtsStatus list_pieces(Pieces *p, CtsError *err)
{
    const int n_threads = p->scene->settings->n_threads;
    CtsStatus st;
    if ((st = cts_alloc_array(&p->strip_end, p->n_strips, err)))
        return st;
    cts_parallel(n_threads, p->n_strips, 1, count_some, p);
    for (size_t strip = 0; strip < p->n_strips; strip++)
        p->strip_end[strip] = p->n += p->strip_end[strip];
    if ((st = cts_alloc_array(&p->place, p->n, err)) || (st = cts_alloc_array(&p->pixels, 4 * p->n, err)) ||
        (st = cts_alloc_array(&p->bound, p->n, err)))
        return st;
    cts_parallel(n_threads, p->n_strips, 1, list_some, p);
    return CTS_OK;
}

/* Renders the pieces, in a band of which nothing else is ever touched. */
static CtsStatus render_pieces(Pieces *p, const CtsEngine *engine, CtsError *err)
{
    CtsPicture drawn = *p->band;
    const size_t n = p->width * (size_t)p->band->height;
    CtsStatus st;
    drawn.pixels = drawn.bound = drawn.depth_mm = NULL;
    if ((st = cts_alloc_sparse(&drawn.pixels, 4 * n, err)) || (st = cts_alloc_sparse(&drawn.bound, n, err)) ||
        (st = engine->render(&p->fine, &drawn, NULL, err)))
        goto end;
    for (size_t i = 0; i < p->n; i++) {
        memcpy(p->pixels + 4 * i, drawn.pixels + 4 * (size_t)p->place[i], 4 * sizeof *drawn.pixels);
        p->bound[i] = drawn.bound[p->place[i]];
    }
end:
    cts_free(&drawn.pixels);
    cts_free(&drawn.bound);
    return st;
}

/* What the strip's pieces say of it: the sum of their squares, and the largest. */
static double squares_of(const Pieces *p, size_t strip, size_t *n, double *most)
{
    size_t i = strip > 0 ? p->strip_end[strip - 1] : 0;
    double sum = 0;
    *n = 0;
    *most = 0;
    while (i < p->strip_end[strip]) {
        /* A piece ends with its row, or where the next begins. */
        const size_t column = p->place[i] % p->width, rest = p->width - column;
        const size_t length = rest < CTS_DRAWN_PIXELS ? rest : CTS_DRAWN_PIXELS;
        double square = 0;
        for (size_t k = i; k < i + length; k++) {
            const float *f = p->pixels + 4 * k;
            const double rgba[4] = {(double)f[0], (double)f[1], (double)f[2], (double)f[3]};
            square += cts_square_of_error(p->scene->preset, p->band->pixels + 4 * (size_t)p->place[k], rgba);
        }
        square /= (double)length;
        sum += square;
        *most = fmax(*most, square);
        ++*n;
        i += length;
    }
    return sum;
}

CtsStatus cts_draft_redraw(const CtsEngine *engine, const CtsScene *scene, CtsPicture *band, int first, int end,
                           CtsError *err)
{
    const size_t width = (size_t)band->width, from = (size_t)first * width, n = (size_t)(end - first) * width;
    CtsPicture rows = *band;
    rows.first_row += first;
    rows.height = end - first;
    rows.pixels += 4 * from;
    memset(rows.pixels, 0, 4 * n * sizeof *rows.pixels);
    if (rows.depth_mm)
        rows.depth_mm += from;
    for (size_t i = 0; i < n && rows.depth_mm; i++)
        rows.depth_mm[i] = INFINITY;
    return engine->render(scene, &rows, NULL, err);
}

static CtsStatus judge_strip(const Pieces *p, const CtsEngine *engine, CtsPicture *band, size_t strip,
                             CtsFrameBound *bound, CtsError *err)
{
    const double asked = cts_scene_error_asked(p->scene);
    CtsScene fine = p->fine;
    size_t n;
    double most;
    const double sum = squares_of(p, strip, &n, &most);
    fine.plan.one_in = 0;
    bound->pieces += n;
    if (sum > 0.25 * asked * asked * (double)n) { /* what is then left, is what the pieces err by themselves */
        bound->refined += (uint64_t)(end_row(p, strip) - first_row(strip)) * p->width;
        return cts_draft_redraw(engine, &fine, band, first_row(strip), end_row(p, strip), err);
    }
    bound->piece_squares += sum;
    bound->piece_most = fmax(bound->piece_most, most);
    return CTS_OK;
}

/* So many rays judge the pieces that these are shown to err by some half of what is asked of the draft. */
static double rays_of(const CtsScene *scene, const CtsScene *fine)
{
    const double share = cts_scene_error_asked(fine) / cts_scene_error_asked(scene);
    return fmax(cts_scene_rays_judged(fine) * share * share, cts_scene_rays_judged(scene));
}

CtsStatus cts_draft_keep(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                         CtsError *err)
{
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const double pixels = (double)scene->view.width * scene->view.height;
    Pieces p = {.scene = scene,
                .fine = *scene,
                .band = band,
                .width = (size_t)band->width,
                .n_strips = ((size_t)band->height + CTS_BAND_ROWS - 1) / CTS_BAND_ROWS};
    CtsStatus st;
    p.fine.plan = cts_scene_finer(scene);
    p.fine.plan.one_in = (int)fmin(pixels / CTS_DRAWN_PIXELS / CTS_DRAFT_PIECES, CTS_DRAFT_ONE_IN);
    if ((st = list_pieces(&p, err)) || (st = render_pieces(&p, engine, err)))
        goto end;
    for (size_t strip = 0; strip < p.n_strips; strip++)
        if ((st = judge_strip(&p, engine, band, strip, bound, err)))
            goto end;
    bound->wall_ms += cts_wall_ms() - wall;
    bound->cpu_ms += cts_cpu_ms() - cpu;
    const CtsBoundSample sample = {
        .of = {(size_t)band->first_row * p.width, p.place, p.pixels, p.bound},
        .strip_end = p.strip_end,
        .n_strips = p.n_strips,
        .n_rays = rays_of(scene, &p.fine),
        .n_pixels = pixels / p.fine.plan.one_in,
    };
    st = cts_bound_judge(bound, &p.fine, &sample, err);
    bound->pixels += p.width * (size_t)band->height;
end:
    free_pieces(&p);
    return st;
}
