/* Random pixels of a scene and their true values. */
#pragma once

#include "core/scene/engine.h"
#include "ctsplat/reference.h"
#include <stdbool.h>
#include <stdint.h>

/* Pixel i represents weight[i] of the picture; the weights sum to about 1. */
struct CtsReference {
    int width, height;
    double background[3];
    size_t n;
    int (*xy)[2];
    double *weight;
    double unit;       /* largest weight of pixels that represent others too; 0: all pixels are sampled */
    double (*rgba)[4]; /* premultiplied, before blending over the background */
};

/* Room for n pixels, to be placed by the caller. */
CtsStatus cts_reference_empty(CtsReference **reference, const CtsScene *scene, size_t n, CtsError *err);

/* Places the pixels; their values are left zero. n is at most the number of pixels. */
CtsStatus cts_reference_place(CtsReference **reference, const CtsScene *scene, size_t n, CtsError *err);

/* The true values of the pixels. */
CtsStatus cts_reference_cast(CtsReference *reference, const CtsScene *scene, CtsError *err);
/* Compares values at the pixels with the reference values. The interval assumes that pixels 2 i and 2 i + 1 share a
 * part of the picture, as in stratified sets; for others see base/limits.h. */
CtsStatus cts_reference_evaluate(const CtsReference *reference, const float (*found)[4], CtsVerified *verified,
                                 CtsError *err);
/* The value of pixel i from a band of the picture; false if it is in another band. */
bool cts_reference_find(const CtsReference *reference, const CtsPicture *band, size_t i, float rgba[4]);

/* A hash of the scene. */
uint64_t cts_reference_seed(const CtsScene *scene);
