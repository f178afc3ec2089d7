/* A render job: one series, one preset, one view or a rotation, any number of files. `ctsplat render` runs one, a batch
 * many. It prints nothing: warnings are findings of the report. */
#pragma once

#include "app/job/marks.h"
#include "app/job/outputs.h"
#include "app/job/pipeline.h"
#include "app/job/watch.h"
#include "ctsplat/export.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/state.h"
#include "output/image/describe.h"

struct CtsMontage;

/* Plain data; pointers belong to the caller. */
typedef struct CtsJob {
    CtsSource source;
    const CtsPreset *preset; /* effective: mode, shade, background, window and remove_table as they are to be */
    CtsRenderSettings render;
    CtsExportSettings export; /* its source is filled in by the job */
    CtsOutputs outputs;
    double swivel_step_deg;           /* swivel: degrees between frames; 0: a full rotation */
    const struct CtsMontage *montage; /* (app/job/montage.h) instead of the one view; NULL: none */
    CtsMarks annotate;
    const CtsJobOption *options; /* options to be written to outputs.state beside the preset */
    int n_options;
} CtsJob;

/* The effective preset, and what of the source depends on it. */
void cts_job_set_preset(CtsJob *job, const CtsPreset *preset);

/* All checks that need no file of the input. */
CtsStatus cts_job_check(const CtsJob *job, CtsReport *report, CtsError *err);

/* State shared by the pictures of a job and of later jobs of the same volume. */
typedef struct CtsPrepared {
    char *volume;     /* identifies the volume of cts_job_volume() (cts_source_choice()); NULL: none; owned */
    char *given;      /* the job's preset as JSON, without occlusion; owned */
    CtsPreset preset; /* adapted to this volume */
    bool no_contrast; /* reported with each picture */
    CtsRenderer *renderer;
} CtsPrepared;

/* True if *prepared can be used for this job of the same volume, whose occlusion may be another; it has its settings
 * then. */
bool cts_job_is_prepared(const CtsJob *job, CtsPrepared *prepared);
/* Reads the slices again where a volume was made of them. */
CtsStatus cts_job_slices(const CtsJob *job, CtsLoaded *loaded, CtsReport *report, CtsError *err);
/* Makes loaded->model the job's, of the slices, where that of *prepared is another. last: as of cts_source_view(). */
CtsStatus cts_job_volume(const CtsJob *job, bool last, CtsLoaded *loaded, CtsPrepared *prepared, CtsReport *report,
                         CtsError *err);
/* Prepares again what cannot be used. *prepared is zeroed at first. */
CtsStatus cts_job_prepare(const CtsJob *job, const CtsModel *model, CtsPrepared *prepared, CtsReport *report,
                          CtsError *err);
void cts_prepared_free(CtsPrepared *prepared);
/* All outputs of the loaded volume; with render.explain the report gets the plan of one view, and no file is written.
 * report->verified covers all frames. */
CtsStatus cts_job_pictures(const CtsJob *job, const CtsLoaded *loaded, const CtsPrepared *prepared,
                           const CtsWatch *watch, CtsReport *report, CtsError *err);

/* Volume, preparation and pictures, or the montage, of scanned slices. */
CtsStatus cts_job_show(const CtsJob *job, bool last, CtsLoaded *loaded, CtsPrepared *prepared, const CtsWatch *watch,
                       CtsReport *report, CtsError *err);
/* The job's montage, instead of its pictures. */
CtsStatus cts_job_montage(const CtsJob *job, bool last, CtsLoaded *loaded, CtsPrepared *prepared, const CtsWatch *watch,
                          CtsReport *report, CtsError *err);

/* The job's outputs; the settings are completed, and must outlive them. */
CtsFiles cts_job_files(const CtsJob *job, const CtsLoaded *loaded, const CtsWatch *watch, CtsExportSettings *settings);
/* Labels that alone are visible, or the preset, and the view. */
CtsPhrase cts_job_caption(const CtsJob *job, const CtsPictureInfo *info);
/* One verdict on several pictures: pooled rmse and interval, the largest maximum and percentile. */
void cts_verified_add(CtsVerified *all, const CtsVerified *one);

/* True if the job's pictures use only the inside of the body. */
bool cts_job_finds_body(const CtsJob *job);

/* Check and find; the series decides the preset where none is given (cts_options_run_job()). */
CtsStatus cts_job_find(const CtsJob *job, const CtsWatch *watch, CtsLoaded *loaded, CtsReport *report, CtsError *err);
/* Load what was found, and render. */
CtsStatus cts_job_run(const CtsJob *job, const CtsWatch *watch, CtsLoaded *loaded, CtsReport *report, CtsError *err);
