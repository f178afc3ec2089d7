#include "core/model/voxel_labels.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "core/model/macrocells.h"
#include "core/volume/volume_new.h"
#include <stdlib.h>

CtsStatus cts_voxel_labels_new(CtsVoxelLabels **voxel_labels, const CtsVolume *volume, int n, int n_planes,
                               CtsError *err)
{
    const size_t in_plane = (size_t)volume->dims[0] * (size_t)volume->dims[1];
    size_t n_voxels, n_blocks = 1;
    CtsStatus st = cts_alloc_zeroed(voxel_labels, 1, err);
    if (st)
        return st;
    CtsVoxelLabels *const l = *voxel_labels;
    l->n = n;
    l->n_planes = n_planes;
    for (int a = 0; a < 3; a++) {
        const int n_cells = volume->dims[a] > 1 ? volume->dims[a] - 1 : 1;
        l->dims[a] = volume->dims[a];
        l->n_block[a] = (n_cells + CTS_FINE_MACROCELL - 1) / CTS_FINE_MACROCELL;
        n_blocks *= (size_t)l->n_block[a];
    }
    if (cts_mul_overflows(in_plane, (size_t)n_planes, &n_voxels))
        st = cts_fail(err, CTS_ERR_MEMORY, "labels of %d slices are too many", n_planes);
    if (st || (st = cts_alloc_array(&l->voxel_label, n_voxels, err)) ||
        (st = cts_alloc_zeroed(&l->shared, (size_t)n_planes, err)) ||
        (st = cts_alloc_zeroed(&l->plane, (size_t)l->dims[2], err)) ||
        (st = cts_alloc_zeroed(&l->share, (size_t)l->dims[2], err)) ||
        (st = cts_alloc_zeroed(&l->appearance, (size_t)n, err)) || (st = cts_alloc_zeroed(&l->name, (size_t)n, err)) ||
        (st = cts_alloc_zeroed(&l->number, (size_t)n, err)) || (st = cts_alloc_array(&l->block, n_blocks + 3, err)))
        cts_voxel_labels_free(voxel_labels);
    return st;
}

void cts_voxel_labels_free(CtsVoxelLabels **voxel_labels)
{
    CtsVoxelLabels *const l = *voxel_labels;
    if (!l)
        return;
    for (int i = 0; i < l->n_appearances; i++)
        free(l->appearances[i].preset);
    free(l->appearances);
    for (int i = 0; l->name && i < l->n; i++)
        free(l->name[i]);
    cts_free(&l->name);
    cts_free(&l->number);
    cts_free(&l->voxel_label);
    for (int p = 0; l->shared && p < l->n_planes; p++)
        cts_free(&l->shared[p].items);
    cts_free(&l->shared);
    cts_free(&l->is_shared);
    cts_free(&l->plane);
    cts_free(&l->share);
    cts_free(&l->appearance);
    cts_free(&l->on_skin);
    cts_free(&l->block);
    cts_model_free(&l->shown);
    cts_free(voxel_labels);
}

void cts_appearance_preset(const CtsAppearance *appearance, const CtsPreset *picture, CtsPreset *preset)
{
    *preset = appearance->preset ? *appearance->preset : *picture;
    if (appearance->opacity >= 0) {
        preset->n_opacity = 1;
        preset->opacity[0] = (CtsOpacityPoint){0, appearance->opacity};
        preset->unit_distance_mm = 1;
    }
    if (appearance->tinted) {
        preset->n_colour = 1;
        preset->colour[0] = (CtsColourPoint){0, {appearance->rgb[0], appearance->rgb[1], appearance->rgb[2]}};
    }
}

/* State of the loops over layers and blocks. */
typedef struct Finishing {
    CtsVoxelLabels *voxel_labels;
    const CtsVolume *volume;
} Finishing;

/* The common appearance of the labels of n x n x n cells, or CTS_APPEARANCES_DIFFER. */
static int appearance_of_cells(const CtsVoxelLabels *l, const int first[3], int n)
{
    const size_t nx = (size_t)l->dims[0], ny = (size_t)l->dims[1];
    int last[3];
    for (int a = 0; a < 3; a++)
        last[a] = first[a] + n < l->dims[a] ? first[a] + n : l->dims[a] - 1;
    const int p0 = l->plane[first[2]], end = l->plane[last[2]] + (l->share[last[2]] > 0);
    const size_t first_at = ((size_t)p0 * ny + (size_t)first[1]) * nx + (size_t)first[0];
    const uint16_t *const one = &l->voxel_label[first_at];
    const int appearance = cts_appearance_of_scanned_voxel(l, first_at), n_i = last[0] - first[0] + 1,
              n_j = last[1] - first[1] + 1;
    for (int p = 0; p <= end - p0; p++)
        for (int j = 0; j < n_j; j++) {
            const uint16_t *const row = one + ((size_t)p * ny + (size_t)j) * nx;
            for (int i = 0; i < n_i; i++)
                if ((row[i] != *one || l->is_shared) &&
                    cts_appearance_of_scanned_voxel(l, (size_t)(row + i - l->voxel_label)) != appearance)
                    return CTS_APPEARANCES_DIFFER;
        }
    return appearance;
}

int cts_appearance_of_cell(const CtsVoxelLabels *l, const int cell[3])
{
    return appearance_of_cells(l, cell, 1);
}

static void find_label_blocks(void *context, int worker, size_t begin, size_t end)
{
    const Finishing *const f = context;
    CtsVoxelLabels *const l = f->voxel_labels;
    (void)worker;
    for (size_t row = begin; row < end; row++)
        for (int b = 0; b < l->n_block[0]; b++) {
            const int first[3] = {b * CTS_FINE_MACROCELL, (int)(row % (size_t)l->n_block[1]) * CTS_FINE_MACROCELL,
                                  (int)(row / (size_t)l->n_block[1]) * CTS_FINE_MACROCELL};
            l->block[row * (size_t)l->n_block[0] + (size_t)b] =
                (uint8_t)appearance_of_cells(l, first, CTS_FINE_MACROCELL);
        }
}

static void show_layers(void *context, int worker, size_t begin, size_t end)
{
    const Finishing *const f = context;
    const CtsVoxelLabels *const l = f->voxel_labels;
    const size_t nx = (size_t)l->dims[0], ny = (size_t)l->dims[1];
    (void)worker;
    for (size_t k = begin; k < end; k++)
        for (size_t j = 0; j < ny; j++) {
            const size_t at = (k * ny + j) * nx;
            for (size_t i = 0; i < nx; i++) {
                const int appearance = cts_appearance_of_voxel(l, (int)i, (int)j, (int)k);
                l->shown.volume->grey[at + i] = appearance == CTS_APPEARANCE_HIDDEN ? 0 : f->volume->grey[at + i];
            }
        }
}

/* Ranges of visible values, from the volume's: where appearances differ, air may be adjacent to any value. */
static CtsStatus show_macrocells(CtsVoxelLabels *l, const CtsMacrocells *all, CtsError *err)
{
    const CtsStatus st = cts_macrocells_new_unset(&l->shown.macrocells, l->dims, err);
    const size_t n = (size_t)l->n_block[0] * (size_t)l->n_block[1] * (size_t)l->n_block[2];
    CtsMacrocells *const m = l->shown.macrocells;
    for (size_t i = 0; !st && i < n; i++)
        m->fine[i] = l->block[i] == CTS_APPEARANCE_HIDDEN    ? (CtsRange){0, 0}
                     : l->block[i] == CTS_APPEARANCES_DIFFER ? (CtsRange){0, all->fine[i].high}
                                                             : all->fine[i];
    if (!st)
        cts_macrocells_sum(m);
    return st;
}

static CtsStatus make_shown(const CtsModel *model, int n_threads, CtsError *err)
{
    CtsVoxelLabels *const l = model->voxel_labels;
    const Finishing f = {l, model->volume};
    const CtsStatus st = cts_volume_new_like(&l->shown.volume, model->volume, l->dims[2], err);
    if (st)
        return st;
    cts_parallel(n_threads, (size_t)l->dims[2], 1, show_layers, (void *)&f);
    return show_macrocells(l, model->macrocells, err);
}

static CtsStatus mark_shared(CtsVoxelLabels *l, CtsError *err)
{
    const size_t in_plane = (size_t)l->dims[0] * (size_t)l->dims[1];
    CtsStatus st = CTS_OK;
    for (int p = 0; p < l->n_planes && !st; p++) {
        if (l->shared[p].n && !l->is_shared)
            st = cts_alloc_zeroed(&l->is_shared, in_plane * (size_t)l->n_planes / 64 + 1, err);
        for (size_t i = 0; i < l->shared[p].n && !st; i++) {
            const size_t at = (size_t)p * in_plane + l->shared[p].items[i].at;
            l->is_shared[at / 64] |= UINT64_C(1) << at % 64;
        }
    }
    return st;
}

CtsStatus cts_voxel_labels_finish(CtsModel *model, int n_threads, CtsError *err)
{
    CtsVoxelLabels *const l = model->voxel_labels;
    Finishing f = {l, model->volume};
    bool hides = false;
    CtsStatus st = mark_shared(l, err);
    if (st || (st = cts_model_prepare(model, n_threads, err)) ||
        (st = cts_voxel_labels_find_skin(l, model->volume, n_threads, err)))
        return st;
    cts_parallel(cts_threads(n_threads), (size_t)l->n_block[1] * (size_t)l->n_block[2], 16, find_label_blocks, &f);
    for (int i = 0; i < l->n; i++)
        hides |= l->appearance[i] == CTS_APPEARANCE_HIDDEN;
    return hides && !CTS_MUTATED(HIDING) ? make_shown(model, cts_threads(n_threads), err) : CTS_OK;
}
