/* The scheduler: reads only headers, assigns series to worker processes, keeps the journal. */
#include "app/batch/batch.h"
#include "app/batch/idle.h"
#include "app/batch/later.h"
#include "app/batch/worker.h"
#include "app/contact/contact_sheet.h"
#include "base/clock.h"
#include "base/compare.h"
#include "base/cpu.h"
#include "base/json.h"
#include "base/mem.h"
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>

/* TICK_MS: interval of timeout checks; timeouts are given in seconds. SYNC_MS: interval of writing the journal to the
 * disk: a machine that fails loses the records of 2 s. MAX_UNSENT: failures to send in a row after which the PACS is
 * given up; each has several attempts of its own (dicom/net/net.c). */
enum { TICK_MS = 200, SYNC_MS = 2000, MAX_UNSENT = 3 };
/* Rendering workers, and the sender. */
#define N_WORKERS(n_jobs) ((n_jobs) + 1)
/* Memory estimate of a series: 16-bit voxels and their copies during processing, and the buffers of pictures. Measured:
 * previews of four series of 5 to 37 million voxels take 0.2 to 0.8 of it. */
static const double BYTES_PER_VOXEL = 5, BYTES_PER_SERIES = 200e6;

typedef struct Run {
    const CtsBatchSettings *settings;
    CtsBatchResult *result;
    CtsBatchPlan *plan;
    CtsPlanFound found;
    CtsJournal *journal;
    CtsWorker workers[N_WORKERS(CTS_BATCH_MAX_JOBS)]; /* n_workers; the first one sends */
    int n_workers, n_jobs, n_threads;
    CtsKey key; /* of the names of series, where they are de-identified */
    size_t next;
    json_t *to_send; /* UIDs of series queued for sending */
    size_t next_to_send;
    int n_unsent; /* series in a row that could not be */
    double start_ms, free_bytes, reported_ms, synced_ms;
    size_t n_pictures, n_uids_ended; /* pictures rendered; series that have ended */
    double sheet_ms, sheet_took_ms;
    bool sheet_stale;
    CtsUtc due;       /* earliest time at which a later run has something to do; "" for never */
    json_t *planned;  /* keys: UIDs of the series below the paths, for `forget` */
    CtsStatus status; /* why no more series are started */
    CtsError *err;
} Run;

static bool interrupted(const Run *r)
{
    return *r->settings->options->render.stop;
}

/* A series whose state is unknown counts with all its pictures. */
static double n_pictures_left(const Run *r)
{
    const CtsBatchLists *const l = r->settings->lists;
    size_t n = 0, n_unknown = r->found.n_series - r->next;
    for (int i = 1; i < r->n_workers; i++) {
        n += (size_t)r->workers[i].n_left;
        n_unknown += r->workers[i].pid && !r->workers[i].counted;
    }
    return (double)n + (double)n_unknown * (l->n_named ? l->n_named : 1) * l->n_views;
}

static void report_batch_progress(Run *r)
{
    const CtsBatchListener *listener = &r->settings->listener;
    const double spent_s = (cts_wall_ms() - r->start_ms) / 1000;
    const CtsBatchProgress progress = {.n_ended = r->n_uids_ended,
                                       .n_series = r->found.n_series,
                                       .n_pictures = r->n_pictures,
                                       .seconds_left =
                                           r->n_pictures ? spent_s * n_pictures_left(r) / (double)r->n_pictures : -1};
    r->reported_ms = cts_wall_ms();
    listener->progress(listener->context, &progress);
}

/* Writes the sheet where that is due. ends: the batch does. */
static CtsStatus write_sheet(Run *r, bool ends, CtsError *err)
{
    const CtsBatchSettings *s = r->settings;
    const double start_ms = cts_wall_ms();
    const bool whole = ends && r->n_uids_ended == r->found.n_series;
    const CtsContactWanted wanted = {.n_ended = r->n_uids_ended,
                                     .n_series = whole ? 0 : r->found.n_series,
                                     .goes_on = !ends,
                                     .n_objects = r->found.counts.n_objects,
                                     .change = cts_journal_record_redact,
                                     .context = s};
    /* Pause between two contact sheets: 50 times as long as writing the last one took, at least 0.5 s, at most 10 s or
     * that time again, so that a slow disk leaves no stale sheet and half of the time to the series. */
    const double pause_ms = fmax(500, fmin(50 * r->sheet_took_ms, fmax(10000, r->sheet_took_ms)));
    const bool wait = !r->sheet_stale || start_ms - r->sheet_ms < pause_ms;
    if (s->options->shard.n > 1 || (!ends && wait))
        return CTS_OK;
    const CtsStatus st = cts_contact_sheet_write(s->options->output_dir, &wanted, err);
    r->sheet_ms = cts_wall_ms();
    r->sheet_took_ms = r->sheet_ms - start_ms;
    r->sheet_stale = false;
    return st;
}

static void report_series(Run *r, const json_t *record)
{
    const CtsBatchListener *listener = &r->settings->listener;
    const char *status = cts_json_text_of(record, "status"), *uid = cts_json_text_of(record, "series_uid");
    const bool done = !strcmp(status, "done");
    char text[1400];
    if (done)
        snprintf(text, sizeof text, "%.80s: done: %zu files, %.1f s", uid,
                 json_array_size(json_object_get(record, "outputs")),
                 json_number_value(json_object_get(record, "wall_ms")) / 1000);
    else
        snprintf(text, sizeof text, "%.80s: %s: %.600s%s%.600s", uid, status, cts_json_text_of(record, "reason_file"),
                 json_object_get(record, "reason_file") ? ": " : "", cts_json_text_of(record, "reason"));
    listener->series(listener->context, text, !done && strcmp(status, "thumbnail") && strcmp(status, "skipped"));
}

/* Counts the final record of a series; up_to_date: nothing had to be rendered. */
static void count_record(Run *r, const json_t *record, bool up_to_date)
{
    const char *status = cts_json_text_of(record, "status");
    r->result->n_up_to_date += up_to_date && !strcmp(status, "done");
    r->result->n_done += !strcmp(status, "done");
    r->result->n_thumbnails += !strcmp(status, "thumbnail");
    r->result->n_skipped += !strcmp(status, "skipped");
    r->result->n_refused += !strcmp(status, "refused");
    r->result->n_failed += !strcmp(status, "failed");
    if (!up_to_date)
        report_series(r, record);
}

/* Ends the batch after a failure; running workers are asked to stop. */
static void give_up_batch(Run *r, const CtsError *why)
{
    if (r->status)
        return;
    r->status = why->status;
    *r->err = *why;
}

static void add_record(Run *r, const json_t *record)
{
    CtsError err = {0};
    r->sheet_stale = true;
    if (cts_journal_add(r->journal, record, &err))
        give_up_batch(r, &err);
}

static void queue_to_send(Run *r, const json_t *record)
{
    CtsError err = {0};
    if (json_array_append(r->to_send, json_object_get(record, "series_uid"))) {
        cts_fail(&err, CTS_ERR_MEMORY, "out of memory for the list of what is to be sent");
        give_up_batch(r, &err);
    }
}

/* Adds the last record of a series: its pictures are rendered, or cannot be; is_sent: they are sent, or cannot be. */
static void end_series(Run *r, json_t *record, bool up_to_date, bool is_sent)
{
    const bool is_done = !strcmp(cts_json_text_of(record, "status"), "done");
    const int n_waiting = is_done && !is_sent ? cts_journal_record_n_unsent(r->settings, record) : 0;
    if (is_sent)
        r->n_unsent = is_done ? 0 : r->n_unsent + 1;
    if (n_waiting > 0) {
        json_object_set_new(record, "unsent", json_integer(n_waiting));
        cts_worker_set_status(record, 5, "not sent yet");
        queue_to_send(r, record);
    }
    if (n_waiting == 0 && !up_to_date)
        cts_later_set_try(&r->due, r->settings, record);
    add_record(r, record);
    if (n_waiting == 0)
        count_record(r, record, up_to_date);
}

static void take_last(Run *r, CtsWorker *w, bool up_to_date)
{
    CtsError err;
    w->n_ended++;
    if (w->n_ended > 1)
        r->result->n_series++;
    end_series(r, w->record, up_to_date, w->sends);
    if (!w->sends && json_integer_value(json_object_get(w->record, "exit_code")) == 5 &&
        !json_object_get(w->record, "unsent") && cts_folder_probe(r->settings, &err))
        give_up_batch(r, &err);
    json_decref(w->record);
    w->record = NULL;
}

static double new_deadline_ms(const Run *r)
{
    const double limit_ms = 1000 * r->settings->options->series_timeout_s;
    return limit_ms > 0 ? cts_wall_ms() + limit_ms : INFINITY;
}

static void take_message(void *context, CtsWorker *w, const char *message)
{
    Run *const r = context;
    const char kind = *message;
    json_t *record = kind ? json_loads(message + 1, 0, NULL) : NULL;
    if (!record || !cts_json_text_of(record, "series_uid")[0]) {
        json_decref(record);
        return;
    }
    json_decref(w->record);
    w->record = record;
    if (!w->sends) {
        /* The first message has the number of pictures that the series lacks. */
        const int n_left = (int)json_integer_value(json_object_get(record, "unfinished"));
        if (kind != CTS_WORKER_BEGUN && w->n_left > n_left)
            r->n_pictures += (size_t)(w->n_left - n_left);
        w->counted = true;
        w->n_left = n_left;
    }
    if (kind == CTS_WORKER_RECORD)
        add_record(r, record);
    else if (kind != CTS_WORKER_BEGUN)
        take_last(r, w, kind == CTS_WORKER_UP_TO_DATE);
}

/* Records a series whose worker ended without a report, with the reason. */
static void record_death(Run *r, CtsWorker *w, int how, const struct rusage *usage)
{
    char reason[300];
    cts_worker_reason(w, how, reason, sizeof reason);
    if (!w->record)
        w->record = cts_worker_new_record(r->settings, &w->series, w->series.uid, w->series.folder);
    cts_worker_set_status(w->record, 1, reason);
    if (!w->sends)
        json_object_set_new(w->record, "peak_rss_bytes", json_integer((json_int_t)usage->ru_maxrss * 1024));
    take_last(r, w, false);
}

static void end_worker(Run *r, CtsWorker *w, int how, const struct rusage *usage)
{
    cts_worker_read(w, take_message, r);
    const bool stopped = w->stop_ms > 0 && !w->killed;
    if (!stopped && (w->record || !w->n_ended))
        record_death(r, w, how, usage);
    if (!w->sends && (WIFSIGNALED(how) || WEXITSTATUS(how)))
        cts_sweep_series(r->settings->options->output_dir, w->series.folder);
    r->free_bytes += w->bytes;
    r->n_uids_ended += !w->sends && !stopped;
    cts_worker_free(w);
    report_batch_progress(r);
}

/* Workers from the first one on that have a process. */
static int n_at_work(const Run *r, int first)
{
    int n = 0;
    for (int i = first; i < r->n_workers; i++)
        n += r->workers[i].pid != 0;
    return n;
}

/* True if all outputs of a series are up to date; adds its record to this shard's own journal. */
static bool is_up_to_date(Run *r, const CtsPlanSeries *series, json_t *record, bool is_own)
{
    if (!cts_journal_record_is_settled(r->settings, record, series->input_sha256))
        return false;
    const bool was_unsent = !json_object_del(record, "unsent");
    if (was_unsent)
        cts_worker_set_status(record, 0, "");
    if (was_unsent || cts_journal_record_n_unsent(r->settings, record) || !is_own)
        end_series(r, record, true, false);
    else
        count_record(r, record, true);
    return true;
}

/* True if nothing is to be rendered of a series now: it failed and its next try is not due, its outputs are up to date,
 * or files of it still come. Images that share a volume's UID have the record UID#2. */
static bool needs_no_worker(Run *r, const CtsPlanSeries *series)
{
    char second[96];
    snprintf(second, sizeof second, "%s#2", series->uid);
    bool is_own, changed = false;
    json_t *record = cts_journal_find(r->journal, series->uid, &is_own);
    json_t *const images = cts_journal_find(r->journal, second, NULL);
    const bool held = record && cts_later_is_held(&r->due, r->settings, record, series->input_sha256);
    const bool images_done = !images || cts_journal_record_is_settled(r->settings, images, series->input_sha256);
    const bool is_done = held || (record && images_done && is_up_to_date(r, series, record, is_own));
    const bool waits = !is_done && cts_later_waits(&r->due, r->settings, series, &record, &changed);
    if (held)
        count_record(r, record, true);
    if (is_done && images) {
        r->result->n_series++;
        count_record(r, images, true);
    }
    if (changed)
        add_record(r, record);
    r->result->n_waiting += waits;
    r->n_uids_ended += is_done || waits;
    json_decref(record);
    json_decref(images);
    return is_done || waits;
}

/* Starts the next series with missing outputs, if a worker is free. */
static bool start_next(Run *r)
{
    CtsError err = {0};
    CtsWorker *w = &r->workers[1];
    const int n_busy = n_at_work(r, 1);
    while (n_busy < r->n_jobs && w->pid)
        w++;
    while (n_busy < r->n_jobs && r->next < r->found.n_series && !r->status && !interrupted(r)) {
        if (cts_plan_series(r->plan, r->next, &w->series, &err)) {
            give_up_batch(r, &err);
            return false;
        }
        if (r->planned)
            json_object_set_new(r->planned, w->series.uid, json_true());
        if (needs_no_worker(r, &w->series)) {
            cts_plan_series_free(&w->series);
            r->next++;
            if (cts_wall_ms() - r->reported_ms > TICK_MS)
                report_batch_progress(r);
            continue;
        }
        const double bytes = BYTES_PER_SERIES + BYTES_PER_VOXEL * (double)w->series.n_voxels;
        if (n_at_work(r, 0) && bytes > r->free_bytes) {
            cts_plan_series_free(&w->series);
            return false;
        }
        const size_t left = r->found.n_series - r->next + (size_t)n_busy;
        const int at_once = left < (size_t)r->n_jobs ? (int)left : r->n_jobs;
        /* One thread more than an equal share, to use the time in which other workers wait for the disk. */
        const int share = (r->n_threads + at_once - 1) / at_once + 1;
        CtsWorkerProcess process = {.settings = r->settings,
                                    .journal = r->journal,
                                    .archives = r->found.archives,
                                    .series = &w->series,
                                    .n_threads = cts_smaller_int(share, r->n_threads)};
        if (cts_worker_fork(&process, cts_worker_render, w, &err)) {
            cts_plan_series_free(&w->series);
            give_up_batch(r, &err);
            return false;
        }
        w->bytes = bytes;
        r->free_bytes -= bytes;
        w->deadline_ms = new_deadline_ms(r);
        r->next++;
        return true;
    }
    return false;
}

/* Sends one series at a time, so as not to overload the PACS. */
static void start_sender(Run *r)
{
    CtsWorker *w = &r->workers[0];
    CtsError err;
    if (w->pid || r->next_to_send == json_array_size(r->to_send) || r->n_unsent == MAX_UNSENT || r->status ||
        interrupted(r))
        return;
    const char *uid = json_string_value(json_array_get(r->to_send, r->next_to_send++));
    w->record = cts_journal_find(r->journal, uid, NULL);
    CtsWorkerProcess process = {.settings = r->settings, .journal = r->journal, .record = w->record};
    const CtsStatus st = w->record ? cts_worker_fork(&process, cts_worker_send, w, &err)
                                   : cts_fail(&err, CTS_ERR_OUTPUT, "%s: its record in the journal is missing", uid);
    if (st) {
        json_decref(w->record);
        w->record = NULL;
        give_up_batch(r, &err);
        return;
    }
    w->sends = true;
    w->deadline_ms = new_deadline_ms(r);
}

/* Records series that are still unsent at the end. */
static void leave_unsent(Run *r)
{
    const size_t n = json_array_size(r->to_send) - r->next_to_send;
    char text[160];
    if (n == 0 || r->status || interrupted(r))
        return;
    r->result->n_failed += n;
    r->due.text[0] = '0'; /* before any time: the next run begins with them */
    snprintf(text, sizeof text, "%zu more series are not sent, as %d before them could not be (run the batch again)", n,
             MAX_UNSENT);
    r->settings->listener.message(r->settings->listener.context, true, text);
}

static void watch_clock(Run *r)
{
    CtsError unwritten;
    write_sheet(r, false, &unwritten); /* the last sheet's failure is reported */
    const double now_ms = cts_wall_ms();
    const bool all = interrupted(r) || r->status;
    for (int i = 0; i < r->n_workers; i++) {
        CtsWorker *w = &r->workers[i];
        if (!w->pid)
            continue;
        if (all)
            cts_worker_stop(w, now_ms);
        else if (!w->killed && now_ms > w->deadline_ms) {
            w->killed = "it took longer than --series-timeout allows";
            kill(w->pid, SIGKILL);
        }
    }
    if (now_ms - r->reported_ms > 1000) /* progress for readers: once a second */
        report_batch_progress(r);
    if (now_ms - r->synced_ms > SYNC_MS) {
        CtsError err;
        r->synced_ms = now_ms;
        if (cts_journal_sync(r->journal, &err))
            give_up_batch(r, &err);
    }
}

/* Waits for a message from any worker, or for the tick. */
static void wait_for_any(Run *r)
{
    struct pollfd fds[N_WORKERS(CTS_BATCH_MAX_JOBS)];
    double wait_ms = TICK_MS;
    for (int i = 0; i < r->n_workers; i++) {
        const CtsWorker *const w = &r->workers[i];
        fds[i] = (struct pollfd){.fd = w->pid ? w->socket : -1, .events = POLLIN};
        if (w->pid)
            wait_ms = fmin(wait_ms, fmax(1, w->deadline_ms - cts_wall_ms()));
    }
    if (poll(fds, (nfds_t)r->n_workers, (int)ceil(wait_ms)) < 0)
        return;
    for (int i = 0; i < r->n_workers; i++) {
        CtsWorker *const w = &r->workers[i];
        struct rusage usage;
        int how;
        if (!w->pid)
            continue;
        const bool open = !fds[i].revents || cts_worker_read(w, take_message, r);
        const pid_t pid = wait4(w->pid, &how, open ? WNOHANG : 0, &usage);
        if (pid < 0 && errno != EINTR) { /* already reaped elsewhere: its exit status is unknown */
            how = 0;
            usage = (struct rusage){0};
        }
        if (pid == w->pid || (pid < 0 && errno != EINTR))
            end_worker(r, w, how, &usage);
    }
}

static CtsStatus run_all_series(Run *r)
{
    for (;;) {
        while (start_next(r))
            ;
        start_sender(r);
        if (!n_at_work(r, 0))
            break;
        wait_for_any(r);
        watch_clock(r);
    }
    leave_unsent(r);
    if (interrupted(r))
        return cts_fail(r->err, CTS_ERR_INTERRUPTED, "interrupted");
    return r->status;
}

static CtsStatus search_series(Run *r, CtsError *err)
{
    const CtsOptions *o = r->settings->options;
    const CtsStatus st = cts_plan_new(&r->plan, r->settings, o->export.deidentify ? &r->key : NULL, &r->found, err);
    if (st)
        return st;
    const CtsArchiveCounts counts = r->found.counts;
    r->result->n_series += r->found.n_series;
    r->result->n_uids += r->found.n_series;
    r->result->n_unreadable += counts.n_unreadable;
    r->result->n_objects += counts.n_objects;
    r->result->n_packed += counts.n_packed;
    if (!r->found.n_series && o->shard.n == 1 && o->source.series_uid)
        return cts_fail(err, CTS_ERR_USAGE, "no series %.80s (ctsplat info lists them)", o->source.series_uid);
    if (!r->found.n_series && o->shard.n == 1 && !o->settled_s)
        return cts_fail(err, CTS_ERR_NO_SERIES,
                        "no image among %llu files, %llu of them unreadable, %llu packed or NIfTI (give "
                        "these, and links to folders, as a PATH each)",
                        (unsigned long long)counts.n_files, (unsigned long long)counts.n_unreadable,
                        (unsigned long long)counts.n_packed);
    return CTS_OK;
}

CtsStatus cts_batch_run(const CtsBatchSettings *settings, CtsBatchResult *result, CtsError *err)
{
    CtsStatus st;
    const CtsOptions *o = settings->options;
    Run r = {.settings = settings, .result = result, .start_ms = cts_wall_ms(), .err = err};
    r.n_threads = cts_threads(o->render.n_threads);
    r.n_jobs = o->jobs ? o->jobs : r.n_threads + 2; /* two more, since some read while others render */
    r.n_jobs = r.n_jobs < CTS_BATCH_MAX_JOBS ? r.n_jobs : CTS_BATCH_MAX_JOBS;
    r.n_workers = N_WORKERS(r.n_jobs);
    const CtsExportSettings *e = &o->export;
    if (e->deidentify && (st = cts_key_load(e->key, o->shard.n == 1, &r.key, err)))
        goto end;
    CtsIdle idle;
    if (cts_idle_begin(&idle, settings, e->deidentify ? &r.key : NULL, result)) {
        st = CTS_OK;
        goto end;
    }
    if ((st = cts_journal_open(&r.journal, settings, err)))
        goto end;
    cts_sweep_all(o->output_dir, o->shard.i, o->shard.n);
    if ((st = search_series(&r, err)))
        goto end;
    r.free_bytes = 0.9 * (double)cts_memory_available(); /* a tenth stays for other programs */
    r.to_send = json_array();
    r.planned = o->forget_days ? json_object() : NULL;
    r.sheet_stale = true;
    r.start_ms = cts_wall_ms(); /* of the search nothing is learned for the pictures */
    st = run_all_series(&r);
    CtsError finish_err;
    /* Not where none is found at all, as where a disk is not mounted. */
    if (!st && r.planned && r.found.n_series && r.next == r.found.n_series)
        cts_journal_forget(r.journal, r.planned);
    CtsStatus finished = cts_journal_finish(r.journal, &finish_err);
    if (!finished)
        finished = write_sheet(&r, true, &finish_err);
    if (finished && !st) {
        *err = finish_err;
        st = finished;
    }
    if (!st)
        cts_idle_end(&idle, settings, &r.due, result);
end:
    json_decref(r.to_send);
    json_decref(r.planned);
    cts_plan_free(&r.plan);
    cts_journal_close(&r.journal);
    return st;
}
