/* volume_dump PATH [--series UID] [--threads N] [--raw FILE] [--repeat N] [--list]: the reader's result for a folder,
 * as lines of "key value", for tests that compare it with other readers and for the reading benchmark. */
#include "base/clock.h"
#include "base/exit_code.h"
#include "base/mem.h"
#include "ctsplat/ctsplat.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct Options {
    const char *path, *series, *raw;
    int threads, repeat, list, copy;
} Options;

static int parse(int argc, char **argv, Options *o)
{
    *o = (Options){.repeat = 1};
    for (int i = 1; i < argc; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strcmp(argv[i], "--list") == 0)
            o->list = 1;
        else if (strcmp(argv[i], "--copy") == 0)
            o->copy = 1;
        else if (argv[i][0] != '-')
            o->path = argv[i];
        else if (!value)
            return 0;
        else if (strcmp(argv[i], "--series") == 0)
            o->series = argv[++i];
        else if (strcmp(argv[i], "--raw") == 0)
            o->raw = argv[++i];
        else if (strcmp(argv[i], "--threads") == 0)
            o->threads = atoi(argv[++i]);
        else if (strcmp(argv[i], "--repeat") == 0)
            o->repeat = atoi(argv[++i]);
        else
            return 0;
    }
    return o->path != NULL;
}

static void print_diagnostics(const CtsDiagnostics *diagnostics)
{
    for (size_t i = 0; i < diagnostics->n; i++)
        printf("finding %s %d %s\n", diagnostics->items[i].code, (int)diagnostics->items[i].severity,
               diagnostics->items[i].text);
}

static void print_list(const CtsSeriesList *list)
{
    printf("files %d not_ct %d unreadable %d\n", list->n_files, list->n_not_ct, list->n_unreadable);
    print_diagnostics(&list->diagnostics);
    for (size_t i = 0; i < list->n; i++) {
        const CtsSeries *s = &list->items[i];
        printf("series %s part %d slices %d size %d %d spacing %.9g %.9g %.9g tilt %.6f syntax %s orientation %s "
               "renderable %d exit %d reason %s\n",
               s->uid, s->part, s->n_slices, s->columns, s->rows, s->spacing_mm[0], s->spacing_mm[1], s->spacing_mm[2],
               s->tilt_deg, s->transfer_syntax, s->orientation, s->renderable, cts_exit_code(s->refusal), s->reason);
        print_diagnostics(&s->diagnostics);
    }
}

static int write_raw(const CtsVolume *v, const char *path)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        return 0;
    const size_t n = cts_volume_n_voxels(v);
    const size_t written = fwrite(v->grey, sizeof *v->grey, n, file);
    return fclose(file) == 0 && written == n;
}

static void print_volume(const CtsVolume *v)
{
    printf("dims %d %d %d\norigin %.17g %.17g %.17g\n", v->dims[0], v->dims[1], v->dims[2], v->origin_lps[0],
           v->origin_lps[1], v->origin_lps[2]);
    for (int axis = 0; axis < 3; axis++)
        printf("step%d %.17g %.17g %.17g\n", axis, v->step_lps[axis][0], v->step_lps[axis][1], v->step_lps[axis][2]);
    printf("hu offset %.17g step %.17g min %.17g max %.17g\n", v->hu_offset, v->hu_step, v->hu_min, v->hu_max);
}

/* Into fresh memory, as a reader's is. */
static void time_copy(const CtsVolume *v)
{
    const size_t bytes = cts_volume_n_voxels(v) * sizeof *v->grey;
    const double start = cts_wall_ms();
    uint16_t *copy = NULL;
    if (cts_alloc_bytes((void **)&copy, bytes, 1, NULL))
        return;
    memcpy(copy, v->grey, bytes);
    const double ms = cts_wall_ms() - start;
    printf("copy %.2f of %u\n", ms, copy[bytes / 4]);
    cts_free_bytes(copy);
}

static CtsStatus run(const Options *o, int last, CtsError *err)
{
    CtsSeriesList *list = NULL;
    CtsVolume *volume = NULL;
    CtsReport report = {0};
    const CtsSeries *series;
    const double start = cts_wall_ms();
    CtsStatus st = cts_series_find(&o->path, 1, o->threads, &list, &report, err);
    if (!st && o->list && last)
        print_list(list);
    if (!st && !o->list && !(st = cts_series_choose(list, o->series, &series, err)))
        st = cts_series_load(series, o->threads, NULL, &volume, &report, err);
    const double total = cts_wall_ms() - start;
    if (!st && volume) {
        double stages = 0;
        printf("ms total %.2f", total);
        for (int s = 0; s < CTS_N_STAGES; s++) {
            stages += report.stages[s].wall_ms;
            if (report.stages[s].ran)
                printf(" %s %.2f", cts_stage_names[s], report.stages[s].wall_ms);
        }
        printf(" other %.2f rss_mib %.1f\n", total - stages, (double)cts_peak_rss_bytes() / 1048576);
    }
    if (!st && volume && o->copy)
        time_copy(volume);
    if (!st && volume && last) {
        print_volume(volume);
        print_diagnostics(&report.diagnostics);
        if (o->raw && !write_raw(volume, o->raw))
            st = cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be written", o->raw);
    }
    cts_volume_free(&volume);
    cts_series_list_free(&list);
    cts_report_free(&report);
    return st;
}

int main(int argc, char **argv)
{
    Options o;
    CtsError err = {0};
    if (!parse(argc, argv, &o)) {
        fprintf(stderr,
                "usage: volume_dump PATH [--series UID] [--threads N] [--raw FILE] [--repeat N] [--list] [--copy]\n");
        return 2;
    }
    for (int i = 0; i < o.repeat && !err.status; i++)
        run(&o, i == o.repeat - 1, &err);
    if (err.status)
        fprintf(stderr, "volume_dump: %s\n", err.text);
    return cts_exit_code(err.status);
}
