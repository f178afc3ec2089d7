/* A volume and a preset become a picture. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <signal.h>
#include <stdbool.h>

CTS_API_BEGIN

/* The engines: row(ID, name) defines the id CTS_ENGINE_ID, and requires the row cts_engine_name. */
#define CTS_ENGINES(row)                                                                                               \
    row(CLASSIC, classic) row(LAYERS, layers) row(VOID, void) row(COMBINED, combined) row(SHEETS, sheets)              \
        row(TILED, tiled) row(RAYCAST, raycast)
#define CTS_ENGINE_ID(id, name) CTS_ENGINE_##id,
/* CTS_ENGINE_AUTO is a request and no engine: the cheapest level of an engine that has levels whose estimated error
 * meets max_error, or else the exact march. */
typedef enum CtsEngineId { CTS_ENGINES(CTS_ENGINE_ID) CTS_N_ENGINES, CTS_ENGINE_AUTO = CTS_N_ENGINES } CtsEngineId;
extern const char *const cts_engine_names[CTS_N_ENGINES + 1];

typedef enum CtsKernelId {
    CTS_KERNEL_TENT,
    CTS_KERNEL_GAUSSIAN,
    CTS_KERNEL_CONE,
    CTS_KERNEL_BSPLINE,
    CTS_KERNEL_CONE_PAPER,
    CTS_N_KERNELS
} CtsKernelId;
extern const char *const cts_kernel_names[CTS_N_KERNELS];

/* Sampling density of an engine with levels, from the cheapest on. */
typedef enum CtsEngineLevel {
    CTS_LEVEL_AUTO, /* chosen to meet max_error */
    CTS_LEVEL_LATTICE,
    CTS_LEVEL_SHEETS,
    CTS_LEVEL_HALF_SHEETS,
    CTS_LEVEL_HYBRID,
    CTS_N_LEVELS
} CtsEngineLevel;
extern const char *const cts_engine_level_names[CTS_N_LEVELS];

/* Views that have a name. */
typedef struct CtsNamedView {
    const char *name;
    double azimuth_deg, elevation_deg;
} CtsNamedView;
enum { CTS_N_VIEWS = 6 };
extern const CtsNamedView cts_views[CTS_N_VIEWS];

/* Contents of the frame where mm_per_pixel is 0: the whole volume at any view of one elevation; or all visible parts in
 * this view, or in all frames of a rotation. */
typedef enum CtsFit { CTS_FIT_VOLUME, CTS_FIT_VISIBLE, CTS_N_FITS } CtsFit;
extern const char *const cts_fit_names[CTS_N_FITS];

typedef enum CtsSwitch { CTS_AS_PRESET, CTS_ON, CTS_OFF } CtsSwitch;

/* Of CtsRenderSettings.occlusion. */
#define CTS_OCCLUSION_AS_PRESET (-1.0)

/* Default target in 1/255 rms: half a level of an 8-bit display, which is invisible. */
#define CTS_DEFAULT_ERROR 0.5

/* Plain data, filled by cts_render_defaults(); 0 or AS_PRESET means "chosen by ctsplat". */
typedef struct CtsRenderSettings {
    int width, height;    /* pixels, 1 to 32768; default 1024 */
    double mm_per_pixel;  /* 0: determined by fit */
    double azimuth_deg;   /* 0 anterior, 90 left */
    double elevation_deg; /* 90 head; -90..90 */
    CtsFit fit;
    /* number of views about the head-foot axis that share one scale and centre; 0 or 1: a single view */
    int rotation_frames;
    /* centre_lps is projected to the middle of the picture; else the centre of the volume, or that of fit, which then
     * determines only the scale */
    bool centre_given;
    double centre_lps[3]; /* mm */
    CtsEngineId engine;
    CtsKernelId kernel;
    double kernel_radius; /* voxels; 0: the kernel's own */
    int samples;          /* sub-sheets per layer; 0: chosen by the engine */
    CtsEngineLevel level; /* of an engine that has levels */
    double max_error;     /* in 1/255 rms, met with the confidence of error control; 0: CTS_DEFAULT_ERROR is aimed at */
    /* engines void and combined treat improbable voxels as void (lossy; the report contains the loss); the others warn
     * that it has no effect */
    bool void_key;
    double tolerance_hu; /* largest change of a voxel between layers that counts as none */
    /* engines void and combined, as in the paper: no occlusion culling; the picture is the same */
    bool no_occlusion_culling;
    bool always_reuse_layers; /* engines layers and combined, likewise: reuse layers also where it does not pay */
    int grey_bits;            /* 8 to 16; 16: grey levels as they are */
    bool opacity_per_voxel;   /* opacity counts per voxel along the ray instead of per mm */
    int mode;                 /* CtsMode, or -1: the preset's */
    double slab_mm;           /* thickness of the visible slab across the view; 0: everything */
    double slab_at_mm;        /* distance of the slab's middle in front of the volume's centre */
    CtsSwitch shade;
    double occlusion;                  /* darkening of folds, 0 to 1; CTS_OCCLUSION_AS_PRESET: the preset's */
    int verify;                        /* number of pixels to render again with raycast */
    int n_threads;                     /* 0: the cores this process may use */
    bool explain;                      /* make the plan, then stop without a picture */
    bool want_depth;                   /* fill the picture's depth_mm (mode composite alone has surfaces) */
    const volatile sig_atomic_t *stop; /* cancels with CTS_ERR_INTERRUPTED, set by a signal handler; may be NULL */
} CtsRenderSettings;

void cts_render_defaults(CtsRenderSettings *settings);

/* Checks without a volume: a setting out of its bounds, an engine without a requested feature. */
CtsStatus cts_render_check(const CtsPreset *preset, const CtsRenderSettings *settings, CtsError *err);

/* True where cropping the air around the patient changes a picture by rounding only (cts_volume_crop_air()): the preset
 * does not show it, the mode is not mip, which shows it black, and all 16 bits of grey levels are used: with fewer,
 * level 0 is the window's lower end, which the preset may show. False for the reference and the paper's engines, whose
 * times refer to all voxels. Not to be cropped either: models with labels, which may give air an opacity, and those
 * without a body mask for minip and average, which would count it. */
bool cts_render_ignores_air(const CtsPreset *preset, const CtsRenderSettings *settings);

/* One picture, premultiplied, not yet blended over a background. Threads never change a bit of it.
 * With settings->explain *picture stays NULL and report->plan holds the plan. */
CtsStatus cts_render(const CtsModel *model, const CtsPreset *preset, const CtsRenderSettings *settings,
                     CtsPicture **picture, CtsReport *report, CtsError *err);

/* Several pictures of one model with one preset from different views, as a rotation: state that does not change from
 * frame to frame (the transfer function's tables, the macro-cells, distances to visible voxels, the transposed copy of
 * the volume) is computed once, and the report says what a frame could reuse. Each frame is the picture that
 * cts_render() renders, bit by bit; samples that max_error chooses for the paper's engines are the first frame's. */
typedef struct CtsRenderer CtsRenderer;

/* Checks all settings. The model's parts must stay as they are until the end; the rest is copied. */
CtsStatus cts_render_begin(CtsRenderer **renderer, const CtsModel *model, const CtsPreset *preset,
                           const CtsRenderSettings *settings, CtsError *err);
/* One picture from this view. A frame that failed may be tried again. */
CtsStatus cts_render_frame(CtsRenderer *renderer, double azimuth_deg, double elevation_deg, CtsPicture **picture,
                           CtsReport *report, CtsError *err);

/* Receiver of a picture's bands. take may change a band and take over its arrays, leaving NULL, but must not keep the
 * band itself. max_rows: the most rows of a band, rounded down to a multiple of CTS_BAND_ROWS, and where errors are
 * controlled to one that has 2^20 pixels (but not below), and never more than fit into 128 MiB, so that memory does not
 * grow with the picture; 0: this limit only. */
typedef struct CtsBandSink {
    CtsStatus (*take)(void *context, CtsPicture *band, CtsError *err);
    void *context;
    int max_rows;
} CtsBandSink;

/* The same picture in bands of rows from the top, each passed to sink as soon as it is rendered. The loss of void_key
 * is always measured: without settings->verify with 256 pixels. */
CtsStatus cts_render_bands(CtsRenderer *renderer, double azimuth_deg, double elevation_deg, const CtsBandSink *sink,
                           CtsReport *report, CtsError *err);
/* Changes the renderer's settings for pictures of the same model and preset. False, and nothing has changed, where
 * they differ in more than size, scale, fit, centre, slab, view, error, threads and the outputs beside the picture. */
bool cts_render_change_settings(CtsRenderer *renderer, const CtsRenderSettings *settings);
void cts_render_end(CtsRenderer **renderer);

CTS_API_END
