#include "lab/check/suite.h"

#include "base/mem.h"
#include "base/random.h"
#include "core/scene/engine.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Errors below the smallest requested one are not reported either. */
#define BOUND_SLACK (0.01 / 255)
/* Twice the error of a single pixel that is possible where pictures meet the promised one. */
#define CHECK_BRIGHT (50 * CHECK_PROMISED)

CtsCheckFamily cts_check_family(CtsEngineId engine)
{
    const unsigned bit = 1u << engine;
    return bit & CHECK_OF_PAPER ? CHECK_PAPER : bit & CHECK_OF_RAYCAST ? CHECK_RAYCAST : CHECK_TILED;
}

static void state(CtsCheckRun *run, double expected, double found, double error, double bound, const char *why)
{
    const CtsCheckResult result = {.name = run->name,
                                   .engine = run->engine < CTS_N_ENGINES ? cts_engine_names[run->engine] : "-",
                                   .expected = expected,
                                   .found = found,
                                   .error = isnan(error) ? INFINITY : error,
                                   .bound = bound,
                                   .pass = error <= bound && !why,
                                   .scene = run->scene,
                                   .why = why};
    run->n_cases++;
    run->n_failed += !result.pass;
    run->settings->sink(&result, run->settings->context);
}

void cts_check_value(CtsCheckRun *run, double expected, double found, double bound)
{
    run->scene.x = run->scene.y = -1;
    state(run, expected, found, expected == found ? 0 : fabs(found - expected), bound, NULL);
}

static void name_points(const CtsPreset *p, char *text, size_t size)
{
    size_t at = 0;
    text[0] = 0;
    for (int i = 0; i < p->n_opacity && at < size; i++)
        at += (size_t)snprintf(text + at, size - at, "%s%.10g:%.6g", i ? " " : "", p->opacity[i].hu,
                               p->opacity[i].opacity);
    if (p->shade && at < size)
        snprintf(text + at, size - at, " lit");
}

CtsStatus cts_check_render(CtsCheckRun *run, const CtsModel *model, const CtsPreset *preset,
                           const CtsRenderSettings *settings, CtsPicture **picture, CtsError *err)
{
    run->scene = (CtsCheckScene){.width = settings->width, .height = settings->height, .x = -1, .y = -1};
    name_points(preset, run->scene.preset, sizeof run->scene.preset);
    run->scene.azimuth_deg = settings->azimuth_deg;
    run->scene.elevation_deg = settings->elevation_deg;
    run->scene.mm_per_pixel = settings->mm_per_pixel;
    CtsReport report = {0};
    const CtsStatus st = cts_render(model, preset, settings, picture, &report, err);
    if (!st)
        run->scene.mm_per_pixel = (*picture)->info.mm_per_pixel;
    run->reported = report.bound;
    cts_report_free(&report);
    return st;
}

void cts_check_worst(CtsCheckWorst *worst, int x, int y, double expected, double found)
{
    const double error = isnan(found) ? INFINITY : fabs(found - expected);
    worst->dark = worst->dark || (expected > CHECK_BRIGHT && found < expected / 2);
    if (error < worst->error)
        return;
    worst->expected = expected;
    worst->found = found;
    worst->error = error;
    worst->x = x;
    worst->y = y;
}

void cts_check_worst_value(CtsCheckRun *run, const CtsCheckWorst *worst, double bound)
{
    run->scene.x = worst->x;
    run->scene.y = worst->y;
    const CtsErrorBound *const reported = &run->reported;
    const bool above = reported->known && (worst->rms > reported->rmse + BOUND_SLACK ||
                                           (reported->max >= 0 && worst->most > reported->max + BOUND_SLACK));
    state(run, worst->expected, worst->found, worst->error, bound,
          worst->dark ? "a pixel has lost half of its light"
          : above     ? "the error is above the reported one"
                      : NULL);
}

double cts_check_bound(const CtsCheckRun *run, const CtsFormulaScene *scene)
{
    const double bound = scene->bound[cts_check_family(run->engine)];
    /* Sheets refuse coarser pixels; no scene with such pixels has voxels that are not 1 mm wide. */
    const bool has_sheets = scene->mode == CTS_MODE_COMPOSITE && scene->dims[0] != 1 && scene->dims[1] != 1 &&
                            scene->dims[2] != 1 && scene->mm_per_pixel <= CTS_SCENE_COARSEST_PIXEL;
    if (!(CHECK_OF_SHEETS >> run->engine & 1))
        return bound;
    /* In cases of very small opacity the error bound of sheets has no meaning; the other engines test them. */
    return !has_sheets || bound < 1e-6 ? CHECK_NONE : fmax(bound, CHECK_SHEETS_PIXEL);
}

static CtsPreset preset_of(const CtsFormulaScene *s)
{
    CtsPreset p = cts_check_preset(s->points, s->n_points);
    p.mode = (CtsMode)s->mode;
    p.unit_distance_mm = s->unit_mm > 0 ? s->unit_mm : 1;
    p.shade = s->lit;
    p.ambient = 0.2;
    p.diffuse = 0.7;
    p.specular = 0.3;
    p.power = s->power > 0 ? s->power : 12;
    return p;
}

static CtsRenderSettings scene_settings_of(const CtsCheckRun *run, const CtsFormulaScene *s)
{
    CtsRenderSettings r;
    cts_render_defaults(&r);
    r.width = s->width > 0 ? s->width : 24;
    r.height = s->height > 0 ? s->height : 24;
    r.engine = run->engine;
    r.stop = run->settings->stop;
    r.azimuth_deg = s->azimuth_deg;
    r.elevation_deg = s->elevation_deg;
    r.mm_per_pixel = s->mm_per_pixel;
    r.samples = s->samples;
    r.kernel = s->kernel;
    r.opacity_per_voxel = s->per_voxel;
    r.max_error = s->max_error;
    if (run->settings->uncorrected && run->engine == CTS_ENGINE_SHEETS) {
        r.level = CTS_LEVEL_HALF_SHEETS;
        r.max_error = 255;
    }
    r.tolerance_hu = s->tolerance_hu;
    /* Threads do not pay for small pictures. */
    r.n_threads = s->n_threads > 0 ? s->n_threads : r.width * r.height < 16384 ? 1 : run->settings->n_threads;
    return r;
}

CtsStatus cts_check_make(const CtsCheckRun *run, const CtsFormulaScene *s, CtsRenderedScene *made, CtsError *err)
{
    double spacing[3];
    for (int a = 0; a < 3; a++)
        spacing[a] = s->spacing_mm[a] > 0 ? s->spacing_mm[a] : 1;
    *made = (CtsRenderedScene){.preset = preset_of(s), .settings = scene_settings_of(run, s)};
    const CtsStatus st = cts_check_volume(&made->model.volume, s->dims, spacing, s->hu_step > 0 ? s->hu_step : 1,
                                          s->formula ? s->formula : cts_hu_linear, s->hu, err);
    if (!st) {
        made->model.volume->step_lps[2][1] = s->lean * spacing[2];
        made->model.volume->slice_layers = s->layers > 0 ? s->layers : 1;
    }
    return st;
}

CtsStatus cts_check_show(CtsCheckRun *run, const CtsFormulaScene *scene, CtsPicture **picture, CtsError *err)
{
    CtsRenderedScene m;
    CtsStatus st = cts_check_make(run, scene, &m, err);
    if (!st)
        st = cts_check_render(run, &m.model, &m.preset, &m.settings, picture, err);
    cts_model_free(&m.model);
    return st;
}

CtsStatus cts_check_find_truth(CtsCheckRun *run, const CtsRenderedScene *scene, CtsPixelTruth truth, const void *data,
                               CtsError *err)
{
    const CtsRenderSettings *s = &scene->settings;
    const CtsTruthCamera camera = {s->azimuth_deg, s->elevation_deg, s->mm_per_pixel, s->width, s->height};
    if (run->truth)
        return CTS_OK;
    const CtsStatus st = cts_alloc_zeroed(&run->truth, 4 * (size_t)s->width * (size_t)s->height, err);
    double *rgba = run->truth;
    for (int y = 0; y < s->height && !st; y++)
        for (int x = 0; x < s->width; x++, rgba += 4) {
            CtsTruthRay ray;
            if (cts_truth_ray(scene->model.volume, &camera, x, y, &ray))
                truth(&ray, data, rgba);
        }
    return st;
}

CtsStatus cts_check_picture(CtsCheckRun *run, const CtsRenderedScene *scene, CtsPixelTruth truth, const void *data,
                            double bound, CtsError *err)
{
    const int width = scene->settings.width, n = width * scene->settings.height;
    CtsPicture *picture = NULL;
    CtsStatus st = cts_check_render(run, &scene->model, &scene->preset, &scene->settings, &picture, err);
    if (!st)
        st = cts_check_find_truth(run, scene, truth, data, err);
    CtsCheckWorst worst = {0};
    double brightest = 0, sum = 0;
    for (int i = 0; i < 4 * n && !st; i++) {
        const double expected = run->truth[i], found = (double)picture->pixels[i];
        cts_check_worst(&worst, i / 4 % width, i / 4 / width, expected, found);
        brightest = fmax(brightest, expected);
        sum += i % 4 < 3 ? (expected - found) * (expected - found) : 0;
    }
    worst.rms = sqrt(sum / (3.0 * n));
    cts_picture_free(&picture);
    if (brightest > 0 && 2 * bound > brightest)
        bound = -1; /* the bound would allow half of the light to be missing */
    if (!st)
        cts_check_worst_value(run, &worst, bound);
    return st;
}

void cts_check_volume_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    const CtsRenderedScene *m = data;
    cts_truth_volume(m->model.volume, &m->preset, ray, rgba);
}

CtsStatus cts_check_against(CtsCheckRun *run, const CtsFormulaScene *scene, CtsPixelTruth truth, CtsError *err)
{
    CtsRenderedScene m;
    CtsStatus st = cts_check_make(run, scene, &m, err);
    if (!st)
        st = cts_check_picture(run, &m, truth, &m, cts_check_bound(run, scene), err);
    cts_model_free(&m.model);
    return st;
}

CtsStatus cts_check_volume_scene(CtsCheckRun *run, const void *data, CtsError *err)
{
    return cts_check_against(run, data, cts_check_volume_truth, err);
}

double cts_check_differing(const CtsPicture *a, const CtsPicture *b)
{
    const size_t n = (size_t)a->width * (size_t)a->height * (size_t)a->n_channels;
    double differing = 0;
    for (size_t i = 0; i < n; i++)
        differing += memcmp(a->pixels + i, b->pixels + i, sizeof *a->pixels) != 0;
    return differing;
}

double cts_hu_noise(const double vox[3], const void *data)
{
    const double *range = data;
    uint64_t state = (uint64_t)range[2] + ((uint64_t)vox[0] - 1) * 0x9e3779b97f4a7c15u +
                     (uint64_t)vox[1] * 0xc2b2ae3d27d4eb4fu + (uint64_t)vox[2] * 0x165667b19e3779f9u;
    return range[0] + (range[1] - range[0]) * (double)(cts_random_next(&state) >> 11) * 0x1p-53;
}

double cts_hu_checkers(const double vox[3], const void *data)
{
    (void)data;
    return fmod(vox[0] + vox[1] + vox[2], 2) > 0 ? 64511 : -1024;
}

static CtsStatus run_case(CtsCheckRun *run, const CtsCheckCase *c, CtsEngineId engine, CtsError *err)
{
    CtsError why = {0};
    run->name = c->name;
    run->scene = (CtsCheckScene){.x = -1, .y = -1};
    run->engine = engine;
    const CtsStatus st = c->run(run, c->data, &why);
    if (st == CTS_ERR_INTERRUPTED || st == CTS_ERR_MEMORY) {
        if (err)
            *err = why;
        return st;
    }
    if (st)
        state(run, 0, NAN, INFINITY, 0, why.text);
    return CTS_OK;
}

CtsStatus cts_check_run(const CtsCheckSettings *settings, int *n_cases, int *n_failed, CtsError *err)
{
    const CtsCheckTable *const tables[] = {&cts_check_linear, &cts_check_stiff,  &cts_check_shapes,
                                           &cts_check_orders, &cts_check_equal,  &cts_check_faces,
                                           &cts_check_voxels, &cts_check_labels, &cts_check_openness};
    CtsCheckRun run = {.settings = settings};
    const size_t n_tables = sizeof tables / sizeof *tables;
    CtsStatus st = CTS_OK;
    bool alone = false, any = !settings->only;
    for (size_t t = 0; t < n_tables && settings->only; t++)
        for (size_t i = 0; i < tables[t]->n; i++)
            alone = alone || !strcmp(tables[t]->cases[i].name, settings->only);
    for (size_t t = 0; t < n_tables; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const CtsCheckCase *c = &tables[t]->cases[i];
            if (settings->only && (alone ? strcmp(c->name, settings->only) : !strstr(c->name, settings->only)))
                continue;
            any = true;
            for (int engine = 0; engine < CTS_N_ENGINES && !st; engine++) {
                if (settings->stop && *settings->stop)
                    st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
                else if (c->engines >> engine & 1)
                    st = run_case(&run, c, (CtsEngineId)engine, err);
            }
            cts_free(&run.truth);
        }
    if (!st && !any)
        st = cts_fail(err, CTS_ERR_USAGE, "no case has a name with \"%s\" in it (ctsplat check lists them)",
                      settings->only);
    *n_cases = run.n_cases;
    *n_failed = run.n_failed;
    return st;
}
