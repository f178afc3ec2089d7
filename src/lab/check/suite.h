/* What the stability suite's case files share: a row per case, and ways to state a result. */
#ifndef CTS_CHECK_SUITE_H
#define CTS_CHECK_SUITE_H

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
    CHECK_OF_TILED = 1u << CTS_ENGINE_TILED,
    CHECK_OF_RAYCAST = 1u << CTS_ENGINE_RAYCAST,
    CHECK_OF_LABELS = CHECK_OF_TILED | CHECK_OF_RAYCAST, /* that know the edges between labels */
    CHECK_OF_ALL = CHECK_OF_PAPER | CHECK_OF_TILED | CHECK_OF_RAYCAST
};
_Static_assert(CHECK_OF_ALL == (1u << CTS_N_ENGINES) - 1, "an engine belongs to no family");

/* What tiled promises of a picture's rms: the default of --max-error. */
#define CHECK_PROMISED (0.5 / 255)

/* A bound where a case does not apply to a family. */
#define CHECK_NONE (-1.0)

typedef struct CtsCheckRun {
    const CtsCheckSettings *settings;
    const char *name;
    CtsEngineId engine;
    int n_cases, n_failed;
    CtsCheckScene scene;
    CtsErrorBound told; /* of the picture that was rendered last */
    double *truth;      /* of the case, RGBA by pixel, which its engines share; freed after them */
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
    cts_check_thin, cts_check_faces, cts_check_voxels, cts_check_labels;

/* One result; error is |found - expected|, or INFINITY where it is no number. */
void cts_check_value(CtsCheckRun *run, double expected, double found, double bound);

/* Defaults with the run's engine and threads, and a picture of width x height. */
CtsRenderSettings cts_check_settings(const CtsCheckRun *run, int width, int height);

/* cts_render(), noted for the result. */
CtsStatus cts_check_render(CtsCheckRun *run, const CtsVolume *volume, const CtsPreset *preset,
                           const CtsRenderSettings *settings, CtsPicture **picture, CtsError *err);

/* The value of pixels that is furthest from the truth. */
typedef struct CtsCheckWorst {
    double expected, found, error;
    int x, y;
    bool dark;        /* a value that should be bright has lost half of its light */
    double rms, most; /* of the picture's colours: error, and the largest; 0: not known */
} CtsCheckWorst;
void cts_check_worst(CtsCheckWorst *worst, int x, int y, double expected, double found);
/* Fails whatever the bound where a pixel is dark, or rms or the largest error is above what the picture's report tells.
 */
void cts_check_worst_value(CtsCheckRun *run, const CtsCheckWorst *worst, double bound);

/* Truth of one pixel; ray is NULL where it misses the box. */
typedef void (*CtsPixelTruth)(const CtsTruthRay *ray, const void *data, double rgba[4]);

/* A picture and what it should be. */
typedef struct CtsCheckPicture {
    const CtsVolume *volume;
    const CtsPreset *preset;
    const CtsRenderSettings *settings;
    CtsPixelTruth truth;
    const void *data; /* handed to truth */
} CtsCheckPicture;

/* Renders and states the worst of all pixels and channels against truth. Fails too where the bound is so wide that
 * half of the brightest pixel's light might be missing. */
CtsStatus cts_check_picture(CtsCheckRun *run, const CtsCheckPicture *asked, double bound, CtsError *err);

/* Number of float values in which two pictures of one size differ by a bit. */
double cts_check_differing(const CtsPicture *a, const CtsPicture *b);

/* Repeatable pseudo-random HU in low..high (data: double[3], low, high and seed) at whole voxels. */
double cts_hu_noise(const double vox[3], const void *data);

#endif
