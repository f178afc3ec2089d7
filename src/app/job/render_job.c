#include "app/job/render_job.h"

#include "app/job/auto_window.h"
#include "app/job/montage.h"
#include "base/compare.h"
#include "base/cpu.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/stage_timer.h"
#include "output/image/whole_picture.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Counts of nearly black and nearly white pixels, for a warning. */
typedef struct Saturation {
    uint64_t n, n_black, n_white; /* pixels sampled; of them practically black, practically white */
    uint64_t n_seen, n_full;      /* of a projection: within the window or above, and at its top or above */
    float most;                   /* the brightest pixel */
} Saturation;

/* Step from sample to sample, 7 or, of a large picture, so many that SAMPLES remain, of which a two-hundredth are known
 * to a ninth (each takes a line of memory from far): odd, so that samples of rows of even width lie in different
 * columns. */
enum { EVERY = 7, SAMPLES = 16384 };
/* Five grey levels of 255 are indistinguishable from black or white. */
static const float black = 5.0f / 255, white = 250.0f / 255;
/* Share of a picture that counts as all of it: a two-hundredth is negligible. */
static const double nearly_all = 0.995;
/* Brightness that no pixel reaches where rays are short, as with micro-CT voxels, and opacity is per millimetre. */
static const float low_opacity = 1 / 8.0f;
/* Largest voxels of a micro-CT (core/volume/threshold.h). */
static const double fine_mm = 0.2;

/* Counts a band before its background is behind it, which a projection's counts leave out. */
static void saturation_add(Saturation *saturation, const CtsPicture *band, const CtsPreset *preset)
{
    const size_t n = (size_t)band->width * (size_t)band->height,
                 every = cts_larger_size((size_t)band->width * (size_t)band->whole_height / SAMPLES | 1, EVERY);
    const bool inverted = band->info.window_low_hu > band->info.window_high_hu;
    Saturation s = *saturation; /* in registers; comparisons, since fmaxf() is a call */
    for (size_t i = 0; i < n; i += every) {
        const float *const rgba = &band->pixels[4 * i], behind = preset->background_none ? 0 : 1 - rgba[3];
        float least = INFINITY, most = -INFINITY;
        for (int c = 0; c < 3; c++) {
            const float p = rgba[c] + behind * (float)preset->background[c];
            least = p < least ? p : least;
            most = p > most ? p : most;
        }
        s.most = most > s.most ? most : s.most;
        s.n_black += most <= black;
        s.n_white += least >= white;
        const float shown = inverted ? rgba[3] - rgba[0] : rgba[0];
        s.n_seen += shown > 0;
        s.n_full += shown >= 1;
        s.n++;
    }
    *saturation = s;
}

/* Warns where half of a projection's visible pixels are white, or nearly all of a picture is black or white. */
static void saturation_report(const Saturation *s, const CtsJob *job, const CtsVolume *v, const CtsPictureInfo *info,
                              CtsReport *report)
{
    const bool projects = info->mode != CTS_MODE_COMPOSITE, is_black = (double)s->n_black > nearly_all * (double)s->n;
    const bool inverted = info->window_low_hu > info->window_high_hu;
    const char *const unit = cts_quantity_units[v->quantity];
    double coarsest_mm = 0;
    for (int a = 0; a < 3; a++)
        coarsest_mm = fmax(coarsest_mm, cts_volume_spacing_mm(v, a));
    if (!projects && !job->render.opacity_per_voxel && coarsest_mm <= fine_mm && (is_black || s->most < low_opacity)) {
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_NEARLY_BLACK,
                              "the picture is nearly all black: opacity is per millimetre, and voxels are %.2g mm wide "
                              "(`opacity-unit` voxel makes it per voxel)",
                              coarsest_mm);
        return;
    }
    if (projects && 2 * s->n_full > s->n_seen)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_MOSTLY_WHITE,
            "%.0f %% of the visible pixels are %s, %g%s%s or more (move the `window` up, or limit the "
            "depth with a `slab` of about 10 mm)",
            100.0 * (double)s->n_full / (double)s->n_seen, inverted ? "black" : "white",
            fmax(info->window_low_hu, info->window_high_hu), *unit ? " " : "", unit);
    else if ((is_black || (double)s->n_white > nearly_all * (double)s->n) &&
             !(report && cts_diagnostics_find(&report->diagnostics, CTS_DIAGNOSTIC_NOTHING_VISIBLE)))
        cts_report_diagnostic(
            report, is_black ? CTS_DIAGNOSTIC_NEARLY_BLACK : CTS_DIAGNOSTIC_NEARLY_WHITE,
            projects
                ? "the picture is nearly all %s: little of it lies between %g and %g%s%s (move the "
                  "`window`; `mode` without a preset takes one that fits)"
                : "the picture is nearly all %s (check which values the preset shows, the `background`, and the scale)",
            is_black ? "black" : "white", info->window_low_hu, info->window_high_hu, *unit ? " " : "", unit);
}

/* Band height while a watch is set, in whole strips: few bands cost little, and enough of them show the progress. */
enum { WATCHED_ROWS = 4 * CTS_BAND_ROWS };

static int n_frames_of(const CtsJob *job)
{
    return job->outputs.rotation ? job->outputs.rotation : 1;
}

/* The first two steps are searching and reading. */
static int n_steps_of(const CtsJob *job)
{
    return 2 + (job->montage ? job->montage->n : n_frames_of(job));
}

CtsStatus cts_job_check(const CtsJob *job, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    for (int i = 0; job->montage && i < job->montage->n; i++)
        if (job->montage->tiles[i].preset && (st = cts_render_check(job->montage->tiles[i].preset, &job->render, err)))
            return st;
    if (job->preset->note[0])
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_PRESET_LEFT_OUT, "preset %s: left out: %s", job->preset->name,
                              job->preset->note);
    if ((st = cts_render_check(job->preset, &job->render, err)) || job->render.explain)
        return st;
    st = cts_outputs_check(&job->outputs, &job->export, err);
    /* The frames of a file must fit its format; labels may have colours: each file decides when it begins. */
    const bool grey = cts_preset_is_grey(job->preset, job->preset->mode);
    for (int i = 0; i < job->outputs.n && !st; i++)
        st = cts_export_check_size(job->outputs.paths[i], job->render.width, job->render.height,
                                   cts_output_n_frames(&job->outputs, i), grey, &job->export, err);
    return st;
}

/* The frame being rendered. */
typedef struct Frame {
    const CtsJob *job;
    const CtsModel *model;
    CtsFiles *files;
    CtsReport *report;
    int number;
    CtsPicture **keep; /* copy of the frame as rendered; NULL: none */
    Saturation saturation;
} Frame;

/* A frame whose view a later frame has. */
typedef struct KeptFrame {
    CtsPicture *picture; /* for a file of all frames, or the watch; NULL: not kept */
    CtsVerified verified;
    CtsErrorBound bound;
} KeptFrame;

/* Bytes of all kept frames: 32 pictures of 1024 x 1024 pixels. A swivel of 72 frames has at most 18 to keep. */
enum { MAX_KEPT_BYTES = 512 << 20 };

static CtsStatus stopped(const CtsJob *job, CtsError *err)
{
    return job->render.stop && *job->render.stop ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : CTS_OK;
}

/* done: of this frame, 0 to 1. */
static void report_step(const Frame *frame, const CtsWatch *watch, double done)
{
    char what[64] = "rendering";
    if (n_frames_of(frame->job) > 1)
        snprintf(what, sizeof what, "frame %d of %d", frame->number + 1, n_frames_of(frame->job));
    cts_watch_step(watch, 2 + frame->number + done, n_steps_of(frame->job), what);
}

CtsPhrase cts_job_caption(const CtsJob *job, const CtsPictureInfo *info)
{
    CtsPhrase caption;
    const char *const shown = job->source.choice.show ? job->source.choice.show : info->preset;
    snprintf(caption.text, sizeof caption.text, "%.50s %.25s", shown, cts_describe_view(info).text);
    return caption;
}

/* Rows as the engine made them: over the background, marked, into all files. */
static CtsStatus finish_part(const Frame *frame, CtsPicture *band, CtsError *err)
{
    const CtsJob *job = frame->job;
    CtsStatus st;
    if (!job->preset->background_none)
        cts_picture_over(band, job->preset->background, job->render.n_threads);
    CtsReport *const first = frame->number == 0 && band->first_row == 0 ? frame->report : NULL;
    if (!(st = cts_marks_draw(&job->annotate, frame->model, band, first, err)))
        st = cts_files_rows(frame->files, frame->number, band, false, frame->report, err);
    if (!st && job->annotate.captions)
        st = cts_marks_caption(&job->annotate, cts_job_caption(job, &band->info).text, 1, band, first, err);
    if (!st && frame->files->watch->band)
        st = frame->files->watch->band(frame->files->watch->context, frame->number, band, err);
    if (!st && !(st = stopped(job, err)))
        st = cts_files_rows(frame->files, frame->number, band, true, frame->report, err);
    report_step(frame, frame->files->watch, (double)(band->first_row + band->height) / band->whole_height);
    return st;
}

/* Rows of a band that are in the cache from the first to the last step, some for each thread; all of them where the
 * watch wants whole bands. */
static CtsStatus finish_band(void *context, CtsPicture *band, CtsError *err)
{
    Frame *const frame = context;
    const CtsStageTimer meter = cts_stage_timer_start(frame->report);
    const int n_rows =
        frame->files->watch->band ? band->height : CTS_BAND_ROWS * cts_threads(frame->job->render.n_threads);
    CtsStatus st = CTS_OK;
    if (frame->keep && cts_picture_add_band(frame->keep, band, NULL)) {
        cts_picture_free(frame->keep);
        frame->keep = NULL;
    }
    saturation_add(&frame->saturation, band, frame->job->preset);
    for (int y = 0; y < band->height && !st; y += n_rows) {
        CtsPicture rows = *band;
        const size_t before = (size_t)y * (size_t)band->width;
        rows.height = cts_smaller_int(n_rows, band->height - y);
        rows.first_row += y;
        rows.pixels += before * (size_t)band->n_channels;
        rows.depth_mm = band->depth_mm ? band->depth_mm + before : NULL;
        rows.bound = band->bound ? band->bound + before : NULL;
        /* the watch may take the pixels of a whole band */
        st = rows.height == band->height ? finish_part(frame, band, err) : finish_part(frame, &rows, err);
    }
    cts_stage_timer_stop(meter, frame->report, CTS_STAGE_EXPORT);
    return st;
}

/* Rotation angle of a frame from the first view. A swivel turns to one side, back through the first view to the other,
 * and back to it. */
static double turn_deg(const CtsJob *job, int frame)
{
    const int n = n_frames_of(job);
    if (job->swivel_step_deg == 0)
        return 360.0 * frame / n;
    const int there = (n + 2) / 4, back = n / 2 + there;
    return job->swivel_step_deg * (frame <= there ? frame : frame <= back ? 2 * there - frame : frame - n);
}

/* The first frame from `from` to `end` - 1 that has the view of this one; `end`: none. */
static int find_same_view(const CtsJob *job, int number, int from, int end)
{
    while (from < end && turn_deg(job, from) != turn_deg(job, number))
        from++;
    return from;
}

static CtsStatus render_frame(CtsRenderer *renderer, Frame *frame, const CtsWatch *watch, CtsError *err)
{
    const CtsJob *job = frame->job;
    const double azimuth_deg = job->render.azimuth_deg + turn_deg(job, frame->number);
    const CtsBandSink sink = {.take = finish_band, .context = frame, .max_rows = watch->step ? WATCHED_ROWS : 0};
    const CtsStageTimer meter = cts_stage_timer_start(frame->report);
    report_step(frame, watch, 0);
    const CtsStatus st = cts_render_bands(renderer, azimuth_deg, job->render.elevation_deg, &sink, frame->report, err);
    cts_watch_diagnostics(watch, frame->report);
    cts_stage_timer_stop(meter, frame->report, CTS_STAGE_COMPOSITE);
    return st ? st : stopped(job, err);
}

/* Renders the frame, or takes it from one of the same view; keeps it for a later one. */
static CtsStatus make_frame(CtsRenderer *renderer, Frame *frame, KeptFrame *kept, CtsError *err)
{
    const CtsJob *const job = frame->job;
    CtsReport *const report = frame->report;
    const int n = n_frames_of(job), number = frame->number, first = find_same_view(job, number, 0, number);
    CtsStatus st;
    const bool keeps = cts_outputs_hold_frames(frame->files->outputs) || frame->files->watch->band;
    frame->files->same = first < number ? first + 1 : 0;
    if (first < number && (!keeps || kept[first].picture)) {
        cts_report_skip(report, "rendering again", "frame %d has the view of frame %d", number + 1, first + 1);
        report->verified = kept[first].verified;
        report->bound = kept[first].bound;
        st = keeps ? finish_band(frame, kept[first].picture, err) : stopped(job, err);
        report_step(frame, frame->files->watch, 1);
        cts_picture_free(&kept[first].picture);
        return st;
    }
    const size_t bytes = (size_t)job->render.width * (size_t)job->render.height * 5 * sizeof(float);
    size_t n_kept = 0;
    for (int i = 0; i < number; i++)
        n_kept += kept[i].picture != NULL;
    if (keeps && find_same_view(job, number, number + 1, n) < n && (n_kept + 1) * bytes <= MAX_KEPT_BYTES)
        frame->keep = &kept[number].picture;
    st = render_frame(renderer, frame, frame->files->watch, err);
    frame->keep = NULL;
    kept[number].verified = report->verified;
    kept[number].bound = report->bound;
    return st;
}

void cts_verified_add(CtsVerified *all, const CtsVerified *one)
{
    const uint64_t n = all->pixels + one->pixels;
    if (!n)
        return;
    const CtsVerified before = *all;
    const double a = (double)before.pixels / (double)n, b = (double)one->pixels / (double)n;
    if (one->max >= all->max)
        *all = *one;
    all->rmse = sqrt(a * before.rmse * before.rmse + b * one->rmse * one->rmse);
    all->p999 = fmax(before.p999, one->p999);
    all->share_above = a * before.share_above + b * one->share_above;
    all->unit = fmax(a * before.unit, b * one->unit);
    all->wall_ms = before.wall_ms + one->wall_ms;
    all->cpu_ms = before.cpu_ms + one->cpu_ms;
    all->pixels = n;
    cts_error_limits(all);
}

/* Adds a frame's bound to that of all. */
static void add_bound(CtsErrorBound *all, const CtsErrorBound *frame)
{
    const CtsErrorBound before = *all;
    *all = *frame;
    all->known |= before.known;
    all->rmse = fmax(before.rmse, frame->rmse);
    all->rms_estimate = fmax(before.rms_estimate, frame->rms_estimate);
    all->max = before.max < 0 || frame->max < 0 ? -1 : fmax(before.max, frame->max);
    all->n_rerendered += before.n_rerendered;
}

static CtsStatus render_frames(const CtsJob *job, const CtsModel *model, CtsRenderer *renderer, CtsFiles *files,
                               CtsReport *report, CtsError *err)
{
    CtsVerified pooled = {0};
    CtsErrorBound bound = report->bound; /* of earlier jobs of the report */
    KeptFrame *kept = NULL;
    CtsStatus st = cts_alloc_zeroed(&kept, (size_t)n_frames_of(job), err);
    Frame frame = {.job = job, .model = model, .files = files, .report = report};
    if (n_frames_of(job) > 1)
        cts_report_skip(report, "loading again", "%d frames share one volume; crop and table removal run once",
                        n_frames_of(job));
    /* A rotation's plan is that of its first view. */
    const int n_frames = job->render.explain ? 1 : n_frames_of(job);
    for (; frame.number < n_frames && !st; frame.number++) {
        report->bound = (CtsErrorBound){0};
        if ((st = make_frame(renderer, &frame, kept, err)))
            break;
        cts_verified_add(&pooled, &report->verified);
        if (frame.number == n_frames - 1)
            report->verified = pooled;
        st = cts_files_frame_done(files, frame.number, report, err);
        if (!st && files->watch->frame)
            st = files->watch->frame(files->watch->context, &report->bound, err);
        add_bound(&bound, &report->bound);
    }
    for (int i = 0; kept && i < n_frames; i++)
        cts_picture_free(&kept[i].picture);
    cts_free(&kept);
    report->verified = pooled;
    report->bound = bound;
    if (!st)
        saturation_report(&frame.saturation, job, model->volume, &files->first, report);
    cts_watch_diagnostics(files->watch, report);
    return st;
}

/* The recipe beside the pictures. */
static CtsStatus write_state(const CtsJob *job, const CtsPreset *preset, const CtsLoaded *loaded,
                             const CtsPictureInfo *first, CtsReport *report, CtsError *err)
{
    CtsStateScene scene = {
        .preset = preset,
        .info = first,
        .width = job->render.width,
        .height = job->render.height,
        .shaded = preset->shade,
        .cropped = job->source.crop.given,
        .source = loaded->series,
        .options = job->options,
        .n_options = job->n_options,
        .labels = loaded->model.voxel_labels ? loaded->labels : NULL,
        .choice = &job->source.choice,
        .report = report,
    };
    memcpy(scene.crop_low_lps, job->source.crop.low_lps, sizeof scene.crop_low_lps);
    memcpy(scene.crop_high_lps, job->source.crop.high_lps, sizeof scene.crop_high_lps);
    for (int i = job->outputs.n - 1; i >= 0; i--)
        if (cts_output_is_dicom(&job->outputs, i))
            scene.capture = job->outputs.paths[i];
    return cts_state_write(job->outputs.state, &scene, job->export.force, err);
}

static CtsRenderSettings settings_of(const CtsJob *job)
{
    CtsRenderSettings render = job->render;
    render.want_depth = job->render.want_depth || cts_outputs_hold_depth(&job->outputs);
    render.rotation_frames = n_frames_of(job);
    if (render.occlusion == CTS_OCCLUSION_AS_PRESET)
        render.occlusion = job->preset->occlusion; /* which may differ from that of the renderer's preset */
    return render;
}

/* The occlusion is a setting of each picture. */
static char *new_preset_text(const CtsPreset *preset)
{
    CtsPreset kept = *preset;
    kept.occlusion = 0;
    return cts_preset_to_json(&kept);
}

/* A window that is fitted to the view serves this view alone. */
bool cts_job_is_prepared(const CtsJob *job, CtsPrepared *prepared)
{
    const CtsPreset *const p = job->preset;
    if (!prepared->renderer || !prepared->given ||
        (p->mode != CTS_MODE_COMPOSITE && p->window_low_hu == p->window_high_hu) ||
        p->needs_contrast != prepared->preset.needs_contrast)
        return false;
    char *const text = new_preset_text(p);
    const CtsRenderSettings render = settings_of(job);
    const bool same = text && !strcmp(text, prepared->given) && cts_render_change_settings(prepared->renderer, &render);
    if (same)
        prepared->preset.occlusion = render.occlusion;
    free(text);
    return same;
}

void cts_prepared_free(CtsPrepared *prepared)
{
    cts_render_end(&prepared->renderer);
    free(prepared->volume);
    free(prepared->given);
    *prepared = (CtsPrepared){0};
}

void cts_job_set_preset(CtsJob *job, const CtsPreset *preset)
{
    job->preset = preset;
    job->source.remove_table = preset->remove_table;
    job->source.crops_air = cts_render_ignores_air(preset, &job->render);
}

CtsStatus cts_job_slices(const CtsJob *job, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    if (loaded->scanned->even->grey)
        return CTS_OK;
    return loaded->series ? cts_source_read(&job->source, loaded, report, err)
                          : cts_fail(err, CTS_ERR_MEMORY, "out of memory for another volume beside the slices");
}

CtsStatus cts_job_volume(const CtsJob *job, bool last, CtsLoaded *loaded, CtsPrepared *prepared, CtsReport *report,
                         CtsError *err)
{
    char *const choice = cts_source_choice(&job->source);
    CtsStatus st = choice ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (st || (loaded->model.volume && prepared->volume && !strcmp(prepared->volume, choice))) {
        free(choice);
        return st;
    }
    const CtsStageTimer meter = cts_stage_timer_start(report);
    cts_prepared_free(prepared);
    prepared->volume = choice;
    if (!(st = cts_job_slices(job, loaded, report, err)) &&
        (st = cts_source_view(&job->source, last, loaded, report, err)))
        cts_model_free(&loaded->model);
    cts_stage_timer_stop(meter, report, CTS_STAGE_GREY);
    return st;
}

CtsStatus cts_job_prepare(const CtsJob *job, const CtsModel *model, CtsPrepared *prepared, CtsReport *report,
                          CtsError *err)
{
    CtsStageTimer meter = cts_stage_timer_start(report);
    const CtsRenderSettings render = settings_of(job);
    CtsStatus st;
    if (cts_job_is_prepared(job, prepared))
        return CTS_OK;
    char *const volume = prepared->volume;
    prepared->volume = NULL;
    cts_prepared_free(prepared);
    *prepared = (CtsPrepared){.volume = volume, .given = new_preset_text(job->preset), .preset = *job->preset};
    if (!(st = cts_fit_preset(model, &render, &prepared->preset, report, err)))
        st = cts_contrast_check(model->volume, cts_threads(job->render.n_threads), &prepared->preset,
                                &prepared->no_contrast, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_CLASSIFY);
    meter = cts_stage_timer_start(report);
    if (!st)
        st = cts_render_begin(&prepared->renderer, model, &prepared->preset, &render, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_GREY); /* --grey-bits makes a volume of other grey levels */
    return st;
}

CtsFiles cts_job_files(const CtsJob *job, const CtsLoaded *loaded, const CtsWatch *watch, CtsExportSettings *settings)
{
    *settings = job->export;
    settings->source = loaded->series;
    settings->labels = job->montage || loaded->model.voxel_labels ? loaded->labels : NULL;
    settings->n_threads = cts_threads(job->render.n_threads);
    return (CtsFiles){.outputs = &job->outputs, .settings = settings, .watch = watch};
}

CtsStatus cts_job_pictures(const CtsJob *job, const CtsLoaded *loaded, const CtsPrepared *prepared,
                           const CtsWatch *watch, CtsReport *report, CtsError *err)
{
    CtsExportSettings settings;
    CtsFiles files = cts_job_files(job, loaded, watch, &settings);
    if (loaded->series && loaded->series->no_patient && job->outputs.state)
        return cts_fail(err, CTS_ERR_PIXELS,
                        "`write-state`: a NIfTI file has no patient and no slices for a presentation state to name");
    if (loaded->series && loaded->series->frames_differ && job->outputs.state)
        return cts_fail(err, CTS_ERR_GEOMETRY,
                        "`write-state`: a presentation state names one frame of reference, and each slice has its own");
    if (loaded->series && job->source.state && !cts_state_is_of(job->source.state, loaded->series))
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_STATE_OF_ANOTHER,
                              "`state`: the presentation state lists another volume than this one");
    if (prepared->no_contrast)
        cts_contrast_report(&prepared->preset, report);
    if (loaded->noise_hu > CTS_NOISY_HU && job->preset->mode == CTS_MODE_COMPOSITE && job->source.smooth_mm == 0)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_NOISY,
                              "the noise of soft tissue, %.0f HU, is visible as grain (`smooth` %d removes most of it; "
                              "`smooth` auto does so wherever it exceeds %d HU)",
                              loaded->noise_hu, CTS_SMOOTH_NOISE_MM, CTS_NOISY_HU);
    CtsStatus st = cts_files_begin(&files, err);
    if (!st)
        st = render_frames(job, &loaded->model, prepared->renderer, &files, report, err);
    const CtsStageTimer meter = cts_stage_timer_start(report);
    if (!st && job->outputs.state && !job->render.explain)
        st = write_state(job, &prepared->preset, loaded, &files.first, report, err);
    cts_watch_diagnostics(watch, report);
    cts_files_end(&files);
    cts_stage_timer_stop(meter, report, CTS_STAGE_EXPORT);
    return st;
}

bool cts_job_finds_body(const CtsJob *job)
{
    const CtsMode mode = job->preset->mode;
    return mode == CTS_MODE_MINIP || mode == CTS_MODE_AVERAGE;
}

CtsStatus cts_job_find(const CtsJob *job, const CtsWatch *watch, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    const CtsStageTimer meter = cts_stage_timer_start(report);
    CtsStatus st = cts_job_check(job, report, err);
    /* An input that does not exist comes before an output that does. */
    for (int i = 0; st == CTS_ERR_OUTPUT && !job->source.from && i < job->source.n_paths; i++)
        if (access(job->source.paths[i], F_OK))
            st = cts_fail(err, CTS_ERR_READ, "%s: %s", job->source.paths[i], strerror(errno));
    cts_watch_diagnostics(watch, report);
    if (!st)
        st = cts_source_find(&job->source, watch, n_steps_of(job), loaded, report, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_SCAN);
    return st;
}

CtsStatus cts_job_show(const CtsJob *job, bool last, CtsLoaded *loaded, CtsPrepared *prepared, const CtsWatch *watch,
                       CtsReport *report, CtsError *err)
{
    CtsStatus st;
    if (job->montage)
        return cts_job_montage(job, last, loaded, prepared, watch, report, err);
    if ((st = cts_job_volume(job, last, loaded, prepared, report, err)))
        return st;
    cts_watch_diagnostics(watch, report);
    if (watch->loaded)
        watch->loaded(watch->context);
    if (!(st = stopped(job, err)) && !(st = cts_job_prepare(job, &loaded->model, prepared, report, err)))
        st = cts_job_pictures(job, loaded, prepared, watch, report, err);
    return st;
}

CtsStatus cts_job_run(const CtsJob *job, const CtsWatch *watch, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    CtsPrepared prepared = {0};
    CtsJob own = *job;
    own.source.without_body = !cts_job_finds_body(job);
    CtsStatus st = cts_source_scan(&own.source, watch, n_steps_of(job), loaded, report, err);
    if (!st)
        st = cts_job_show(&own, true, loaded, &prepared, watch, report, err);
    const CtsStageTimer meter = cts_stage_timer_start(report);
    cts_prepared_free(&prepared);
    cts_stage_timer_stop(meter, report, CTS_STAGE_EXPORT);
    return st;
}
