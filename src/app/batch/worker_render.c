/* A series of the batch as render jobs: one volume for all its pictures. */
#include "app/batch/worker.h"

#include "base/clock.h"
#include "base/exit_code.h"
#include "base/stage_timer.h"
#include "base/text.h"
#include "dicom/codec/pixels.h"
#include "output/report/log.h"
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static CtsJob job_of(const CtsBatchSettings *s, const CtsBatchPicture *picture)
{
    CtsJob job = cts_options_job(s->options);
    job.export.force = true;
    job.montage = s->lists->views[picture->view].is_montage ? &s->options->montage : NULL;
    job.render.azimuth_deg = s->lists->views[picture->view].azimuth_deg;
    job.render.elevation_deg = s->lists->views[picture->view].elevation_deg;
    cts_job_set_preset(&job, &s->lists->presets[picture->preset]);
    job.source.labels_unnamed = true; /* in journal and sheet */
    job.source.choice.show_present = true;
    job.outputs.paths = (const char *const *)picture->paths;
    job.outputs.n = 0;
    while (picture->paths && picture->paths[job.outputs.n])
        job.outputs.n++;
    return job;
}

CtsStatus cts_batch_check(const CtsBatchSettings *s, CtsReport *report, CtsError *err)
{
    CtsStatus st = cts_log_check(s->options->log, err);
    /* Defaults are checked with their series: an archive of CT need not care for MR. */
    const int n_checked = s->lists->n_named ? s->lists->n_named : 1;
    for (int p = 0; p < n_checked && !st; p++)
        for (int f = 0; f < s->lists->n_formats && !st; f++) {
            char *path;
            if (asprintf(&path, "%s/check.%s", s->options->output_dir, s->lists->formats[f]) < 0)
                return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
            const char *paths[] = {path, NULL};
            const CtsBatchPicture picture = {.preset = p, .paths = paths};
            const CtsJob job = job_of(s, &picture);
            st = cts_job_check(&job, f == 0 ? report : NULL, err);
            free(path);
        }
    return st;
}

static CtsStatus on_band(void *context, int frame, CtsPicture *band, CtsError *err)
{
    CtsWorkerProcess *const c = context;
    CtsStatus st = CTS_OK;
    const int n_frames = c->settings->options->rotation ? c->settings->options->rotation : 1;
    if (frame == 0 && band->first_row == 0)
        st = cts_thumbnail_begin(&c->thumb, c->picture->thumb_stem, CTS_THUMBNAIL_SIDE, band, n_frames, err);
    return st ? st : cts_thumbnail_rows(c->thumb, band, err);
}

static CtsStatus on_output(void *context, int frame, const char *path, const char *format, uint64_t bytes,
                           CtsError *err)
{
    CtsWorkerProcess *const c = context;
    cts_log_output(c->log, path, format, bytes);
    return cts_worker_output(c, path, frame, err);
}

static CtsStatus on_frame(void *context, const CtsErrorBound *bound, CtsError *err)
{
    CtsWorkerProcess *const c = context;
    (void)err;
    c->error = bound->known ? fmax(c->error, bound->rmse) : -1;
    return CTS_OK;
}

static CtsStatus end_thumb(CtsWorkerProcess *c, CtsError *err)
{
    CtsThumbnailFile files[CTS_THUMBNAIL_FILES];
    int n_files = 0;
    CtsStatus st = c->thumb ? cts_thumbnail_end(&c->thumb, files, &n_files, err) : CTS_OK;
    for (int i = 0; i < n_files && !st; i++)
        st = cts_worker_thumbnail(c, &files[i], err);
    return st;
}

/* A picture of the card, beside the thumbnails. */
static CtsStatus save_card_picture(CtsWorkerProcess *c, const CtsPicture *picture, const char *kind, CtsError *err)
{
    CtsThumbnail *thumb = NULL;
    CtsThumbnailFile files[CTS_THUMBNAIL_FILES];
    int n_files = 0;
    char *stem;
    if (asprintf(&stem, "%s/%s/thumbs/%s", c->settings->options->output_dir, c->folder, kind) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    CtsStatus st = cts_thumbnail_begin(&thumb, stem, picture->width, picture, 1, err);
    if (!st && !(st = cts_thumbnail_rows(thumb, picture, err)))
        st = cts_thumbnail_end(&thumb, files, &n_files, err);
    if (!st)
        st = cts_worker_card_picture(c, kind, stem, &files[0], err);
    cts_thumbnail_discard(&thumb);
    free(stem);
    return st;
}

/* Three sections, with the labels' outlines, while the slices are there. */
static CtsStatus draw_sections(CtsWorkerProcess *c, CtsError *err)
{
    CtsPicture *picture = NULL;
    CtsStatus st = cts_card_sections(c->loaded.scanned, c->loaded.labels, &picture, err);
    if (!st)
        st = save_card_picture(c, picture, "sections", err);
    cts_picture_free(&picture);
    return st;
}

/* The image of a series that is no volume. */
static CtsStatus draw_image(CtsWorkerProcess *c, CtsError *err)
{
    CtsPicture *picture = NULL;
    const CtsSeries *const s = c->loaded.series;
    CtsStatus st = cts_slice_picture(s->slices[s->n_slices / 2], CTS_THUMBNAIL_SIDE, CTS_THUMBNAIL_SIDE, &picture, err);
    if (!st)
        st = save_card_picture(c, picture, "image", err);
    cts_picture_free(&picture);
    return st ? cts_context(err, "no thumbnail") : CTS_OK;
}

/* Some series of an archive lack an organ: they show the labels that they have, and are skipped where they have none.
 */
static CtsStatus check_shown(CtsWorkerProcess *c, const CtsSource *source, CtsError *err)
{
    const char *const show = source->choice.show;
    char lacking[CTS_LACKING_TEXT];
    bool any;
    if (!show || !c->loaded.labels)
        return CTS_OK;
    CtsStatus st = cts_labels_lacking(c->loaded.labels, show, lacking, &any, err);
    if (!st && !any) {
        c->skipped = true;
        st = cts_fail(err, CTS_ERR_PIXELS, "`show`: it has no label %s", lacking);
    } else if (!st && *lacking) {
        cts_report_diagnostic(&c->report, CTS_DIAGNOSTIC_LABELS_LACKING,
                              "`show`: no label is called %s; the others are shown", lacking);
    }
    return st;
}

/* Reads labels and slices, once for all pictures. */
static CtsStatus load_series_slices(CtsWorkerProcess *c, const CtsSource *source, CtsError *err)
{
    if (c->is_loaded)
        return CTS_OK;
    const CtsStageTimer meter = cts_stage_timer_start(&c->report);
    CtsStatus st = cts_source_labels(source, &c->loaded, &c->report, err);
    if (!st && !(st = check_shown(c, source, err)))
        st = cts_source_read(source, &c->loaded, &c->report, err);
    cts_stage_timer_stop(meter, &c->report, CTS_STAGE_DECODE);
    if (st)
        return st;
    CtsPixelFacts facts = {0};
    cts_pixel_facts(&facts, c->loaded.scanned->even);
    c->is_loaded = true;
    cts_worker_loaded(c, &facts);
    return c->settings->options->no_sections ? CTS_OK : draw_sections(c, err);
}

/* last: no other volume is needed. */
static CtsStatus render_picture(CtsWorkerProcess *c, const CtsJob *job, bool last, CtsError *err)
{
    const CtsWatch watch = {.context = c, .band = on_band, .output = on_output, .frame = on_frame};
    const size_t first_diagnostic = c->report.diagnostics.n;
    c->error = 0;
    c->report.verified = (CtsVerified){0};
    cts_log_picture(c->log, job->preset->name, &job->render, job->outputs.rotation ? job->outputs.rotation : 1);
    CtsStatus st = cts_job_show(job, last, &c->loaded, &c->prepared, &watch, &c->report, err);
    if (!st && !(st = end_thumb(c, err)))
        st = cts_worker_picture_done(c, first_diagnostic, err);
    cts_thumbnail_discard(&c->thumb);
    return st;
}

/* Volumes of one scan, of which each picture needs one; a montage has its own. */
typedef enum VolumeKind { OF_MONTAGE, WITH_TABLE, WITH_AIR, CROPPED, N_VOLUME_KINDS } VolumeKind;

static VolumeKind volume_kind(const CtsJob *job)
{
    const CtsSource *const source = &job->source;
    return job->montage ? OF_MONTAGE : !source->remove_table ? WITH_TABLE : source->crops_air ? CROPPED : WITH_AIR;
}

static CtsStatus render_pictures(CtsWorkerProcess *c, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const CtsBatchPicture *const pictures = c->pictures;
    const int n = c->n_pictures;
    VolumeKind last = OF_MONTAGE;
    bool inside = false;
    for (int i = 0; i < n; i++) {
        const CtsJob job = job_of(c->settings, &pictures[i]);
        last = volume_kind(&job) > last ? volume_kind(&job) : last;
        inside |= cts_job_finds_body(&job);
    }
    for (VolumeKind kind = OF_MONTAGE; kind < N_VOLUME_KINDS; kind++)
        for (int i = 0; i < n && !st; i++) {
            CtsJob job = job_of(c->settings, &pictures[i]);
            if (volume_kind(&job) != kind)
                continue;
            job.source.n_threads = job.render.n_threads = c->n_threads;
            job.source.paths = c->label_paths;
            job.source.n_paths = c->n_label_paths;
            job.source.labels_listed = true;
            job.source.without_body = !inside;
            job.source.archives = c->archives;
            c->picture = &pictures[i];
            /* The volume first: its findings are not those of a preset. */
            if (!(st = load_series_slices(c, &job.source, err)) &&
                (job.montage || !(st = cts_job_volume(&job, kind == last, &c->loaded, &c->prepared, &c->report, err))))
                st = render_picture(c, &job, kind == last, err);
        }
    cts_prepared_free(&c->prepared);
    return st;
}

/* Label files of the series' study, so that a batch opens each about once. */
static CtsStatus list_label_files(CtsWorkerProcess *c, CtsError *err)
{
    const CtsPlanSeries *const s = c->series;
    c->label_paths = calloc(s->n_label_files + 1, sizeof *c->label_paths);
    if (!c->label_paths)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < s->n_label_files; i++) {
        const CtsBatchLabelFile *const f = &s->label_files[i];
        if (!strcmp(f->study_uid, c->loaded.series->study_uid))
            c->label_paths[c->n_label_paths++] = f->path;
    }
    return CTS_OK;
}

static CtsStatus render_series(CtsWorkerProcess *c)
{
    CtsError err = {0}, log_err;
    const CtsOptions *const o = c->settings->options;
    const CtsPlanSeries *const s = c->series;
    const double start_ms = cts_wall_ms();
    if (s->n_stacked) /* with slices of other series, which this process does not see */
        cts_report_diagnostic(&c->report, CTS_DIAGNOSTIC_SINGLE_SLICES, CTS_SINGLE_SLICES_TEXT, s->own_uid,
                              s->n_stacked - 1, s->n_stacked);
    CtsStatus st = cts_worker_begin_series(c, &err);
    if (!st)
        st = list_label_files(c, &err);
    const char *const modalities = cts_options_given(o, "modality");
    if (!st && modalities && !cts_text_lists(modalities, c->loaded.series->modality)) {
        c->skipped = true;
        st = cts_fail(&err, CTS_ERR_NO_SERIES, "is of modality %s, and not of %s", c->loaded.series->modality,
                      modalities);
    }
    const bool is_shown = !st && cts_worker_shows_image(c);
    if (is_shown)
        st = draw_image(c, &err);
    if (!st && !c->loaded.series->renderable)
        st = cts_fail(&err, c->loaded.series->refusal, "%s%s", c->loaded.series->reason,
                      is_shown || !c->loaded.series->passed ? ""
                                                            : "; its pixels may show the patient's name, so it is not "
                                                              "shown (`show-patient` shows it)");
    if (!st && !(st = cts_log_open(&c->log, o->log, o->export.key, o->shard.n == 1, start_ms, &err))) {
        char command[512] = "batch";
        cts_options_command(o, command + strlen(command), sizeof command - strlen(command));
        cts_log_run(c->log, command, c->loaded.series->uid);
        if (!o->show_paths)
            cts_log_without_names(c->log, &c->names);
        st = render_pictures(c, &err);
    }
    cts_loaded_free(&c->loaded);
    free(c->label_paths);
    cts_log_report(c->log, &c->report);
    if (st)
        cts_log_failed(c->log, cts_exit_code(st), err.text);
    else
        cts_log_done(c->log, c->n_threads);
    if (cts_log_close(&c->log, &log_err))
        cts_report_diagnostic(&c->report, CTS_DIAGNOSTIC_LOG_LOST, "the log is incomplete: %s", log_err.text);
    const CtsStatus reported = cts_worker_end_series(c, st, &err);
    cts_report_free(&c->report);
    return reported ? reported : st == CTS_ERR_INTERRUPTED ? st : CTS_OK;
}

static CtsStatus render_all(CtsWorkerProcess *c, CtsError *err)
{
    const CtsPlanSeries *const s = c->series;
    CtsSeriesList *list = NULL;
    CtsReport scan = {0};
    const CtsSeriesSearch search = {.paths = s->paths,
                                    .n_paths = s->n_paths,
                                    .n_threads = c->n_threads,
                                    .images = true,
                                    .rules = c->settings->options->source.rules,
                                    .archives = c->archives,
                                    .numbers = s->numbers};
    CtsStatus st = cts_series_search(&search, &list, &scan, err);
    for (size_t i = 0; !st && i < list->n; i++) {
        CtsWorkerProcess one = *c;
        one.now = one.loaded.series = &list->items[i];
        if (strcmp(one.now->uid, s->own_uid) && one.now->uid[0])
            continue;
        for (size_t f = 0; f < list->diagnostics.n; f++)
            cts_report_diagnostic(&one.report, list->diagnostics.items[f].id, "%s", list->diagnostics.items[f].text);
        one.report.stages[CTS_STAGE_SCAN] = scan.stages[CTS_STAGE_SCAN];
        scan.stages[CTS_STAGE_SCAN] = (CtsStageTime){0}; /* the first one's */
        st = render_series(&one);
        c->is_final = true;
        c->start_wall_ms = cts_wall_ms();
        c->start_cpu_ms = cts_cpu_ms();
    }
    cts_report_free(&scan);
    cts_series_list_free(&list);
    return st;
}

void cts_worker_render(CtsWorkerProcess *c)
{
    CtsError err = {0};
    for (int i = 0; i < c->series->n_paths; i++)
        cts_names_add(&c->names, c->series->paths[i]);
    const CtsStatus st = render_all(c, &err);
    if (st && st != CTS_ERR_INTERRUPTED && !c->is_final) {
        c->record = cts_worker_new_record(c->settings, c->series, c->series->uid, c->series->folder);
        cts_worker_report_status(c, st, err.text);
        cts_worker_send_record(c, CTS_WORKER_LAST_RECORD, NULL);
    }
    fflush(NULL);
    _exit(st == CTS_ERR_INTERRUPTED ? 130 : st == CTS_ERR_MEMORY ? CTS_WORKER_NO_MEMORY : 0);
}

/* Paths of the captures that are to be sent, in the order of the line's entries; each and the list to be freed. */
static CtsStatus list_captures(const CtsWorkerProcess *c, char ***paths, int *n, CtsError *err)
{
    size_t i;
    json_t *entry;
    *n = 0;
    if (!(*paths = calloc((size_t)cts_journal_record_n_unsent(c->settings, c->record) + 1, sizeof **paths)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    json_array_foreach(json_object_get(c->record, "outputs"), i, entry)
    {
        char path[PATH_MAX];
        if (!cts_journal_record_is_unsent(c->settings, c->record, entry) ||
            !cts_journal_record_path(c->settings, entry, path, sizeof path))
            continue;
        if (!((*paths)[*n] = strdup(path)))
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        ++*n;
    }
    return CTS_OK;
}

/* Records that the PACS has the file. */
static void on_sent(void *context, const char *sent)
{
    CtsWorkerProcess *c = context;
    size_t i;
    json_t *entry;
    json_array_foreach(json_object_get(c->record, "outputs"), i, entry)
    {
        char path[PATH_MAX];
        if (!cts_journal_record_path(c->settings, entry, path, sizeof path) || strcmp(path, sent))
            continue;
        if (!json_object_get(entry, "sent_to"))
            json_object_set_new(entry, "sent_to", json_array());
        json_array_append_new(json_object_get(entry, "sent_to"), json_string(c->settings->lists->send_to));
    }
    json_object_set_new(c->record, "unsent", json_integer(cts_journal_record_n_unsent(c->settings, c->record)));
    cts_worker_send_record(c, CTS_WORKER_RECORD, NULL);
}

void cts_worker_send(CtsWorkerProcess *c)
{
    CtsError err = {0};
    char **paths;
    int n;
    CtsReport report = {0};
    CtsNet net = c->settings->options->net;
    net.report = &report;
    net.sent = on_sent;
    net.context = c;
    CtsStatus st = list_captures(c, &paths, &n, &err);
    if (!st)
        st = cts_net_send(&c->settings->options->send.peer, &net, (const char *const *)paths, n, NULL, &err);
    if (st == CTS_ERR_INTERRUPTED)
        _exit(130);
    if (!st)
        json_object_del(c->record, "unsent");
    for (size_t i = 0; i < report.diagnostics.n; i++)
        cts_worker_add_diagnostic(c, &report.diagnostics.items[i], NULL);
    cts_worker_set_status(c->record, cts_exit_code(st), st ? err.text : "");
    cts_worker_send_record(c, CTS_WORKER_LAST_RECORD, NULL);
    _exit(0);
}
