#include "engine/splat/raster.h"

#include "base/mem.h"
#include <math.h>

/* Rays along the box's faces belong to it, independent of rounding. */
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
        r->per_x[c] = 1 / r->by_x[c];
    }
    for (int c = 0; c < 2; c++)
        r->column_tables |= r->moves[c] && !r->moves[1 - c] && r->by_y[c] == 0;
    r->filled = r->column_tables && r->moves[0];
}

/* Cells, and behind them fractions. */
static CtsStatus table_init(CtsRasterTable *table, int n, CtsError *err)
{
    const CtsStatus st = cts_alloc_zeroed(&table->cell, 2 * ((size_t)n + 16), err);
    if (!st)
        table->frac = (float *)table->cell + n + 16;
    return st;
}

CtsStatus cts_raster_row_init(CtsRasterRow *row, const CtsRaster *raster, const CtsSimd *simd, CtsError *err)
{
    CtsStatus st;
    *row = (CtsRasterRow){.raster = raster, .simd = simd};
    for (int c = 0; c < 2; c++)
        if ((st = table_init(&row->columns[c], raster->width, err)) ||
            (st = table_init(&row->rows[c], raster->height, err)))
            return st;
    return CTS_OK;
}

void cts_raster_row_free(CtsRasterRow *row)
{
    for (int c = 0; c < 2; c++) {
        cts_free(&row->columns[c].cell);
        cts_free(&row->rows[c].cell);
    }
}

/* The first x of xa..xb for which (position >= at) == rising; positions are monotone, so a guess and a few steps. */
static int first_past(double base, double by_x, double per_x, double at, int xa, int xb)
{
    const bool rising = by_x > 0;
    const double guess = (at - base) * per_x;
    int x = guess <= xa ? xa : guess >= xb ? xb : (int)guess + 1;
    while (x > xa && (base + by_x * (double)(x - 1) >= at) == rising)
        x--;
    while (x < xb && (base + by_x * (double)x >= at) != rising)
        x++;
    return x;
}

int cts_raster_passes(const CtsRasterRow *row, int axis, double at, int xa, int xb)
{
    const CtsRaster *r = row->raster;
    return first_past(row->base[axis], r->by_x[axis], r->per_x[axis], at, xa, xb);
}

/* Narrow xa..xb to the pixels (or rows) whose positions base + step * x lie inside the box along one axis. */
static void clip_to_box(const CtsRaster *r, int axis, double base, double step, int *xa, int *xb)
{
    const double low = -FACE, past = nextafter(r->last[axis] + FACE, INFINITY);
    if (step == 0) {
        *xb = base >= low && base < past ? *xb : *xa;
        return;
    }
    const int enter = first_past(base, step, 1 / step, step > 0 ? low : past, *xa, *xb);
    *xb = first_past(base, step, 1 / step, step > 0 ? past : low, enter, *xb);
    *xa = enter;
}

/* Positions base + step * (offset + index), for indices 0..n-1. */
static void set_table(const CtsRasterRow *row, CtsRasterTable *table, int axis, double step, int offset, int n)
{
    const double base = row->layer_base[axis];
    if (table->known && table->base == base)
        return;
    table->known = true;
    table->base = base;
    int first = offset, past = offset + n;
    clip_to_box(row->raster, axis, base, step, &first, &past);
    table->first = first - offset;
    table->past = past - offset;
    row->simd->place(base, step, row->raster->last[axis], first, past - first, table->cell + table->first,
                     table->frac + table->first);
}

void cts_raster_begin_plane(CtsRasterRow *row, double layer)
{
    const CtsRaster *r = row->raster;
    for (int c = 0; c < 2; c++)
        row->layer_base[c] = r->origin[c] + r->by_layer[c] * layer;
    for (int c = 0; c < 2 && r->column_tables; c++) {
        if (r->moves[c])
            set_table(row, &row->columns[c], c, r->by_x[c], 0, r->width);
        else
            set_table(row, &row->rows[c], c, r->by_y[c], r->first_row, r->height);
    }
}

bool cts_raster_begin_row(CtsRasterRow *row, int y)
{
    const CtsRaster *r = row->raster;
    if (r->column_tables) {
        const int c = r->moves[0] ? 0 : 1;
        const CtsRasterTable *rows = &row->rows[1 - c];
        row->x0 = row->columns[c].first;
        row->x1 = y >= rows->first && y < rows->past ? row->columns[c].past : row->x0;
        row->base[c] = row->layer_base[c];
        row->base[1 - c] = row->layer_base[1 - c] + r->by_y[1 - c] * (double)(r->first_row + y);
    } else {
        row->x0 = 0;
        row->x1 = r->width;
        for (int c = 0; c < 2; c++) {
            row->base[c] = row->layer_base[c] + r->by_y[c] * (double)(r->first_row + y);
            clip_to_box(r, c, row->base[c], r->by_x[c], &row->x0, &row->x1);
        }
    }
    if (row->x0 >= row->x1)
        return false;
    if (r->column_tables && !r->moves[1]) {
        row->v_cell = row->rows[1].cell[y];
        row->v_frac = row->rows[1].frac[y];
    } else if (!r->moves[1]) {
        int32_t cell[8];
        float frac[8];
        row->simd->place(row->base[1], 0, r->last[1], 0, 1, cell, frac);
        row->v_cell = cell[0];
        row->v_frac = frac[0];
    }
    return true;
}

void cts_raster_fill(CtsRasterRow *row, int xa, int xb)
{
    const CtsRaster *r = row->raster;
    for (int c = 0; c < 2; c++) {
        if ((r->column_tables && r->moves[c]) || (c == 1 && !r->moves[1]))
            continue;
        row->simd->place(row->base[c], r->by_x[c], r->last[c], xa, xb - xa, row->columns[c].cell + xa,
                         row->columns[c].frac + xa);
    }
}
