/* Labels along a ray within one cell: labels' fields are cubics along it, and so are their differences. */
#include "engine/raycast/raycaster.h"

#include "base/compare.h"
#include "base/mutation.h"
#include "engine/raycast/cubic.h"
#include <stdlib.h>

enum { MAX_BOUNDARIES = 3 * CTS_MAX_CELL_LABELS * CTS_MAX_CELL_LABELS / 2 };

/* Positions where the largest field changes between two labels of different appearance, and the ends. */
static int find_boundaries(const CtsVoxelLabels *voxel_labels, const CtsCellLabels *in_cell, const double (*field)[4],
                           double *boundary)
{
    int n = 1;
    boundary[0] = 0;
    for (int i = 0; i < in_cell->n; i++)
        for (int k = i + 1; k < in_cell->n; k++) {
            double apart[4];
            if (voxel_labels->appearance[in_cell->voxel_label[i]] ==
                    voxel_labels->appearance[in_cell->voxel_label[k]] ||
                CTS_MUTATED(LABEL_INTERVALS))
                continue;
            for (int m = 0; m < 4; m++)
                apart[m] = field[i][m] - field[k][m];
            n += cts_cubic_sign_changes(apart, boundary + n);
        }
    qsort(boundary, (size_t)n, sizeof *boundary, cts_compare_double);
    boundary[n] = 1;
    return n;
}

static int appearance_at(const CtsVoxelLabels *voxel_labels, const CtsCellLabels *in_cell, const double (*field)[4],
                         double u)
{
    int most = 0;
    for (int i = 1; i < in_cell->n; i++)
        if (cts_cubic_at(field[i], u) > cts_cubic_at(field[most], u))
            most = i;
    return voxel_labels->appearance[in_cell->voxel_label[most]];
}

int cts_raycast_label_intervals(const CtsVoxelLabels *voxel_labels, const CtsRayWalk *walk, CtsRayInterval *interval)
{
    CtsCellLabels in_cell;
    double field[CTS_MAX_CELL_LABELS][4], boundary[MAX_BOUNDARIES + 2];
    int n = 0;
    cts_cell_labels(voxel_labels, walk->cell, &in_cell);
    for (int i = 0; i < in_cell.n; i++)
        cts_cubic_in_cell(in_cell.corner[i], walk->from, walk->to, field[i]);
    const int n_boundaries = find_boundaries(voxel_labels, &in_cell, (const double(*)[4])field, boundary);
    for (int i = 0; i < n_boundaries; i++) {
        const int appearance =
            appearance_at(voxel_labels, &in_cell, (const double(*)[4])field, 0.5 * (boundary[i] + boundary[i + 1]));
        if (n > 0 && interval[n - 1].appearance == appearance)
            interval[n - 1].to = boundary[i + 1];
        else if (boundary[i + 1] > boundary[i] || n_boundaries == 1)
            interval[n++] = (CtsRayInterval){boundary[i], boundary[i + 1], appearance};
    }
    return n;
}
