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

/* n pixels of a scene (at most all), as they are found in the bands of a picture, then done again. Zeroed, it is a
 * verification of nothing, which costs nothing. */
typedef struct CtsVerify {
    const CtsScene *scene;
    CtsReference *reference;
    float (*found)[4];
} CtsVerify;

CtsStatus cts_verify_begin(CtsVerify *verify, const CtsScene *scene, size_t n, CtsError *err);
/* The pixels' true values; and how far those found are from them. */
CtsStatus cts_verify_cast(CtsVerify *verify, CtsError *err);
CtsStatus cts_verify_judge(const CtsVerify *verify, CtsVerified *verified, CtsError *err);
void cts_verify_take(CtsVerify *verify, const CtsPicture *band);
/* Casts, judges and fills report->verified. */
CtsStatus cts_verify_end(CtsVerify *verify, CtsReport *report, CtsError *err);
void cts_verify_free(CtsVerify *verify);

#endif
