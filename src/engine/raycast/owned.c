/* Labels along a ray within one cell: labels' fields are cubics along it, and so are their differences. */
#include "engine/raycast/raycaster.h"

#include "base/mutation.h"
#include "engine/raycast/cubic.h"
#include <stdlib.h>

enum { MOST_CUTS = 3 * CTS_CELL_OWNERS * CTS_CELL_OWNERS / 2 };

static int by_place(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* Positions where the largest field changes between two labels of different appearance, and the ends. */
static int find_cuts(const CtsOwners *owners, const CtsCellOwners *in_cell, const double (*field)[4], double *cut)
{
    int n = 1;
    cut[0] = 0;
    for (int i = 0; i < in_cell->n; i++)
        for (int k = i + 1; k < in_cell->n; k++) {
            double apart[4];
            if (owners->look[in_cell->owner[i]] == owners->look[in_cell->owner[k]] || CTS_MUTATED(OWNER_CUTS))
                continue;
            for (int m = 0; m < 4; m++)
                apart[m] = field[i][m] - field[k][m];
            n += cts_cubic_sign_changes(apart, cut + n);
        }
    qsort(cut, (size_t)n, sizeof *cut, by_place);
    cut[n] = 1;
    return n;
}

static int look_at(const CtsOwners *owners, const CtsCellOwners *in_cell, const double (*field)[4], double u)
{
    int most = 0;
    for (int i = 1; i < in_cell->n; i++)
        if (cts_cubic_at(field[i], u) > cts_cubic_at(field[most], u))
            most = i;
    return owners->look[in_cell->owner[most]];
}

int cts_raycast_owned(const CtsOwners *owners, const CtsRayWalk *walk, CtsOwnedStretch *stretch)
{
    CtsCellOwners in_cell;
    double field[CTS_CELL_OWNERS][4], cut[MOST_CUTS + 2];
    int n = 0;
    cts_cell_owners(owners, walk->cell, &in_cell);
    for (int i = 0; i < in_cell.n; i++)
        cts_cubic_in_cell(in_cell.corner[i], walk->from, walk->to, field[i]);
    const int n_cuts = find_cuts(owners, &in_cell, (const double(*)[4])field, cut);
    for (int i = 0; i < n_cuts; i++) {
        const int look = look_at(owners, &in_cell, (const double(*)[4])field, 0.5 * (cut[i] + cut[i + 1]));
        if (n > 0 && stretch[n - 1].look == look)
            stretch[n - 1].to = cut[i + 1];
        else if (cut[i + 1] > cut[i] || n_cuts == 1)
            stretch[n++] = (CtsOwnedStretch){cut[i], cut[i + 1], look};
    }
    return n;
}
