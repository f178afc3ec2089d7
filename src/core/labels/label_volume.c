/* Labels on their slices -> whose each voxel of a volume is. */
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/vec3.h"
#include "core/labels/label_set.h"
#include "core/model/voxel_labels.h"
#include <math.h>
#include <stdlib.h>

/* A voxel with fractions of labels, while they are assigned. */
typedef struct VoxelSharing {
    CtsFractionalVoxel voxel;
    uint16_t left;
    uint32_t last; /* index + 1 of the last label assigned */
} VoxelSharing;

/* Of one plane. */
typedef struct Sharings {
    VoxelSharing *items; /* n */
    size_t n;
    uint32_t *number; /* index + 1 of the voxel's entry, 0: none; NULL where the plane has none */
} Sharings;

typedef struct Painting {
    CtsVoxelLabels *voxel_labels;
    const CtsLabels *labels;
    const size_t *label, *order; /* label of each of n voxel labels; painting order, the last one wins */
    size_t n;
    int first;         /* slice of the first plane */
    double (*at)[3];   /* of each plane, where it lies in the volume */
    CtsStatus *status; /* of each plane */
} Painting;

/* Labels get the remaining fraction, in order of priority. Only the largest ones are kept, equal ones by number. */
static void take_share(VoxelSharing *s, size_t voxel_label, uint16_t share)
{
    CtsFractionalVoxel *const v = &s->voxel;
    const uint16_t taken = share < s->left ? share : s->left;
    int at = CTS_MAX_FRACTIONS;
    if (s->last == voxel_label + 1)
        return;
    s->last = (uint32_t)voxel_label + 1;
    s->left = (uint16_t)(s->left - taken);
    while (at > 0 && taken &&
           (taken > v->share[at - 1] || (taken == v->share[at - 1] && voxel_label < v->voxel_label[at - 1])))
        at--;
    for (int i = CTS_MAX_FRACTIONS - 1; i > at; i--) {
        v->share[i] = v->share[i - 1];
        v->voxel_label[i] = v->voxel_label[i - 1];
    }
    if (at < CTS_MAX_FRACTIONS) {
        v->share[at] = taken;
        v->voxel_label[at] = (uint16_t)voxel_label;
    }
}

/* Index of the plane's voxel at which a row of the scan begins, with its column *x0 in the volume; NULL: outside. */
static size_t row_at(const Painting *p, size_t plane, uint32_t row, int *x0)
{
    const CtsVoxelLabels *const l = p->voxel_labels;
    const int j = (int)(row % (uint32_t)p->labels->grid.rows) + (int)lround(p->at[plane][1]);
    *x0 = (int)lround(p->at[plane][0]);
    return j < 0 || j >= l->dims[1] ? SIZE_MAX : (size_t)j * (size_t)l->dims[0];
}

static uint32_t slice_row(const Painting *p, size_t plane)
{
    return ((uint32_t)p->first + (uint32_t)plane) * (uint32_t)p->labels->grid.rows;
}

/* Adds entries for a label's fractions in a plane, or, where all entries are known, assigns the fractions. */
static CtsStatus assign_fractions(const Painting *p, size_t plane, size_t voxel_label, bool known, Sharings *all)
{
    const CtsLabel *const l = &p->labels->items[p->label[voxel_label]];
    const size_t end = cts_label_find_share(l, slice_row(p, plane + 1));
    CtsStatus st = CTS_OK;
    for (size_t n = cts_label_find_share(l, slice_row(p, plane)); n < end && !st; n++) {
        const CtsLabelShare s = l->shares[n];
        int x0;
        const size_t row = row_at(p, plane, s.row, &x0), at = row + (size_t)(s.column + x0);
        if (row == SIZE_MAX || s.column + x0 < 0 || s.column + x0 >= p->voxel_labels->dims[0])
            continue;
        if (!all->number)
            st = cts_alloc_zeroed(&all->number, (size_t)p->voxel_labels->dims[0] * (size_t)p->voxel_labels->dims[1],
                                  NULL);
        if (!st && known)
            take_share(&all->items[all->number[at] - 1], voxel_label, s.share);
        else if (!st && !all->number[at] && !(st = cts_grow(&all->items, all->n, NULL))) {
            all->items[all->n] = (VoxelSharing){.voxel.at = (uint32_t)at, .left = CTS_WHOLE_SHARE};
            all->number[at] = (uint32_t)++all->n;
        }
    }
    return st;
}

/* Assigns voxels without a label, and the remainder of fractional ones. */
static void paint_runs(const Painting *p, size_t plane, size_t voxel_label, const Sharings *all)
{
    const CtsVoxelLabels *const l = p->voxel_labels;
    const CtsLabel *const label = &p->labels->items[p->label[voxel_label]];
    uint16_t *const voxels = l->voxel_label + plane * (size_t)l->dims[0] * (size_t)l->dims[1];
    const size_t n_end = cts_label_find_row(label, slice_row(p, plane + 1));
    for (size_t n = cts_label_find_row(label, slice_row(p, plane)); n < n_end; n++) {
        int x0;
        const size_t row = row_at(p, plane, label->runs[n].row, &x0);
        const int first = label->runs[n].first + x0, end = label->runs[n].end + x0;
        for (int i = first > 0 ? first : 0; row != SIZE_MAX && i < end && i < l->dims[0]; i++)
            if (all->number && all->number[row + (size_t)i])
                take_share(&all->items[all->number[row + (size_t)i] - 1], voxel_label, CTS_WHOLE_SHARE);
            else if (voxels[row + (size_t)i] == p->n)
                voxels[row + (size_t)i] = (uint16_t)voxel_label;
    }
}

/* Assigns the remainder to the unlabelled entry, and the voxel to its largest fraction. */
static CtsStatus end_plane(const Painting *p, size_t plane, Sharings *all)
{
    CtsVoxelLabels *const l = p->voxel_labels;
    CtsFractionalPlane *const shared = &l->shared[plane];
    const CtsStatus st = all->n ? cts_alloc_array(&shared->items, all->n, NULL) : CTS_OK;
    for (; !st && shared->n < all->n; shared->n++) {
        VoxelSharing *const s = &all->items[shared->n];
        take_share(s, p->n, CTS_WHOLE_SHARE);
        shared->items[shared->n] = s->voxel;
        l->voxel_label[plane * (size_t)l->dims[0] * (size_t)l->dims[1] + s->voxel.at] = s->voxel.voxel_label[0];
    }
    if (shared->n)
        qsort(shared->items, shared->n, sizeof *shared->items, cts_fractional_by_place);
    return st;
}

static void paint_planes(void *context, int worker, size_t begin, size_t end)
{
    const Painting *const p = context;
    const CtsVoxelLabels *const l = p->voxel_labels;
    const size_t in_plane = (size_t)l->dims[0] * (size_t)l->dims[1];
    (void)worker;
    for (size_t plane = begin; plane < end; plane++) {
        Sharings all = {.n = 0};
        CtsStatus st = CTS_OK;
        for (size_t i = 0; i < in_plane; i++)
            l->voxel_label[plane * in_plane + i] = (uint16_t)p->n;
        for (size_t n = 0; n < p->n && !st; n++)
            st = assign_fractions(p, plane, n, false, &all);
        for (size_t n = p->n; n-- > 0 && !st;) {
            st = assign_fractions(p, plane, p->order[n], true, &all);
            paint_runs(p, plane, p->order[n], &all);
        }
        p->status[plane] = st ? st : end_plane(p, plane, &all);
        free(all.items);
        cts_free(&all.number);
    }
}

/* On which slice, or between which two, each layer lies. */
static void place_layers(CtsVoxelLabels *l, double (*at)[3])
{
    int plane = 0;
    for (int k = 0; k < l->dims[2]; k++) {
        while (plane + 2 < l->n_planes && at[plane + 1][2] <= k + 1e-6)
            plane++;
        const double gap = plane + 1 < l->n_planes ? at[plane + 1][2] - at[plane][2] : 0;
        const double share = gap > 0 ? fmin(fmax((k - at[plane][2]) / gap, 0), 1) : 0;
        l->plane[k] = share > 1 - 1e-6 ? plane + 1 : plane;
        l->share[k] = share < 1e-6 || share > 1 - 1e-6 ? 0 : share;
    }
}

/* Position of each scanned slice in the volume: column and row of its first voxel, and its layer; and the slices that
 * the volume's layers lie on or between. */
static CtsStatus find_planes(const CtsLabelGrid *g, const CtsVolume *v, double (*at)[3], int *first, int *end,
                             CtsError *err)
{
    double inverse[3][3], away[3];
    if (!cts_volume_inverse(v, inverse))
        return cts_fail(err, CTS_ERR_INTERNAL, "the volume's steps do not span space");
    for (int k = 0; k < g->n_slices; k++) {
        cts_sub3(g->position_lps[k], v->origin_lps, away);
        cts_apply3(inverse, away, at[k]);
    }
    *first = 0;
    *end = g->n_slices;
    while (*first + 1 < *end && at[*first + 1][2] <= 1e-6)
        ++*first;
    while (*end - 1 > *first && at[*end - 2][2] >= v->dims[2] - 1 - 1e-6)
        --*end;
    return CTS_OK;
}

CtsStatus cts_labels_to_volume(const CtsLabels *labels, const size_t *label, const size_t *order, size_t n,
                               CtsModel *model, int n_threads, CtsError *err)
{
    const size_t n_slices = (size_t)labels->grid.n_slices;
    const CtsVolume *const v = model->volume;
    double(*at)[3] = NULL;
    Painting p = {.labels = labels, .label = label, .order = order, .n = n};
    int end = 0;
    CtsStatus st = cts_alloc_array(&at, n_slices, err);
    if (!st && !(st = cts_alloc_zeroed(&p.status, n_slices, err)) &&
        !(st = find_planes(&labels->grid, v, at, &p.first, &end, err)) &&
        !(st = cts_voxel_labels_new(&model->voxel_labels, v, (int)n + 1, end - p.first, err))) {
        p.voxel_labels = model->voxel_labels;
        p.at = at + p.first;
        place_layers(model->voxel_labels, p.at);
        cts_parallel(cts_threads(n_threads), (size_t)model->voxel_labels->n_planes, 1, paint_planes, &p);
        for (int plane = 0; plane < model->voxel_labels->n_planes && !st; plane++)
            st = p.status[plane] ? cts_fail(err, p.status[plane], "out of memory") : CTS_OK;
    }
    cts_free(&at);
    cts_free(&p.status);
    return st;
}
