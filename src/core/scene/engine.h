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
    int samples;          /* sub-sheets per layer; 0: chosen by the engine */
    double max_error;     /* in 1/255 rms; 0: the engine's default */
    CtsEngineLevel level; /* of an engine that has levels (CtsEngine.levels); CTS_LEVEL_AUTO: as max_error needs */
    int n_tried; /* levels that were tried before this one was chosen, itself among them, which share the chance that a
                    limit of the error is too low; 0 counts as 1 */
} CtsPlan;

/* How a pixel was found. */
typedef enum CtsPixelOrigin {
    CTS_PIXEL_RENDERED,     /* by the engine; one whose ray misses the volume, too */
    CTS_PIXEL_INTERPOLATED, /* from rendered pixels */
    CTS_PIXEL_REFERENCE,    /* re-rendered by error control */
} CtsPixelOrigin;

/* What an engine hands to error control (render/error) beside the pixels of a band. Zeroed before it renders. */
typedef struct CtsErrorMap {
    uint8_t *origin;  /* CtsPixelOrigin of each pixel */
    float *indicator; /* of each pixel's error, rms over red, green and blue, at least 0. The larger, the likelier a
                         pixel is re-rendered; the engine's row says whether it bounds the error */
    double interpolation_error;         /* estimate of the sum of the squared errors of the interpolated pixels */
    double largest_interpolation_error; /* largest term of that estimate */
} CtsErrorMap;

/* What an engine's indicators are. */
typedef enum CtsIndicator {
    CTS_INDICATOR_NONE,     /* it has none: there is no error control, and samples a layer are chosen by trial */
    CTS_INDICATOR_ESTIMATE, /* likely errors; nothing bounds the largest */
    CTS_INDICATOR_BOUND,    /* upper limits, as far as the engine can tell: the picture's `bound` */
} CtsIndicator;

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

/* Voxels from one pixel to the next, at most, along any axis of the volume. Engines with levels place groups of pixels
 * by whole numbers, which hold up to CTS_SCENE_COARSEST_PIXEL. */
enum { CTS_SCENE_COARSEST_PIXEL = 64 };
static inline double cts_scene_voxels_per_pixel(const CtsScene *scene)
{
    double most = 0;
    for (int a = 0; a < 3; a++)
        most = fmax(most, fmax(fabs(scene->view.right_vox[a]), fabs(scene->view.up_vox[a])));
    return most * scene->view.mm_per_pixel;
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

/* Pixels of a tile that a level is tried on; corners are multiples of these. */
enum { CTS_PROBE_X = 16, CTS_PROBE_Y = 8 };

/* Rows are defined by the engines, as cts_engine_NAME, and listed in render/engines. */
typedef struct CtsEngine {
    const char *name; /* as in --engine */
    /* Fill picture (zeroed; its size, channels and info are set), which may be a band of the view; premultiplied, over
     * nothing. A band is those rows of the whole, bit by bit. picture is NULL for --explain: only make the plan. errors
     * is NULL where no error control follows; always for an engine without indicator. */
    CtsStatus (*render)(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,
                        CtsError *err);
    /* Renders n pixels of a band, whose numbers in it stand in place; off: error bounds. error: what they may be off
     * by, rms over 0..1; 0: reference precision. Error control re-renders pixels by it, its own engine's and those of
     * engines that have NULL here. */
    CtsStatus (*render_pixels)(const CtsScene *scene, const CtsPicture *band, const uint32_t *place, size_t n,
                               double error, float (*rgba)[4], float *off, CtsError *err);
    /* Renders n tiles of CTS_PROBE_X x CTS_PROBE_Y pixels at the scene's level, each with its first pixel at corner,
     * with an indicator a pixel: what a level is chosen by. NULL for an engine without levels. */
    CtsStatus (*render_tiles)(const CtsScene *scene, const int (*corner)[2], size_t n, float (*rgba)[4],
                              float *indicator, CtsError *err);
    CtsIndicator indicator;     /* what it writes to CtsErrorMap; with one it keeps plan.max_error by itself */
    unsigned modes;             /* bit 1 << CtsMode for each it can do */
    unsigned kernels;           /* bit 1 << CtsKernelId */
    unsigned levels;            /* bit 1 << CtsEngineLevel; 0: it has none */
    bool exact;                 /* nothing is left to plan: every pixel is what the scene says */
    bool repeats_layers;        /* goes through all layers for each band of rows */
    bool skips_void;            /* leaves out what is provably invisible */
    bool cuts_slabs;            /* sees a part of each ray, as --slab asks */
    bool knows_owners;          /* cuts rays where the volume's owner changes, and has a look for each */
    bool takes_key;             /* skips what counts as void by the scene's lut, so that --void key has a use */
    void (*forget)(void *kept); /* frees what render left in *scene->kept; NULL for an engine that keeps nothing */
} CtsEngine;

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
