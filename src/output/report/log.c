#define _GNU_SOURCE
#include "output/report/log.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/file.h"
#include "base/json.h"
#include "base/parallel.h"
#include "base/site_key.h"
#include "output/report/info.h"
#include "output/report/masked.h"
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
    char *text;
    size_t size;
    char run_id[17];
    CtsUtc time;
    char *command, *series_hash; /* NULL: not known */
    char *last_words;
    const CtsNames *names; /* of files that are not to be told; NULL: none */
    CtsKey key;
    bool has_key; /* else no UID is told, not even as a hash */
};

/* A random number, so that runs of many machines can stand in one file; and when it began. */
static void name_run(CtsLog *log)
{
    uint64_t id = 0;
    if (getrandom(&id, sizeof id, 0) != (ssize_t)sizeof id)
        id = (uint64_t)time(NULL) << 20 ^ (uint64_t)getpid();
    snprintf(log->run_id, sizeof log->run_id, "%016llx", (unsigned long long)id);
    log->time = cts_utc_now();
}

static CtsStatus open_file(const char *path, int *fd, CtsError *err)
{
    *fd = strcmp(path, "-") ? open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666) : STDERR_FILENO;
    return *fd < 0 ? cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (the log)", path, strerror(errno)) : CTS_OK;
}

CtsStatus cts_log_check(const char *path, CtsError *err)
{
    int fd;
    const CtsStatus st = path ? open_file(path, &fd, err) : CTS_OK;
    if (path && !st && fd != STDERR_FILENO)
        close(fd);
    return st;
}

CtsStatus cts_log_open(CtsLog **log, const char *path, const char *key, bool may_make_key, double start_ms,
                       CtsError *err)
{
    *log = NULL;
    if (!path)
        return CTS_OK;
    CtsLog *l = calloc(1, sizeof *l);
    if (!l)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    l->path = path;
    l->start_ms = start_ms;
    l->parallel_before_ms = cts_parallel_ms();
    name_run(l);
    CtsStatus st = cts_key_load(key, may_make_key, &l->key, err);
    l->has_key = !st;
    if (!key) /* a log without hashes is better than none */
        st = CTS_OK;
    if (st || (st = open_file(path, &l->fd, err))) {
        free(l);
        return st;
    }
    *log = l;
    return CTS_OK;
}

/* A log that runs out of memory loses a line, never the picture. */
static void add_line(CtsLog *log, json_t *object)
{
    char *line = object ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(12)) : NULL;
    if (line) {
        const size_t n = strlen(line);
        char *text = realloc(log->text, log->size + n + 1);
        if (text) {
            memcpy(text + log->size, line, n);
            text[log->size + n] = '\n';
            log->text = text;
            log->size += n + 1;
        }
    }
    free(line);
    json_decref(object);
}

/* To the microsecond: more digits are noise. */
static json_t *new_ms(double ms)
{
    return json_real(round(ms * 1000) / 1000);
}

static json_t *new_event(const CtsLog *log, const char *event)
{
    return json_pack("{s:s,s:o}", "event", event, "t_ms", new_ms(cts_wall_ms() - log->start_ms));
}

static void set_integer(json_t *object, const char *key, uint64_t value)
{
    json_object_set_new(object, key, json_integer((json_int_t)value));
}

/* A message names series by their UIDs, and files. */
static json_t *new_message(const CtsLog *log, const char *text)
{
    char *nameless = log->names ? cts_without_names(text, log->names, NULL) : NULL;
    char *masked =
        nameless || !log->names ? cts_without_uids(log->has_key ? &log->key : NULL, nameless ? nameless : text) : NULL;
    free(nameless);
    json_t *value = masked ? cts_json_new_text(masked) : json_null();
    free(masked);
    return value;
}

void cts_log_picture(CtsLog *log, const char *preset, const CtsRenderSettings *settings, int n_frames)
{
    if (!log)
        return;
    json_t *event = new_event(log, "picture");
    json_object_set_new(event, "preset", cts_json_new_text(preset));
    json_object_set_new(event, "view", json_pack("[f,f]", settings->azimuth_deg, settings->elevation_deg));
    json_object_set_new(event, "size", json_pack("[i,i]", settings->width, settings->height));
    json_object_set_new(event, "frames", json_integer(n_frames));
    add_line(log, event);
}

void cts_log_output(CtsLog *log, const char *path, const char *format, uint64_t bytes)
{
    if (!log)
        return;
    json_t *event = new_event(log, "output");
    json_object_set_new(event, "path", cts_json_new_text(path));
    json_object_set_new(event, "format", json_string(format));
    set_integer(event, "bytes", bytes);
    add_line(log, event);
}

/* Whether an earlier entry says the same: each frame of a rotation leaves out the same things. */
static bool told_before(const CtsReport *report, size_t index)
{
    const CtsSkip *skips = report->skips;
    for (size_t i = 0; i < index; i++)
        if (!strcmp(skips[i].what, skips[index].what) && !strcmp(skips[i].why, skips[index].why))
            return true;
    return false;
}

/* Verification counts as compositing in the stages, which add up to the whole; here stands what it took of that. */
json_t *cts_error_json(const CtsReport *report)
{
    const CtsVerified *v = &report->verified;
    const double picture_cpu_ms = cts_report_picture_cpu_ms(report);
    json_t *error = json_object();
    set_integer(error, "pixels", v->pixels);
    json_object_set_new(error, "rmse", json_real(v->rmse));
    json_object_set_new(error, "rmse_low", json_real(v->rmse_low));
    json_object_set_new(error, "rmse_high", json_real(v->rmse_high));
    /* JSON has no infinity: no error at all has no psnr_db. */
    json_object_set_new(error, "psnr_db", v->rmse > 0 ? json_real(-20 * log10(v->rmse)) : json_null());
    json_object_set_new(error, "p999", json_real(v->p999));
    json_object_set_new(error, "max", json_real(v->max));
    json_object_set_new(error, "share", json_real(v->share_above));
    json_object_set_new(error, "share_high", json_real(v->share_high));
    json_object_set_new(error, "cpu_ms", new_ms(v->cpu_ms));
    json_object_set_new(error, "picture_cpu_ms", new_ms(picture_cpu_ms));
    json_object_set_new(error, "cost",
                        json_string(v->cpu_ms < picture_cpu_ms ? "less than the picture" : "more than the picture"));
    return error;
}

static void log_verified(CtsLog *log, const CtsReport *report)
{
    json_t *event = new_event(log, "error"), *error = cts_error_json(report);
    json_object_update(event, error);
    json_decref(error);
    add_line(log, event);
}

void cts_log_without_names(CtsLog *log, const CtsNames *names)
{
    if (log)
        log->names = names;
}

/* Each finding once, however many frames met it. */
static void log_findings(CtsLog *log, const CtsFindings *findings)
{
    for (size_t i = 0; i < findings->n; i++) {
        const CtsFinding *f = &findings->items[i];
        bool told = false;
        for (size_t k = 0; k < i && !told; k++)
            told = !strcmp(findings->items[k].code, f->code) && !strcmp(findings->items[k].text, f->text);
        if (told)
            continue;
        json_t *event = new_event(log, "finding");
        json_object_set_new(event, "code", json_string(f->code));
        json_object_set_new(event, "severity", json_string(cts_severity_names[f->severity]));
        json_object_set_new(event, "text", new_message(log, f->text));
        add_line(log, event);
    }
}

/* Whether a line of size bytes stands among those in front of it. */
static bool stands_before(const char *plan, const char *line, size_t size)
{
    for (const char *p = plan; p < line; p = strchr(p, '\n') + 1)
        if (!strncmp(p, line, size) && p[size] == '\n')
            return true;
    return false;
}

/* What --explain prints, each line once, however many frames had it. */
static void log_plan(CtsLog *log, const char *plan)
{
    for (const char *line = plan; line && *line;) {
        const size_t size = strcspn(line, "\n");
        if (!stands_before(plan, line, size)) {
            json_t *event = new_event(log, "plan");
            json_object_set_new(event, "text", json_stringn(line, size));
            add_line(log, event);
        }
        line += size + (line[size] == '\n');
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
        json_t *event = new_event(log, "stage");
        json_object_set_new(event, "stage", json_string(cts_stage_names[s]));
        json_object_set_new(event, "wall_ms", new_ms(stage->wall_ms));
        json_object_set_new(event, "cpu_ms", new_ms(stage->cpu_ms));
        set_integer(event, "items", stage->items);
        set_integer(event, "bytes", stage->bytes);
        add_line(log, event);
    }
    for (size_t i = 0; i < report->n_skips; i++) {
        if (told_before(report, i))
            continue;
        json_t *event = new_event(log, "skipped");
        json_object_set_new(event, "what", json_string(report->skips[i].what));
        json_object_set_new(event, "why", json_string(report->skips[i].why));
        add_line(log, event);
    }
    for (size_t i = 0; i < report->n_labels; i++) {
        json_t *event = new_event(log, "label"), *label = cts_label_json(&report->labels[i]);
        json_object_update(event, label);
        json_decref(label);
        add_line(log, event);
    }
    log_findings(log, &report->findings);
    if (report->table.known) {
        json_t *event = new_event(log, "table"), *table = cts_table_json(&report->table);
        json_object_update(event, table);
        json_decref(table);
        add_line(log, event);
    }
    if (report->voxels.known) {
        json_t *event = new_event(log, "voxels");
        set_integer(event, "total", report->voxels.total);
        set_integer(event, "void", report->voxels.void_voxels);
        set_integer(event, "reused", report->voxels.reused);
        set_integer(event, "splatted", report->voxels.splatted);
        add_line(log, event);
    }
    if (report->bound.known) {
        json_t *event = new_event(log, "bound");
        json_object_set_new(event, "rmse", json_real(report->bound.rmse));
        json_object_set_new(event, "max", json_real(report->bound.max));
        json_object_set_new(event, "kind", json_string("estimated"));
        set_integer(event, "cast", report->bound.cast);
        add_line(log, event);
    }
    if (report->verified.pixels)
        log_verified(log, report);
}

static char *new_line(json_t *object)
{
    char *line = object ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(12)) : NULL;
    json_decref(object);
    return line;
}

static char *run_line(const CtsLog *log)
{
    return new_line(json_pack("{s:s,s:f,s:s,s:s,s:s,s:o,s:o}", "event", "run", "t_ms", 0.0, "run_id", log->run_id,
                              "version", CTS_VERSION, "time", log->time.text, "command",
                              log->command ? cts_json_new_text(log->command) : json_null(), "series_uid_hash",
                              log->series_hash ? json_string(log->series_hash) : json_null()));
}

static void prepare_last_words(CtsLog *log)
{
    char *run = run_line(log), *failed = new_line(json_pack("{s:s,s:f,s:i,s:s}", "event", "failed", "t_ms", 0.0,
                                                            "exit_code", 130, "message", "interrupted"));
    char *text = NULL;
    if (run && failed && asprintf(&text, "%s\n%s\n", run, failed) > 0) {
        free(log->last_words);
        log->last_words = text;
    }
    free(run);
    free(failed);
}

void cts_log_run(CtsLog *log, const char *command, const char *series_uid)
{
    if (!log)
        return;
    if (command && !log->command)
        log->command = strdup(command);
    if (series_uid && !log->series_hash && log->has_key)
        log->series_hash = cts_uid_hash(&log->key, series_uid);
    prepare_last_words(log);
}

bool cts_log_last_words(const CtsLog *log, int *fd, const char **text, size_t *size)
{
    if (!log || !log->last_words)
        return false;
    *fd = log->fd;
    *text = log->last_words;
    *size = strlen(log->last_words);
    return true;
}

void cts_log_failed(CtsLog *log, int exit_code, const char *message)
{
    if (!log)
        return;
    json_t *event = new_event(log, "failed");
    json_object_set_new(event, "exit_code", json_integer(exit_code));
    json_object_set_new(event, "message", new_message(log, message));
    add_line(log, event);
}

void cts_log_done(CtsLog *log, int n_threads)
{
    if (!log)
        return;
    json_t *event = new_event(log, "done");
    json_object_set_new(event, "wall_ms", new_ms(log->end_ms - log->start_ms));
    json_object_set_new(event, "cpu_ms", new_ms(log->cpu_ms));
    json_object_set_new(event, "serial_ms", new_ms(fmax(log->end_ms - log->start_ms - log->parallel_ms, 0)));
    set_integer(event, "peak_rss_bytes", cts_peak_rss_bytes());
    const char *why;
    json_object_set_new(event, "threads", json_integer(cts_threads_why(n_threads, &why)));
    json_object_set_new(event, "threads_why", json_string(why));
    add_line(log, event);
}

/* What the first line tells is known last. */
static void put_run_first(CtsLog *log)
{
    char *run = run_line(log), *text = NULL;
    if (run && asprintf(&text, "%s\n%.*s", run, (int)log->size, log->text ? log->text : "") > 0) {
        free(log->text);
        log->text = text;
        log->size = strlen(text);
    }
    free(run);
}

CtsStatus cts_log_close(CtsLog **log, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsLog *l = *log;
    if (!l)
        return CTS_OK;
    put_run_first(l);
    if (!cts_write_all(l->fd, l->text, l->size))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (the log)", l->path, strerror(errno));
    if (l->fd != STDERR_FILENO && close(l->fd) && !st)
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (the log)", l->path, strerror(errno));
    free(l->text);
    free(l->command);
    free(l->series_hash);
    free(l->last_words);
    free(l);
    *log = NULL;
    return st;
}
