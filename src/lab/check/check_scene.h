/* Volumes and presets made by formula, for the stability suite and the tests. */
#pragma once

#include "ctsplat/preset.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"

typedef double (*CtsHuFormula)(const double vox[3], const void *data);

/* HU at each voxel rounded to grey levels of hu_step HU, HU = -1024 + hu_step * grey, clamped to 0..65535. */
CtsStatus cts_check_volume(CtsVolume **volume, const int dims[3], const double spacing_mm[3], double hu_step,
                           CtsHuFormula hu, const void *data, CtsError *err);

/* data is double[4]: constant and slope along each voxel axis. */
double cts_hu_linear(const double vox[3], const void *data);
/* data is double[1]. */
double cts_hu_constant(const double vox[3], const void *data);

/* A point of both opacity and colour. */
typedef struct CtsCheckPoint {
    double hu, opacity, rgb[3];
} CtsCheckPoint;

/* Composite, unlit, unit distance 1 mm, window 0..1000, black background. */
CtsPreset cts_check_preset(const CtsCheckPoint *points, int n);

/* One colour and opacity everywhere. */
CtsPreset cts_check_even_preset(double opacity, double red, double green, double blue);
