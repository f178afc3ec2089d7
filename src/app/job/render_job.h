/* A render job: one series, one preset, one view or a rotation, any number of files. What `ctsplat render` runs, and
 * what works through many series runs for each. Nothing here prints: warnings are findings of the report. */
#ifndef CTS_JOB_RENDER_JOB_H
#define CTS_JOB_RENDER_JOB_H

#include "app/job/outputs.h"
#include "app/job/source.h"
#include "app/job/watch.h"
#include "ctsplat/export.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/state.h"

/* What is drawn on a picture. */
typedef struct CtsMarks {
    bool orientation, scale, labels;
} CtsMarks;

/* Plain data; what it points at is the caller's. */
typedef struct CtsJob {
    CtsSource source;
    const CtsPreset *preset; /* effective: mode, shade, background, window and remove_table as they are to be */
    CtsRenderSettings render;
    CtsExportSettings export; /* its source is filled in by the job */
    CtsOutputs outputs;
    double swivel_step_deg; /* the outputs' rotation swings to and fro by so much a frame; 0: it goes round */
    CtsMarks annotate;
    const CtsWord *words; /* what outputs.state is to hold beside the preset */
    int n_words;
} CtsJob;

/* All that can be refused before any file is read. */
CtsStatus cts_job_check(const CtsJob *job, CtsReport *report, CtsError *err);

/* What a job's pictures are made with, and those of other jobs after it. */
typedef struct CtsPrepared {
    CtsPreset preset; /* as this volume needs it */
    bool no_contrast; /* which each picture is told with */
    CtsRenderer *renderer;
} CtsPrepared;

/* Free prepared->renderer with cts_render_end(), also after a failure. */
CtsStatus cts_job_prepare(const CtsJob *job, const CtsVolume *volume, CtsPrepared *prepared, CtsReport *report,
                          CtsError *err);
/* Whether it does for this job too, of the same volume and preset, whose window is known. */
bool cts_job_again(const CtsJob *job, CtsPrepared *prepared);
CtsStatus cts_job_pictures(const CtsJob *job, const CtsLoaded *loaded, const CtsPrepared *prepared,
                           const CtsWatch *watch, CtsReport *report, CtsError *err);

/* Both: renders what was loaded into all outputs; with render.explain the report gets the plan of one view, and no file
 * is written. report->verified stands for all frames. */
CtsStatus cts_job_render(const CtsJob *job, const CtsLoaded *loaded, const CtsWatch *watch, CtsReport *report,
                         CtsError *err);

/* Whether its pictures show the inside of the body alone. */
bool cts_job_looks_inside(const CtsJob *job);

/* Check, load, render. */
CtsStatus cts_job_run(const CtsJob *job, const CtsWatch *watch, CtsReport *report, CtsError *err);

#endif
