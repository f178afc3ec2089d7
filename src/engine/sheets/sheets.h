/* Sheets: splatting in groups of 4 x 4 pixels of the final picture.
 *
 * A SHEET is one layer of voxels across the principal axis p; a and b are the axes within it, a the one along which
 * voxels are stored side by side. The tent footprint makes a sheet bilinear, so that the grey level where a pixel's ray
 * meets it takes two neighbours in each of two rows. A GROUP is 16 neighbouring pixels, one a lane: they meet a sheet
 * within a window of few rows, whose voxels are loaded by rows. What lies between two sheets, a SLAB, is classified by
 * the grey levels at both of its faces through a table of 256 x 256 bins of these, integrated in advance. Half-sheets
 * are the planes in the middle of slabs; sampled too, they halve the slabs.
 *
 * The pipeline of the paper in object order: footprint, layers, void voxels left out (by blocks of 4^3 cells, for tiles
 * of 16 x 8 pixels), and groups that are opaque end. ctsplat-methods(7) has the mathematics. */
#pragma once

#include "base/simd_path.h"
#include "core/model/macrocells.h"
#include "core/scene/engine.h"
#include "core/scene/openness.h"
#include "core/scene/shade.h"
#include <stdbool.h>
#include <stdint.h>

enum {
    SHEETS_SIDE = 4,                          /* pixels of a group each way */
    SHEETS_LANES = SHEETS_SIDE * SHEETS_SIDE, /* a group */
    SHEETS_TILE_X = 16,
    SHEETS_TILE_Y = 8,                 /* pixels of a tile, which has one mask of visible blocks */
    SHEETS_REGION = 64,                /* pixels each way of what a thread takes at a time */
    SHEETS_BLOCK = CTS_FINE_MACROCELL, /* slabs of a block, which is void or not as a whole */
    SHEETS_GRIDS = 3,                  /* each has half as many points a row as the one before */
    SHEETS_BINS = 256,                 /* bins of the pre-integrated table */
    SHEETS_LIT = 4,                    /* points of a slab at which it is lit */
    SHEETS_WEIGHT_BITS = 14            /* of footprint weights: a product with 16 bits fits 32 */
};

/* Bins of grey levels, by which the table is indexed: coarse ones below and above what is visible, all of one width,
 * and fine ones between. The number of a sample's bin is sample * coarse_scale + coarse_add + clamp(sample * fine_scale
 * + fine_add, 0, fine_span), rounded and kept within 0 to 255; a sample is (grey level - 32768) * 2^14, as the march
 * has it. */
typedef struct SheetsBins {
    float coarse_scale, coarse_add, fine_scale, fine_add, fine_span;
    double grey[SHEETS_BINS];     /* grey level in the middle of each */
    double edge[SHEETS_BINS + 1]; /* and where each begins and ends */
    int first, last;              /* bins between which all that is visible lies */
    int grey_low, grey_high; /* nothing is visible at grey levels of grey_low or below, nor at grey_high or above */
} SheetsBins;

/* Mean extinction per mm, red, green and blue of a quarter of the way from one bin to another, on a straight line, at
 * [front * 256 + back]. */
typedef float SheetsPart[4][SHEETS_BINS * SHEETS_BINS + SHEETS_LANES]; /* the rest keeps them off the same cache sets */

typedef struct SheetsTransfer {
    SheetsBins bins;
    SheetsPart *part;        /* of SHEETS_LIT quarters */
    double extinction_scale; /* that it was made for */
} SheetsTransfer;

/* Colour (premultiplied) and opacity of a slab by front and back bin, for one length of rays in it: four numbers of
 * 16 bits, red lowest, alpha highest, each with 5 bits of exponent and 11 of fraction (sheets_unpack in sample_tmpl.h).
 */
typedef struct SheetsOpacity {
    uint64_t *rgba; /* [front * 256 + back] */
    /* The same index: shares of a slab's absorbed light that each quarter of it takes, in 255ths, the first lowest;
     * NULL where nothing is lit. */
    uint32_t *light;
    /* The same index: opacity of a slab that goes from the front bin to the back bin or stays at the back bin,
     * the larger, for near misses; one more entry. NULL where the table is for comparison alone. */
    uint16_t *near;
    double length_mm, extinction_scale;
} SheetsOpacity;

/* Blocks of 4^3 cells that may be visible, a bit each, layer by layer and row by row along a. Words overlap: word k of
 * a row has the blocks from 16 k to 16 k + 31, so that 17 successive ones lie within one. */
enum { SHEETS_WORD_SHIFT = 4, SHEETS_WORD_STEP = 1 << SHEETS_WORD_SHIFT };
typedef struct SheetsVoid {
    int n[2], n_layers, row_words;
    uint32_t *bits; /* [(layer * n[1] + j) * row_words + k] */
    size_t n_visible;
} SheetsVoid;

/* Intersections of the pixels' rays with the sheets, in voxels along a and b: origin + x * right + y * down + k * shear
 * at pixel (x, y) and sheet k. */
typedef struct SheetsView {
    int p, a, b;          /* volume axes */
    int n[3];             /* voxels along a, b, p */
    int step;             /* +1 or -1: from sheet to sheet front to back */
    ptrdiff_t row, sheet; /* voxels from one to the next along b and p; along a it is one */
    const uint16_t *grey;
    double origin[2], right[2], down[2], shear[2];
    double slab_mm;                                                 /* length of a ray between two sheets */
    double start_mm, start_right_mm, start_down_mm, start_sheet_mm; /* of a ray where it meets a sheet, likewise */
    double near_mm, far_mm;
    double margin; /* voxels by which shafts are wider than the rays of their pixels */
    /* Rays run along p, at the same place of every sheet: between two sheets the field is linear along them, as the
     * tables take it to be, and so are gradients. */
    bool straight;
} SheetsView;

/* A grid of pixels, every one, every second or every fourth, and its groups' lanes. */
typedef struct SheetsGrid {
    int pitch; /* pixels from one to the next */
    int32_t lane[2]
                [SHEETS_LANES]; /* voxels along a and b from the group's corner, none negative; 16 bits of fraction */
    int64_t corner[2];          /* from its first pixel to its corner; 32 bits of fraction */
    bool dense;                 /* no voxel lies between the cells that neighbouring points take their samples from */
    int reach[2]; /* voxels along a and b from the corner's on that a group's samples may need, with both neighbours */
} SheetsGrid;

typedef struct SheetsCounts {
    uint64_t groups, sheets, slabs, lit, tiles, void_tiles;
    uint64_t may_show; /* blocks that groups have met in which voxels around their samples may be visible */
} SheetsCounts;

/* Everything a thread needs, read-only. */
typedef struct SheetsJob {
    const CtsScene *scene;
    const struct SheetsKernels *kernels;
    SheetsView view;
    SheetsGrid grid[SHEETS_GRIDS]; /* every pixel; every second; every fourth */
    SheetsBins bins;
    const uint64_t *opacity[3]; /* of half a slab, a slab, two slabs */
    const uint32_t *light;      /* of the finest of these in use, */
    const uint16_t *near;       /* likewise; NULL: indicators have no errors of slabs */
    const SheetsPart *part;     /* SheetsTransfer.part */
    bool all_depths;            /* rays are marched all along */
    const SheetsVoid *blocks;
    bool half;      /* half-sheets are sampled, too */
    int n_lattices; /* grids that pixels may be interpolated from, each from the next; those of the last are marched */
    float min_transmittance, min_shaded_weight;
    const CtsShade *shade;   /* NULL: unlit. Its axes are a, b, p */
    const CtsOpenness *open; /* NULL: light reaches everywhere */
    bool want_depth;
    double camera_mm; /* from the camera plane to the plane through the view's centre */
} SheetsJob;

/* Result of a group: premultiplied colour and opacity, depth from the plane through the view's centre, and error
 * indicator. */
typedef struct SheetsPixels {
    float rgba[4][SHEETS_LANES];
    float depth_mm[SHEETS_LANES];
    float indicator[SHEETS_LANES];
} SheetsPixels;

/* A group to be marched. */
typedef struct SheetsGroup {
    const SheetsJob *job;
    const SheetsGrid *grid;
    int x, y;                /* its first pixel */
    const uint64_t *visible; /* a bit a block of slabs that may show something */
    SheetsCounts *counts;
} SheetsGroup;

/* The kernels of one SIMD path. */
typedef struct SheetsKernels {
    void (*march)(const SheetsGroup *group, SheetsPixels *pixels);
    /* Bits of the layers of blocks that may be visible to pixels x[0] to x[1], y[0] to y[1]; of those that `of` has
     * (NULL: all). True where there are any. */
    bool (*find_visible)(const SheetsJob *job, const int x[2], const int y[2], const uint64_t *of, uint64_t *bits);
    /* Entries first to end - 1 (multiples of 16) of SheetsOpacity.rgba and, where it is not NULL, .light, for slabs of
     * this length. */
    void (*fill_slabs)(const SheetsPart *part, float length_mm, size_t first, size_t end, uint64_t *rgba,
                       uint32_t *light);
} SheetsKernels;
#define SHEETS_KERNELS(path) extern const SheetsKernels cts_sheets_##path;
CTS_EACH_PATH(SHEETS_KERNELS)

CtsStatus cts_sheets_transfer_init(SheetsTransfer *transfer, const CtsScene *scene, int largest_grey, CtsError *err);
void cts_sheets_transfer_free(SheetsTransfer *transfer);
/* Makes the table again only where length or extinction differ from those that it was made for. with_near, lit: with
 * `near` and `light`. */
CtsStatus cts_sheets_opacity_find(SheetsOpacity *opacity, const SheetsTransfer *transfer, double length_mm,
                                  bool with_near, bool lit, const SheetsKernels *kernels, int n_threads, CtsError *err);

/* grey: the volume's, or for p = 0 its transposed copy. */
void cts_sheets_view_init(SheetsView *view, const CtsView *camera, const uint16_t *grey);
void cts_sheets_grid_init(SheetsGrid *grid, const SheetsView *view, int pitch);

static inline int cts_sheets_words(int n_layers)
{
    return (n_layers + 63) / 64;
}

/* A rectangle of pixels, or of every second or fourth one each way, whose first is pixel (x0, y0) of the view; rows
 * from the top, one after the other. */
typedef struct SheetsPatch {
    const SheetsGrid *grid;
    int x0, y0, width, height;
    float *rgba; /* premultiplied */
    float *indicator;
    float *depth_mm;   /* from the plane through the view's centre; infinite before, and where nothing is visible; NULL:
                          not wanted */
    uint8_t *may_show; /* of each group: whether anything may be visible at its points, or between them if the grid is
                          dense; of pixels, 0 where they are interpolated, too */
} SheetsPatch;

/* Fills the picture, whose depths are infinite, and the indicators, one a pixel. lattices: job->n_lattices, as
 * cts_sheets_lattice_init() takes them. */
CtsStatus cts_sheets_run(const SheetsJob *job, CtsPicture *picture, float *indicator, SheetsPatch lattices[],
                         SheetsCounts *total, CtsError *err);
/* As CtsEngine.render_tiles. */
CtsStatus cts_sheets_probe(const SheetsJob *job, const int (*corner)[2], size_t n, float (*rgba)[4], float *indicator,
                           CtsError *err);
_Static_assert((int)SHEETS_TILE_X == (int)CTS_PROBE_X && (int)SHEETS_TILE_Y == (int)CTS_PROBE_Y, "tiles are probes");
