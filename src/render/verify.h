/* How far a picture is from the reference, from a sample of its pixels. */
#ifndef CTS_RENDER_VERIFY_H
#define CTS_RENDER_VERIFY_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "splat/engine.h"

/* Places n pixels: the picture is halved again and again into equal parts, two pixels at random in each part, so that
 * they are spread evenly and the error's spread can be told. The same scene gives the same pixels. xy holds room for n;
 * n is at most the number of pixels. weight[i] is the share of the picture that pixel i stands for. */
void cts_verify_places(const CtsScene *scene, size_t n, int (*xy)[2], double *weight);

/* Does scene->settings->verify random pixels again by the float64 ray caster, with the scene's kernel, mode and
 * lighting, and fills report->verified. Differences are over red, green and blue as display values 0..1, clamped,
 * after blending over the preset's background (black where it has none): the same numbers as comparing the two final
 * pictures at these pixels. rmse_low and rmse_high are a 95 % interval from the spread within the parts. */
CtsStatus cts_verify(const CtsScene *scene, const CtsPicture *picture, CtsReport *report, CtsError *err);

/* The same against values that the caller has: n pixels xy of weight, rgba as from cts_raycast_pixels(). */
CtsStatus cts_verify_against(const CtsScene *scene, const CtsPicture *picture, size_t n, const int (*xy)[2],
                             const double *weight, const double (*rgba)[4], CtsVerified *verified, CtsError *err);

#endif
