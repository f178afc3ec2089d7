/* Verification: some pixels of a picture are compared with the reference. */
#pragma once

#include "render/error/reference_samples.h"

enum { CTS_VERIFY_CLASSES = 8 };

/* Pixels alike in how large an error is likely there. */
typedef struct CtsVerifyClass {
    struct CtsCandidate
        *candidates; /* those of the CtsVerify.n highest random numbers so far, and up to as many more */
    uint64_t least;  /* random number of candidates that count */
    size_t n, room, offered;
} CtsVerifyClass;

/* n pixels of a picture (at most all), first chosen from its bands: half of them uniformly, half where errors are
 * probably large; then rendered by the reference. In further pictures of the same scene the same pixels are compared. A
 * zeroed struct verifies nothing, at no cost. */
typedef struct CtsVerify {
    const CtsScene *scene;
    size_t n;
    uint64_t seed;
    bool choosing, lost; /* lost: memory ran out while choosing */
    CtsVerifyClass classes[CTS_VERIFY_CLASSES];
    CtsReference *reference; /* NULL until chosen */
    float (*found)[4];
} CtsVerify;

void cts_verify_begin(CtsVerify *verify, const CtsScene *scene, size_t n);
/* bound: the engine's upper limit of each pixel's error, rms over red, green and blue; pixels with large ones are
 * preferred. It is not trusted: half of the pixels are chosen uniformly. NULL: contrast to neighbours is used. */
void cts_verify_take(CtsVerify *verify, const CtsPicture *band, const float *bound);
/* Ends the choice; the true values are left zero. */
CtsStatus cts_verify_choose(CtsVerify *verify, CtsError *err);
/* Completes the verification and fills report->verified, with an interval that holds for any picture. */
CtsStatus cts_verify_end(CtsVerify *verify, CtsReport *report, CtsError *err);
void cts_verify_free(CtsVerify *verify);
