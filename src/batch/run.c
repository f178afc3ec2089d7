/* The batch's own process: reads nothing but headers, hands out series, keeps the journal. */
#define _GNU_SOURCE
#include "base/clock.h"
#include "base/cpu.h"
#include "base/file.h"
#include "base/mem.h"
#include "batch/child.h"
#include "batch/line.h"
#include "batch/sweep.h"
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

/* How long a child that was asked to stop may take, and how often the clock is looked at. */
enum { GRACE_MS = 2000, TICK_MS = 200, SYNC_MS = 2000, MOST_MESSAGE = 64 << 20 };
/* A volume of 16-bit voxels, its copies while it is worked on, and what a picture takes. */
static const double BYTES_PER_VOXEL = 5, BYTES_PER_SERIES = 200e6;

/* A series that is under way. */
typedef struct Worker {
    pid_t pid; /* 0: none */
    int socket;
    CtsPlanSeries series;
    bool granted, loaded; /* may render; is ready to */
    bool ended;           /* its last line came */
    double deadline_ms;   /* INFINITY while it waits */
    double stop_ms;       /* it was asked to end; 0: not yet */
    const char *killed;   /* why, or NULL */
    double bytes;         /* what it may take, guessed */
    char *text;           /* of messages, as far as they came */
    size_t n_text, capacity;
} Worker;

typedef struct Run {
    const CtsBatchSettings *settings;
    CtsBatchResult *result;
    CtsPlan *plan;
    CtsJournal *journal;
    Worker *workers;
    int n_workers; /* as many as render, and one that reads ahead */
    int n_jobs, n_threads;
    size_t next, n_ended;
    double start_ms, free_bytes, told_ms, synced_ms;
    uint64_t voxels_done, voxels_left;
    CtsStatus status; /* why no more series are started */
    CtsError *err;
} Run;

static bool interrupted(const Run *r)
{
    return r->settings->stop && *r->settings->stop;
}

static const char *text_of(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

static void tell_progress(Run *r)
{
    const CtsBatchTold *told = &r->settings->told;
    const double spent_s = (cts_wall_ms() - r->start_ms) / 1000;
    r->told_ms = cts_wall_ms();
    if (told->progress)
        told->progress(told->context, r->n_ended, r->result->n_series,
                       r->voxels_done ? spent_s * (double)r->voxels_left / (double)r->voxels_done : -1);
}

static void tell_series(Run *r, const json_t *line)
{
    const CtsBatchTold *told = &r->settings->told;
    const char *status = text_of(line, "status"), *uid = text_of(line, "series_uid");
    const bool done = !strcmp(status, "done");
    char text[1400];
    if (done)
        snprintf(text, sizeof text, "%.80s: done: %zu files, %.1f s", uid,
                 json_array_size(json_object_get(line, "outputs")),
                 json_number_value(json_object_get(line, "wall_ms")) / 1000);
    else
        snprintf(text, sizeof text, "%.80s: %s: %s", uid, status, text_of(line, "reason"));
    if (told->series)
        told->series(told->context, text, !done);
}

/* A line that is the last of a series in this run. */
static void count(Run *r, const json_t *line)
{
    const char *status = text_of(line, "status");
    r->result->n_done += !strcmp(status, "done");
    r->result->n_refused += !strcmp(status, "refused");
    r->result->n_failed += !strcmp(status, "failed");
}

/* The batch cannot go on; what is under way is asked to stop. */
static void give_up(Run *r, CtsStatus status, const CtsError *why)
{
    if (!r->status) {
        r->status = status;
        if (why)
            *r->err = *why;
    }
}

static void add_line(Run *r, const json_t *line)
{
    CtsError err = {0};
    const CtsStatus st = cts_journal_add(r->journal, line, &err);
    if (st)
        give_up(r, st, &err);
}

/* Whether -O takes a file at all: else a failure to write is not the series' own. */
static CtsStatus probe_folder(const Run *r, CtsError *err)
{
    enum { PROBE = 1 << 20 };
    char path[PATH_MAX];
    CtsTempFile *temp = NULL;
    char *bytes = calloc(1, PROBE);
    if (!bytes || snprintf(path, sizeof path, "%s/probe", r->settings->folder) >= PATH_MAX) {
        free(bytes);
        return CTS_OK;
    }
    CtsStatus st = cts_temp_open(&temp, path, err);
    if (!st && !(st = cts_temp_write(temp, bytes, PROBE, err)) && fsync(cts_temp_fd(temp)))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be written: %s", r->settings->folder, strerror(errno));
    cts_temp_discard(&temp);
    free(bytes);
    return st;
}

static void take_message(Run *r, Worker *w, char *text)
{
    const bool last = !strncmp(text, CTS_CHILD_LAST, strlen(CTS_CHILD_LAST));
    if (!strcmp(text, CTS_CHILD_LOADED)) {
        w->loaded = true;
        w->deadline_ms = INFINITY;
        return;
    }
    json_t *line = last || !strncmp(text, CTS_CHILD_LINE, strlen(CTS_CHILD_LINE))
                       ? json_loads(strchr(text, ' ') + 1, 0, NULL)
                       : NULL;
    if (!line || !text_of(line, "series_uid")[0]) {
        json_decref(line);
        return;
    }
    add_line(r, line);
    if (last) {
        CtsError err;
        w->ended = true;
        count(r, line);
        tell_series(r, line);
        if (json_integer_value(json_object_get(line, "exit_code")) == 5 && probe_folder(r, &err))
            give_up(r, CTS_ERR_OUTPUT, &err);
    }
    json_decref(line);
}

/* What came; false at its end. */
static bool read_messages(Run *r, Worker *w)
{
    for (;;) {
        if (w->capacity - w->n_text < 4096) {
            const size_t capacity = w->capacity ? 2 * w->capacity : 1 << 16;
            char *grown = capacity > MOST_MESSAGE ? NULL : realloc(w->text, capacity);
            if (!grown)
                return false;
            w->text = grown;
            w->capacity = capacity;
        }
        const ssize_t n = recv(w->socket, w->text + w->n_text, w->capacity - w->n_text - 1, 0);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
        w->n_text += (size_t)n;
        w->text[w->n_text] = 0;
        char *start = w->text;
        for (char *end; (end = memchr(start, '\n', (size_t)(w->text + w->n_text - start))); start = end + 1) {
            *end = 0;
            take_message(r, w, start);
        }
        w->n_text -= (size_t)(start - w->text);
        memmove(w->text, start, w->n_text);
    }
}

/* A series that ended without a word: what is known of it, with the reason. */
static void tell_death(Run *r, const Worker *w, int how, const struct rusage *usage)
{
    char reason[300];
    if (w->killed)
        snprintf(reason, sizeof reason, "%s", w->killed);
    else if (WIFSIGNALED(how) && WTERMSIG(how) == SIGKILL)
        snprintf(reason, sizeof reason, "its process was killed, as happens when memory runs out");
    else if (WIFSIGNALED(how))
        snprintf(reason, sizeof reason, "its process crashed: signal %d (%s)", WTERMSIG(how), strsignal(WTERMSIG(how)));
    else
        snprintf(reason, sizeof reason, "its process ended with status %d and told nothing", WEXITSTATUS(how));
    json_t *line = cts_journal_find(r->journal, w->series.uid);
    /* What it had finished is in the line that it told last, if that is of this input. */
    if (!line || strcmp(text_of(line, "input_sha256"), w->series.input_sha256)) {
        json_decref(line);
        line = cts_child_failed_line(r->settings, &w->series, reason, 1);
    }
    json_object_set_new(line, "status", json_string("failed"));
    json_object_set_new(line, "reason", json_string(reason));
    json_object_set_new(line, "exit_code", json_integer(1));
    json_object_set_new(line, "ended", cts_child_now());
    json_object_set_new(line, "peak_rss_bytes", json_integer((json_int_t)usage->ru_maxrss * 1024));
    add_line(r, line);
    count(r, line);
    tell_series(r, line);
    json_decref(line);
}

static void sweep_series(const Run *r, const Worker *w)
{
    char path[PATH_MAX];
    for (int deep = 0; deep < 2; deep++)
        if (snprintf(path, sizeof path, "%s/%s%s", r->settings->folder, w->series.folder, deep ? "/thumbs" : "") <
            PATH_MAX)
            cts_sweep(path, w->pid);
}

static void end_worker(Run *r, Worker *w, int how, const struct rusage *usage)
{
    read_messages(r, w);
    const bool stopped = w->stop_ms > 0 && !w->killed;
    if (!w->ended && !stopped)
        tell_death(r, w, how, usage);
    if (WIFSIGNALED(how) || WEXITSTATUS(how))
        sweep_series(r, w);
    r->n_ended++;
    r->free_bytes += w->bytes;
    r->voxels_done += w->series.n_voxels;
    r->voxels_left -= w->series.n_voxels;
    close(w->socket);
    cts_plan_series_free(&w->series);
    free(w->text);
    *w = (Worker){0};
    tell_progress(r);
}

static Worker *free_worker(Run *r, int *n_busy)
{
    Worker *found = NULL;
    *n_busy = 0;
    for (int i = 0; i < r->n_workers; i++) {
        if (r->workers[i].pid)
            ++*n_busy;
        else if (!found)
            found = &r->workers[i];
    }
    return found;
}

/* What an earlier run made of a series stands; says so in this shard's own journal. */
static bool stands(Run *r, const CtsPlanSeries *series)
{
    json_t *line = r->settings->fresh ? NULL : cts_journal_find(r->journal, series->uid);
    const bool settled = line && cts_line_settled(r->settings, line, series->input_sha256);
    if (settled) {
        if (!cts_journal_holds(r->journal, series->uid))
            add_line(r, line);
        count(r, line);
        r->result->n_stood += !strcmp(text_of(line, "status"), "done");
        r->n_ended++;
        r->voxels_left -= series->n_voxels;
    }
    json_decref(line);
    return settled;
}

/* A thread more than a fair share: it works while other series wait for the disk, and sleeps otherwise. */
static int threads_of_one(const Run *r, int at_once)
{
    const int share = (r->n_threads + at_once - 1) / at_once + 1;
    return share < r->n_threads ? share : r->n_threads;
}

/* Starts the next series that has something to be made, if there is room for one. */
static bool start_next(Run *r)
{
    int n_busy;
    CtsError err = {0};
    Worker *w = free_worker(r, &n_busy);
    while (w && r->next < cts_plan_n_series(r->plan) && !r->status && !interrupted(r)) {
        CtsStatus st = cts_plan_series(r->plan, r->next, &w->series, &err);
        if (st) {
            give_up(r, st, &err);
            return false;
        }
        if (stands(r, &w->series)) {
            cts_plan_series_free(&w->series);
            r->next++;
            if (cts_wall_ms() - r->told_ms > TICK_MS)
                tell_progress(r);
            continue;
        }
        const double bytes = BYTES_PER_SERIES + BYTES_PER_VOXEL * (double)w->series.n_voxels;
        if (n_busy && bytes > r->free_bytes) {
            cts_plan_series_free(&w->series);
            return false;
        }
        const size_t left = cts_plan_n_series(r->plan) - r->next + (size_t)n_busy;
        const int at_once = left < (size_t)r->n_jobs ? (int)left : r->n_jobs;
        st =
            cts_child_start(r->settings, r->journal, &w->series, threads_of_one(r, at_once), &w->pid, &w->socket, &err);
        if (st) {
            w->pid = 0;
            cts_plan_series_free(&w->series);
            give_up(r, st, &err);
            return false;
        }
        w->bytes = bytes;
        r->free_bytes -= bytes;
        w->deadline_ms =
            r->settings->series_timeout_s > 0 ? cts_wall_ms() + 1000 * r->settings->series_timeout_s : INFINITY;
        r->next++;
        return true;
    }
    return false;
}

/* As many as n_jobs at a time may render; whoever is ready first goes first. */
static void grant(Run *r)
{
    int n_granted = 0;
    for (int i = 0; i < r->n_workers; i++)
        n_granted += r->workers[i].pid && r->workers[i].granted;
    for (int loaded = 1; loaded >= 0; loaded--)
        for (int i = 0; i < r->n_workers && n_granted < r->n_jobs; i++) {
            Worker *w = &r->workers[i];
            if (!w->pid || w->granted || w->loaded != loaded)
                continue;
            w->granted = true;
            n_granted++;
        }
    for (int i = 0; i < r->n_workers; i++) {
        Worker *w = &r->workers[i];
        if (!w->pid || !w->granted || !w->loaded)
            continue;
        w->loaded = false; /* the files of one UID may hold several series, each of which asks */
        if (send(w->socket, "g", 1, MSG_NOSIGNAL) < 0)
            continue;
        w->deadline_ms =
            r->settings->series_timeout_s > 0 ? cts_wall_ms() + 1000 * r->settings->series_timeout_s : INFINITY;
    }
}

static void ask_to_stop(Worker *w, double now_ms)
{
    if (w->stop_ms <= 0) {
        w->stop_ms = now_ms;
        kill(w->pid, SIGTERM);
    } else if (now_ms - w->stop_ms > GRACE_MS) {
        kill(w->pid, SIGKILL);
    }
}

static void watch_clock(Run *r)
{
    const double now_ms = cts_wall_ms();
    const bool all = interrupted(r) || r->status;
    for (int i = 0; i < r->n_workers; i++) {
        Worker *w = &r->workers[i];
        if (!w->pid)
            continue;
        if (all)
            ask_to_stop(w, now_ms);
        if (!w->killed && !all && now_ms > w->deadline_ms) {
            w->killed = "it took longer than --series-timeout allows";
            kill(w->pid, SIGKILL);
        }
    }
    if (now_ms - r->told_ms > 1000)
        tell_progress(r);
    if (now_ms - r->synced_ms > SYNC_MS) {
        CtsError err;
        const CtsStatus st = cts_journal_sync(r->journal, &err);
        r->synced_ms = now_ms;
        if (st)
            give_up(r, st, &err);
    }
}

/* Waits for a word from any child, or for a while. */
static void wait_for_any(Run *r)
{
    struct pollfd fds[1 + CTS_BATCH_MOST_JOBS];
    Worker *of[1 + CTS_BATCH_MOST_JOBS];
    int n = 0;
    double wait_ms = TICK_MS;
    for (int i = 0; i < r->n_workers; i++)
        if (r->workers[i].pid) {
            wait_ms = fmin(wait_ms, fmax(1, r->workers[i].deadline_ms - cts_wall_ms()));
            of[n] = &r->workers[i];
            fds[n++] = (struct pollfd){.fd = r->workers[i].socket, .events = POLLIN};
        }
    if (poll(fds, (nfds_t)n, (int)ceil(wait_ms)) < 0)
        return;
    for (int i = 0; i < n; i++) {
        Worker *w = of[i];
        struct rusage usage;
        int how;
        const bool open = !fds[i].revents || read_messages(r, w);
        const pid_t pid = wait4(w->pid, &how, open ? WNOHANG : 0, &usage);
        if (pid == w->pid)
            end_worker(r, w, how, &usage);
    }
}

static CtsStatus run_series(Run *r)
{
    for (;;) {
        int n_busy;
        while (start_next(r))
            ;
        free_worker(r, &n_busy);
        if (!n_busy)
            break;
        grant(r);
        wait_for_any(r);
        watch_clock(r);
    }
    if (interrupted(r))
        return cts_fail(r->err, CTS_ERR_INTERRUPTED, "interrupted");
    return r->status;
}

static void forget_patient(json_t *line)
{
    json_object_del(json_object_get(line, "geometry"), "description");
}

CtsStatus cts_batch_open_folder(const CtsBatchSettings *s, CtsError *err)
{
    char folder[PATH_MAX], path[PATH_MAX];
    if (mkdir(s->folder, 0777) && errno != EEXIST)
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s", s->folder, strerror(errno));
    if (!realpath(s->folder, folder))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s", s->folder, strerror(errno));
    for (int i = 0; i < s->n_paths; i++)
        if (realpath(s->paths[i], path) && !strcmp(path, folder))
            return cts_fail(err, CTS_ERR_USAGE,
                            "%s: is searched for series, and nothing is written there "
                            "(choose another folder for -O)",
                            s->folder);
    snprintf(path, sizeof path, "%.4000s/batch.jsonl", s->folder);
    return cts_file_check_writable(path, true, err);
}

static CtsStatus search(Run *r, CtsError *err)
{
    const CtsBatchSettings *s = r->settings;
    const CtsPlanInput input = {.paths = s->paths,
                                .n_paths = s->n_paths,
                                .n_threads = s->n_threads,
                                .folder = s->folder,
                                .series_uid = s->series_uid,
                                .shard = s->shard,
                                .n_shards = s->n_shards,
                                .warn = s->told.warning,
                                .context = s->told.context,
                                .stop = s->stop};
    CtsStatus st = cts_plan_new(&r->plan, &input, err);
    if (st)
        return st;
    const CtsArchiveCounts counts = cts_plan_counts(r->plan);
    r->result->n_series = cts_plan_n_series(r->plan);
    if (!r->result->n_series && s->n_shards == 1)
        return cts_fail(err, CTS_ERR_NO_SERIES, "no CT slice among %llu files, %llu of them unreadable",
                        (unsigned long long)counts.n_files, (unsigned long long)counts.n_unreadable);
    for (size_t i = 0; i < r->result->n_series && !st; i++) {
        CtsPlanSeries series;
        if (!(st = cts_plan_series(r->plan, i, &series, err))) {
            r->voxels_left += series.n_voxels;
            cts_plan_series_free(&series);
        }
    }
    return st;
}

CtsStatus cts_batch_run(const CtsBatchSettings *settings, CtsBatchResult *result, CtsError *err)
{
    CtsStatus st;
    Run r = {.settings = settings, .result = result, .start_ms = cts_wall_ms(), .err = err};
    *result = (CtsBatchResult){0};
    r.n_threads = cts_threads(settings->n_threads);
    r.n_jobs = settings->n_jobs ? settings->n_jobs : r.n_threads + 1; /* one of them may wait for the disk */
    r.n_jobs = r.n_jobs < CTS_BATCH_MOST_JOBS ? r.n_jobs : CTS_BATCH_MOST_JOBS;
    r.n_workers = r.n_jobs + 1;
    r.free_bytes = 0.9 * (double)cts_memory_available();
    if (!(r.workers = calloc((size_t)r.n_workers, sizeof *r.workers)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if ((st =
             cts_journal_open(&r.journal, settings->folder, settings->shard, settings->n_shards, settings->fresh, err)))
        goto end;
    cts_sweep_all(settings->folder, settings->shard, settings->n_shards);
    if ((st = search(&r, err)))
        goto end;
    st = run_series(&r);
    CtsError finish_err;
    const CtsStatus finished =
        cts_journal_finish(r.journal, settings->show_patient ? NULL : forget_patient, &finish_err);
    if (finished && !st) {
        *err = finish_err;
        st = finished;
    }
end:
    cts_plan_free(&r.plan);
    cts_journal_close(&r.journal);
    free(r.workers);
    return st;
}
