#include "engine/sheets/sheets.h"

#include <math.h>

/* A sample's position is rounded to 2^-16 voxels, and shafts to floats: four times, by up to 2^-24 of the largest
 * position each. Margins of 2^-10 voxels and 2^-20 of it are more than both. */
static double margin_of(const SheetsView *v, int width, int height)
{
    double most = 0;
    for (int c = 0; c < 2; c++)
        most = fmax(most, fabs(v->origin[c]) + width * fabs(v->right[c]) + height * fabs(v->down[c]) +
                              v->n[2] * fabs(v->shear[c]));
    return 0x1p-10 + most * 0x1p-20;
}

void cts_sheets_view_init(SheetsView *v, const CtsView *camera, const uint16_t *grey)
{
    const int *const d = camera->dims;
    const int p = camera->axis, a = p == 0, b = p == 2 ? 1 : 2;
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
    v->straight = llrint(v->shear[0] * 0x1p32) == 0 && llrint(v->shear[1] * 0x1p32) == 0;
    v->margin = margin_of(v, camera->width, camera->height);
    v->start_mm = mm[0];
    v->start_right_mm = mm[1] - mm[0];
    v->start_down_mm = mm[2] - mm[0];
    v->start_sheet_mm = 1 / along[p];
}

void cts_sheets_grid_init(SheetsGrid *g, const SheetsView *view, int pitch)
{
    g->pitch = pitch;
    g->dense = true;
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
        g->dense &= pitch * (fabs(view->right[c]) + fabs(view->down[c])) <= 2;
    }
}
