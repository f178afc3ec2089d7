/* ctsplat check: the numerical stability suite. */
#include "cli/commands.h"
#include "cli/terminal.h"
#include "lab/check/check.h"
#include <math.h>
#include <stdio.h>

static void print_scene(const CtsCheckScene *s)
{
    if (s->width == 0)
        return;
    if (s->x >= 0)
        printf("  pixel %d,%d of %dx%d", s->x, s->y, s->width, s->height);
    else
        printf("  %dx%d", s->width, s->height);
    printf("  view %.10g,%.10g  %.6g mm a pixel  preset %s", s->azimuth_deg, s->elevation_deg, s->mm_per_pixel,
           s->preset);
}

static void print(const CtsCheckResult *result, void *context)
{
    (void)context;
    printf("%s  %-48s  %-8s  expected %-13.8g  found %-13.8g  error %-9.3g  bound %-9.3g",
           result->pass ? "pass" : "FAIL", result->name, result->engine, result->expected, result->found, result->error,
           result->bound);
    print_scene(&result->scene);
    printf("  --only '%s'%s%s\n", result->name, result->why ? ": " : "", result->why ? result->why : "");
    fflush(stdout);
}

/* JSON has no infinities: a value that is no number is null. */
static json_t *number(double x)
{
    return isfinite(x) ? json_real(x) : json_null();
}

static json_t *scene_json(const CtsCheckScene *s)
{
    json_t *scene = json_pack("{s:[f,f], s:[i,i], s:f, s:s}", "view", s->azimuth_deg, s->elevation_deg, "size",
                              s->width, s->height, "mm_per_pixel", s->mm_per_pixel, "preset", s->preset);
    if (s->x >= 0)
        json_object_set_new(scene, "pixel", json_pack("[i,i]", s->x, s->y));
    return scene;
}

static void add_result(const CtsCheckResult *r, void *cases)
{
    json_t *item = json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:b}", "name", r->name, "engine", r->engine, "expected",
                             number(r->expected), "found", number(r->found), "error", number(r->error), "bound",
                             number(r->bound), "pass", r->pass);
    if (r->scene.width > 0)
        json_object_update_new(item, scene_json(&r->scene));
    json_array_append_new(cases, item);
}

CtsStatus cli_check(const CtsOptions *options, int *exit_code, CtsError *err)
{
    int n_cases, n_failed;
    json_t *cases = options->json ? json_array() : NULL;
    const CtsCheckSettings settings = {
        .n_threads = options->render.n_threads,
        .only = options->only,
        .stop = &cli_stop,
        .sink = cases ? add_result : print,
        .context = cases,
    };
    cli_interrupt_sets_stop();
    CtsStatus st = cts_check_run(&settings, &n_cases, &n_failed, err);
    if (!st && cases && json_array_size(cases) == (size_t)n_cases)
        st = cli_print_json(json_pack("{s:O}", "cases", cases), err);
    else if (!st && options->json)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    else if (!st)
        printf("%d cases, %d failed\n", n_cases, n_failed);
    json_decref(cases);
    if (!st && n_failed)
        *exit_code = 1;
    return st;
}
