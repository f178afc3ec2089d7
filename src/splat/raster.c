#include "splat/raster.h"

#include "base/mem.h"
#include <math.h>

/* Rays along the box's faces belong to it, whatever the last bit of their position says. */
#define FACE 1e-9

void cts_raster_init(CtsRaster *r, const CtsView *view, const CtsStack *stack, const int density[2])
{
    const int axis[2] = {stack->u_axis, stack->v_axis}, across = stack->axis;
    double start[3];
    *r = (CtsRaster){.width = view->width, .height = view->height};
    cts_view_ray(view, 0, 0, start);
    for (int c = 0; c < 2; c++) {
        const double m = density[c], mm = view->mm_per_pixel;
        const double slope = view->forward_vox[axis[c]] / view->forward_vox[across];
        r->last[c] = (stack->n[c] - 1) * density[c];
        r->origin[c] = m * (start[axis[c]] - start[across] * slope);
        r->by_x[c] = m * mm * (view->right_vox[axis[c]] - view->right_vox[across] * slope);
        r->by_y[c] = -m * mm * (view->up_vox[axis[c]] - view->up_vox[across] * slope);
        r->by_layer[c] = m * slope;
        r->moves[c] = r->by_x[c] != 0;
    }
    for (int c = 0; c < 2; c++)
        r->column_tables |= r->moves[c] && !r->moves[1 - c] && r->by_y[c] == 0;
}

CtsStatus cts_raster_row_init(CtsRasterRow *row, const CtsRaster *raster, const CtsKernels *kernels, CtsError *err)
{
    CtsStatus st;
    *row = (CtsRasterRow){.raster = raster, .kernels = kernels};
    for (int c = 0; c < 2; c++)
        if ((st = cts_alloc_zeroed(&row->cell[c], (size_t)raster->width + 16, err)) ||
            (st = cts_alloc_zeroed(&row->frac[c], (size_t)raster->width + 16, err)))
            return st;
    return CTS_OK;
}

void cts_raster_row_free(CtsRasterRow *row)
{
    for (int c = 0; c < 2; c++) {
        cts_free(&row->cell[c]);
        cts_free(&row->frac[c]);
    }
}

/* The first x of xa..xb for which (position >= at) == rising; positions are monotone, so a guess and a few steps. */
static int first_past(double base, double by_x, double at, int xa, int xb)
{
    const bool rising = by_x > 0;
    const double guess = (at - base) / by_x;
    int x = guess <= xa ? xa : guess >= xb ? xb : (int)guess;
    while (x > xa && (base + by_x * (double)(x - 1) >= at) == rising)
        x--;
    while (x < xb && (base + by_x * (double)x >= at) != rising)
        x++;
    return x;
}

int cts_raster_passes(const CtsRasterRow *row, int axis, double at, int xa, int xb)
{
    return first_past(row->base[axis], row->raster->by_x[axis], at, xa, xb);
}

/* Narrow xa..xb to the pixels inside the box along one axis. */
static void clip(const CtsRaster *r, int axis, double base, int *xa, int *xb)
{
    const double low = -FACE, past = nextafter(r->last[axis] + FACE, INFINITY), by_x = r->by_x[axis];
    if (by_x == 0) {
        *xb = base >= low && base < past ? *xb : *xa;
        return;
    }
    const int enter = first_past(base, by_x, by_x > 0 ? low : past, *xa, *xb);
    *xb = first_past(base, by_x, by_x > 0 ? past : low, enter, *xb);
    *xa = enter;
}

void cts_raster_begin_plane(CtsRasterRow *row, double layer)
{
    const CtsRaster *r = row->raster;
    for (int c = 0; c < 2; c++)
        row->layer_base[c] = r->origin[c] + r->by_layer[c] * layer;
    if (!r->column_tables)
        return;
    const int c = r->moves[0] ? 0 : 1;
    if (row->has_table && row->table_base == row->layer_base[c])
        return;
    row->has_table = true;
    row->table_base = row->layer_base[c];
    row->table_x0 = 0;
    row->table_x1 = r->width;
    clip(r, c, row->table_base, &row->table_x0, &row->table_x1);
    row->kernels->place(row->table_base, r->by_x[c], r->last[c], row->table_x0, row->table_x1 - row->table_x0,
                        row->cell[c] + row->table_x0, row->frac[c] + row->table_x0);
}

bool cts_raster_begin_row(CtsRasterRow *row, int y)
{
    const CtsRaster *r = row->raster;
    row->x0 = r->column_tables ? row->table_x0 : 0;
    row->x1 = r->column_tables ? row->table_x1 : r->width;
    for (int c = 0; c < 2; c++) {
        row->base[c] = row->layer_base[c] + r->by_y[c] * (double)(r->first_row + y);
        if (!r->column_tables || !r->moves[c])
            clip(r, c, row->base[c], &row->x0, &row->x1);
    }
    return row->x0 < row->x1;
}

void cts_raster_fill(CtsRasterRow *row, int xa, int xb)
{
    const CtsRaster *r = row->raster;
    for (int c = 0; c < 2; c++) {
        int32_t *cell = row->cell[c];
        float *frac = row->frac[c];
        if (!r->moves[c]) {
            row->kernels->place(row->base[c], 0, r->last[c], 0, 1, cell + xa, frac + xa);
            for (int x = xa + 1; x < xb; x++) {
                cell[x] = cell[xa];
                frac[x] = frac[xa];
            }
        } else if (!r->column_tables) {
            row->kernels->place(row->base[c], r->by_x[c], r->last[c], xa, xb - xa, cell + xa, frac + xa);
        }
    }
}
