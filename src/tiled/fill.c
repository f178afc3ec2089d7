/* Rows between: where pixels lie much closer than voxels, every second row of rays says nearly all. */
#include "base/mutation.h"
#include "tiled/march.h"

#include <math.h>
#include <string.h>

typedef float Colour __attribute__((vector_size(16)));

/* Rows above and below; NULL beyond the tile. */
typedef struct Around {
    const float *above2, *above, *below, *below2;
} Around;

typedef int32_t Bits __attribute__((vector_size(16)));

static inline Colour colour_at(const float *row, int i)
{
    Colour c;
    memcpy(&c, row + 4 * i, sizeof c);
    return c;
}

static inline Colour size_of(Colour c)
{
    return (Colour)((Bits)c & 0x7fffffff);
}

static inline Colour larger(Colour a, Colour b)
{
    const Bits more = a > b;
    return (Colour)((more & (Bits)a) | (~more & (Bits)b));
}

/* Cubic through four rows, quadratic through three at the tile's ends. True when it can be trusted: the second
 * differences and the step from row to row are small. */
static bool fill_colour(const Around *r, int n, float most, Colour *out)
{
    Colour worst = {0};
    if (r->above2 && r->below2) {
        for (int i = 0; i < n; i++) {
            const Colour a = colour_at(r->above2, i), b = colour_at(r->above, i);
            const Colour c = colour_at(r->below, i), d = colour_at(r->below2, i);
            worst = larger(worst, larger(size_of(a - 2 * b + c), size_of(b - 2 * c + d)) + size_of(b - c));
            out[i] = (9 * (b + c) - (a + d)) * (1.0f / 16);
        }
    } else {
        const float *near = r->above2 ? r->below : r->above, *mid = r->above2 ? r->above : r->below;
        const float *far = r->above2 ? r->above2 : r->below2;
        if (!far)
            return false;
        for (int i = 0; i < n; i++) {
            const Colour a = colour_at(near, i), b = colour_at(mid, i), c = colour_at(far, i);
            worst = larger(worst, 2 * size_of(a - 2 * b + c) + size_of(a - b));
            out[i] = (3 * a + 6 * b - c) * 0.125f;
        }
    }
    for (int i = 0; i < n; i++) {
        out[i] = larger(out[i], (Colour){0});
        out[i][3] = out[i][3] < 1 ? out[i][3] : 1;
    }
    for (int c = 0; c < 4; c++)
        if (!(worst[c] <= most) && !CTS_MUTATED(BLIND_FILL))
            return false;
    return true;
}

/* Between two depths of one surface; no surface above and below leaves none between. */
static bool fill_depth(const float *above, const float *below, int n, float most_mm, float *out)
{
    for (int i = 0; i < n; i++) {
        const bool none = isinf(above[i]) && isinf(below[i]);
        if (!none && !(fabsf(above[i] - below[i]) <= most_mm))
            return false;
        out[i] = none ? INFINITY : 0.5f * (above[i] + below[i]);
    }
    return true;
}

TiledFill cts_tiled_fill(const TiledJob *j, const TiledSpan *s, int away, int above, int below)
{
    if (above < away || below < away)
        return TILED_FILL_NONE;
    const size_t at = (size_t)(s->y - j->first_row) * (size_t)j->width + (size_t)s->x;
    const ptrdiff_t row = (ptrdiff_t)j->width * away;
    Colour colour[CTS_PACKET];
    float depth[CTS_PACKET];
    float *rgba = j->rgba + 4 * at;
    const Around r = {above >= 3 * away ? rgba - 12 * row : NULL, rgba - 4 * row, rgba + 4 * row,
                      below >= 3 * away ? rgba + 12 * row : NULL};
    /* A row that others are filled from is held to more. */
    if (!fill_colour(&r, s->n, j->fill_step / (float)away, colour))
        return TILED_FILL_NONE;
    memcpy(rgba, colour, sizeof *colour * (size_t)s->n);
    if (!j->depth_mm)
        return TILED_FILL_ALL;
    float *mm = j->depth_mm + at;
    if (!fill_depth(mm - row, mm + row, s->n, j->layer_mm, depth))
        return TILED_FILL_COLOUR;
    memcpy(mm, depth, sizeof *depth * (size_t)s->n);
    return TILED_FILL_ALL;
}
