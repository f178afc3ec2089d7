/* What a frame's pixels may be off by: what the engine's bounds are worth, from pixels that are made again, and the
 * worst ones put right.
 *
 * The engine's bound b of a pixel is cheap and takes the worst of everything. What the picture's error is, a sample
 * tells, whatever the ratios e / b are like: a pixel is made again, exactly (CtsEngine.again), with a chance p that
 * grows with b^2 + f^2, f a floor that lets every pixel have its chance; the worst are made again in any case. All of
 * them are put right. What the others err by together, e^2 (1 - p) / p summed over those made again has for its
 * expectation, and each term is at most a weight that is known, as long as e^2 <= b^2 + f^2: Chernoff's bound makes an
 * upper limit of that, which holds in 999 of 1000 pictures (cts_expectation_limit()). It asks of b only to be a bound,
 * not to be a good one; where a pixel shows that it is none, the weight grows by as much. What is made again has
 * a bound as well, far smaller, which counts as error.
 *
 * Pixels to which the engine sent no ray are not judged so: it says itself what those err by, by an estimate that has a
 * largest term as well, beside what the pixels err by between which they lie.
 *
 * Strips of CTS_BAND_ROWS rows are judged one by one, so that a picture is the same in bands of any size. Where a strip
 * errs by more than what is asked for, more of its pixels are made again, until it does not. */
#ifndef CTS_RENDER_BOUND_H
#define CTS_RENDER_BOUND_H

#include "core/scene/engine.h"

/* Zeroed, it is a frame of which nothing is known. */
typedef struct CtsFrameBound {
    uint64_t pixels, again;     /* of the frame, and those of them that were made again */
    double most;                /* the largest of the engine's bounds that are left */
    double found, weight;       /* sum of e^2 (1 - p) / p, and the largest that a term may have */
    double beyond;              /* the largest e^2 / (b^2 + f^2) that a pixel has shown */
    uint64_t between;           /* pixels that had no ray, */
    double missed, missed_most; /* what the engine says of them (CtsPicture) */
    double wall_ms, cpu_ms;
} CtsFrameBound;

/* Takes a band whose bounds the engine gave, and puts its worst pixels right. */
CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                         CtsError *err);
/* What the frame's error is at most, rms. */
double cts_bound_rmse(const CtsFrameBound *bound);
/* The report's bound, and a warning where the error may be larger than it should be. */
void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report);

#endif
