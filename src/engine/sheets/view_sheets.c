#include "engine/sheets/sheets.h"

#include "base/mem.h"
#include "base/parallel.h"
#include "base/simd_fixed.h"
#include <math.h>

void cts_sheets_view_init(SheetsView *v, const CtsView *camera, const uint16_t *grey)
{
    static const int within[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    const int *const d = camera->dims;
    const int p = camera->axis, a = within[p][0], b = within[p][1];
    const ptrdiff_t plane = (ptrdiff_t)d[0] * d[1];
    /* Voxels from one to the next along each axis; of the transposed copy, x and y exchanged. */
    const ptrdiff_t stride[3] = {p == 0 ? d[1] : 1, p == 0 ? 1 : d[0], plane};
    *v = (SheetsView){.p = p,
                      .a = a,
                      .b = b,
                      .n = {d[a], d[b], d[p]},
                      .step = camera->axis_sign,
                      .row = stride[b],
                      .sheet = stride[p],
                      .grey = grey,
                      .slab_mm = camera->layer_mm,
                      .near_mm = camera->near_mm,
                      .far_mm = camera->far_mm};
    const double *const along = camera->forward_vox;
    double start[3][3]; /* of the first pixel, its right and its lower neighbour */
    for (int i = 0; i < 3; i++)
        cts_view_ray(camera, i == 1, i == 2, start[i]);
    double mm[3], at[2][3]; /* where each meets sheet 0 */
    for (int i = 0; i < 3; i++) {
        mm[i] = -start[i][p] / along[p];
        at[0][i] = start[i][a] + mm[i] * along[a];
        at[1][i] = start[i][b] + mm[i] * along[b];
    }
    for (int c = 0; c < 2; c++) {
        v->origin[c] = at[c][0];
        v->right[c] = at[c][1] - at[c][0];
        v->down[c] = at[c][2] - at[c][0];
        v->shear[c] = along[c == 0 ? a : b] / along[p];
    }
    v->start_mm = mm[0];
    v->start_right_mm = mm[1] - mm[0];
    v->start_down_mm = mm[2] - mm[0];
    v->start_sheet_mm = 1 / along[p];
}

void cts_sheets_grid_init(SheetsGrid *g, const SheetsView *view, int pitch)
{
    g->pitch = pitch;
    for (int c = 0; c < 2; c++) {
        int32_t least = 0, most = 0;
        for (int l = 0; l < SHEETS_LANES; l++) {
            const double x = pitch * (l % SHEETS_SIDE), y = pitch * (l / SHEETS_SIDE);
            g->lane[c][l] = (int32_t)lrint((x * view->right[c] + y * view->down[c]) * 65536);
            least = g->lane[c][l] < least ? g->lane[c][l] : least;
        }
        for (int l = 0; l < SHEETS_LANES; l++) {
            g->lane[c][l] -= least;
            most = g->lane[c][l] > most ? g->lane[c][l] : most;
        }
        g->corner[c] = (int64_t)least * 65536;
        g->reach[c] = ((most + 65535) >> 16) + 2;
    }
}

typedef struct Transposing {
    const CtsVolume *volume;
    uint16_t *copy;
} Transposing;

/* By parts that stay in the cache; of these sizes, the fastest on a layer of 512 x 512 voxels. */
static void transpose_layer(const uint16_t *from, size_t nx, size_t ny, uint16_t *to)
{
    enum { SIDE = 8, ROWS = 64, COLUMNS = 32 };
    const size_t whole_x = nx - nx % SIDE, whole_y = ny - ny % SIDE;
    for (size_t y0 = 0; y0 < whole_y; y0 += ROWS)
        for (size_t x0 = 0; x0 < whole_x; x0 += COLUMNS)
            for (size_t x = x0; x < whole_x && x < x0 + COLUMNS; x += SIDE)
                for (size_t y = y0; y < whole_y && y < y0 + ROWS; y += SIDE)
                    transpose_8x8(from + y * nx + x, nx, to + x * ny + y, ny);
    for (size_t y = 0; y < ny; y++)
        for (size_t x = y < whole_y ? whole_x : 0; x < nx; x++)
            to[x * ny + y] = from[y * nx + x];
}

static void transpose_some(void *context, int worker, size_t first, size_t end)
{
    const Transposing *const t = context;
    const size_t nx = (size_t)t->volume->dims[0], ny = (size_t)t->volume->dims[1];
    (void)worker;
    for (size_t k = first; k < end; k++)
        transpose_layer(t->volume->grey + k * nx * ny, nx, ny, t->copy + k * nx * ny);
}

CtsStatus cts_sheets_transpose(uint16_t **copy, const CtsVolume *volume, int n_threads, CtsError *err)
{
    const CtsStatus st = cts_alloc_array(copy, cts_volume_n_voxels(volume), err);
    if (st)
        return st;
    Transposing t = {volume, *copy};
    cts_parallel(n_threads, (size_t)volume->dims[2], 1, transpose_some, &t);
    return CTS_OK;
}
