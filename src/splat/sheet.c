#include "splat/sheet.h"

#include "base/mem.h"
#include "base/mutation.h"

enum { LEFT_MARGIN = 16, MARGINS = 64 };

CtsStatus cts_sheet_init(CtsSheet *s, const CtsTiles *tiles, CtsError *err)
{
    CtsStatus st;
    *s = (CtsSheet){.step = -1};
    for (int c = 0; c < 2; c++)
        s->last[c] = tiles->last_voxel[c] * tiles->density[c];
    s->stride = ((size_t)s->last[0] + 1 + MARGINS + 15) / 16 * 16;
    /* Rows a large power of two apart would fall on the same cache lines. */
    if (s->stride % 512 == 0)
        s->stride += 16;
    size_t n;
    if (cts_mul_overflows(s->stride, (size_t)s->last[1] + 2, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a layer's sheet is too large");
    if ((st = cts_alloc_zeroed(&s->block, n, err)))
        return st;
    s->origin = s->block + LEFT_MARGIN;
    return cts_alloc_zeroed(&s->holds, (size_t)tiles->n_segments[0] * (size_t)tiles->n_segments[1], err);
}

void cts_sheet_free(CtsSheet *s)
{
    cts_free(&s->block);
    cts_free(&s->holds);
}

static int floor_div(int a, int b)
{
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

/* Voxels whose centres lie on lattice points lo..hi, within 0..n-1. */
static void voxels_on(int lo, int hi, int density, int n, int *i0, int *i1)
{
    const int first = -floor_div(-lo, density), last = floor_div(hi, density);
    *i0 = first > 0 ? first : 0;
    *i1 = last < n - 1 ? last + 1 : n;
    if (*i1 < *i0)
        *i1 = *i0;
}

/* One voxel's footprint, kept within lattice columns u0..u1-1. */
static void scatter_clipped(const CtsScatter *job, int i, int u0, int u1)
{
    const CtsFootprint *f = job->footprint;
    const int at = i * f->density[0] - f->reach[0], n_taps = 2 * f->reach[0] + 1;
    const int first = u0 > at ? u0 - at : 0, past = u1 - at < n_taps ? u1 - at : n_taps;
    const uint32_t change = (uint32_t)job->value[i] - (job->old ? (uint32_t)job->old[i] : job->base);
    uint32_t *to = job->sheet + (size_t)i * (size_t)f->density[0];
    if (change == 0)
        return;
    for (int v = job->tap0; v < job->tap1; v++, to += job->stride)
        for (int u = first; u < past; u++)
            to[u] += change * f->weight[v][u];
}

static uint64_t count_marks(const uint64_t *marks, int i0, int i1)
{
    uint64_t n = 0;
    for (int i = i0; i < i1;) {
        const int take = 64 - (i & 63) < i1 - i ? 64 - (i & 63) : i1 - i;
        const uint64_t bits = marks[i / 64] >> (i & 63);
        n += (uint64_t)__builtin_popcountll(take < 64 ? bits & ((UINT64_C(1) << take) - 1) : bits);
        i += take;
    }
    return n;
}

/* Columns of voxels: those that touch the patch, those whose footprint lies inside it, those that stand in it. */
typedef struct Columns {
    int touch0, touch1, inner0, inner1, own0, own1;
    int u0, u1; /* lattice columns that may be written */
} Columns;

static Columns columns_of(const CtsSplat *s, const CtsPatch *p)
{
    const CtsFootprint *f = s->footprint;
    const int reach = f->reach[0];
    Columns c;
    /* At the sheet's ends footprints may run out into the margin. */
    c.u0 = p->u0 == 0 ? -reach : p->u0;
    c.u1 = p->u1 == s->sheet->last[0] + 1 ? p->u1 + reach : p->u1;
    voxels_on(p->u0 - reach, p->u1 - 1 + reach, f->density[0], s->n[0], &c.touch0, &c.touch1);
    voxels_on(c.u0 + reach, c.u1 - 1 - reach, f->density[0], s->n[0], &c.inner0, &c.inner1);
    voxels_on(p->u0, p->u1 - 1, f->density[0], s->n[0], &c.own0, &c.own1);
    if (c.inner1 == c.inner0)
        c.inner0 = c.inner1 = c.touch1;
    return c;
}

/* Returns how many of the voxels that stand in the patch were splatted. */
static uint64_t splat_row(const CtsSplat *s, const CtsPatch *p, const Columns *c, const CtsScatter *job)
{
    const bool marked = p->from_old || p->skip_equal;
    for (int i = c->touch0; i < c->inner0; i++)
        scatter_clipped(job, i, c->u0, c->u1);
    if (marked) {
        const int word0 = c->touch0 / 64, i0 = word0 * 64;
        s->kernels->mark(job->value + i0, job->old ? job->old + i0 : NULL, (uint16_t)s->base, c->touch1 - i0,
                         s->marks + word0);
        s->kernels->scatter_marked(job, s->marks, c->inner0, c->inner1);
    } else {
        s->kernels->scatter(job, c->inner0, c->inner1);
    }
    for (int i = c->inner1; i < c->touch1; i++)
        scatter_clipped(job, i, c->u0, c->u1);
    return marked ? count_marks(s->marks, c->own0, c->own1) : (uint64_t)(c->own1 - c->own0);
}

CtsSplatCount cts_splat_patch(const CtsSplat *s, const CtsPatch *p)
{
    const CtsFootprint *f = s->footprint;
    const int reach = f->reach[1], density = f->density[1];
    const size_t stride = s->sheet->stride;
    const Columns columns = columns_of(s, p);
    CtsSplatCount count = {0};
    int j0, j1;
    if (p->u0 >= p->u1 || p->v0 >= p->v1)
        return count;
    if (!p->from_old) {
        const uint32_t start = s->base << CTS_WEIGHT_BITS;
        for (int v = p->v0; v < p->v1; v++)
            for (uint32_t *to = s->sheet->origin + (size_t)v * stride + p->u0, *end = to + (p->u1 - p->u0); to < end;
                 to++)
                *to = start;
    }
    voxels_on(p->v0 - reach, p->v1 - 1 + reach, density, s->n[1], &j0, &j1);
    for (int j = j0; j < j1; j++) {
        const int at = j * density;
        const int first = p->v0 - at > -reach ? p->v0 - at : -reach;
        const int past = p->v1 - at < reach + 1 ? p->v1 - at : reach + 1;
        CtsScatter job = {.footprint = f,
                          .sheet = s->sheet->origin + (size_t)(at + first) * stride - f->reach[0],
                          .stride = stride,
                          .tap0 = first + reach,
                          .tap1 = past + reach,
                          .value = s->row_of(s->rows, j),
                          .old = p->from_old ? s->row_of(s->old_rows, j) : NULL,
                          .base = s->base};
        const uint64_t splatted = splat_row(s, p, &columns, &job);
        if (at >= p->v0 && at < p->v1) {
            count.inside += (uint64_t)(columns.own1 - columns.own0);
            count.splatted += splatted;
        }
    }
    if (CTS_MUTATED(FLOAT_DRIFT) && p->from_old)
        for (int v = p->v0; v < p->v1; v++)
            for (int u = p->u0; u < p->u1; u++)
                s->sheet->origin[(size_t)v * stride + (size_t)u] =
                    (uint32_t)(float)s->sheet->origin[(size_t)v * stride + (size_t)u];
    return count;
}
