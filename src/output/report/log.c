#include "output/report/log.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/file.h"
#include "base/json.h"
#include "base/parallel.h"
#include "base/site_key.h"
#include "output/report/info.h"
#include "output/report/redact.h"
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

struct CtsLog {
    const char *path;
    int fd;
    double parallel_before_ms;
    double start_ms, end_ms, cpu_ms,
        parallel_ms; /* the end: when the report was given, as writing it is not the run's */
    FILE *lines;     /* in memory: text, size once it is flushed */
    char *text;
    size_t size;
    json_t *run; /* the first line, whose fields are known only at the end */
    char *last_words;
    const CtsNames *names; /* of files that the log must not contain; NULL: none */
    CtsKey key;
    bool has_key; /* else UIDs are omitted, even as hashes */
};

/* With a random id, so that runs of many machines can share a file. */
static json_t *new_run(void)
{
    uint64_t id = 0;
    char run_id[17];
    if (getrandom(&id, sizeof id, 0) != (ssize_t)sizeof id)
        id = (uint64_t)time(NULL) << 20 ^ (uint64_t)getpid();
    snprintf(run_id, sizeof run_id, "%016llx", (unsigned long long)id);
    return json_pack("{s:s,s:f,s:s,s:s,s:s,s:n,s:n}", "event", "run", "t_ms", 0.0, "run_id", run_id, "version",
                     CTS_VERSION, "time", cts_utc_now().text, "command", "series_uid_hash");
}

static CtsStatus open_log(const char *path, int *fd, CtsError *err)
{
    *fd = strcmp(path, "-") ? open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666) : STDERR_FILENO;
    return *fd < 0 ? cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (the log)", path, strerror(errno)) : CTS_OK;
}

CtsStatus cts_log_check(const char *path, CtsError *err)
{
    int fd;
    const CtsStatus st = path ? open_log(path, &fd, err) : CTS_OK;
    if (path && !st && fd != STDERR_FILENO)
        close(fd);
    return st;
}

static void free_log(CtsLog *l)
{
    fclose(l->lines);
    free(l->text);
    json_decref(l->run);
    free(l->last_words);
    free(l);
}

CtsStatus cts_log_open(CtsLog **log, const char *path, const char *key, bool may_make_key, double start_ms,
                       CtsError *err)
{
    *log = NULL;
    if (!path)
        return CTS_OK;
    CtsLog *l = calloc(1, sizeof *l);
    if (l)
        l->lines = open_memstream(&l->text, &l->size);
    if (!l || !l->lines) {
        free(l);
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    l->path = path;
    l->start_ms = start_ms;
    l->parallel_before_ms = cts_parallel_ms();
    l->run = new_run();
    CtsStatus st = cts_key_load(key, may_make_key, &l->key, err);
    l->has_key = !st;
    if (!key) /* without a key the log has no hashes */
        st = CTS_OK;
    if (st || (st = open_log(path, &l->fd, err))) {
        free_log(l);
        return st;
    }
    *log = l;
    return CTS_OK;
}

static char *new_log_line(json_t *object)
{
    char *line = object ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(12)) : NULL;
    json_decref(object);
    return line;
}

/* A log that runs out of memory loses a line, never the picture. */
static void add_log_line(CtsLog *log, json_t *object)
{
    char *line = new_log_line(object);
    if (line)
        fprintf(log->lines, "%s\n", line);
    free(line);
}

/* To the microsecond: more digits are noise. */
static json_t *new_ms(double ms)
{
    return json_real(round(ms * 1000) / 1000);
}

/* Writes a line with the fields of an event; takes ownership of fields. */
static void add_event(CtsLog *log, const char *event, json_t *fields)
{
    if (!log) {
        json_decref(fields);
        return;
    }
    json_t *object = json_pack("{s:s,s:o}", "event", event, "t_ms", new_ms(cts_wall_ms() - log->start_ms));
    json_object_update(object, fields);
    json_decref(fields);
    add_log_line(log, object);
}

/* Skips a line equal to an earlier one, as frames of a rotation may cause. */
static void add_once(CtsLog *log, const char *event, json_t *fields)
{
    char *text = new_log_line(json_incref(fields));
    if (text && !fflush(log->lines) && memmem(log->text, log->size, text + 1, strlen(text) - 1))
        json_decref(fields);
    else
        add_event(log, event, fields);
    free(text);
}

/* A message names series by their UIDs, and files. */
static json_t *new_message(const CtsLog *log, const char *text)
{
    char *nameless = log->names ? cts_redact_names(text, log->names, NULL) : NULL;
    char *masked =
        nameless || !log->names ? cts_redact_uids(log->has_key ? &log->key : NULL, nameless ? nameless : text) : NULL;
    free(nameless);
    json_t *value = masked ? cts_json_new_text(masked) : json_null();
    free(masked);
    return value;
}

void cts_log_picture(CtsLog *log, const char *preset, const CtsRenderSettings *settings, int n_frames)
{
    add_event(log, "picture",
              json_pack("{s:o,s:[f,f],s:[i,i],s:i}", "preset", cts_json_new_text(preset), "view", settings->azimuth_deg,
                        settings->elevation_deg, "size", settings->width, settings->height, "frames", n_frames));
}

void cts_log_output(CtsLog *log, const char *path, const char *format, uint64_t bytes)
{
    add_event(
        log, "output",
        json_pack("{s:o,s:s,s:I}", "path", cts_json_new_text(path), "format", format, "bytes", (json_int_t)bytes));
}

/* Verification counts as compositing in the stages, which add up to the whole; this event has its share. */
json_t *cts_error_json(const CtsReport *report)
{
    const CtsVerified *v = &report->verified;
    const double picture_cpu_ms = cts_report_picture_cpu_ms(report);
    /* JSON has no infinity: no error at all has no psnr_db. */
    return json_pack("{s:I,s:f,s:f,s:f,s:o,s:f,s:f,s:f,s:f,s:o,s:o,s:s}", "pixels", (json_int_t)v->pixels, "rmse",
                     v->rmse, "rmse_low", v->rmse_low, "rmse_high", v->rmse_high, "psnr_db",
                     v->rmse > 0 ? json_real(-20 * log10(v->rmse)) : json_null(), "p999", v->p999, "max", v->max,
                     "share", v->share_above, "share_high", v->share_high, "cpu_ms", new_ms(v->cpu_ms),
                     "picture_cpu_ms", new_ms(picture_cpu_ms), "cost",
                     v->cpu_ms < picture_cpu_ms ? "less than the picture" : "more than the picture");
}

void cts_log_without_names(CtsLog *log, const CtsNames *names)
{
    if (log)
        log->names = names;
}

/* The lines of the plan, as --explain prints them. */
static void log_plan(CtsLog *log, const char *plan)
{
    while (plan && *plan) {
        const size_t size = strcspn(plan, "\n");
        add_once(log, "plan", json_pack("{s:s%}", "text", plan, size));
        plan += size + (plan[size] == '\n');
    }
}

void cts_log_report(CtsLog *log, const CtsReport *report)
{
    if (!log)
        return;
    log->end_ms = cts_wall_ms();
    log->cpu_ms = cts_cpu_ms();
    log->parallel_ms = cts_parallel_ms() - log->parallel_before_ms;
    log_plan(log, report->plan);
    for (int s = 0; s < CTS_N_STAGES; s++) {
        const CtsStageTime *stage = &report->stages[s];
        if (!stage->ran)
            continue;
        add_event(log, "stage",
                  json_pack("{s:s,s:o,s:o,s:I,s:I}", "stage", cts_stage_names[s], "wall_ms", new_ms(stage->wall_ms),
                            "cpu_ms", new_ms(stage->cpu_ms), "items", (json_int_t)stage->items, "bytes",
                            (json_int_t)stage->bytes));
    }
    for (size_t i = 0; i < report->n_skips; i++)
        add_once(log, "skipped", json_pack("{s:s,s:s}", "what", report->skips[i].what, "why", report->skips[i].why));
    for (size_t i = 0; i < report->n_labels; i++)
        add_event(log, "label", cts_label_json(&report->labels[i]));
    for (size_t i = 0; i < report->diagnostics.n; i++) {
        const CtsDiagnostic *d = &report->diagnostics.items[i];
        add_once(log, "finding",
                 json_pack("{s:s,s:s,s:o}", "code", d->code, "severity", cts_severity_names[d->severity], "text",
                           new_message(log, d->text)));
    }
    if (report->table.known)
        add_event(log, "table", cts_table_json(&report->table));
    const CtsVoxelCounts *v = &report->voxels;
    const CtsErrorBound *b = &report->bound;
    if (v->known)
        add_event(log, "voxels",
                  json_pack("{s:I,s:I,s:I,s:I}", "total", (json_int_t)v->total, "void", (json_int_t)v->void_voxels,
                            "reused", (json_int_t)v->reused, "splatted", (json_int_t)v->splatted));
    if (b->known)
        add_event(log, "bound",
                  json_pack("{s:f,s:f,s:o,s:s,s:I,s:s,s:s?}", "rmse", b->rmse, "rms_estimate", b->rms_estimate, "max",
                            b->max >= 0 ? json_real(b->max) : json_null(), "kind", "estimated", "cast",
                            (json_int_t)b->n_rerendered, "engine", b->engine, "level", *b->level ? b->level : NULL));
    if (report->verified.pixels)
        add_event(log, "error", cts_error_json(report));
}

void cts_log_run(CtsLog *log, const char *command, const char *series_uid)
{
    char *const hash = log && series_uid && log->has_key ? cts_uid_hash(&log->key, series_uid) : NULL;
    if (log && command)
        json_object_set_new(log->run, "command", cts_json_new_text(command));
    if (hash)
        json_object_set_new(log->run, "series_uid_hash", json_string(hash));
    free(hash);
}

bool cts_log_last_words(CtsLog *log, int *fd, const char **text, size_t *size)
{
    char *const run = log ? new_log_line(json_incref(log->run)) : NULL;
    char *const failed = new_log_line(
        json_pack("{s:s,s:f,s:i,s:s}", "event", "failed", "t_ms", 0.0, "exit_code", 130, "message", "interrupted"));
    const int n = run && failed ? asprintf(&log->last_words, "%s\n%s\n", run, failed) : -1;
    free(run);
    free(failed);
    if (n < 0)
        return false;
    *fd = log->fd;
    *text = log->last_words;
    *size = (size_t)n;
    return true;
}

void cts_log_failed(CtsLog *log, int exit_code, const char *message)
{
    if (!log)
        return;
    add_event(log, "failed", json_pack("{s:i,s:o}", "exit_code", exit_code, "message", new_message(log, message)));
}

void cts_log_done(CtsLog *log, int n_threads)
{
    if (!log)
        return;
    const char *why;
    const int threads = cts_threads_why(n_threads, &why);
    add_event(log, "done",
              json_pack("{s:o,s:o,s:o,s:I,s:i,s:s}", "wall_ms", new_ms(log->end_ms - log->start_ms), "cpu_ms",
                        new_ms(log->cpu_ms), "serial_ms",
                        new_ms(fmax(log->end_ms - log->start_ms - log->parallel_ms, 0)), "peak_rss_bytes",
                        (json_int_t)cts_peak_rss_bytes(), "threads", threads, "threads_why", why));
}

CtsStatus cts_log_close(CtsLog **log, CtsError *err)
{
    CtsLog *l = *log;
    if (!l)
        return CTS_OK;
    char *run = new_log_line(json_incref(l->run)), *text = NULL;
    const int n = run && !fflush(l->lines) ? asprintf(&text, "%s\n%s", run, l->text) : -1;
    const bool good = n >= 0 && cts_write_all(l->fd, text, (size_t)n) && (l->fd == STDERR_FILENO || !close(l->fd));
    const CtsStatus st = good ? CTS_OK : cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (the log)", l->path, strerror(errno));
    free(run);
    free(n >= 0 ? text : NULL);
    free_log(l);
    *log = NULL;
    return st;
}
