/* Rendering of frames of one volume with one preset, by a plan that is made for the first one. State that does not
 * change from frame to frame (the quantised copy, the transfer function's table, the void key, the engine's cache) is
 * computed once. */
#pragma once

#include "core/model/macrocells.h"
#include "core/scene/engine.h"
#include "core/scene/openness.h"
#include "core/scene/resolve.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "render/error/error_control.h"
#include "render/error/verify.h"
#include "render/frames/void_key_report.h"

/* Nothing but a search for its plan changes it from outside of frames.c. */
struct CtsRenderer {
    CtsModel given;                /* copy of the caller's, who owns its parts */
    const CtsModel *original;      /* given; for engines without label boundaries the one with air for hidden voxels */
    const CtsModel *model;         /* original, or quantised: for the engine */
    CtsModel quantised;            /* its body mask is original's */
    CtsMacrocells *own_macrocells; /* given's, if the caller's model has none */
    CtsPreset preset;
    CtsRenderSettings settings;
    const CtsEngine *engine;
    CtsEngineId engine_id; /* of engine, which may leave frames to the exact march (CTS_ENGINE_AUTO) */
    const char *why_march; /* reason for the exact march; NULL: none */
    CtsOpenness *openness; /* of original; NULL until a frame needs it */
    CtsLut *lut;
    double lut_scale; /* extinction_scale that lut was made for */
    CtsFittedVoidKey key;
    bool key_found, key_reported;
    void *engine_cache[CTS_N_ENGINES]; /* by each engine that renders from model: the chosen one, and the exact march */
    void *original_cache;              /* cache of the engine of probe renderings, if model is quantised */
    int n_begun;                       /* frames */
    CtsRenderSettings fitted;          /* settings of the last view that was fitted, if is_fitted */
    bool is_fitted;
    /* Memory of a rotation's last frame, for the next one: fresh pages cost an eighth of a preview. */
    CtsPicture *band;   /* NULL: none */
    CtsErrorMap errors; /* of n_errors pixels */
    size_t n_errors;
    CtsPlan plan; /* that of the first frame, for all of them, if is_planned */
    bool is_planned;
};

/* The settings of one view: its angles, and the scale and centre that the fit gives it. */
CtsStatus cts_frames_view(CtsRenderer *renderer, const double view_deg[2], CtsRenderSettings *settings,
                          CtsReport *report, CtsError *err);

/* Sets the plan for the renderer's settings (quality_search.c). An engine with error control gets the requested error;
 * for others the fewest samples per layer are determined by trials on a small picture of this view (azimuth and
 * elevation). The report contains the error found, and a warning where no plan meets the request. */
CtsStatus cts_quality_search(CtsRenderer *renderer, const double view_deg[2], CtsReport *report, CtsError *err);

/* State of one frame; must not be copied. */
typedef struct CtsFrame {
    CtsRenderer *renderer;
    CtsEngineId engine_id; /* engine of the frame */
    CtsSceneStore store;
    CtsScene original; /* store's scene with the volume before quantisation, whose loss is part of the error */
    CtsVerify verify;
    CtsErrorControl error_control;
} CtsFrame;

/* By the renderer's plan. least_lossy: least number of pixels to verify if --void key loses anything. */
CtsStatus cts_frame_begin(CtsFrame *frame, CtsRenderer *renderer, const double view_deg[2], int least_lossy,
                          CtsReport *report, CtsError *err);
/* Bands are whole strips of so many rows; the last may have fewer. */
int cts_frame_strip_rows(const CtsFrame *frame);
/* Rows first_row to first_row + n_rows - 1; free with cts_picture_free(). */
CtsStatus cts_frame_rows(CtsFrame *frame, int first_row, int n_rows, CtsPicture **band, CtsReport *report,
                         CtsError *err);
/* Takes a band back, for a later frame of a rotation; or frees it, also where its pixels have a new owner. */
void cts_frame_return(CtsFrame *frame, CtsPicture **band);
/* Verifies the frame as requested, unless st is a failure. Returns st, or the verification's failure. */
CtsStatus cts_frame_end(CtsFrame *frame, CtsStatus st, CtsReport *report, CtsError *err);
