#include "engine/tiled/appearance_tables.h"

#include "base/mem.h"

static CtsStatus init_appearance(TiledAppearances *appearances, const CtsScene *scene, int appearance, CtsError *err)
{
    CtsScene own = *scene;
    CtsPreset preset = {.unit_distance_mm = 1};
    const CtsAppearance *const a = &appearances->voxel_labels->appearances[appearance];
    CtsStatus st = CTS_OK;
    if (appearance != CTS_APPEARANCE_HIDDEN)
        cts_appearance_preset(a, scene->preset, &preset);
    if (appearance != CTS_APPEARANCE_HIDDEN && (a->preset || a->opacity >= 0))
        st = cts_lut_new(&appearances->own[appearance], &preset, scene->volume, NULL, scene->extinction_scale, err);
    if (st)
        return st;
    own.preset = &preset;
    cts_tiled_transfer_init(&appearances->transfer[appearance], &own);
    return CTS_OK;
}

CtsStatus cts_tiled_appearances_init(TiledAppearances *appearances, const CtsScene *scene, CtsError *err)
{
    const CtsVoxelLabels *const voxel_labels = scene->model->voxel_labels;
    CtsStatus st;
    *appearances = (TiledAppearances){.voxel_labels = voxel_labels, .n = voxel_labels->n_appearances};
    if (!(st = cts_alloc_array(&appearances->transfer, (size_t)appearances->n, err)))
        st = cts_alloc_zeroed(&appearances->own, (size_t)appearances->n, err);
    for (int l = 0; !st && l < appearances->n; l++)
        st = init_appearance(appearances, scene, l, err);
    if (st)
        cts_tiled_appearances_free(appearances);
    return st;
}

void cts_tiled_appearances_free(TiledAppearances *appearances)
{
    for (int l = 0; appearances->own && l < appearances->n; l++)
        cts_lut_free(&appearances->own[l]);
    cts_free(&appearances->transfer);
    cts_free(&appearances->own);
}
