/* Labels that may contain skin: tissue that rays from the air around the body reach first. Tested along two axes of the
 * volume, since the body is cut at its ends along the third, where enclosed air may be open. */
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/model/voxel_labels.h"
#include "core/volume/box.h"
#include "core/volume/threshold.h"
#include <math.h>
#include <string.h>

/* HU: between air, blankets and foam below it, and fat above. */
static const double tissue_hu = -500;
/* Depth of skin including its blurred edge; and thickness of a holder, a cloth or an ear behind which skin may be
 * visible. A chest wall is thicker. */
static const double skin_mm = 3, thin_mm = 5;

/* Every second line along either axis: skin that few lines meet is no face. */
enum { EVERY = 2 };

typedef struct SkinSearch {
    const CtsVoxelLabels *voxel_labels;
    const CtsVolume *volume;
    uint16_t tissue; /* grey level from which on a voxel is tissue */
    int axis[3];     /* across the body twice, and along it */
    bool *on_skin;   /* of each worker, for each label */
} SkinSearch;

/* Follows one line from its first voxel, at `at`, in the direction of sign. */
static void follow_to_tissue(const SkinSearch *s, const int at[3], int axis, int sign, bool *on_skin)
{
    const CtsVolume *const v = s->volume;
    const ptrdiff_t strides[3] = {1, v->dims[0], (ptrdiff_t)v->dims[0] * v->dims[1]}, stride = sign * strides[axis];
    const uint16_t *grey = v->grey + at[0] + at[1] * strides[1] + at[2] * strides[2];
    const double step_mm = cts_volume_spacing_mm(v, axis);
    const int n = v->dims[axis], n_skin = 1 + (int)(skin_mm / step_mm), n_thin = (int)(thin_mm / step_mm);
    int voxel[3] = {at[0], at[1], at[2]};
    if (*grey >= s->tissue)
        return; /* tissue cut by the volume's border */
    for (int i = 0, run = 0; i < n; i++, grey += stride) {
        const bool is_tissue = *grey >= s->tissue;
        if (run > 0 && !is_tissue && run > n_thin)
            return;
        run = is_tissue ? run + 1 : 0;
        if (run > n_skin && run > n_thin)
            return;
        voxel[axis] = at[axis] + sign * i;
        if (run > 0 && run <= n_skin)
            on_skin[cts_label_of_voxel(s->voxel_labels, voxel[0], voxel[1], voxel[2])] = true;
    }
}

static void search_layers(void *context, int worker, size_t begin, size_t end)
{
    const SkinSearch *const s = context;
    const int *const dims = s->volume->dims;
    bool *const on_skin = s->on_skin + (size_t)worker * (size_t)s->voxel_labels->n;
    for (size_t k = EVERY * begin; k < EVERY * end && k < (size_t)dims[s->axis[2]]; k += EVERY)
        for (int a = 0; a < 2; a++)
            for (int line = 0; line < dims[s->axis[1 - a]]; line += EVERY) {
                int at[3];
                at[s->axis[2]] = (int)k;
                at[s->axis[1 - a]] = line;
                at[s->axis[a]] = 0;
                follow_to_tissue(s, at, s->axis[a], 1, on_skin);
                at[s->axis[a]] = dims[s->axis[a]] - 1;
                follow_to_tissue(s, at, s->axis[a], -1, on_skin);
            }
}

CtsStatus cts_voxel_labels_find_skin(CtsVoxelLabels *l, const CtsVolume *v, int n_threads, CtsError *err)
{
    const int n_workers = cts_threads(n_threads);
    SkinSearch s = {.voxel_labels = l, .volume = v};
    const double tissue = ceil((tissue_hu - v->hu_offset) / v->hu_step);
    s.tissue = v->quantity == CTS_QUANTITY_HU ? (uint16_t)fmin(fmax(tissue, 1), UINT16_MAX) /* 0 is air or padding */
                                              : cts_dense_grey(v);
    cts_volume_section_axes(v, s.axis);
    CtsStatus st = cts_alloc_zeroed(&s.on_skin, (size_t)n_workers * (size_t)l->n, err);
    if (!st && !(st = cts_alloc_zeroed(&l->on_skin, (size_t)l->n, err))) {
        cts_parallel(n_workers, ((size_t)v->dims[s.axis[2]] + EVERY - 1) / EVERY, 1, search_layers, &s);
        for (size_t i = 0; i < (size_t)n_workers * (size_t)l->n; i++)
            l->on_skin[i % (size_t)l->n] |= s.on_skin[i];
        l->on_skin[l->n - 1] = true;
    }
    cts_free(&s.on_skin);
    return st;
}
