/* The row type of the engine table, and the scene that every engine gets: derived once per picture, read-only. */
#ifndef CTS_SCENE_ENGINE_H
#define CTS_SCENE_ENGINE_H

#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/volume.h"
#include "core/scene/view.h"
#include "core/transfer/lut.h"
#include <math.h>

/* How finely an engine is to work: as the settings ask, or as it was found that their error is kept. */
typedef struct CtsPlan {
    int samples;      /* sub-sheets per layer; 0: chosen by the engine */
    double max_error; /* in 1/255 rms; 0: the engine's default */
    int one_in;       /* of so many pieces of a row one is rendered, where cts_plan_draws(); 0: all are */
} CtsPlan;

/* Rows are drawn from in pieces of so many pixels. */
enum { CTS_DRAWN_PIXELS = 8 };

/* Whether the piece of row y that pixel x lies in is rendered: by chance, the same in every picture (the finaliser of
 * MurmurHash3). */
static inline bool cts_plan_draws(const CtsPlan *plan, int x, int y)
{
    uint32_t h = (uint32_t)(x / CTS_DRAWN_PIXELS) * 0x9e3779b1u + (uint32_t)y * 0x85ebca77u;
    h = (h ^ h >> 16) * 0x85ebca6bu;
    h = (h ^ h >> 13) * 0xc2b2ae35u;
    return plan->one_in <= 1 || (h ^ h >> 16) % (uint32_t)plan->one_in == 0;
}

typedef struct CtsScene {
    const CtsVolume *volume;
    const CtsPreset *preset;           /* mode and shade already as the settings ask */
    const CtsRenderSettings *settings; /* n_threads and kernel_radius already resolved */
    const CtsLut *lut;                 /* NULL in mip, minip and average */
    CtsPlan plan;
    CtsView view;
    double extinction_scale; /* as in lut; for engines that evaluate the preset themselves */
    /* What the engine keeps from frame to frame of one volume and one preset: *kept is NULL for the first frame, then
     * what the engine left there. NULL for a picture by itself. */
    void **kept;
    int frame; /* its number among those; bands of one picture have the same */
} CtsScene;

/* Half a level of an 8-bit display, which no eye sees; as a share of the display's range. */
static inline double cts_scene_error_asked(const CtsScene *scene)
{
    return (scene->plan.max_error > 0 ? scene->plan.max_error : 0.5) / 255;
}

/* From this error on, in 1/255 rms, a draft will do: about four times what drafts of real CT err by, lit and unlit. */
static inline double cts_scene_draft_from(const CtsScene *scene)
{
    return scene->preset->shade ? 4 : 2;
}

/* A draft is judged by a sample, which says little of fewer pixels than these; they take little time besides. */
enum { CTS_DRAFT_PIXELS = 1 << 17 };

static inline bool cts_scene_drafts(const CtsScene *scene)
{
    return scene->plan.samples == 0 && scene->plan.max_error >= cts_scene_draft_from(scene) &&
           (double)scene->view.width * scene->view.height >= CTS_DRAFT_PIXELS;
}

/* The plan where a draft won't do. */
static inline CtsPlan cts_scene_finer(const CtsScene *scene)
{
    CtsPlan plan = scene->plan;
    plan.max_error = fmin(plan.max_error, 0.99 * cts_scene_draft_from(scene));
    return plan;
}

/* Rays of a picture that are cast to judge what its bounds are worth, where these are as large as they may be. */
static inline double cts_scene_rays_judged(const CtsScene *scene)
{
    if (cts_scene_drafts(scene))
        return 64; /* more would take as long as the draft */
    const double pixels = (double)scene->view.width * scene->view.height / 1024;
    return pixels < 64 ? 64 : pixels > 256 ? 256 : pixels;
}

/* The bounds that an engine gives its pixels may be so large, rms: errors lie about ten times below them, and so many
 * rays can show that they lie below what is asked for (render/error/bound.h). */
static inline double cts_scene_bound_aimed(const CtsScene *scene)
{
    return cts_scene_error_asked(scene) * sqrt(cts_scene_rays_judged(scene)) / 5;
}

typedef struct CtsEngine {
    const char *name; /* as in --engine */
    /* Fill picture (zeroed; its size, channels and info are set), which may be a band of the view; premultiplied, over
     * nothing. A band is those rows of the whole, bit by bit. picture is NULL for --explain: only make the plan. */
    CtsStatus (*render)(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err);
    unsigned modes;             /* bit 1 << CtsMode for each it can do */
    unsigned kernels;           /* bit 1 << CtsKernelId */
    bool exact;                 /* nothing is left to plan: every pixel is what the scene says */
    bool bounds_error;          /* keeps plan.max_error, and fills picture->bound; others know plan.samples alone */
    bool repeats_layers;        /* goes through all layers for each band of rows */
    bool skips_void;            /* leaves out what is provably invisible */
    bool cuts_slabs;            /* sees a part of each ray, as --slab asks */
    bool takes_key;             /* skips what counts as void by the scene's lut, so that --void key has a use */
    void (*forget)(void *kept); /* frees what render left in *scene->kept; NULL for an engine that keeps nothing */
} CtsEngine;

extern const CtsEngine cts_engine_classic, cts_engine_layers, cts_engine_void, cts_engine_combined, cts_engine_tiled,
    cts_engine_raycast;

/* What minip and average look at: the inside of the body; NULL: all that there is. */
const struct CtsBodyMask *cts_scene_body(const CtsScene *scene);
/* The plan's lines about it and about the slab that is seen. */
void cts_scene_tell_parts(const CtsScene *scene, CtsReport *report);

/* True when the caller asked to stop; engines look once a layer or tile. */
static inline bool cts_scene_stopped(const CtsScene *scene)
{
    return scene->settings->stop && *scene->settings->stop;
}

#endif
