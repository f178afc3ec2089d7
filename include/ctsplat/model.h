/* A CT volume and what was found out about its voxels: the input of rendering. */
#pragma once

#include "ctsplat/volume.h"

CTS_API_BEGIN

struct CtsMacrocells;  /* src/core/model/macrocells.h */
struct CtsBodyMask;    /* src/core/model/body_mask.h */
struct CtsVoxelLabels; /* src/core/model/voxel_labels.h */

/* Plain data, and a volume alone is a model: (CtsModel){.volume = volume}. The functions below keep its parts
 * consistent; after other changes of the volume call cts_model_changed(). */
typedef struct CtsModel {
    CtsVolume *volume;
    /* Ranges of grey levels by macro-cell, for engines with empty-space skipping; NULL: computed by each renderer. Set
     * by cts_model_prepare(). */
    struct CtsMacrocells *macrocells;
    /* The inside of the patient's body, for minip and average; NULL: everything. Set by cts_model_remove_table(). */
    struct CtsBodyMask *body;
    /* Assignment of voxels to labels, with their appearances; NULL: one appearance for all. Set by
     * cts_model_take_labels(). */
    struct CtsVoxelLabels *voxel_labels;
} CtsModel;

/* Frees all parts, the volume too. */
void cts_model_free(CtsModel *model);

/* Computes the macro-cells once, before several pictures of one model; n_threads 0: all cores. */
CtsStatus cts_model_prepare(CtsModel *model, int n_threads, CtsError *err);
/* Frees what depends on grey levels and dimensions: macro-cells, and the assignment of voxels to labels. */
void cts_model_changed(CtsModel *model);

/* As the functions of the volume (ctsplat/volume.h); the body mask keeps its place. */
CtsStatus cts_model_crop(CtsModel *model, const double lo_lps[3], const double hi_lps[3], CtsError *err);
void cts_model_crop_air(CtsModel *model);
CtsStatus cts_model_smooth(CtsModel *model, double sd_mm, int n_threads, CtsError *err);
CtsStatus cts_model_interpolate(CtsModel *model, int n_parts, CtsInterpolation how, int n_threads,
                                CtsInterpolationCounts *made, CtsError *err);

CTS_API_END
