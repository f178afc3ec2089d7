/* The tiled engine's inner loop: packets of 8 pixels march through the layers, front to back.
 *
 * One template (march_tmpl.h) is compiled three times: march_c.c with plain C primitives, the readable truth,
 * march_avx2.c with AVX2 ones, and march_avx512.c, where two packets march together. All do the same operations in the
 * same order for a pixel, so their pictures are the same bytes.
 *
 * WHAT A RAY MAY BE WRONG BY. Between two sheets, on a stretch of length L, the field x(s) is taken for the parabola
 * y(s) through the two ends and the middle. Along an axis x is a straight line and so is y; else x has a kink at each
 * voxel face that the ray crosses and bends in between.
 *
 * off, what is possible. With e = x - y and f from 0 to 1 along the stretch, e vanishes at 0, 1/2 and 1, so that it is
 * the integral of x'' with Peano's kernel K of interpolation at these places: at most 0.0963 for a kink in which x
 * turns by 1, and, as the integral of |K| is at most 0.0377, as much for what bends by 1 in between. A kink at a face
 * across u turns the field by |du| times the second difference of voxels along u; in a cell |x''| is at most 2 (|du dv|
 * |uv| + |du| |uk| + |dv| |vk|) with the mixed differences of its corners (du, dv: voxels along the stretch). Of all
 * voxels that a beam's rays touch between two layers the largest such differences are found (bend_tmpl.h); they shrink
 * with the stretch, the former in proportion, the latter by its square. No voxel, however thin, hides from them.
 *
 * off, what is seen. Where the middle lies d beside the straight line, a single kink leaves |e| <= 2 d and, on average
 * over places, less than d / 2. `off` is 3 d / 2, and half of that the mean. On CT it lies some ten times below what is
 * possible, so that a bound takes an eighth of the one at least, or the other (BOUND_SHARE). Where the possible may
 * change a pixel by more than `may_hide`, and by eight times what is seen, the field is looked at: at its kinks and
 * half way between, which tells its quadratic part; then |e| is at most 5/4 of the largest e there, and of the cubic
 * rest 0.0482 times the third difference. The halves of a stretch that has been looked at are off by 9/4 of that at
 * most: the parabola through three places of a half is by 5/4 of it beside the whole's. Four straight lines stand for
 * the parabola (1/64 of its bend), which turns up to 1/16 of it beside all three places. The table's rounding comes on
 * top.
 *
 * depth. Let V(g) be the total variation of the extinction k up to grey level g (CtsSlabTable.change). k(x) and k(y)
 * differ only where k changes between x and y, so that with |x - y| <= a, and y running evenly from low to high,
 *
 *     |integral of k(x) - k(y)| <= L min(1, 2 a / (high - low)) (V(high + a) - V(low - a))
 *
 * with off / 2 for a, the mean of |x - y|, or where the field has been looked at with all of off, and with the
 * parabola's flattest place for its mean slope (worst_share()). It holds for ramps, for peaks between two levels and
 * for jumps, and is 0 where k does not change within a of the field. The same with colours in place of k gives `tint`.
 *
 * effect. If a stretch is deeper by e than found, e of the light T that reaches it shows its colour c instead of what
 * is behind. Let X = C' + T c be what the pixel would be if all ended there, C' what was gathered before it: the pixel
 * C moves by e (X - C). Stretches err independently of one another, so the squares add up, and sums of e^2, e^2 X and
 * e^2 X.X give them at the end of the ray, when C is known: bodies that are met early cost nothing, a wire before a
 * bright background costs all. A stretch that is taken for opaque and may not be shows something unknown.
 *
 * The rest: a quarter of depth^2 times how far colours lie apart, for colours mixed within a slab (its series in the
 * depth); the light left when a ray ends; for lighting, by how much it does not run straight along the stretch, half of
 * what the gradient's bend changes, and what waits for its lighting (light_tmpl.h).
 *
 * So nothing of the field is missed altogether: what may be hidden stands in the bound, an eighth of it at least. What
 * a gradient does between two places is told by these alone. Ranges of macro-cells, or of a slab's voxels, alone decide
 * what is leapt, and those are exact (cts_lut_visible). A stretch that may change a pixel by four times what the plan
 * aims at is halved, down to a sixteenth of a layer; lighting is told more finely already at that, as more of its bound
 * comes true.
 *
 * Errors lie some ten times below such bounds, which take the worst of everything. The plan therefore aims above the
 * error asked for (cts_scene_bound_aimed), and render/error/bound.h casts rays that show what the bounds are worth.
 *
 * DRAFTS, where an error that the eye may see is asked for, are marched by draft_tmpl.h, on a lattice first
 * (lattice.h), and derive nothing. */
#ifndef CTS_TILED_MARCH_H
#define CTS_TILED_MARCH_H

#include "base/clock.h"
#include "core/scene/shade.h"
#include "engine/tiled/draft_table.h"
#include "engine/tiled/empty_space.h"
#include "engine/tiled/layout.h"
#include "engine/tiled/slab.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_PACKET = 8 };

/* Every second pixel of every second row of a draft (lattice.h), from row 2 first_row of the view on. */
typedef struct TiledLattice {
    const float *rgba; /* NULL: there is none */
    int width, first_row;
    float agree; /* what lies between pixels that are not further apart is filled in */
} TiledLattice;

/* Everything a thread needs, read-only. Layers are numbered q = 0, 1, ... in the order a ray meets them; sheets, of
 * which there are `samples` to a layer, t = 0, 1, ... in the same order. */
typedef struct TiledJob {
    const uint16_t *layer0;             /* voxel (0, 0) of layer q = 0 */
    ptrdiff_t fetch_ahead;              /* voxels from a ray's place on a layer to its place some layers on */
    ptrdiff_t row_stride, layer_stride; /* the latter from q to q + 1: negative where rays run against the axis */
    int nu, nv, nk;
    bool rising; /* layer q is volume layer q; else nk - 1 - q */
    /* Where the ray of pixel (x, y) meets layer q: u = u_at[0] + u_at[1] x + u_at[2] y + u_at[3] q, v alike. */
    double u_at[4], v_at[4];
    /* The ray that meets layer 0 at (u, v) is seen from q = near_at[0] + near_at[1] u + near_at[2] v on, and up to
     * far_at alike: the slab that is asked for. */
    double near_at[3], far_at[3];
    bool slab;              /* one is asked for */
    int64_t u_step, v_step; /* voxels from sheet to sheet, in 2^-32 */
    /* A packet's pixels against its first one, in 2^-16 voxels, and the smallest of each half packet. */
    int32_t lane_u[CTS_PACKET], lane_v[CTS_PACKET], half_u[CTS_PACKET], half_v[CTS_PACKET];
    int window_u, window_v; /* largest first column and row of a window of 8 x 3 voxels */
    bool windowed;          /* half a packet fits such a window */
    bool gathers;           /* if not: offsets inside a layer and positions fit 32 bits; else lane by lane */
    int one_window_rows;    /* two packets at most so many rows apart fit one of 16 x 4; 0: no two do */
    bool straight;          /* u_at[3] and v_at[3] are 0: every layer is met at the same place */
    int sheets;             /* a layer: each is sampled, and what lies between two sheets is a stretch */
    int samples;            /* how finely sheets may be placed, to a layer: 16 to a stretch */
    /* What may go wrong, see above. Grey levels, and shares of the display's range. */
    float rounding;              /* the field is known to so many grey levels */
    float may_change;            /* a stretch may change a pixel by so much before it is halved */
    float may_hide;              /* what three places of a stretch may hide is looked for above this */
    float may_shine;             /* the same for its lighting; */
    float may_turn;              /* and this before its normal's turning is averaged */
    float let_pass;              /* what changes a pixel by less is not looked at more closely */
    float may_mix;               /* a slab's mixed colours may be off by so much before it is cut */
    bool hard_tint;              /* colours turn so fast that their steepest change says nothing of the others */
    float tint;                  /* by how much colours lie apart from one entry of the table to the next, at most */
    float grey_least, grey_most; /* the volume's */
    float stiff_depth;           /* a stretch of more optical depth is cut where its light is lost */
    float full_depth;            /* what lies deeper gets no light worth cutting for */
    float layer_mm;              /* ray length from layer to layer */
    float stop_transmittance;    /* a packet ends when all of its pixels have less than this left */
    float range;                 /* by how much what is behind may differ from what is seen, lit or not */
    float background[3];
    CtsSlabTable table;
    CtsDraftTable draft; /* with mean: slabs are looked up whole in this, as the plan allows */
    CtsEmptySpace empty;
    const CtsShade *shade;          /* NULL: unlit */
    float frame[3][3];              /* as shade's, for differences along u, v and from q to q + 1, times 16384 */
    float most_due;                 /* opacity that may wait for its lighting */
    bool narrow_offsets;            /* positions, and offsets within a layer and slopes around it, fit 32 bits */
    bool narrow;                    /* voxels differ by less than 32768 grey levels */
    double depth_at[4];             /* depth_mm of pixel (x, y) at layer q, as u_at */
    CtsPlan plan;                   /* says which packets are marched */
    int width, first_row, past_row; /* of the view's rows the picture holds these */
    TiledLattice lattice;
    float *rgba;     /* the picture: pixel (0, first_row) on */
    float *depth_mm; /* NULL: not wanted */
    float *bound;    /* of each pixel's error; NULL: not wanted */
} TiledJob;

/* How much the field may bend for any of a beam's rays on their way through a slab, in grey levels; see above. */
typedef struct TiledBend {
    float kink;  /* it turns by so much where rays cross faces of voxels, */
    float twist; /* bends so much in between, */
    float cubic; /* and a sixth of its third derivative is so large */
    bool quiet;  /* none of the slab's voxels lets anything show */
} TiledBend;

enum { CTS_RUN_SLABS = 16 };

/* Slabs from..to - 1 in which something may be visible. */
typedef struct TiledRun {
    int from, to;
    bool inner;                    /* no window of the beam's rays touches a face of the volume there */
    unsigned bend_known;           /* bit i: bend[i], */
    TiledBend bend[CTS_RUN_SLABS]; /* of slab from + i */
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
    uint64_t samples; /* field values, one a pixel and sheet */
    uint64_t slabs;   /* pixel slabs in which something could be seen */
    uint64_t marches; /* packets, or pairs of them, that met something */
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
