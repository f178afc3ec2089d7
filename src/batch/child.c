#define _GNU_SOURCE
#include "batch/child.h"

#include "base/clock.h"
#include "base/exit_code.h"
#include "base/json.h"
#include "base/mem.h"
#include "base/sanitized.h"
#include "batch/line.h"
#include "batch/sweep.h"
#include "report/info.h"
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
#include <time.h>
#include <unistd.h>

struct CtsBatchChild {
    const CtsBatchSettings *settings;
    CtsJournal *journal;
    const CtsPlanSeries *series;
    int socket, n_threads;
    double start_wall_ms, start_cpu_ms;
    /* Of the series under way, of which the files may hold several: */
    json_t *line;
    char folder[96];
    CtsBatchPicture *pictures;
    int n_pictures, n_left;
    bool told; /* a last line was sent */
};

json_t *cts_child_now(void)
{
    char text[32];
    const time_t now = time(NULL);
    struct tm utc;
    gmtime_r(&now, &utc);
    strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    return json_string(text);
}

static json_t *new_line(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *uid,
                        const char *folder)
{
    char hex[65] = "";
    json_t *line = json_object();
    cts_line_options_hash(settings, hex, NULL);
    json_object_set_new(line, "series_uid", cts_line_text(uid));
    json_object_set_new(line, "folder", json_string(folder));
    json_object_set_new(line, "status", json_string("failed"));
    json_object_set_new(line, "reason", json_string("not finished"));
    json_object_set_new(line, "exit_code", json_integer(1));
    json_object_set_new(line, "ended", cts_child_now());
    json_object_set_new(line, "input_sha256", json_string(series->input_sha256));
    json_object_set_new(line, "options_sha256", json_string(hex));
    json_object_set_new(line, "files", json_integer(series->n_paths));
    json_object_set_new(line, "outputs", json_array());
    json_object_set_new(line, "thumbnails", json_array());
    json_object_set_new(line, "findings", json_array());
    return line;
}

json_t *cts_child_failed_line(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *reason,
                              int exit_code)
{
    json_t *line = new_line(settings, series, series->uid, series->folder);
    json_object_set_new(line, "reason", cts_line_text(reason));
    json_object_set_new(line, "exit_code", json_integer(exit_code));
    json_object_set_new(line, "status", json_string(exit_code == 3 || exit_code == 4 ? "refused" : "failed"));
    return line;
}

static CtsStatus send_text(int socket, const char *text, size_t n, CtsError *err)
{
    while (n > 0) {
        const ssize_t done = send(socket, text, n, MSG_NOSIGNAL);
        if (done < 0 && errno == EINTR)
            continue;
        if (done < 0)
            return cts_fail(err, CTS_ERR_INTERRUPTED, "the batch is gone: %s", strerror(errno));
        text += done;
        n -= (size_t)done;
    }
    return CTS_OK;
}

static CtsStatus send_line(struct CtsBatchChild *c, const char *word, CtsError *err)
{
    char *text = json_dumps(c->line, JSON_COMPACT | JSON_REAL_PRECISION(12));
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    CtsStatus st = send_text(c->socket, word, strlen(word), err);
    if (!st)
        st = send_text(c->socket, text, strlen(text), err);
    if (!st)
        st = send_text(c->socket, "\n", 1, err);
    free(text);
    return st;
}

static void free_pictures(struct CtsBatchChild *c)
{
    for (int i = 0; i < c->n_pictures; i++) {
        CtsBatchPicture *p = &c->pictures[i];
        for (int f = 0; p->paths && p->paths[f]; f++)
            free((char *)p->paths[f]);
        free(p->paths);
        free((char *)p->thumb_stem);
    }
    free(c->pictures);
    c->pictures = NULL;
    c->n_pictures = c->n_left = 0;
}

/* The line to go on from: what an earlier run made of the same files, or an empty one. */
static void take_line(struct CtsBatchChild *c, const char *uid)
{
    json_t *known = cts_journal_find(c->journal, uid);
    const char *input = json_string_value(json_object_get(known, "input_sha256"));
    c->line = new_line(c->settings, c->series, uid, c->folder);
    if (known && (!input || strcmp(input, c->series->input_sha256)))
        cts_line_drop_all(known, c->settings);
    static const char *const lists[] = {"outputs", "thumbnails"};
    for (int i = 0; i < 2; i++)
        if (json_is_array(json_object_get(known, lists[i])))
            json_object_set(c->line, lists[i], json_object_get(known, lists[i]));
    json_decref(known);
}

/* What of one picture is missing; nothing: its paths and stem stay NULL. */
static CtsStatus find_missing(struct CtsBatchChild *c, CtsBatchPicture *p, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    char stem[CTS_LINE_STEM];
    int n = 0;
    cts_line_stem(s, p, stem);
    if (!(p->paths = calloc((size_t)s->n_formats + 1, sizeof *p->paths)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int f = 0; f < s->n_formats; f++) {
        char *path;
        if (cts_line_stands(s, c->line, p, s->formats[f]))
            continue;
        cts_line_drop(c->line, s, p, s->formats[f]);
        if (asprintf(&path, "%s/%s/%s.%s", s->folder, c->folder, stem, s->formats[f]) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        p->paths[n++] = path;
    }
    if (n || !cts_line_stands(s, c->line, p, NULL)) {
        char *path;
        cts_line_drop(c->line, s, p, NULL);
        if (asprintf(&path, "%s/%s/thumbs/%s", s->folder, c->folder, stem) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        p->thumb_stem = path;
    }
    return CTS_OK;
}

static CtsStatus make_folders(struct CtsBatchChild *c, CtsError *err)
{
    char path[PATH_MAX];
    for (int deep = 0; deep < 2; deep++) {
        if (snprintf(path, sizeof path, "%s/%s%s", c->settings->folder, c->folder, deep ? "/thumbs" : "") >= PATH_MAX)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: the path is too long", c->settings->folder);
        if (mkdir(path, 0777) && errno != EEXIST)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s", path, strerror(errno));
        struct stat info;
        if (lstat(path, &info) || !S_ISDIR(info.st_mode))
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: is no folder (a link is not followed out of -O)", path);
        cts_sweep(path, 0);
    }
    return CTS_OK;
}

static void tell_geometry(struct CtsBatchChild *c, const CtsSeries *series)
{
    const CtsPixelFacts none = {0};
    json_t *geometry = cts_info_json(series, &none, c->settings->show_patient);
    json_t *findings = json_object_get(geometry, "findings");
    if (findings)
        json_object_set(c->line, "findings", findings);
    json_object_del(geometry, "findings");
    json_object_del(geometry, "series_uid");
    json_object_set_new(c->line, "geometry", geometry);
}

static CtsStatus list_pictures(struct CtsBatchChild *c, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    CtsStatus st = CTS_OK;
    if (!(c->pictures = calloc((size_t)s->n_presets * (size_t)s->n_views, sizeof *c->pictures)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int p = 0; p < s->n_presets && !st; p++)
        for (int v = 0; v < s->n_views && !st; v++) {
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

CtsStatus cts_batch_begin(struct CtsBatchChild *c, const CtsSeries *series, const CtsBatchPicture **pictures, int *n,
                          CtsError *err)
{
    char uid[96];
    CtsStatus st;
    snprintf(uid, sizeof uid, series->part ? "%s#%d" : "%s", c->series->uid, series->part);
    snprintf(c->folder, sizeof c->folder, series->part ? "%s-%d" : "%s", c->series->folder, series->part);
    c->start_wall_ms = cts_wall_ms();
    c->start_cpu_ms = cts_cpu_ms();
    *pictures = NULL;
    *n = 0;
    take_line(c, uid);
    tell_geometry(c, series);
    if (!series->renderable)
        return CTS_OK;
    if ((st = list_pictures(c, err)) || (c->n_pictures && (st = make_folders(c, err))))
        return st;
    *pictures = c->pictures;
    *n = c->n_pictures;
    return CTS_OK;
}

CtsStatus cts_batch_loaded(struct CtsBatchChild *c, double hu_min, double hu_max, CtsError *err)
{
    const char text[] = CTS_CHILD_LOADED "\n";
    char go;
    json_t *geometry = json_object_get(c->line, "geometry");
    if (isfinite(hu_min) && isfinite(hu_max)) {
        json_object_set_new(geometry, "hu_min", cts_json_new_number(hu_min));
        json_object_set_new(geometry, "hu_max", cts_json_new_number(hu_max));
    }
    CtsStatus st = send_text(c->socket, text, strlen(text), err);
    while (!st) {
        const ssize_t n = recv(c->socket, &go, 1, 0);
        if (n == 1)
            break;
        if (n == 0 || errno != EINTR || (c->settings->stop && *c->settings->stop))
            st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    }
    return st;
}

static json_t *new_entry(const struct CtsBatchChild *c, const CtsBatchPicture *picture, const char *path)
{
    const CtsBatchSettings *s = c->settings;
    const size_t n = strlen(s->folder) + 1;
    char hex[65] = "";
    const char *dot = strrchr(path, '.');
    cts_line_settings_hash(s, picture->preset, picture->view, dot && !strcmp(dot, ".dcm"), hex, NULL);
    return json_pack("{s:s,s:s,s:s,s:s}", "path", strlen(path) > n ? path + n : path, "preset",
                     s->presets[picture->preset].name, "view", s->views[picture->view].name, "settings_sha256", hex);
}

CtsStatus cts_batch_output(struct CtsBatchChild *c, const CtsBatchPicture *picture, const char *path, int frame,
                           uint64_t bytes, CtsError *err)
{
    json_t *entry = new_entry(c, picture, path);
    const char *dot = strrchr(path, '.');
    (void)bytes;
    if (frame >= 0)
        json_object_set_new(entry, "frame", json_integer(frame));
    json_object_set_new(entry, "format", json_string(dot ? dot + 1 : ""));
    const CtsStatus st =
        cts_line_file_facts(c->settings, json_string_value(json_object_get(entry, "path")), entry, err);
    if (st)
        json_decref(entry);
    else
        json_array_append_new(json_object_get(c->line, "outputs"), entry);
    return st;
}

CtsStatus cts_batch_thumbnail(struct CtsBatchChild *c, const CtsBatchPicture *picture, const char *path, int n_frames,
                              const int size[2], uint64_t bytes, CtsError *err)
{
    json_t *entry = new_entry(c, picture, path);
    json_object_set_new(entry, "frames", json_integer(n_frames));
    json_object_set_new(entry, "bytes", json_integer((json_int_t)bytes));
    json_object_set_new(entry, "width", json_integer(size[0]));
    json_object_set_new(entry, "height", json_integer(size[1]));
    return json_array_append_new(json_object_get(c->line, "thumbnails"), entry)
               ? cts_fail(err, CTS_ERR_MEMORY, "out of memory")
               : CTS_OK;
}

/* Pictures that took part of a run's time stand even when the next ones are never made. */
CtsStatus cts_batch_picture_done(struct CtsBatchChild *c, const CtsBatchPicture *picture, CtsError *err)
{
    (void)picture;
    return --c->n_left > 0 ? send_line(c, CTS_CHILD_LINE, err) : CTS_OK;
}

static void tell_findings(struct CtsBatchChild *c, const CtsFindings *findings)
{
    json_t *list = json_object_get(c->line, "findings");
    for (size_t i = 0; i < findings->n; i++) {
        json_t *entry =
            json_pack("{s:o,s:s,s:o}", "code", cts_line_text(findings->items[i].code), "severity",
                      cts_severity_names[findings->items[i].severity], "text", cts_line_text(findings->items[i].text));
        bool told = false;
        for (size_t k = 0; k < json_array_size(list) && !told; k++)
            told = json_equal(json_array_get(list, k), entry);
        if (!told)
            json_array_append(list, entry);
        json_decref(entry);
    }
}

static void tell_times(struct CtsBatchChild *c, const CtsReport *report)
{
    json_t *stages = json_object();
    for (int s = 0; s < CTS_N_STAGES; s++)
        if (report->stages[s].ran)
            json_object_set_new(stages, cts_stage_names[s],
                                json_pack("{s:f,s:f}", "wall_ms", round(report->stages[s].wall_ms * 1000) / 1000,
                                          "cpu_ms", round(report->stages[s].cpu_ms * 1000) / 1000));
    json_object_set_new(c->line, "stages", stages);
    json_object_set_new(c->line, "wall_ms", json_real(round(cts_wall_ms() - c->start_wall_ms)));
    json_object_set_new(c->line, "cpu_ms", json_real(round(cts_cpu_ms() - c->start_cpu_ms)));
    json_object_set_new(c->line, "peak_rss_bytes", json_integer((json_int_t)cts_peak_rss_bytes()));
    json_object_set_new(c->line, "threads", json_integer(c->n_threads));
}

static const char *status_word(CtsStatus status)
{
    const int code = cts_exit_code(status);
    return !code ? "done" : code == 3 || code == 4 ? "refused" : "failed";
}

/* Files in the order of their names, whichever of them were made anew. */
static void sort_outputs(json_t *line)
{
    json_t *list = json_object_get(line, "outputs");
    for (size_t i = 1; i < json_array_size(list); i++)
        for (size_t k = i; k > 0; k--) {
            json_t *a = json_array_get(list, k - 1), *b = json_array_get(list, k);
            const char *path_a = json_string_value(json_object_get(a, "path"));
            const char *path_b = json_string_value(json_object_get(b, "path"));
            if (!path_a || !path_b || strcmp(path_a, path_b) <= 0)
                break;
            json_incref(a);
            json_array_set(list, k - 1, b);
            json_array_set_new(list, k, a);
        }
}

CtsStatus cts_batch_end(struct CtsBatchChild *c, const CtsReport *report, CtsStatus status, const CtsError *why)
{
    CtsError err;
    CtsStatus st = CTS_OK;
    /* What is interrupted stays as it was told last. */
    if (status != CTS_ERR_INTERRUPTED) {
        tell_findings(c, &report->findings);
        tell_times(c, report);
        sort_outputs(c->line);
        json_object_set_new(c->line, "status", json_string(status_word(status)));
        json_object_set_new(c->line, "reason", cts_line_text(status ? why->text : ""));
        json_object_set_new(c->line, "exit_code", json_integer(cts_exit_code(status)));
        json_object_set_new(c->line, "ended", cts_child_now());
        st = send_line(c, CTS_CHILD_LAST, &err);
        c->told = true;
    }
    json_decref(c->line);
    c->line = NULL;
    free_pictures(c);
    return st;
}

/* A picture is never worth the machine: this process goes first when memory runs out, and no further than it may. */
static void limit(const CtsBatchSettings *s)
{
    const struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const uint64_t bytes = s->series_bytes ? s->series_bytes : cts_memory_available() / 10 * 9;
    const struct rlimit data = {bytes, bytes};
    /* A sanitizer's own memory counts as data. */
    if (bytes && !CTS_SANITIZED)
        setrlimit(RLIMIT_DATA, &data);
    const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
    if (fd >= 0) {
        const ssize_t n = write(fd, "1000", 4);
        (void)n;
        close(fd);
    }
}

static void run_child(struct CtsBatchChild *c)
{
    CtsError err = {0};
    const CtsBatchSettings *s = c->settings;
    limit(s);
    cts_journal_leave(c->journal);
    const CtsBatchTask task = {.uid = c->series->uid,
                               .paths = c->series->paths,
                               .n_paths = c->series->n_paths,
                               .n_threads = c->n_threads,
                               .child = c};
    const CtsStatus st = s->work(s->context, &task, &err);
    if (st && st != CTS_ERR_INTERRUPTED && !c->told) {
        c->line = cts_child_failed_line(s, c->series, err.text, cts_exit_code(st));
        send_line(c, CTS_CHILD_LAST, NULL);
    }
    fflush(NULL);
    _exit(st == CTS_ERR_INTERRUPTED ? 130 : 0);
}

CtsStatus cts_child_start(const CtsBatchSettings *settings, CtsJournal *journal, const CtsPlanSeries *series,
                          int n_threads, pid_t *pid, int *socket, CtsError *err)
{
    int ends[2];
    const pid_t parent = getpid();
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends))
        return cts_fail(err, CTS_ERR_INTERNAL, "no socket: %s", strerror(errno));
    fflush(NULL);
    *pid = fork();
    if (*pid < 0) {
        close(ends[0]);
        close(ends[1]);
        return cts_fail(err, CTS_ERR_INTERNAL, "no process: %s", strerror(errno));
    }
    if (*pid == 0) {
        struct CtsBatchChild child = {.settings = settings,
                                      .journal = journal,
                                      .series = series,
                                      .socket = ends[1],
                                      .n_threads = n_threads,
                                      .start_wall_ms = cts_wall_ms()};
        close(ends[0]);
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent)
            _exit(1);
        run_child(&child);
    }
    close(ends[1]);
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
    *socket = ends[0];
    return CTS_OK;
}
