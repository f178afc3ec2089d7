/* The row type of the engine table, and the scene that every engine gets: derived once per picture, read-only. */
#pragma once

#include "base/limits.h"
#include "core/scene/view.h"
#include "core/transfer/lut.h"
#include "ctsplat/model.h"
#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include <math.h>

/* Resolution and quality of an engine, by the settings or chosen to meet the requested error. */
typedef struct CtsPlan {
    int samples;          /* sub-sheets per layer; 0: chosen by the engine */
    double max_error;     /* in 1/255 rms; 0: the engine's default */
    CtsEngineLevel level; /* of an engine that has levels (CtsEngine.levels); CTS_LEVEL_AUTO: as max_error needs */
    bool coarse_lattice;  /* at level lattice every fourth pixel each way is marched first, not every second */
    bool few_rays; /* so few that testing single cells does not pay: probe renderings, the sample that chooses a level,
                      and the sample of another engine's pixels that error control re-renders; not at level hybrid,
                      whose marched groups need the test. Rounding of a ray may depend on it */
} CtsPlan;

/* Origin of a pixel. */
typedef enum CtsPixelOrigin {
    CTS_PIXEL_RENDERED,     /* by the engine; one whose ray misses the volume, too */
    CTS_PIXEL_INTERPOLATED, /* from rendered pixels */
    CTS_PIXEL_MARCHED,      /* in a group that error control had the exact march render */
    CTS_PIXEL_REFERENCE,    /* re-rendered by error control as a sample */
} CtsPixelOrigin;

/* Output of an engine for error control (render/error) beside the pixels of a band. Zeroed before it renders, save
 * indicators of an engine that sets all. */
typedef struct CtsErrorMap {
    uint8_t *origin;  /* CtsPixelOrigin of each pixel */
    float *indicator; /* of each pixel's error, rms over red, green and blue, at least 0. The larger, the likelier a
                         pixel is re-rendered; the engine's row says whether it bounds the error */
    CtsTerms interpolation; /* an estimate of the sum of the squared errors of the interpolated pixels */
} CtsErrorMap;

/* Meaning of an engine's indicators. */
typedef enum CtsIndicator {
    CTS_INDICATOR_NONE,     /* it has none: there is no error control, and samples a layer are chosen by trial */
    CTS_INDICATOR_ESTIMATE, /* likely errors; nothing bounds the largest */
    CTS_INDICATOR_BOUND,    /* upper limits, as estimated by the engine: the picture's `bound` */
} CtsIndicator;

typedef struct CtsScene {
    const CtsModel *model;              /* its macro-cells are made */
    const CtsVolume *volume;            /* the model's */
    const CtsPreset *preset;            /* mode, shade and occlusion are those of the settings */
    const CtsRenderSettings *settings;  /* n_threads and kernel_radius already resolved */
    const CtsLut *lut;                  /* NULL in mip, minip and average */
    const struct CtsOpenness *openness; /* core/scene/openness.h; NULL: 1 everywhere */
    CtsPlan plan;
    CtsView view;
    double extinction_scale; /* as in lut; for engines that evaluate the preset themselves */
    void **cache;            /* of the engine, for frames of one volume and one preset (cts_scene_cache()) */
    int frame;               /* its number among those; bands of one picture have the same */
} CtsScene;

/* Requested error as a fraction of the display range. */
static inline double cts_scene_requested_error(const CtsScene *scene)
{
    return (scene->plan.max_error > 0 ? scene->plan.max_error : CTS_DEFAULT_ERROR) / 255;
}

/* Voxels from one pixel to the next, at most, along any axis of the volume. Engines with levels place groups of pixels
 * by whole numbers, which hold some 5000 (six pixels by 16 bits of fraction); at CTS_SCENE_COARSEST_PIXEL a scan of 512
 * voxels is eight pixels wide, and samples between which nothing is read say little of it. */
enum { CTS_SCENE_COARSEST_PIXEL = 64 };
static inline double cts_scene_voxels_per_pixel(const CtsScene *scene)
{
    double most = 0;
    for (int a = 0; a < 3; a++)
        most = fmax(most, fmax(fabs(scene->view.right_vox[a]), fabs(scene->view.up_vox[a])));
    return most * scene->view.mm_per_pixel;
}

/* Squared difference of two pixels over the preset's background, averaged over the channels. */
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

/* Size in pixels of the tiles for which a level is tried; corners are multiples of these. */
enum { CTS_PROBE_X = 16, CTS_PROBE_Y = 8 };

/* Rows are defined by the engines, as cts_engine_NAME, and listed in render/engines. */
typedef struct CtsEngine {
    const char *name; /* as in --engine */
    /* Fill picture (zeroed unless sets_all; its size, channels and info are set), which may be a band of the view;
     * premultiplied, over nothing. A band is those rows of the whole, bit by bit. picture is NULL for --explain: only
     * make the plan. errors is NULL where no error control follows; always for an engine without indicator. */
    CtsStatus (*render)(const CtsScene *scene, CtsPicture *picture, CtsErrorMap *errors, CtsReport *report,
                        CtsError *err);
    /* Renders n pixels of a band, given by their indices in place; off: error estimates. error: requested rms error
     * over 0..1; 0: reference precision. Error control re-renders pixels of its own engine with it, and those of
     * engines that have NULL here. */
    CtsStatus (*render_pixels)(const CtsScene *scene, const CtsPicture *band, const uint32_t *place, size_t n,
                               double error, float (*rgba)[4], float *off, CtsError *err);
    /* Renders n tiles of CTS_PROBE_X x CTS_PROBE_Y pixels at the scene's level, each with its first pixel at corner,
     * and an indicator per pixel, for the choice of a level. NULL for an engine without levels. */
    CtsStatus (*render_tiles)(const CtsScene *scene, const int (*corner)[2], size_t n, float (*rgba)[4],
                              float *indicator, CtsError *err);
    CtsIndicator indicator; /* meaning of its CtsErrorMap.indicator; with one, error control keeps plan.max_error */
    unsigned modes;         /* bit 1 << CtsMode for each it can do */
    unsigned kernels;       /* bit 1 << CtsKernelId */
    unsigned levels;        /* bit 1 << CtsEngineLevel; 0: no levels */
    bool is_reference;      /* the reference: no plan and no error control */
    bool sets_all;          /* sets every pixel and indicator, whatever they were before */
    bool is_layered;        /* goes through all layers for each band of rows */
    bool skips_void;        /* skips provably invisible voxels */
    bool supports_slabs;    /* can render a part of each ray, as for --slab */
    bool supports_labels;   /* splits rays at boundaries of labels, and supports their appearances */
    bool uses_void_key;     /* skips voxels that the scene's lut marks void, so that --void key has an effect */
    void (*free_cache)(void *cache); /* frees the cache in *scene->cache; NULL for an engine without one */
} CtsEngine;

/* The engine's cache, of size zeroed bytes when it is first asked for; freed by its free_cache(). NULL without memory.
 */
void *cts_scene_cache(const CtsScene *scene, size_t size, CtsError *err);

/* The voxels that minip and average use: the inside of the body; NULL: all. */
const struct CtsBodyMask *cts_scene_body(const CtsScene *scene);
/* Adds the plan's lines about the body and the slab. */
void cts_scene_report_region(const CtsScene *scene, CtsReport *report);

/* True when the caller requested a stop; engines check once per layer or tile. */
static inline bool cts_scene_stopped(const CtsScene *scene)
{
    return scene->settings->stop && *scene->settings->stop;
}
