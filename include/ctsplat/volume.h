/* A volume as grey levels, with its place in the patient. */
#pragma once

#include "ctsplat/quantity.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_API_BEGIN

/* Plain data; created by cts_volume_new() or cts_series_load(), freed by cts_volume_free(). Voxel (i, j, k) is grey[(k
 * * dims[1] + j) * dims[0] + i]; its centre lies at origin_lps + i * step_lps[0] + j * step_lps[1] + k * step_lps[2]
 * (patient coordinates, LPS, mm). The steps need not be orthogonal: a stack with gantry tilt keeps its true shear. */
typedef struct CtsVolume {
    int dims[3]; /* columns, rows, slices; each 1 or more */
    uint16_t *grey;
    double origin_lps[3];
    double step_lps[3][3];
    CtsModality modality;
    /* Names with "hu", here and wherever values of a volume are meant, stand for its quantity. */
    CtsQuantity quantity;
    /* Value = hu_offset + hu_step * grey. Of HU usually -1024 and 1; hu_step is a negative power of two for a
     * fractional rescale slope. Of another quantity its lowest value, and 1, 2 or 5 times a power of ten. Grey 0 is air
     * or padding, the paper's invalid data. */
    double hu_offset, hu_step;
    /* Of a quantity other than HU, measured on the scanned voxels before crop, smoothing and labels: the level of air,
     * Otsu's threshold between air and the rest, and the 99.5th percentile of the rest. A relative preset's 0 is
     * air_value, its 1 bright_value. All 0: not measured. */
    double air_value, air_limit, bright_value;
    /* Number of layers from one scanned slice to the next: 1, or more where layers were interpolated. Gradients along
     * the slice axis are taken over this distance, since interpolated layers contain no measured detail. */
    int slice_layers;
    double hu_min, hu_max; /* of the pixels as stored, padding left out, before anything was clamped */
    /* Voxels of grey 0 along each axis around the stored ones, as cts_volume_crop_air(), cts_table_crop() or
     * cts_scanned_box() counted them. The volume's box, centre and diagonal contain them, and so do frames, the blocks
     * of the field of occlusion and histograms; indices of voxels begin at the stored ones. */
    int air_before[3], air_behind[3];
} CtsVolume;

/* A volume of zeros with unit spacing, HU = grey - 1024. Refuses sizes below 1 and products past SIZE_MAX. */
CtsStatus cts_volume_new(CtsVolume **volume, int nx, int ny, int nz, CtsError *err);
void cts_volume_free(CtsVolume **volume);

size_t cts_volume_n_voxels(const CtsVolume *volume);
/* HU of grey level 0 where all bits of it are used: the least HU of scanners' 12-bit scale; lower HU and padding become
 * it. */
#define CTS_LEAST_HU (-1024.0)
static inline double cts_volume_hu(const CtsVolume *v, uint16_t grey)
{
    return v->hu_offset + v->hu_step * grey;
}

/* Voxels along an axis, stored or air. */
static inline int cts_volume_extent(const CtsVolume *v, int axis)
{
    return v->air_before[axis] + v->dims[axis] + v->air_behind[axis];
}

/* Length of step_lps[axis] in mm. */
double cts_volume_spacing_mm(const CtsVolume *volume, int axis);
/* Centre of the box that holds the outermost voxel centres, and its longest diagonal. */
void cts_volume_centre_lps(const CtsVolume *volume, double centre_lps[3]);
double cts_volume_diagonal_mm(const CtsVolume *volume);
/* The box along the patient's axes that contains all voxel centres, as used by cts_volume_crop(). */
void cts_volume_box_lps(const CtsVolume *volume, double low_lps[3], double high_lps[3]);
/* Continuous voxel coordinates of a point, and the inverse of the step matrix: vox[a] = sum_c inverse[a][c] * lps[c].
 * False when the steps do not span space. */
int cts_volume_inverse(const CtsVolume *volume, double inverse[3][3]);

/* Keeps the voxels whose centres lie in [lo, hi] (LPS mm); others become air, and the volume shrinks to the box, with
 * no air counted around it. first: the voxel that becomes voxel (0, 0, 0); may be NULL. CTS_ERR_USAGE when it is
 * empty. */
CtsStatus cts_volume_crop(CtsVolume *volume, const double lo_lps[3], const double hi_lps[3], int first[3],
                          CtsError *err);

/* Shrinks to the box of the voxels above grey 0, with a margin for gradients and the field of occlusion; the others are
 * counted as air around it. first: as above. A volume of air alone is unchanged. cts_render_ignores_air() says for
 * which pictures. */
void cts_volume_crop_air(CtsVolume *volume, int first[3]);

/* Gives back the memory behind the last voxel that crops have left for layers. */
void cts_volume_fit_memory(CtsVolume *volume);

/* Number of layers per slice distance that makes voxels nearly cubes: 1 where slices lie no further apart than one and
 * a half pixels, at most 8. */
int cts_volume_layers_per_slice(const CtsVolume *volume);

/* Interpolation between slices: cubics along the slice axis (Catmull and Rom 1974), clamped to the range of the two
 * slices; shape-based where a surface moves by more than the width of its edge, elsewhere cubic; linear. */
typedef enum CtsInterpolation {
    CTS_INTERPOLATION_SHAPE,
    CTS_INTERPOLATION_CUBIC,
    CTS_INTERPOLATION_LINEAR,
    CTS_N_INTERPOLATIONS
} CtsInterpolation;

/* Evenly spaced layers by linear interpolation between slices, which are read without being stored. */
typedef struct CtsLinearLayers {
    const uint16_t *slices; /* one after the other */
    int n_slices;
    const double *layer; /* position of each in layers, rising from 0 */
} CtsLinearLayers;

/* Statistics of layers between slices, as far as they are not linear. */
typedef struct CtsInterpolationCounts {
    uint64_t n_voxels, n_moved;   /* of layers between slices, and those of them that were moved */
    double sum_of_differences_hu; /* between those and straight lines from slice to slice */
    bool no_memory;               /* for moving any */
} CtsInterpolationCounts;

/* Inserts n_parts - 1 layers between any two slices, by cubic or shape-based interpolation: grey levels at the slices
 * are unchanged. n_parts 1 changes nothing. n_threads 0: all cores; threads never change the result. Adds to *made. On
 * CTS_ERR_MEMORY the volume is unchanged. */
CtsStatus cts_volume_interpolate(CtsVolume *volume, int n_parts, CtsInterpolation how, int n_threads,
                                 CtsInterpolationCounts *made, CtsError *err);

/* Smooths the grey levels with a Gaussian of this standard deviation, 0 to CTS_MAX_SMOOTH_MM, along all three axes;
 * each axis rounds to whole grey levels. Border voxels are continued outside. Threads never change the result. */
enum { CTS_MAX_SMOOTH_MM = 20 };
CtsStatus cts_volume_smooth(CtsVolume *volume, double sd_mm, int n_threads, CtsError *err);

/* A copy with the window's HU mapped to 2^bits grey levels, as the paper's pictures of 8 bits have it: below the window
 * 0, above it the largest, whichever end is black. CTS_ERR_USAGE for an empty window. Free with cts_volume_free(). */
CtsStatus cts_volume_quantise(const CtsVolume *volume, int bits, double black_hu, double white_hu, int n_threads,
                              CtsVolume **quantised, CtsError *err);

/* Voxels by grey level, stored or air, 65536 exact counts, for any number of threads (0: all cores). Free with
 * cts_volume_histogram_free(). */
CtsStatus cts_volume_histogram(const CtsVolume *volume, int n_threads, uint64_t **count, CtsError *err);
void cts_volume_histogram_free(uint64_t **count);

CTS_API_END
