#include "app/options/options.h"
#include "output/image/whole_picture.h"

#include "base/cpu.h"
#include "base/stage_timer.h"
#include <stdlib.h>
#include <string.h>

/* Receiver of the pictures, and the picture that is assembled from bands. */
typedef struct Whole {
    CtsPictureSink take;
    void *context;
    bool alone; /* the bands have no other receiver */
    CtsPicture *picture;
    int frame; /* its number */
} Whole;

static CtsStatus take_over(Whole *w, CtsPicture *band, CtsError *err)
{
    if (!(w->picture = malloc(sizeof *w->picture)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    *w->picture = *band;
    w->picture->bound = NULL;
    band->pixels = band->depth_mm = NULL;
    return CTS_OK;
}

static CtsStatus take_band(void *context, int frame, CtsPicture *band, CtsError *err)
{
    Whole *const w = context;
    w->frame = frame;
    return w->alone && band->height == band->whole_height ? take_over(w, band, err)
                                                          : cts_picture_add_band(&w->picture, band, err);
}

/* Passed on when its error is known, too. */
static CtsStatus pass_picture(void *context, const CtsErrorBound *bound, CtsError *err)
{
    Whole *const w = context;
    CtsPicture *const whole = w->picture;
    (void)bound;
    w->picture = NULL;
    return whole ? w->take(w->context, w->frame, whole, err) : CTS_OK;
}

static CtsStatus keep_picture(void *context, int frame, CtsPicture *picture, CtsError *err)
{
    (void)frame, (void)err;
    *(CtsPicture **)context = picture;
    return CTS_OK;
}

/* A series that stays loaded, and the volume that the last picture of it was made of. */
struct CtsSession {
    CtsLoaded loaded;
    CtsPrepared prepared; /* by the last picture */
};

static CtsStatus run_loaded(CtsSession *session, const CtsOptions *options, CtsPreset *preset, CtsJob *job,
                            const CtsWatch *watch, CtsReport *report, CtsError *err)
{
    const CtsVolume *const scanned = session->loaded.scanned->even;
    CtsStatus st = cts_options_settle(options, scanned->modality, scanned->quantity, preset, job, report, err);
    if (!st)
        st = cts_job_check(job, report, err);
    for (int i = 0; !st && !session->loaded.series && i < job->outputs.n; i++)
        if (cts_output_is_dicom(&job->outputs, i))
            st = cts_fail(err, CTS_ERR_USAGE, "%s: an array without a patient cannot become a DICOM object",
                          job->outputs.paths[i]);
    return st ? st : cts_job_show(job, false, &session->loaded, &session->prepared, watch, report, err);
}

/* session NULL: the job finds and reads its series itself. */
static CtsStatus run_options(CtsSession *session, const CtsOptions *options, Whole *whole, CtsReport *report,
                             CtsError *err)
{
    CtsJob job;
    CtsPreset preset;
    const CtsWatch watch = {.context = whole, .band = whole ? take_band : NULL, .frame = whole ? pass_picture : NULL};
    CtsStatus st = cts_options_one_job(options, &preset, &job, report, err);
    job.render.stop = options->net.stop;
    if (!st && !whole && !options->outputs.n)
        st = cts_fail(err, CTS_ERR_USAGE, "no output (give `output` FILE, or a place for the picture in memory)");
    job.render.want_depth = options->depth;
    if (whole)
        whole->alone = !options->outputs.n;
    if (!st)
        st = session ? run_loaded(session, options, &preset, &job, &watch, report, err)
                     : cts_options_run_job(options, &preset, &job, &watch, report, err);
    return st ? st : cts_options_send(options, report, err);
}

/* Free options in any case. */
static CtsStatus take_options(CtsOptions *options, const CtsJobOption *given, int n_given,
                              const volatile sig_atomic_t *stop, CtsError *err)
{
    CtsStatus st = CTS_OK;
    cts_options_begin(options);
    options->net.stop = stop;
    for (int i = 0; i < n_given && !st; i++)
        st = cts_options_take(options, CTS_FOR_JOB, &given[i], err);
    return st;
}

/* whole NULL: no pictures in memory. */
static CtsStatus run_given(CtsSession *session, const CtsJobOption *given, int n_given,
                           const volatile sig_atomic_t *stop, Whole *whole, CtsReport *report, CtsError *err)
{
    CtsOptions options;
    CtsReport own = {0};
    CtsError own_error;
    err = err ? err : &own_error;
    CtsStatus st = take_options(&options, given, n_given, stop, err);
    if (!st && session && (options.paths.n || options.from.given || options.source.series_uid))
        st =
            cts_fail(err, CTS_ERR_USAGE, "the series is loaded already (`path`, `series` and `from` name another one)");
    if (!st && session && options.labels.n)
        st = cts_fail(err, CTS_ERR_USAGE, "`labels` are read with the series (give them where it is loaded)");
    if (!st && whole && whole->take == keep_picture && options.rotation > 1)
        st = cts_fail(err, CTS_ERR_USAGE, "`rotation`: of %d pictures none can be the one in memory", options.rotation);
    if (!st && !(st = cts_options_end(&options, CTS_FOR_JOB, err)))
        st = run_options(session, &options, whole, report ? report : &own, err);
    if (whole)
        cts_picture_free(&whole->picture);
    cts_options_free(&options);
    cts_report_free(&own);
    return st;
}

CtsStatus cts_session_run(CtsSession *session, const CtsJobOption *given, int n_given,
                          const volatile sig_atomic_t *stop, CtsPicture **picture, CtsReport *report, CtsError *err)
{
    Whole whole = {.take = keep_picture, .context = picture};
    if (picture)
        *picture = NULL;
    const CtsStatus st = run_given(session, given, n_given, stop, picture ? &whole : NULL, report, err);
    if (st && picture)
        cts_picture_free(picture);
    return st;
}

CtsStatus cts_options_run(const CtsJobOption *given, int n_given, const volatile sig_atomic_t *stop,
                          CtsPicture **picture, CtsReport *report, CtsError *err)
{
    return cts_session_run(NULL, given, n_given, stop, picture, report, err);
}

CtsStatus cts_session_open(CtsSession **session, const CtsJobOption *given, int n_given,
                           const volatile sig_atomic_t *stop, CtsReport *report, CtsError *err)
{
    CtsOptions options;
    CtsReport own = {0};
    CtsError own_error;
    CtsSession *s = *session = calloc(1, sizeof *s);
    err = err ? err : &own_error;
    if (!s)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    CtsStatus st = take_options(&options, given, n_given, stop, err);
    if (!st && !(st = cts_options_end(&options, CTS_FOR_JOB, err))) {
        CtsSource source = cts_options_source(&options);
        source.remove_table = options.remove_table != CTS_OFF;
        source.n_threads = cts_threads(source.n_threads);
        st = cts_source_scan(&source, &(CtsWatch){0}, 2, &s->loaded, report ? report : &own, err);
    }
    cts_options_free(&options);
    cts_report_free(&own);
    if (st)
        cts_session_close(session);
    return st;
}

CtsStatus cts_session_take(CtsSession **session, CtsScanned **scanned, CtsError *err)
{
    CtsSession *s = *session = calloc(1, sizeof *s);
    if (!s)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    s->loaded.scanned = *scanned;
    *scanned = NULL;
    return CTS_OK;
}

void cts_session_close(CtsSession **session)
{
    CtsSession *s = *session;
    if (!s)
        return;
    cts_prepared_free(&s->prepared);
    cts_loaded_free(&s->loaded);
    free(s);
    *session = NULL;
}

const CtsScanned *cts_session_scanned(const CtsSession *session)
{
    return session->loaded.scanned;
}

const CtsSeries *cts_session_series(const CtsSession *session)
{
    return session->loaded.series;
}

CtsStatus cts_session_frames(CtsSession *session, const CtsJobOption *given, int n_given,
                             const volatile sig_atomic_t *stop, CtsPictureSink take, void *context, CtsReport *report,
                             CtsError *err)
{
    Whole whole = {.take = take, .context = context};
    return run_given(session, given, n_given, stop, &whole, report, err);
}
