/* ctsplat check: the numerical stability suite. */
#include "base/file.h"
#include "cli/commands.h"
#include "cli/interrupt.h"
#include "cli/print_json.h"
#include "lab/check/check.h"
#include "lab/check/plot.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct Results {
    bool print;
    CtsCheckResult *items;
    size_t n;
    bool lost; /* memory ran out */
} Results;

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

static void add(const CtsCheckResult *result, void *context)
{
    Results *results = context;
    CtsCheckResult *items = realloc(results->items, (results->n + 1) * sizeof *items);
    if (items) {
        results->items = items;
        items[results->n] = *result;
        items[results->n++].why = NULL;
    } else {
        results->lost = true;
    }
    if (!results->print)
        return;
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

static CtsStatus print_json(const Results *results, CtsError *err)
{
    json_t *cases = json_array();
    for (size_t i = 0; cases && i < results->n; i++) {
        const CtsCheckResult *r = &results->items[i];
        json_t *item = json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:b}", "name", r->name, "engine", r->engine,
                                 "expected", number(r->expected), "found", number(r->found), "error", number(r->error),
                                 "bound", number(r->bound), "pass", r->pass);
        if (r->scene.width > 0)
            json_object_update_new(item, scene_json(&r->scene));
        json_array_append_new(cases, item);
    }
    return cli_print_json(json_pack("{s:o}", "cases", cases), err);
}

CtsStatus cli_check(const CtsOptions *options, int *exit_code, CtsError *err)
{
    CtsStatus st;
    int n_cases, n_failed;
    Results results = {.print = !options->json};
    const CtsCheckSettings settings = {
        .n_threads = options->render.n_threads,
        .only = options->only,
        .stop = &cli_stop,
        .sink = add,
        .context = &results,
    };
    cli_interrupt_asks();
    const char *dot = options->plot ? strrchr(options->plot, '.') : NULL;
    if (options->plot && (!dot || strcasecmp(dot, ".svg")))
        return cts_fail(err, CTS_ERR_USAGE, "--plot %s: its name must end in .svg", options->plot);
    if (options->plot && (st = cts_file_check_writable(options->plot, options->export.force, err)))
        return st;
    if ((st = cts_check_run(&settings, &n_cases, &n_failed, err)))
        goto end;
    if (results.lost) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    if (options->json)
        st = print_json(&results, err);
    else
        printf("%d cases, %d failed\n", n_cases, n_failed);
    if (!st && options->plot)
        st = cts_check_plot(results.items, results.n, options->plot, options->export.force, err);
    if (n_failed)
        *exit_code = 1;
end:
    free(results.items);
    return st;
}
