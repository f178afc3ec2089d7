#include "engine/tiled/lattice.h"

#include <math.h>

typedef float Rgba __attribute__((vector_size(16)));
typedef int32_t Rgba_mask __attribute__((vector_size(16)));

bool cts_lattice_pays(const TiledJob *j, const CtsScene *scene)
{
    const double across = fmax(fabs(j->u_at[1]), fabs(j->v_at[1])), down = fmax(fabs(j->u_at[2]), fabs(j->v_at[2]));
    return cts_scene_drafts(scene) && !j->depth_mm && j->first_row % 2 == 0 && 2 * fmax(across, down) < 1;
}

void cts_lattice_spread(TiledJob *lattice, const TiledJob *j)
{
    *lattice = *j;
    for (int c = 1; c <= 2; c++) {
        lattice->u_at[c] *= 2;
        lattice->v_at[c] *= 2;
        lattice->depth_at[c] *= 2;
    }
    /* One more than there are pixels: the far sides of the last cells. */
    lattice->width = (j->width + 1) / 2 + 1;
    lattice->first_row = j->first_row / 2;
    lattice->past_row = (j->past_row + 1) / 2 + 1;
}

static Rgba smaller(Rgba a, Rgba b)
{
    const Rgba_mask less = a < b;
    return (Rgba)(((Rgba_mask)a & less) | ((Rgba_mask)b & ~less));
}

static Rgba larger(Rgba a, Rgba b)
{
    const Rgba_mask more = b < a;
    return (Rgba)(((Rgba_mask)a & more) | ((Rgba_mask)b & ~more));
}

static const Rgba *places(const TiledJob *j, int x, int y)
{
    const TiledLattice *l = &j->lattice;
    return (const Rgba *)(const void *)l->rgba + (ptrdiff_t)(y / 2 - l->first_row) * l->width + x / 2;
}

static bool any(Rgba_mask mask)
{
    return mask[0] | mask[1] | mask[2] | mask[3];
}

bool cts_lattice_fill(const TiledJob *j, int x, int y, int n)
{
    const Rgba *const upper = places(j, x, y), *const lower = upper + j->lattice.width;
    const int n_cells = (n + 1) / 2;
    const Rgba agree = {j->lattice.agree, j->lattice.agree, j->lattice.agree, j->lattice.agree};
    Rgba_mask apart = {0}, seen = {0};
    for (int i = 0; i < n_cells; i++) {
        const Rgba least = smaller(smaller(upper[i], upper[i + 1]), smaller(lower[i], lower[i + 1]));
        const Rgba most = larger(larger(upper[i], upper[i + 1]), larger(lower[i], lower[i + 1]));
        apart |= agree < most - least;
        seen |= most > 0;
    }
    if (any(apart) || !any(seen))
        return false;
    Rgba *const here = (Rgba *)(void *)j->rgba + (ptrdiff_t)(y - j->first_row) * j->width + x, *below = here + j->width;
    const bool both = y + 1 < j->past_row;
    for (int i = 0; i < n; i++) {
        const Rgba top = 0.5f * (upper[i / 2] + upper[(i + 1) / 2]),
                   bottom = 0.5f * (lower[i / 2] + lower[(i + 1) / 2]);
        here[i] = top;
        if (both)
            below[i] = 0.5f * (top + bottom);
    }
    return true;
}
