/* Worker process of one series: determines missing outputs, and records the results. */
#include "app/batch/batch.h"

#include "app/batch/worker.h"
#include "base/clock.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/json.h"
#include "base/mem.h"
#include "base/sanitized.h"
#include "base/text.h"
#include "output/report/log.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

void cts_worker_set_status(json_t *record, int exit_code, const char *reason)
{
    const char *const status = !exit_code ? "done" : exit_code == 3 || exit_code == 4 ? "refused" : "failed";
    json_object_set_new(record, "status", json_string(status));
    json_object_set_new(record, "reason", cts_json_new_text(reason));
    json_object_set_new(record, "exit_code", json_integer(exit_code));
    json_object_set_new(record, "ended", json_string(cts_utc_now().text));
    json_object_del(record, "unfinished");
    json_object_del(record, "reason_file");
}

void cts_worker_report_status(CtsWorkerProcess *worker_process, CtsStatus status, const char *reason)
{
    char *file = NULL, *text = cts_redact_names(reason, &worker_process->names, &file);
    cts_worker_set_status(worker_process->record, cts_exit_code(status), text ? text : "");
    if (file)
        json_object_set_new(worker_process->record, "reason_file", cts_json_new_text(file));
    free(file);
    free(text);
}

/* Folders, how many files in each, and the first of them, in order of path. */
static json_t *new_sources(const CtsPlanSeries *series)
{
    json_t *list = json_array(), *last = NULL;
    for (int i = 0; i < series->n_paths; i++) {
        const char *path = series->paths[i], *slash = strrchr(path, '/');
        char *folder = slash ? strndup(path, (size_t)(slash - path)) : strdup(".");
        json_t *name = folder ? cts_json_new_text(folder) : NULL;
        if (last && json_equal(json_object_get(last, "folder"), name)) {
            json_object_set_new(last, "files", json_integer(json_integer_value(json_object_get(last, "files")) + 1));
        } else {
            last = json_pack("{s:O,s:o,s:i}", "folder", name, "first", cts_json_new_text(slash ? slash + 1 : path),
                             "files", 1);
            json_array_append_new(list, last);
        }
        json_decref(name);
        free(folder);
    }
    return list;
}

json_t *cts_worker_new_record(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *uid,
                              const char *folder)
{
    char hex[65] = "";
    cts_journal_record_hash(settings, NULL, true, hex, NULL);
    json_t *record = json_pack("{s:o,s:s}", "series_uid", cts_json_new_text(uid), "folder", folder);
    cts_worker_set_status(record, 1, "not finished");
    json_object_update_new(record, json_pack("{s:o,s:s,s:s,s:i,s:[],s:[],s:[]}", "sources", new_sources(series),
                                             "input_sha256", series->input_sha256, "options_sha256", hex, "files",
                                             series->n_paths, "outputs", "thumbnails", "findings"));
    return record;
}

static CtsStatus send_text(const CtsWorkerProcess *worker_process, const char *message, CtsError *err)
{
    return cts_send_all(worker_process->socket, message, strlen(message))
               ? CTS_OK
               : cts_fail(err, CTS_ERR_INTERRUPTED, "the batch process has ended: %s", strerror(errno));
}

/* A message with the text, which has the series' name in the batch wherever reasons and findings have its own; NULL
 * without memory. */
static char *renamed_message(char kind, const char *text, const CtsPlanSeries *series)
{
    char *out = NULL;
    size_t size;
    FILE *stream = open_memstream(&out, &size);
    if (!stream)
        return NULL;
    const char *own = series && strcmp(series->own_uid, series->uid) ? series->own_uid : "";
    const size_t n = strlen(own);
    fputc(kind, stream);
    for (const char *at; n && (at = strstr(text, own)); text = at + n)
        fprintf(stream, "%.*s%s", (int)(at - text), text, at[n] >= '0' && at[n] <= '9' ? own : series->uid);
    fprintf(stream, "%s\n", text);
    return cts_text_end(stream, &out);
}

CtsStatus cts_worker_send_record(const CtsWorkerProcess *c, char kind, CtsError *err)
{
    char *const record = json_dumps(c->record, JSON_COMPACT | JSON_REAL_PRECISION(12));
    char *const message = record ? renamed_message(kind, record, c->series) : NULL;
    const CtsStatus st = message ? send_text(c, message, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    free(record);
    free(message);
    return st;
}

/* Makes this process the first choice of the OOM killer, and limits its memory. */
static void limit_worker(double mib)
{
    const struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const uint64_t bytes = mib > 0 ? (uint64_t)(mib * 1048576) : cts_memory_available() / 10 * 9;
    const struct rlimit data = {bytes, bytes};
    /* A sanitizer's own memory counts as data. */
    if (bytes && !CTS_SANITIZED)
        setrlimit(RLIMIT_DATA, &data);
    FILE *const score = fopen("/proc/self/oom_score_adj", "we");
    if (score) {
        fputs("1000", score); /* the largest */
        fclose(score);
    }
}

CtsStatus cts_worker_fork(CtsWorkerProcess *worker_process, void (*run)(CtsWorkerProcess *worker_process),
                          CtsWorker *worker, CtsError *err)
{
    int ends[2];
    const pid_t parent = getpid();
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends))
        return cts_fail(err, CTS_ERR_INTERNAL, "no socket: %s", strerror(errno));
    fflush(NULL);
    const pid_t pid = fork();
    if (pid < 0) {
        close(ends[0]);
        close(ends[1]);
        return cts_fail(err, CTS_ERR_INTERNAL, "no process: %s", strerror(errno));
    }
    if (pid == 0) {
        worker_process->socket = ends[1];
        worker_process->start_wall_ms = cts_wall_ms();
        worker_process->start_cpu_ms = cts_cpu_ms();
        close(ends[0]);
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent)
            _exit(1);
        limit_worker(worker_process->settings->options->series_mib);
        cts_journal_leave(worker_process->journal);
        run(worker_process);
    }
    close(ends[1]);
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
    worker->socket = ends[0];
    worker->pid = pid;
    return CTS_OK;
}

static void free_pictures(CtsWorkerProcess *c)
{
    for (int i = 0; i < c->n_pictures; i++) {
        CtsBatchPicture *p = &c->pictures[i];
        for (int f = 0; p->paths && p->paths[f]; f++)
            free((char *)p->paths[f]);
        free(p->paths);
        free((char *)p->thumb_stem);
    }
    free(c->pictures);
}

/* The record to continue: that of an earlier run with the same files, or an empty one. */
static void take_record(CtsWorkerProcess *c, const char *uid)
{
    const char *input;
    c->known = cts_journal_find(c->journal, uid, NULL);
    input = json_string_value(json_object_get(c->known, "input_sha256"));
    c->record = cts_worker_new_record(c->settings, c->series, uid, c->folder);
    if (c->known && (!input || strcmp(input, c->series->input_sha256))) {
        cts_journal_record_drop(c->known, "outputs", c->settings, NULL, NULL);
        cts_journal_record_drop(c->known, "thumbnails", c->settings, NULL, NULL);
        json_decref(c->known);
        c->known = NULL;
    }
    static const char *const kept[] = {"outputs", "thumbnails", "errors", "tries"};
    for (int i = 0; i < 4; i++)
        if (i < 3 ? json_is_array(json_object_get(c->known, kept[i]))
                  : json_is_integer(json_object_get(c->known, kept[i])))
            json_object_set(c->record, kept[i], json_object_get(c->known, kept[i]));
}

/* The missing outputs of a picture; if nothing is missing, its paths and stem stay NULL. */
static CtsStatus find_missing(CtsWorkerProcess *c, CtsBatchPicture *p, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    char stem[CTS_RECORD_STEM];
    int n = 0;
    cts_journal_record_stem(s, p, stem);
    if (!(p->paths = calloc((size_t)s->lists->n_formats + 1, sizeof *p->paths)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int f = 0; f < s->lists->n_formats; f++) {
        char *path;
        if (cts_journal_record_is_up_to_date(s, c->record, p, s->lists->formats[f]))
            continue;
        cts_journal_record_drop(c->record, "outputs", s, p, s->lists->formats[f]);
        if (asprintf(&path, "%s/%s/%s.%s", s->options->output_dir, c->folder, stem, s->lists->formats[f]) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        p->paths[n++] = path;
    }
    if (n)
        cts_journal_record_drop(c->record, "errors", s, p, NULL);
    if (n || !cts_journal_record_is_up_to_date(s, c->record, p, NULL)) {
        char *path;
        cts_journal_record_drop(c->record, "thumbnails", s, p, NULL);
        if (asprintf(&path, "%s/%s/thumbs/%s", s->options->output_dir, c->folder, stem) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        p->thumb_stem = path;
    }
    return CTS_OK;
}

static CtsStatus make_folders(CtsWorkerProcess *c, CtsError *err)
{
    char path[PATH_MAX];
    for (int deep = 0; deep < 2; deep++) {
        if (snprintf(path, sizeof path, "%s/%s%s", c->settings->options->output_dir, c->folder,
                     deep ? "/thumbs" : "") >= PATH_MAX)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: the path is too long", c->settings->options->output_dir);
        if (mkdir(path, 0777) && errno != EEXIST)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s", path, strerror(errno));
        struct stat info;
        if (lstat(path, &info) || !S_ISDIR(info.st_mode))
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: is not a folder (links that lead out of -O are not followed)",
                            path);
    }
    cts_sweep_series(c->settings->options->output_dir, c->folder);
    return CTS_OK;
}

/* An equal finding in the list, or NULL. */
static json_t *same_diagnostic(json_t *list, const json_t *entry)
{
    static const char *const keys[] = {"code", "text", "preset"};
    for (size_t i = json_array_size(list); i-- > 0;) {
        json_t *other = json_array_get(list, i);
        bool same = true;
        for (int k = 0; k < 3 && same; k++) {
            const json_t *a = json_object_get(other, keys[k]), *b = json_object_get(entry, keys[k]);
            same = a == b || json_equal(a, b);
        }
        if (same)
            return other;
    }
    return NULL;
}

void cts_worker_add_diagnostic(CtsWorkerProcess *c, const CtsDiagnostic *diagnostic, const char *preset)
{
    json_t *list = json_object_get(c->record, "findings"), *entry = cts_diagnostic_json(diagnostic);
    char *file = NULL, *text = cts_redact_names(diagnostic->text, &c->names, &file);
    json_object_set_new(entry, "text", cts_json_new_text(text ? text : ""));
    if (preset)
        json_object_set_new(entry, "preset", json_string(preset));
    json_t *previous = same_diagnostic(list, entry);
    if (previous) {
        const json_int_t count = json_integer_value(json_object_get(previous, "count"));
        json_object_set_new(previous, "count", json_integer((count ? count : 1) + 1));
    } else {
        json_array_append(list, previous = entry);
    }
    if (file && !json_object_get(previous, "files"))
        json_object_set_new(previous, "files", json_array());
    if (file)
        json_array_append_new(json_object_get(previous, "files"), cts_json_new_text(file));
    json_decref(entry);
    free(file);
    free(text);
}

void cts_worker_loaded(CtsWorkerProcess *c, const CtsPixelFacts *facts)
{
    json_t *geometry = cts_info_json(c->now, facts, true);
    CtsKey key;
    if (c->settings->options->export.deidentify) {
        const bool known = *c->now->study_uid && !cts_key_load(c->settings->options->export.key, false, &key, NULL);
        char *study = known ? cts_uid_hash(&key, c->now->study_uid) : NULL;
        json_object_set_new(geometry, "study", study ? json_string(study) : json_null());
        free(study);
    }
    json_object_del(geometry, "findings");
    json_object_del(geometry, "series_uid");
    json_object_set_new(c->record, "geometry", geometry);
    json_array_clear(json_object_get(c->record, "findings"));
    for (size_t i = 0; i < c->now->diagnostics.n; i++)
        cts_worker_add_diagnostic(c, &c->now->diagnostics.items[i], NULL);
    for (size_t i = 0; i < facts->diagnostics.n; i++)
        cts_worker_add_diagnostic(c, &facts->diagnostics.items[i], NULL);
}

static CtsStatus list_pictures(CtsWorkerProcess *c, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    CtsStatus st = CTS_OK;
    if (!(c->pictures = calloc((size_t)s->lists->n_presets * (size_t)s->lists->n_views, sizeof *c->pictures)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int p = 0; p < s->lists->n_presets && !st; p++)
        for (int v = 0; v < s->lists->n_views && !st; v++) {
            if (!cts_journal_record_takes(s, c->record, p, v))
                continue;
            CtsBatchPicture *picture = &c->pictures[c->n_pictures++];
            *picture = (CtsBatchPicture){.preset = p, .view = v};
            st = find_missing(c, picture, err);
            if (!st && !picture->thumb_stem) {
                free(picture->paths);
                c->n_pictures--;
            }
        }
    c->n_left = c->n_pictures;
    return st;
}

bool cts_worker_shows_image(const CtsWorkerProcess *c)
{
    return c->now->passed && (!c->now->may_name || c->settings->options->show_patient);
}

CtsStatus cts_worker_begin_series(CtsWorkerProcess *c, CtsError *err)
{
    const CtsSeries *const series = c->now;
    char uid[96];
    CtsStatus st;
    snprintf(uid, sizeof uid, series->part ? "%s#%d" : "%s", c->series->uid, series->part);
    snprintf(c->folder, sizeof c->folder, series->part ? "%s-%d" : "%s", c->series->folder, series->part);
    take_record(c, uid);
    cts_worker_loaded(c, &(CtsPixelFacts){0});
    json_object_set(c->record, "modality", json_object_get(json_object_get(c->record, "geometry"), "modality"));
    if (series->passed) {
        cts_journal_record_drop(c->record, "thumbnails", c->settings, NULL, NULL);
        json_object_set_new(c->record, "may_name", json_boolean(series->may_name));
        if (cts_worker_shows_image(c) && (st = make_folders(c, err)))
            return st;
    }
    if (series->renderable && ((st = list_pictures(c, err)) || (c->n_pictures && (st = make_folders(c, err)))))
        return st;
    json_object_set_new(c->record, "unfinished", json_integer(c->n_left));
    return cts_worker_send_record(c, CTS_WORKER_BEGUN, err);
}

/* Of the file PATH, or of PATH with a suffix behind it. */
static json_t *new_entry(const CtsWorkerProcess *c, const char *path, const char *suffix)
{
    const CtsBatchSettings *s = c->settings;
    const size_t n = strlen(s->options->output_dir) + 1;
    char hex[65] = "";
    const char *dot = strrchr(path, '.');
    cts_journal_record_hash(s, c->picture, dot && !strcmp(dot, ".dcm"), hex, NULL);
    return json_pack("{s:s+,s:s,s:s,s:s,s:s}", "path", path + n, suffix, "preset",
                     s->lists->presets[c->picture->preset].name, "view", s->lists->views[c->picture->view].name,
                     "settings_sha256", hex, "version", CTS_VERSION);
}

/* Inserts in the order of names, independent of the order of rendering. Takes ownership of entry. */
static void add_in_order(json_t *list, json_t *entry)
{
    size_t i = json_array_size(list);
    while (i > 0 && strcmp(cts_json_text_of(json_array_get(list, i - 1), "path"), cts_json_text_of(entry, "path")) > 0)
        i--;
    json_array_insert_new(list, i, entry);
}

CtsStatus cts_worker_output(CtsWorkerProcess *c, const char *path, int frame, CtsError *err)
{
    json_t *entry = new_entry(c, path, "");
    const char *dot = strrchr(path, '.');
    if (frame >= 0)
        json_object_set_new(entry, "frame", json_integer(frame));
    json_object_set_new(entry, "format", json_string(dot ? dot + 1 : ""));
    const CtsStatus st = cts_journal_record_file_facts(c->settings, entry, err);
    if (st)
        json_decref(entry);
    else
        add_in_order(json_object_get(c->record, "outputs"), entry);
    return st;
}

CtsStatus cts_worker_thumbnail(CtsWorkerProcess *c, const CtsThumbnailFile *file, CtsError *err)
{
    json_t *entry = new_entry(c, c->picture->thumb_stem, file->suffix);
    json_object_update_new(entry, json_pack("{s:i,s:I,s:i,s:i}", "frames", file->n_frames, "bytes",
                                            (json_int_t)file->bytes, "width", file->width, "height", file->height));
    if (c->error >= 0)
        json_object_set_new(entry, "error_255", json_real(255 * c->error));
    return json_array_append_new(json_object_get(c->record, "thumbnails"), entry)
               ? cts_fail(err, CTS_ERR_MEMORY, "out of memory")
               : CTS_OK;
}

/* Listed with the thumbnails, so that it is moved and removed with them. */
CtsStatus cts_worker_card_picture(CtsWorkerProcess *c, const char *kind, const char *stem, const CtsThumbnailFile *file,
                                  CtsError *err)
{
    json_t *list = json_object_get(c->record, "thumbnails");
    for (size_t i = json_array_size(list); i-- > 0;)
        if (json_object_get(json_array_get(list, i), kind))
            json_array_remove(list, i);
    const char *const path = stem + strlen(c->settings->options->output_dir) + 1;
    json_t *entry = json_pack("{s:s+,s:b,s:I}", "path", path, file->suffix, kind, 1, "bytes", (json_int_t)file->bytes);
    return json_array_append_new(list, entry) ? cts_fail(err, CTS_ERR_MEMORY, "out of memory") : CTS_OK;
}

/* The report's findings up to n that the line does not have yet; preset: whose they are, or NULL: of the series, which
 * the report has once each time that it is read. */
static void report_diagnostics(CtsWorkerProcess *c, size_t n, const char *preset)
{
    CtsDiagnostic *const items = c->report.diagnostics.items;
    for (; c->n_diagnostics < n; c->n_diagnostics++) {
        const CtsDiagnostic *d = &items[c->n_diagnostics];
        if (!cts_diagnostics_have(&c->now->diagnostics, d) &&
            (preset || !cts_diagnostics_have(&(CtsDiagnostics){items, c->n_diagnostics}, d)))
            cts_worker_add_diagnostic(c, d, preset);
    }
}

/* Syncs and records each picture, so that it remains if the process dies later. */
CtsStatus cts_worker_picture_done(CtsWorkerProcess *c, size_t first_diagnostic, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    const char *preset = s->lists->presets[c->picture->preset].name;
    report_diagnostics(c, first_diagnostic, NULL);
    report_diagnostics(c, c->report.diagnostics.n, preset);
    if (c->report.verified.pixels) {
        json_t *entry = json_pack("{s:s,s:s}", "preset", preset, "view", s->lists->views[c->picture->view].name);
        json_t *error = cts_error_json(&c->report);
        json_object_update(entry, error);
        json_decref(error);
        if (!json_is_array(json_object_get(c->record, "errors")))
            json_object_set_new(c->record, "errors", json_array());
        json_array_append_new(json_object_get(c->record, "errors"), entry);
    }
    json_object_set_new(c->record, "unfinished", json_integer(--c->n_left));
    return c->n_left > 0 ? cts_worker_send_record(c, CTS_WORKER_RECORD, err) : CTS_OK;
}

static void record_labels(CtsWorkerProcess *c)
{
    json_t *labels = c->report.n_labels ? json_array() : NULL;
    for (size_t i = 0; i < c->report.n_labels; i++)
        json_array_append_new(labels, cts_label_json(&c->report.labels[i]));
    if (labels)
        json_object_set_new(c->record, "labels", labels);
}

static void record_times(CtsWorkerProcess *c)
{
    json_t *stages = json_object();
    for (int s = 0; s < CTS_N_STAGES; s++)
        if (c->report.stages[s].ran)
            json_object_set_new(stages, cts_stage_names[s],
                                json_pack("{s:f,s:f}", "wall_ms", round(c->report.stages[s].wall_ms * 1000) / 1000,
                                          "cpu_ms", round(c->report.stages[s].cpu_ms * 1000) / 1000));
    json_object_update_new(c->record, json_pack("{s:o,s:f,s:f,s:I,s:i}", "stages", stages, "wall_ms",
                                                round(cts_wall_ms() - c->start_wall_ms), "cpu_ms",
                                                round(cts_cpu_ms() - c->start_cpu_ms), "peak_rss_bytes",
                                                (json_int_t)cts_peak_rss_bytes(), "threads", c->n_threads));
}

/* Keeps an earlier run's findings for presets that this run does not render. */
static void keep_diagnostics(CtsWorkerProcess *c)
{
    size_t i;
    json_t *entry;
    json_array_foreach(json_object_get(c->known, "findings"), i, entry)
    {
        const char *preset = json_string_value(json_object_get(entry, "preset"));
        bool kept = preset;
        for (int k = 0; k < c->n_pictures && kept; k++)
            kept = strcmp(c->settings->lists->presets[c->pictures[k].preset].name, preset);
        if (kept)
            json_array_append(json_object_get(c->record, "findings"), entry);
    }
}

/* Keeps the times of the run that rendered, when nothing is rendered now. */
static void keep_times(CtsWorkerProcess *c)
{
    static const char *const kept[] = {"geometry", "findings", "labels",         "stages",
                                       "wall_ms",  "cpu_ms",   "peak_rss_bytes", "threads"};
    json_t *geometry = json_incref(json_object_get(c->record, "geometry"));
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
        if (json_object_get(c->known, kept[i]))
            json_object_set(c->record, kept[i], json_object_get(c->known, kept[i]));
    json_object_update_missing(json_object_get(c->record, "geometry"), geometry);
    json_decref(geometry);
}

CtsStatus cts_worker_end_series(CtsWorkerProcess *c, CtsStatus status, const CtsError *why)
{
    CtsError err;
    CtsStatus st = CTS_OK;
    const bool is_up_to_date = !status && c->known && c->n_pictures == 0;
    /* An interrupted series keeps its last record. */
    if (status != CTS_ERR_INTERRUPTED) {
        report_diagnostics(c, c->report.diagnostics.n, NULL);
        record_labels(c);
        if (c->report.table.known)
            json_object_set_new(c->record, "table", cts_table_json(&c->report.table));
        record_times(c);
        if (is_up_to_date)
            keep_times(c);
        else
            keep_diagnostics(c);
        cts_worker_report_status(c, status, status ? why->text : "");
        if (status && (c->skipped || (c->now->passed && status == c->now->refusal)))
            json_object_set_new(c->record, "status", json_string(c->skipped ? "skipped" : "thumbnail"));
        st = cts_worker_send_record(c, is_up_to_date ? CTS_WORKER_UP_TO_DATE : CTS_WORKER_LAST_RECORD, &err);
    }
    json_decref(c->record);
    json_decref(c->known);
    free_pictures(c);
    return st;
}
