#include "engine/project/project_packets.h"

#include "base/clamp.h"
#include <math.h>

/* Position of a ray in a cell, 0 to 1. */
static void place_in_cell(const CtsProjectedRay *ray, const int cell[3], double t, double place[3])
{
    for (int a = 0; a < 3; a++)
        place[a] = cts_clamp01(ray->start[a] + t * ray->step[a] - cell[a]);
}

static int body_stretches(const CtsBodyMask *body, const int cell[3], const double enter[3], const double leave[3],
                          CtsLineInterval interval[CTS_MAX_CELL_INTERVALS])
{
    double corner[8], begin[3], end[3];
    cts_body_mask_corners(body, cell, corner);
    for (int a = 0; a < 3; a++) {
        begin[a] = cts_body_mask_place(body, a, cell[a], enter[a]);
        end[a] = cts_body_mask_place(body, a, cell[a], leave[a]);
    }
    return cts_threshold_intervals(corner, CTS_BODY_THRESHOLD, begin, end, interval);
}

/* Within the body, the intervals are split at boundaries of labels. */
int cts_project_stretches(const CtsProjector *p, const CtsProjectedRay *ray, const int cell[3], double from, double to,
                          double first[CTS_MAX_CELL_INTERVALS], double last[CTS_MAX_CELL_INTERVALS])
{
    const int appearance = p->voxel_labels ? cts_appearance_of_cell(p->voxel_labels, cell) : CTS_APPEARANCE_PRESET;
    CtsLineInterval body[CTS_MAX_CELL_INTERVALS] = {{1, CTS_APPEARANCE_PRESET}}, part[CTS_MAX_CELL_INTERVALS];
    double enter[3], leave[3], way[2][3], begin = 0;
    int n = 0;
    if (appearance == CTS_APPEARANCE_HIDDEN)
        return 0;
    place_in_cell(ray, cell, from, enter);
    place_in_cell(ray, cell, to, leave);
    const int n_body = p->body ? body_stretches(p->body, cell, enter, leave, body) : 1;
    for (int b = 0; b < n_body; begin = body[b++].end) {
        const double length = body[b].end - begin;
        int n_parts = 1;
        part[0] = (CtsLineInterval){1, body[b].appearance};
        for (int a = 0; a < 3; a++) {
            way[0][a] = enter[a] + begin * (leave[a] - enter[a]);
            way[1][a] = enter[a] + body[b].end * (leave[a] - enter[a]);
        }
        if (body[b].appearance != CTS_APPEARANCE_HIDDEN && appearance == CTS_APPEARANCES_DIFFER)
            n_parts = cts_label_intervals(p->voxel_labels, cell, way[0], way[1], part);
        for (int i = 0; i < n_parts && n < CTS_MAX_CELL_INTERVALS; i++)
            if (part[i].appearance != CTS_APPEARANCE_HIDDEN) {
                first[n] = from + (begin + (i ? part[i - 1].end : 0) * length) * (to - from);
                last[n++] = from + (begin + part[i].end * length) * (to - from);
            }
    }
    return n;
}

double cts_project_point(const CtsProjector *p, const CtsProjectedRay *ray)
{
    double at[3], first[CTS_MAX_CELL_INTERVALS], last[CTS_MAX_CELL_INTERVALS], corner[8];
    int cell[3];
    for (int a = 0; a < 3; a++)
        cell[a] = (int)fmin(fmax(ray->start[a] + ray->t0 * ray->step[a], 0), p->n_cells[a] - 1);
    if (cts_project_stretches(p, ray, cell, ray->t0, ray->t0, first, last) == 0)
        return INFINITY;
    place_in_cell(ray, cell, ray->t0, at);
    const uint16_t *const base = p->volume->grey + cell[0] + cell[1] * p->stride[1] + cell[2] * p->stride[2];
    for (int c = 0; c < 8; c++)
        corner[c] = base[(c & 1) * p->stride[0] + (c >> 1 & 1) * p->stride[1] + (c >> 2) * p->stride[2]];
    return cts_cell_at(corner, at[0], at[1], at[2]);
}
