/* The tiled engine's inner loop: packets of 8 pixels march through the layers, front to back.
 *
 * One template (march_tmpl.h) is compiled three times: march_c.c with plain C primitives, the readable truth,
 * march_avx2.c with AVX2 ones, and march_avx512.c, where two packets march together. All do the same operations in the
 * same order for a pixel, so their pictures are the same bytes. */
#ifndef CTS_TILED_MARCH_H
#define CTS_TILED_MARCH_H

#include "base/clock.h"
#include "scene/shade.h"
#include "tiled/empty_space.h"
#include "tiled/layout.h"
#include "tiled/slab.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_PACKET = 8 };

/* Everything a thread needs, read-only. Layers are numbered q = 0, 1, ... in the order a ray meets them; sheets, of
 * which there are `samples` to a layer, t = 0, 1, ... in the same order. */
typedef struct TiledJob {
    const uint16_t *layer0;             /* voxel (0, 0) of layer q = 0 */
    ptrdiff_t row_stride, layer_stride; /* the latter from q to q + 1: negative where rays run against the axis */
    int nu, nv, nk;
    bool rising; /* layer q is volume layer q; else nk - 1 - q */
    /* Where the ray of pixel (x, y) meets layer q: u = u_at[0] + u_at[1] x + u_at[2] y + u_at[3] q, v alike. */
    double u_at[4], v_at[4];
    /* The ray that meets layer 0 at (u, v) is seen from q = near_at[0] + near_at[1] u + near_at[2] v on, and up to
     * far_at alike: the slab that is asked for. */
    double near_at[3], far_at[3];
    bool slab; /* one is asked for */
    int64_t u_step, v_step; /* voxels from sheet to sheet, in 2^-32 */
    /* A packet's pixels against its first one, in 2^-16 voxels, and the smallest of each half packet. */
    int32_t lane_u[CTS_PACKET], lane_v[CTS_PACKET], half_u[CTS_PACKET], half_v[CTS_PACKET];
    int window_u, window_v; /* largest first column and row of a window of 8 x 3 voxels */
    bool windowed;          /* half a packet fits such a window */
    bool gathers;           /* if not: offsets inside a layer and positions fit 32 bits; else lane by lane */
    int one_window_rows;    /* two packets at most so many rows apart fit one of 16 x 4; 0: no two do */
    bool straight;          /* u_at[3] and v_at[3] are 0: every layer is met at the same place */
    int sheets;             /* a layer: each is sampled, and what lies between two sheets is a stretch */
    int samples;            /* how finely sheets may be placed, to a layer: 4 to a stretch */
    /* What a stretch needs beyond its two sheets. Grey levels are those of a stretch that all light reaches. */
    float quiet_low, quiet_high; /* nothing between them shows, even if the field bends a little */
    float refine_grey;           /* a field that changes less, and its rise too, is taken for straight */
    float bend_grey;             /* a field that bends less is taken for straight in either half */
    float halve_grey;            /* a field that bends more is looked at again in either half */
    float hiding;                /* 1 over what self_hiding() may leave, in table entries */
    float faint_depth;           /* a stretch of less optical depth is cut into 2, if at all */
    float stiff_depth;           /* a stretch of more optical depth is cut where its light is lost */
    float full_depth;            /* what lies deeper gets no light worth cutting for */
    float layer_mm;              /* ray length from layer to layer */
    float stop_transmittance;    /* a packet ends when all of its pixels have less than this left */
    CtsSlabTable table;
    CtsEmptySpace empty;
    /* Of 2^fill_levels rows one is marched; the others are filled where that can be trusted: where colours change and
     * bend from row to row by no more than fill_step. */
    int fill_levels;
    float fill_step;
    const CtsShade *shade;          /* NULL: unlit */
    float frame[3][3];              /* as shade's, for differences along u, v and from q to q + 1, times 16384 */
    float most_due;                 /* opacity that may wait for its lighting */
    bool narrow;                    /* voxels differ by less than 32768 grey levels */
    double depth_at[4];             /* depth_mm of pixel (x, y) at layer q, as u_at */
    int width, first_row, past_row; /* of the view's rows the picture holds these */
    float *rgba;                    /* the picture: pixel (0, first_row) on */
    float *depth_mm;                /* NULL: not wanted */
} TiledJob;

/* Slabs from..to - 1 in which something may be visible. */
typedef struct TiledRun {
    int from, to;
    bool inner; /* no window of the beam's rays touches a face of the volume there */
} TiledRun;

/* A bundle of rays, one packet wide: bounds over all of them, and the runs of slabs that they must march through,
 * found on demand (rays that become opaque never ask for the later ones). */
typedef struct TiledBeam {
    double u[2], v[2];      /* where the rays meet layer 0: smallest and largest */
    int first, last;        /* slabs first..last - 1 hold something for some ray */
    int full_from, full_to; /* slabs full_from..full_to - 1 are inside the box for every ray */
    int next;               /* slab from which the next run is searched */
    int n_runs;
    TiledRun *runs; /* room for nk; the thread's */
} TiledBeam;

typedef struct TiledCounts {
    uint64_t samples;         /* field values, one a pixel and sheet */
    uint64_t slabs;           /* pixel slabs in which something could be seen */
    uint64_t marches;         /* packets, or pairs of them, that met something */
    uint64_t between, filled; /* packets of rows between; of them filled without a march */
    /* Every so many marches the clock is read around what is sampled, composited and shaded. */
    uint64_t splat_ticks, composite_ticks, shade_ticks;
} TiledCounts;

enum { TILED_TIMED_MARCHES = 32 };

static inline uint64_t cts_tiled_ticks(void)
{
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#else
    return (uint64_t)(cts_wall_ms() * 1e6);
#endif
}

/* A packet's pixels: x to x + 7 of row y, of which the first n are in the picture. */
typedef struct TiledSpan {
    int x, y, n;
} TiledSpan;

/* One packet, or as many as the SIMD path takes at a time, from the top. */
typedef void (*cts_tiled_packets_fn)(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts);

void cts_tiled_packets_c(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts);
void cts_tiled_packets_avx2(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts);
/* Takes two; only for windowed or gathers jobs. */
void cts_tiled_packets_avx512(const TiledJob *job, TiledBeam *beam, const TiledSpan *spans, TiledCounts *counts);

typedef enum TiledFill { TILED_FILL_NONE, TILED_FILL_COLOUR, TILED_FILL_ALL } TiledFill;
/* A packet's colours and depths from those `away` and 3 times that many rows above and below; the tile has so many rows
 * above and below the packet. NONE: that cannot be trusted; COLOUR: only the depth cannot. */
TiledFill cts_tiled_fill(const TiledJob *job, const TiledSpan *span, int away, int above, int below);

/* Bounds for the rays of pixels x0..x1 - 1 by y0..y1 - 1; false when they miss everything that may be visible. */
bool cts_tiled_beam_init(const TiledJob *job, TiledBeam *beam, int x0, int y0, int x1, int y1, int first);
/* Find one more run; false when there is none. */
bool cts_tiled_beam_extend(const TiledJob *job, TiledBeam *beam);
/* q between which the ray that meets layer 0 at (u, v) is inside the box of voxel centres; leave < enter: never. */
void cts_tiled_clip(const TiledJob *job, double u, double v, double *enter, double *leave);

/* Distance from the camera plane of the ray of pixel (x, y) at layer q. */
static inline float cts_tiled_depth_mm(const TiledJob *job, int x, int y, float q)
{
    return (float)(job->depth_at[0] + job->depth_at[1] * x + job->depth_at[2] * y + job->depth_at[3] * (double)q);
}

#endif
