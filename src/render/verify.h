/* Verification: some pixels of a picture are done again by the reference. */
#ifndef CTS_RENDER_VERIFY_H
#define CTS_RENDER_VERIFY_H

#include "render/reference_set.h"

/* n pixels of a picture (at most all), first chosen from its bands as they come, likelier where neighbours differ much,
 * since errors are large there; then done again. Of further pictures of the same scene the same pixels are looked up.
 * Zeroed, it is a verification of nothing, which costs nothing. */
typedef struct CtsVerify {
    const CtsScene *scene;
    size_t n;
    uint64_t seed, offered;
    struct CtsCandidate *heap; /* the n + 1 of the highest priority so far, the lowest of them first */
    size_t n_heap;
    CtsReference *reference; /* NULL until chosen */
    float (*found)[4];
} CtsVerify;

CtsStatus cts_verify_begin(CtsVerify *verify, const CtsScene *scene, size_t n, CtsError *err);
void cts_verify_take(CtsVerify *verify, const CtsPicture *band);
/* Ends the choice; the true values are left zero. */
CtsStatus cts_verify_choose(CtsVerify *verify, CtsError *err);
/* Does the pixels again. */
CtsStatus cts_verify_cast(CtsVerify *verify, CtsError *err);
CtsStatus cts_verify_judge(const CtsVerify *verify, CtsVerified *verified, CtsError *err);
/* Chooses, casts, judges and fills report->verified. */
CtsStatus cts_verify_end(CtsVerify *verify, CtsReport *report, CtsError *err);
void cts_verify_free(CtsVerify *verify);

#endif
