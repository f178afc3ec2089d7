#include "ctsplat/model.h"

#include "base/cpu.h"
#include "core/model/body_mask.h"
#include "core/model/macrocells.h"
#include "core/model/voxel_labels.h"

void cts_model_free(CtsModel *model)
{
    cts_model_changed(model);
    cts_body_mask_free(&model->body);
    cts_volume_free(&model->volume);
}

CtsStatus cts_model_prepare(CtsModel *model, int n_threads, CtsError *err)
{
    return model->macrocells ? CTS_OK
                             : cts_macrocells_new(&model->macrocells, model->volume, cts_threads(n_threads), err);
}

void cts_model_changed(CtsModel *model)
{
    cts_macrocells_free(&model->macrocells);
    cts_voxel_labels_free(&model->voxel_labels);
}

/* After a crop: voxel first[] has become voxel (0, 0, 0). */
static void begin_at(CtsModel *model, const int first[3])
{
    for (int axis = 0; model->body && axis < 3; axis++)
        model->body->first[axis] += first[axis];
    cts_model_changed(model);
}

CtsStatus cts_model_crop(CtsModel *model, const double lo_lps[3], const double hi_lps[3], CtsError *err)
{
    int first[3];
    const CtsStatus st = cts_volume_crop(model->volume, lo_lps, hi_lps, first, err);
    if (!st)
        begin_at(model, first);
    return st;
}

void cts_model_crop_air(CtsModel *model)
{
    int first[3];
    cts_volume_crop_air(model->volume, first);
    begin_at(model, first);
}

CtsStatus cts_model_smooth(CtsModel *model, double sd_mm, int n_threads, CtsError *err)
{
    cts_model_changed(model);
    return cts_volume_smooth(model->volume, sd_mm, n_threads, err);
}

CtsStatus cts_model_interpolate(CtsModel *model, int n_parts, CtsInterpolation how, int n_threads,
                                CtsInterpolationCounts *made, CtsError *err)
{
    const CtsStatus st = cts_volume_interpolate(model->volume, n_parts, how, n_threads, made, err);
    if (st || n_parts <= 1)
        return st;
    if (model->body)
        cts_body_mask_refine(model->body, n_parts);
    cts_model_changed(model);
    return CTS_OK;
}
