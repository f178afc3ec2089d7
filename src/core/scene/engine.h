/* The row type of the engine table, and the scene that every engine gets: derived once per picture, read-only. */
#ifndef CTS_SCENE_ENGINE_H
#define CTS_SCENE_ENGINE_H

#include "core/scene/view.h"
#include "core/transfer/lut.h"
#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/volume.h"
#include <math.h>

/* How finely an engine is to work: as the settings ask, or as it was found that their error is kept. */
typedef struct CtsPlan {
    int samples;      /* sub-sheets per layer; 0: chosen by the engine */
    double max_error; /* in 1/255 rms; 0: the engine's default */
} CtsPlan;

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

/* What a pixel, as it shows on the preset's background, is off by against another: its square, the mean of the
 * channels. */
static inline double cts_scene_square_of_error(const CtsScene *scene, const float *pixel, const float *rgba)
{
    double square = 0;
    for (int c = 0; c < 3; c++) {
        const double behind = scene->preset->background_none ? 0 : scene->preset->background[c];
        const double off = (double)(pixel[c] - rgba[c]) + (double)(rgba[3] - pixel[3]) * behind;
        square += off * off / 3;
    }
    return square;
}

typedef struct CtsEngine {
    const char *name; /* as in --engine */
    /* Fill picture (zeroed; its size, channels and info are set), which may be a band of the view; premultiplied, over
     * nothing. A band is those rows of the whole, bit by bit. picture is NULL for --explain: only make the plan. */
    CtsStatus (*render)(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err);
    /* Makes pixels of the band again, whose numbers in it stand in place, exactly but for what off says; for an engine
     * that keeps plan.max_error and fills picture->bound. Others know plan.samples alone, and have NULL here. */
    CtsStatus (*again)(const CtsScene *scene, const CtsPicture *band, const uint32_t *place, size_t n, float (*rgba)[4],
                       float *off, CtsError *err);
    unsigned modes;             /* bit 1 << CtsMode for each it can do */
    unsigned kernels;           /* bit 1 << CtsKernelId */
    bool exact;                 /* nothing is left to plan: every pixel is what the scene says */
    bool repeats_layers;        /* goes through all layers for each band of rows */
    bool skips_void;            /* leaves out what is provably invisible */
    bool cuts_slabs;            /* sees a part of each ray, as --slab asks */
    bool knows_owners;          /* cuts rays where the volume's owner changes, and has a look for each */
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
