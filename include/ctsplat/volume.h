/* A CT volume as grey levels, with its place in the patient. */
#ifndef CTSPLAT_VOLUME_H
#define CTSPLAT_VOLUME_H

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_API_BEGIN

struct CtsMacrocells; /* src/core/volume/macrocells.h */
struct CtsBodyMask;   /* src/core/volume/body_mask.h */
struct CtsOwners;     /* src/core/volume/owners.h */

/* Plain data; made by cts_volume_new() or cts_series_load(), freed by cts_volume_free().
 * Voxel (i, j, k) stands at grey[(k * dims[1] + j) * dims[0] + i]; its centre lies at
 * origin_lps + i * step_lps[0] + j * step_lps[1] + k * step_lps[2] (patient coordinates, LPS, mm).
 * The steps need not be orthogonal: a stack with gantry tilt keeps its true shear. */
typedef struct CtsVolume {
    int dims[3]; /* columns, rows, slices; each 1 or more */
    uint16_t *grey;
    double origin_lps[3];
    double step_lps[3][3];
    /* HU = hu_offset + hu_step * grey. Usually -1024 and 1; hu_step is a negative power of two for a fractional
     * rescale slope. Grey 0 is air or padding, the paper's invalid data. */
    double hu_offset, hu_step;
    /* How many layers go from one slice as it was scanned to the next: 1, or more where layers were put between them.
     * Over that distance gradients are taken along the slice axis, since what lies between two slices was never
     * measured. */
    int slice_layers;
    double hu_min, hu_max; /* of the pixels as stored, padding left out, before anything was clamped */
    /* Ranges of grey levels by macro-cell, for engines that skip what is void; NULL where nobody has made them. Whoever
     * changes grey calls cts_volume_changed(). */
    struct CtsMacrocells *macrocells;
    /* The inside of the patient's body, which minip and average look at; NULL: everything. Made by
     * cts_volume_remove_table(). */
    struct CtsBodyMask *body;
    /* Which label owns each voxel, and how it looks; NULL: all look alike. Made by cts_volume_take_labels(), after all
     * that changes the volume; owned. */
    struct CtsOwners *owners;
} CtsVolume;

/* A volume of zeros with unit spacing, HU = grey - 1024. Refuses sizes below 1 and products past SIZE_MAX. */
CtsStatus cts_volume_new(CtsVolume **volume, int nx, int ny, int nz, CtsError *err);
void cts_volume_free(CtsVolume **volume);

/* Make the macro-cells once, before several pictures of one volume; n_threads 0: all cores. */
CtsStatus cts_volume_prepare(CtsVolume *volume, int n_threads, CtsError *err);
/* Forget what was derived from the grey levels. */
void cts_volume_changed(CtsVolume *volume);

size_t cts_volume_n_voxels(const CtsVolume *volume);
static inline double cts_volume_hu(const CtsVolume *v, uint16_t grey)
{
    return v->hu_offset + v->hu_step * grey;
}

/* Length of step_lps[axis] in mm. */
double cts_volume_spacing_mm(const CtsVolume *volume, int axis);
/* Centre of the box that holds the outermost voxel centres, and its longest diagonal. */
void cts_volume_centre_lps(const CtsVolume *volume, double centre_lps[3]);
double cts_volume_diagonal_mm(const CtsVolume *volume);
/* The box along the patient's axes that holds all voxel centres: what cts_volume_crop() takes. */
void cts_volume_box_lps(const CtsVolume *volume, double low_lps[3], double high_lps[3]);
/* Continuous voxel coordinates of a point, and the inverse of the step matrix: vox[a] = sum_c inverse[a][c] * lps[c].
 * False when the steps do not span space. */
int cts_volume_inverse(const CtsVolume *volume, double inverse[3][3]);

/* Keep the voxels whose centres lie in [lo, hi] (LPS mm); others become air, and the volume shrinks to what is left.
 * CTS_ERR_USAGE when nothing is left. */
CtsStatus cts_volume_crop(CtsVolume *volume, const double lo_lps[3], const double hi_lps[3], CtsError *err);

/* How many layers each slice distance is worth, so that voxels come near to cubes: 1 where slices lie no further apart
 * than one and a half pixels, at most 8. */
int cts_volume_thickness(const CtsVolume *volume);

/* What comes between slices: cubics along the slice axis (Catmull and Rom 1974), which pass nothing that their two
 * slices have; in shape what moves from slice to slice by more than its own edge is moved, and else they are cubics;
 * linear. */
typedef enum CtsInterpolation {
    CTS_INTERPOLATION_SHAPE,
    CTS_INTERPOLATION_CUBIC,
    CTS_INTERPOLATION_LINEAR,
    CTS_N_INTERPOLATIONS
} CtsInterpolation;

/* What of layers between slices no blend of what lies above and below is. */
typedef struct CtsMadeUp {
    uint64_t n_voxels, n_moved;   /* of layers between slices, and those of them that were moved */
    double sum_of_differences_hu; /* between those and straight lines from slice to slice */
    bool no_memory;               /* for moving any */
} CtsMadeUp;

/* Puts n_parts - 1 layers between any two slices, by cubics or by shape: grey levels at the slices stay what they were.
 * n_parts 1 changes nothing. n_threads 0: all cores; threads never change the result. Adds to *made. On CTS_ERR_MEMORY
 * the volume is as it was. */
CtsStatus cts_volume_refine(CtsVolume *volume, int n_parts, CtsInterpolation how, int n_threads, CtsMadeUp *made,
                            CtsError *err);

/* Smooths the grey levels with a Gaussian of this standard deviation, 0 to CTS_MAX_SMOOTH_MM, along all three axes;
 * each axis rounds to whole grey levels. Beyond the border the last voxel goes on. Threads never change the result. */
enum { CTS_MAX_SMOOTH_MM = 20 };
CtsStatus cts_volume_smooth(CtsVolume *volume, double sd_mm, int n_threads, CtsError *err);

/* A copy with the window's HU mapped to 2^bits grey levels, as the paper's pictures of 8 bits have it: below the window
 * 0, above it the largest. CTS_ERR_USAGE for an empty window. Free with cts_volume_free(). */
CtsStatus cts_volume_quantise(const CtsVolume *volume, int bits, double low_hu, double high_hu, int n_threads,
                              CtsVolume **quantised, CtsError *err);

/* Voxels by grey level, 65536 exact counts, for any number of threads (0: all cores). Free with
 * cts_volume_histogram_free(). */
CtsStatus cts_volume_histogram(const CtsVolume *volume, int n_threads, uint64_t **count, CtsError *err);
void cts_volume_histogram_free(uint64_t **count);

CTS_API_END
#endif
