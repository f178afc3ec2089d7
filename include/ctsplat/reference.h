/* Reference values of single pixels: the float64 reference ray caster, converged to 1e-7. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <stddef.h>

CTS_API_BEGIN

/* Pixels of one scene with their reference values; created once, to compare any number of pictures of that scene. */
typedef struct CtsReference CtsReference;

/* n random pixels (at most all) of the picture that cts_render() would render with these settings, whatever the engine;
 * kernel, mode and lighting as in the settings. Stratified sampling: the picture is halved repeatedly into equal parts,
 * with two pixels in each part. The same scene gets the same pixels. */
CtsStatus cts_reference_new(CtsReference **reference, const CtsModel *model, const CtsPreset *preset,
                            const CtsRenderSettings *settings, size_t n, CtsError *err);
void cts_reference_free(CtsReference **reference);

/* Differences over red, green and blue as display values 0..1, clamped, after blending over the preset's background
 * (black if none): the same numbers as comparing the two final pictures at these pixels. rmse_low and rmse_high are a
 * 95 % interval from the spread within the parts. CTS_ERR_USAGE for a different size. */
CtsStatus cts_reference_compare(const CtsReference *reference, const CtsPicture *picture, CtsVerified *verified,
                                CtsError *err);

CTS_API_END
