/* A volume and a preset become a picture. */
#ifndef CTSPLAT_RENDER_H
#define CTSPLAT_RENDER_H

#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <signal.h>
#include <stdbool.h>

CTS_API_BEGIN

/* The engines: row(ID, name) makes the id CTS_ENGINE_ID, and asks for the row cts_engine_name. */
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

/* How finely an engine that has levels works, from the cheapest on. */
typedef enum CtsEngineLevel {
    CTS_LEVEL_AUTO, /* as max_error needs */
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

/* What the frame holds where mm_per_pixel is 0: the whole volume at any view of one elevation; or all that the preset
 * can show in this view, or in all frames of a rotation. */
typedef enum CtsFit { CTS_FIT_VOLUME, CTS_FIT_VISIBLE, CTS_N_FITS } CtsFit;
extern const char *const cts_fit_names[CTS_N_FITS];

typedef enum CtsSwitch { CTS_AS_PRESET, CTS_ON, CTS_OFF } CtsSwitch;

/* Plain data, filled by cts_render_defaults(); 0 or AS_PRESET means "chosen by ctsplat". */
typedef struct CtsRenderSettings {
    int width, height;    /* pixels, 1 to 32768; default 1024 */
    double mm_per_pixel;  /* 0: as fit says */
    double azimuth_deg;   /* 0 anterior, 90 left */
    double elevation_deg; /* 90 head; -90..90 */
    CtsFit fit;
    int rotation_frames;  /* views about the head-foot axis that share one scale and centre; 0 or 1: none */
    bool centre_given;    /* centre_lps is seen in the middle of the picture; else the centre of the volume, or as fit
                             says, which then says the scale alone */
    double centre_lps[3]; /* mm */
    CtsEngineId engine;
    CtsKernelId kernel;
    double kernel_radius;   /* voxels; 0: the kernel's own */
    int samples;            /* sub-sheets per layer; 0: chosen by the engine */
    CtsEngineLevel level;   /* of an engine that has levels */
    double max_error;       /* in 1/255 rms, kept as far as rays that are cast tell; 0: the engine's default */
    bool void_key;          /* engines void and combined take improbable voxels for void (lossy; the
                             * report tells what is lost); the others warn that they have no use for it */
    double tolerance_hu;    /* largest change taken for none */
    bool sees_hidden;       /* engines void and combined, as the paper has them: they splat what opaque pixels hide,
                             * too; the picture is the same */
    bool reuses_always;     /* engines layers and combined, likewise: also where reuse does not pay */
    int grey_bits;          /* 8 to 16; 16: grey levels as they are */
    bool opacity_per_voxel; /* opacity counts per voxel along the ray instead of per mm */
    int mode;               /* CtsMode, or -1: as the preset says */
    double slab_mm;         /* thickness of the slab across the view that is seen; 0: all */
    double slab_at_mm;      /* how far the slab's middle lies in front of the volume's centre */
    CtsSwitch shade;
    int verify;                        /* pixels to render again with raycast */
    int n_threads;                     /* 0: the cores this process may use */
    bool explain;                      /* make the plan, then stop without a picture */
    bool want_depth;                   /* fill the picture's depth_mm (mode composite alone has surfaces) */
    const volatile sig_atomic_t *stop; /* set by a signal handler: give up with CTS_ERR_INTERRUPTED; may be NULL */
} CtsRenderSettings;

void cts_render_defaults(CtsRenderSettings *settings);

/* What can be refused before there is a volume: a setting out of its bounds, an engine that lacks what is asked for. */
CtsStatus cts_render_check(const CtsPreset *preset, const CtsRenderSettings *settings, CtsError *err);

/* One picture, premultiplied, not yet blended over a background. Threads never change a bit of it.
 * With settings->explain *picture stays NULL and report->plan holds the plan. */
CtsStatus cts_render(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                     CtsPicture **picture, CtsReport *report, CtsError *err);

/* Several pictures of one volume with one preset from different sides, as a rotation: what does not change from frame
 * to frame (the transfer function's tables, the macro-cells, distances to what is visible, the transposed copy of the
 * volume) is made once, and the report says what a frame did not need to make. Each frame is the picture that
 * cts_render() makes, bit by bit. */
typedef struct CtsRenderer CtsRenderer;

/* Checks all settings. The volume must stay as it is until the end; preset and settings are copied. */
CtsStatus cts_render_begin(CtsRenderer **renderer, const CtsVolume *volume, const CtsPreset *preset,
                           const CtsRenderSettings *settings, CtsError *err);
/* One picture, seen from here. A frame that fails may be tried again. */
CtsStatus cts_render_frame(CtsRenderer *renderer, double azimuth_deg, double elevation_deg, CtsPicture **picture,
                           CtsReport *report, CtsError *err);

/* Where bands of a picture go. take may change a band and take its arrays, leaving
 * NULL, but must not keep the band itself. max_rows: the most rows of a band, rounded
 * down to a multiple of CTS_BAND_ROWS (but not below), and never more than 128 MiB hold, so that memory does not grow
 * with the picture; 0: as many as those. */
typedef struct CtsBandSink {
    CtsStatus (*take)(void *context, CtsPicture *band, CtsError *err);
    void *context;
    int max_rows;
} CtsBandSink;

/* The same picture in bands of rows from the top, each handed to sink as soon as it is made. What void_key loses is
 * measured, asked for or not: without settings->verify with 256 pixels. */
CtsStatus cts_render_bands(CtsRenderer *renderer, double azimuth_deg, double elevation_deg, const CtsBandSink *sink,
                           CtsReport *report, CtsError *err);
/* Asks the renderer for pictures of the same volume and preset by other settings. False, and nothing has changed, where
 * they differ in more than size, scale, fit, centre, slab, view, error, threads and what is wanted beside the picture.
 */
bool cts_render_again(CtsRenderer *renderer, const CtsRenderSettings *settings);
void cts_render_end(CtsRenderer **renderer);

CTS_API_END
#endif
