/* Shared declarations of the suite's case files: a row per case, and functions to report a result. */
#pragma once

#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "lab/check/check.h"
#include "lab/check/check_scene.h"
#include "lab/check/truth.h"
#include <stddef.h>

/* Engines that share their numerics share their bounds. */
typedef enum CtsCheckFamily { CHECK_PAPER, CHECK_TILED, CHECK_RAYCAST, CHECK_N_FAMILIES } CtsCheckFamily;
CtsCheckFamily cts_check_family(CtsEngineId engine);

enum {
    CHECK_OF_PAPER =
        1u << CTS_ENGINE_CLASSIC | 1u << CTS_ENGINE_LAYERS | 1u << CTS_ENGINE_VOID | 1u << CTS_ENGINE_COMBINED,
    CHECK_OF_RAYCAST = 1u << CTS_ENGINE_RAYCAST,
    CHECK_OF_ALL = (1u << CTS_N_ENGINES) - 1,
    CHECK_OF_SHEETS = 1u << CTS_ENGINE_SHEETS, /* samples rays, and meets --max-error by error control alone */
    /* meet it by estimates for each segment */
    CHECK_OF_TILED = CHECK_OF_ALL & ~(CHECK_OF_PAPER | CHECK_OF_RAYCAST | CHECK_OF_SHEETS),
    /* the field between voxels, and the boundaries between labels */
    CHECK_OF_FIELDS = CHECK_OF_TILED | CHECK_OF_RAYCAST,
};

/* The rms error that tiled promises: the default target. */
#define CHECK_PROMISED (0.5 / 255)

/* Sheets promise the rms of a picture: a pixel may be off by four times that. */
#define CHECK_SHEETS_PIXEL (4 * CHECK_PROMISED)

/* A bound where a case does not apply to a family. */
#define CHECK_NONE (-1.0)

typedef struct CtsCheckRun {
    const CtsCheckSettings *settings;
    const char *name;
    CtsEngineId engine;
    int n_cases, n_failed;
    CtsCheckScene scene;
    CtsErrorBound reported; /* of the picture that was rendered last */
    double *truth;          /* of the case, RGBA by pixel, which its engines share; freed after them */
} CtsCheckRun;

typedef struct CtsCheckCase {
    const char *name;
    unsigned engines; /* bit 1 << CtsEngineId */
    CtsStatus (*run)(CtsCheckRun *run, const void *data, CtsError *err);
    const void *data;
} CtsCheckCase;

typedef struct CtsCheckTable {
    const CtsCheckCase *cases;
    size_t n;
} CtsCheckTable;

extern const CtsCheckTable cts_check_linear, cts_check_stiff, cts_check_shapes, cts_check_orders, cts_check_equal,
    cts_check_faces, cts_check_voxels, cts_check_labels, cts_check_openness;

/* One result; error is |found - expected|, or INFINITY where it is no number. */
void cts_check_value(CtsCheckRun *run, double expected, double found, double bound);

/* A scene by formula, and the error bound of each family. Omitted fields are 0, which has the stated meaning. */
typedef struct CtsFormulaScene {
    int dims[3];
    double spacing_mm[3]; /* zeros: 1 */
    double lean;          /* the slices' step leans along y by this share of its length: a gantry tilt */
    int layers;           /* to a slice distance; 0: 1 */
    double hu_step;       /* 0: 1 */
    CtsHuFormula formula; /* NULL: cts_hu_linear() */
    double hu[5];         /* handed to it */
    const CtsCheckPoint *points;
    int n_points;
    double azimuth_deg, elevation_deg, mm_per_pixel; /* mm 0: all fits */
    int width, height;                               /* 0: 24 */
    double unit_mm;                                  /* 0: 1 */
    double power;                                    /* of the highlight; 0: 12 */
    bool per_voxel, lit;
    int mode; /* CtsMode */
    int samples, n_threads;
    double max_error, tolerance_hu;
    CtsKernelId kernel;
    double bound[CHECK_N_FAMILIES];
} CtsFormulaScene;

#define POINTS(ARRAY) .points = (ARRAY), .n_points = (int)(sizeof(ARRAY) / sizeof *(ARRAY))
#define CUBE_OF(N) .dims = {N, N, N}
#define VIEW(AZ, EL) .azimuth_deg = AZ, .elevation_deg = EL
#define PIXELS(W, H) .width = W, .height = H

/* A row of a table, with data of this type. */
#define ROW(NAME, ENGINES, RUN, TYPE, ...)                                                                             \
    {                                                                                                                  \
        NAME, ENGINES, RUN, &(const TYPE)                                                                              \
        {                                                                                                              \
            __VA_ARGS__                                                                                                \
        }                                                                                                              \
    }
#define SCENE(NAME, ENGINES, RUN, ...) ROW(NAME, ENGINES, RUN, CtsFormulaScene, __VA_ARGS__)

/* A CtsCheckCase.run of a scene whose HU are linear: it is exact in trilinear interpolation, so that every view of it
 * has a closed form. Families that it does not apply to have the bound CHECK_NONE. */
CtsStatus cts_check_linear_scene(CtsCheckRun *run, const void *scene, CtsError *err);
#define LINEAR(NAME, ...) SCENE(NAME, CHECK_OF_ALL, cts_check_linear_scene, __VA_ARGS__)

double cts_check_bound(const CtsCheckRun *run, const CtsFormulaScene *scene);

/* The scene as it is rendered. */
typedef struct CtsRenderedScene {
    CtsModel model; /* to be freed */
    CtsPreset preset;
    CtsRenderSettings settings;
} CtsRenderedScene;
CtsStatus cts_check_make(const CtsCheckRun *run, const CtsFormulaScene *scene, CtsRenderedScene *made, CtsError *err);

/* Creates and renders a scene, and frees everything except the picture. */
CtsStatus cts_check_show(CtsCheckRun *run, const CtsFormulaScene *scene, CtsPicture **picture, CtsError *err);

/* cts_render(), noted for the result. */
CtsStatus cts_check_render(CtsCheckRun *run, const CtsModel *model, const CtsPreset *preset,
                           const CtsRenderSettings *settings, CtsPicture **picture, CtsError *err);

/* The value of pixels that is furthest from the truth. */
typedef struct CtsCheckWorst {
    double expected, found, error;
    int x, y;
    bool dark;        /* a bright value has lost half of its light */
    double rms, most; /* of the picture's colours: rms and largest error; 0: not known */
} CtsCheckWorst;
void cts_check_worst(CtsCheckWorst *worst, int x, int y, double expected, double found);
/* Fails for any bound where a pixel is dark, or rms or largest error exceed the picture's reported one. */
void cts_check_worst_value(CtsCheckRun *run, const CtsCheckWorst *worst, double bound);

/* Truth of a ray that meets the box; rgba is 0 before. */
typedef void (*CtsPixelTruth)(const CtsTruthRay *ray, const void *data, double rgba[4]);

/* Sets run->truth, unless an earlier engine had the same scene: a truth often takes longer than any engine. */
CtsStatus cts_check_find_truth(CtsCheckRun *run, const CtsRenderedScene *scene, CtsPixelTruth truth, const void *data,
                               CtsError *err);

/* Renders and reports the largest error of all pixels and channels against truth, which gets data. Also fails where the
 * bound is so wide that half of the brightest pixel's light might be missing. */
CtsStatus cts_check_picture(CtsCheckRun *run, const CtsRenderedScene *scene, CtsPixelTruth truth, const void *data,
                            double bound, CtsError *err);
/* The same for a scene by formula; data is the scene created from it, a CtsRenderedScene. */
CtsStatus cts_check_against(CtsCheckRun *run, const CtsFormulaScene *scene, CtsPixelTruth truth, CtsError *err);

/* A CtsCheckCase.run of a scene whose truth is rays through its voxels; and that truth, of a CtsRenderedScene. */
CtsStatus cts_check_volume_scene(CtsCheckRun *run, const void *scene, CtsError *err);
void cts_check_volume_truth(const CtsTruthRay *ray, const void *data, double rgba[4]);

/* Number of float values in which two pictures of one size differ by a bit. */
double cts_check_differing(const CtsPicture *a, const CtsPicture *b);

/* Repeatable pseudo-random HU in low..high (data: double[3], low, high and seed) at whole voxels. */
double cts_hu_noise(const double vox[3], const void *data);
/* Alternating 16-bit extremes. */
double cts_hu_checkers(const double vox[3], const void *data);
