/* Openness: share of the light from all sides that reaches a place, 0 to 1. A field of its own, independent of the
 * view, that darkens folds (ambient occlusion).
 *
 * The volume is cut into blocks of about 2.5 mm, from its first voxel on, stored or air. A block's extinction is the
 * mean of the preset's over its voxels. From a block's centre 26 directions lead through the centres of the neighbours
 * by face, edge and corner, in steps of s mm, K = round(35 / s) - 1 of them; T_k is the transmittance of the first k
 * blocks, the block itself not among them, each s mm long, and beyond the volume nothing absorbs. A direction's
 * openness is the mean of T_0 = 1 to T_K: what absorbs at r mm weighs 1 - r / 35. The block's is the mean over the
 * directions, in steps of 1/255, and lies at the middle of its n x n x n voxels; between the middles it is trilinear,
 * beyond the outermost it is constant.
 */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/preset.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <stdint.h>

typedef struct CtsOpenness {
    int n[3];                  /* blocks along each volume axis */
    int size[3];               /* voxels of a block */
    int air[3];                /* those of the first block that are air before the volume's stored voxels */
    double scale[3], shift[3]; /* block coordinate = voxel coordinate * scale + shift */
    int plane;                 /* blocks from one to the next along axis 2; 0 where there is one */
    /* Openness in 1/255 of block (i, j, k), lowest byte, and of its neighbours at i + 1, j + 1 and both, at
     * [(k * n[1] + j) * n[0] + i]. */
    uint32_t *square;
} CtsOpenness;

/* Makes the field for what the preset shows of the volume; hidden labels count as air, labels with a preset or an
 * opacity of their own have that. Only the preset's opacities matter. */
CtsStatus cts_openness_new(CtsOpenness **openness, const CtsModel *model, const CtsPreset *preset, int n_threads,
                           CtsError *err);
void cts_openness_free(CtsOpenness **openness);

/* True where the preset has light that openness dims. */
static inline bool cts_openness_counts(const CtsPreset *preset)
{
    return preset->mode == CTS_MODE_COMPOSITE && preset->shade && preset->occlusion > 0;
}
/* The same, reported as a stage; *openness stays NULL where it does not count. */
CtsStatus cts_openness_of_scene(CtsOpenness **openness, const CtsModel *model, const CtsPreset *preset, int n_threads,
                                CtsReport *report, CtsError *err);

/* At a place in voxel coordinates. */
double cts_openness_at(const CtsOpenness *openness, const double vox[3]);
