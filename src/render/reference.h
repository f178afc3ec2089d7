/* Random pixels of a scene and their true values. */
#ifndef CTS_RENDER_REFERENCE_H
#define CTS_RENDER_REFERENCE_H

#include "ctsplat/reference.h"
#include "splat/engine.h"

/* Pixel i stands for weight[i] of the picture; the weights sum to 1. */
struct CtsReference {
    int width, height;
    double background[3];
    size_t n;
    int (*xy)[2];
    double *weight;
    double (*rgba)[4]; /* premultiplied, before blending over the background */
};

/* Places the pixels; their values are left zero. n is at most the number of pixels. */
CtsStatus cts_reference_place(CtsReference **reference, const CtsScene *scene, size_t n, CtsError *err);

/* The scene's settings->verify pixels done again, and report->verified filled. */
CtsStatus cts_verify(const CtsScene *scene, const CtsPicture *picture, CtsReport *report, CtsError *err);

#endif
