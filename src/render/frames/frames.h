/* Rendering of frames of one volume with one preset, by the caller's plan. State that does not change from frame to
 * frame (the quantised copy, the transfer function's table, the void key, the engine's cache) is computed once. */
#pragma once

#include "core/scene/engine.h"
#include "core/scene/resolve.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "render/error/error_control.h"
#include "render/error/verify.h"

typedef struct CtsFrames CtsFrames;

/* Checks all settings. The model's parts must stay as they are; the rest is copied. */
CtsStatus cts_frames_new(CtsFrames **frames, const CtsModel *model, const CtsPreset *preset,
                         const CtsRenderSettings *settings, CtsError *err);
void cts_frames_free(CtsFrames **frames);

/* As cts_render_change_settings(). */
bool cts_frames_change_settings(CtsFrames *frames, const CtsRenderSettings *settings);

const CtsEngine *cts_frames_engine(const CtsFrames *frames);
/* Settings, preset and model as cts_frames_new() was given them. */
const CtsRenderSettings *cts_frames_settings(const CtsFrames *frames);
const CtsPreset *cts_frames_preset(const CtsFrames *frames);
const CtsModel *cts_frames_model(const CtsFrames *frames);

/* The settings of one view: its angles, and the scale and centre that the fit gives it. */
CtsStatus cts_frames_view(CtsFrames *frames, const double view_deg[2], CtsRenderSettings *settings, CtsReport *report,
                          CtsError *err);

/* Task for one frame. */
typedef struct CtsFrameTask {
    double azimuth_deg, elevation_deg;
    CtsPlan plan;
    int n_verified;  /* pixels to be verified by the ray caster */
    int least_lossy; /* least number of them if --void key loses anything */
    bool want_depth, explain;
} CtsFrameTask;

/* State of one frame; must not be copied. */
typedef struct CtsFrame {
    CtsFrames *frames;
    CtsEngineId engine_id; /* engine of the frame */
    bool want_depth, explain;
    CtsSceneStore store;
    CtsScene original; /* store's scene with the volume before quantisation, whose loss is part of the error */
    CtsVerify verify;
    CtsErrorControl error_control;
} CtsFrame;

CtsStatus cts_frame_begin(CtsFrame *frame, CtsFrames *frames, const CtsFrameTask *task, CtsReport *report,
                          CtsError *err);
/* Reports the engine's plan without rendering. */
CtsStatus cts_frame_explain(CtsFrame *frame, CtsReport *report, CtsError *err);
/* Bands are whole strips of so many rows; the last may have fewer. */
int cts_frame_strip_rows(const CtsFrame *frame);
/* Rows first_row to first_row + n_rows - 1; free with cts_picture_free(). */
CtsStatus cts_frame_rows(CtsFrame *frame, int first_row, int n_rows, CtsPicture **band, CtsReport *report,
                         CtsError *err);
/* Verifies the frame as requested, unless st is a failure. Returns st, or the verification's failure. */
CtsStatus cts_frame_end(CtsFrame *frame, CtsStatus st, CtsReport *report, CtsError *err);
