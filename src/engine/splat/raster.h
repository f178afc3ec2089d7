/* Intersections of the picture's rays with a layer: lattice positions, linear in pixel and layer, in closed form.
 *
 * A position is (origin + by_layer * layer + by_y * y) + by_x * x in double, so that it depends neither on the start of
 * a row nor on vector width, and is monotone along a row. */
#pragma once

#include "core/scene/view.h"
#include "engine/splat/loops.h"
#include "engine/splat/stack.h"

typedef struct CtsRaster {
    int width, height, first_row; /* of the picture, which may be a band; row 0 is the view's first_row */
    int last[2];                  /* lattice index of the last voxel along u and v */
    double origin[2], by_x[2], by_y[2], by_layer[2];
    double per_x[2];    /* 1 / by_x */
    bool moves[2];      /* along a picture row */
    bool column_tables; /* one lattice axis changes along picture rows only, the other from row to row only */
    bool filled;        /* nothing is left for cts_raster_fill() */
} CtsRaster;

/* Cells and fractions along one axis, by picture column or row, of the positions base + step * index; valid for those
 * inside the box. */
typedef struct CtsRasterTable {
    bool known;
    double base;
    int first, past;
    int32_t *cell;
    float *frac;
} CtsRasterTable;

/* All rows of the view. */
void cts_raster_init(CtsRaster *raster, const CtsView *view, const CtsStack *stack, const int density[2]);

/* One thread's rows. */
typedef struct CtsRasterRow {
    const CtsRaster *raster;
    const CtsSimd *simd;
    double layer_base[2]; /* of the plane begun last */
    double base[2];       /* of the row begun last */
    int x0, x1;           /* pixels of the row whose rays cross the plane inside the box */
    CtsRasterTable columns[2], rows[2];
    int32_t v_cell; /* for horizontal rows */
    float v_frac;
} CtsRasterRow;

CtsStatus cts_raster_row_init(CtsRasterRow *row, const CtsRaster *raster, const CtsSimd *simd, CtsError *err);
void cts_raster_row_free(CtsRasterRow *row);

/* The plane at a layer coordinate (whole on a layer), then a picture row of it; false: nothing of the row is inside. */
void cts_raster_begin_plane(CtsRasterRow *row, double layer);
bool cts_raster_begin_row(CtsRasterRow *row, int y);

/* Computes cells and fractions of pixels xa..xb-1 of the row, where they are not in the plane's tables. */
void cts_raster_fill(CtsRasterRow *row, int xa, int xb);

/* Lattice positions of the row's pixels. */
static inline void cts_raster_places(const CtsRasterRow *row, CtsPlaces *places)
{
    places->horizontal = !row->raster->moves[1];
    places->cell[0] = row->columns[0].cell;
    places->frac[0] = row->columns[0].frac;
    places->cell[1] = places->horizontal ? &row->v_cell : row->columns[1].cell;
    places->frac[1] = places->horizontal ? &row->v_frac : row->columns[1].frac;
}

/* The first pixel of xa..xb whose position along axis has passed lattice point at: reached it where positions rise,
 * fallen below it where they fall; xb if none has. Exact: agrees with the cells of cts_raster_fill(). */
int cts_raster_passes(const CtsRasterRow *row, int axis, double at, int xa, int xb);
