/* Error control: estimates the error of a frame from re-rendered pixels, and corrects the worst pixels.
 *
 * The engine gives each pixel an error indicator b (CtsErrorMap), which is cheap and need not be good. The frame's
 * error e is estimated from a sample: a pixel is re-rendered by the exact march (CtsEngine.render_pixels) with a
 * probability p that grows with b^2 + f^2, where the floor f gives every pixel a chance; the worst pixels are
 * re-rendered in any case. All of them are replaced. The sum of e^2 (1 - p) / p over the re-rendered pixels has the
 * squared error of the others for its expectation. Chernoff's bound gives an upper limit of the sum that holds in 999
 * of 1000 pictures (cts_terms_limit()), from the squares of the terms; each has a known upper limit, too, as long as b
 * bounds the error. Where a re-rendered pixel shows that e^2 exceeds b^2 + f^2, the limit of the terms grows by as
 * much. The exact march has an error too, far smaller, which counts: its square is added, as the errors have nothing to
 * do with each other.
 *
 * Interpolated pixels are not sampled. The engine itself samples their errors, in addition to the errors of the pixels
 * that they were interpolated from.
 *
 * Strips of cts_strip_rows() rows are processed one by one, and bands are whole strips, so that a picture is the same
 * in bands of any size. Where a strip's error is larger than requested, more of its pixels are re-rendered, round by
 * round; and all of them where the level was not the caller's choice. Large strips leave the correction to the groups
 * with the largest errors: strips of 64 rows would make default pictures of 1024 x 1024 pixels take 1.13 times as long
 * (mean of 30 views of five series, up to 1.7).
 *
 * A round draws pixels of its own. Those of the engine's own that earlier rounds drew count too, with the probability
 * to be drawn in any of the rounds, until their groups are marched: they know more of pixels with small indicators,
 * which later rounds hardly draw. Of 800 limits of bright specks, wires and plates in the air 5 were too low without
 * them, 3 of which hold with them (tests/soak/sweep.py --traps, seed 43), and limits of several rounds were 1.05 times
 * as high.
 *
 * 999 of 1000 holds for one limit of one sample (the probe that chose a level has other pixels); interpolated pixels
 * have one of their own: with both it is 998. A strip's rounds end when the estimate is small (optional stopping), so
 * that low estimates are a little likelier to stay. For a picture of one strip the union bound over its at most five
 * limits still gives 995 of 1000; for more strips, which stop by themselves, no bound is derived. Measured: 1 of 2632
 * limits of small invented scenes lies below the error (sweep.py, seed 732), 1 of 772 of traps (seed 44). Few pixels
 * with all of a picture's error and no indicator are beyond any sample. */
#pragma once

#include "core/scene/engine.h"

/* Of one frame. The caller sets the first three fields and zeroes the others. */
typedef struct CtsErrorControl {
    const CtsEngine *engine; /* rendered the frame */
    const CtsEngine *march;  /* re-renders pixels: a row with render_pixels, the same or another */
    CtsScene scene;          /* of the frame, as march gets it: `kept` is what march keeps */
    bool whole_strips;       /* strips whose error stays too large are re-rendered whole */
    bool marches_groups;     /* before that, their groups of pixels with large indicators are (marched_groups.h) */
    bool has_opacity_step;   /* of the preset: the march meets a request only on average there, and pixels are
                              * re-rendered with reference precision */
    double march_error;      /* of re-rendered pixels, as the probe found it, rms; 0: not known */
    uint64_t n_pixels;       /* of the bands so far */
    uint64_t n_rerendered;   /* of them */
    uint64_t n_interpolated; /* of them */
    uint64_t n_marched;      /* of them, in groups */
    double largest;          /* largest indicator of a pixel that was not re-rendered */
    CtsTerms terms;          /* e^2 (1 - p) / p of the sampled pixels */
    CtsTerms interpolation;  /* of CtsErrorMap */
    CtsTermRange range;      /* the largest of all strips */
    double excess;           /* largest e^2 / (b^2 + f^2) of a re-rendered pixel */
    double wall_ms, cpu_ms;
} CtsErrorControl;

/* Takes a band with what its engine indicated, and corrects its worst pixels. On return the origin of re-rendered
 * pixels is CTS_PIXEL_REFERENCE, and their indicator 0. */
CtsStatus cts_error_control_enforce(CtsErrorControl *control, CtsPicture *band, CtsErrorMap *errors, CtsError *err);
/* Prediction of the error of a frame whose pixels are like these n. */
typedef struct CtsErrorPrediction {
    size_t n;
    const float *indicator; /* estimates */
    const float *group;     /* the largest of each pixel's group; NULL: no groups are marched */
    const double *square;   /* squared errors against the exact march */
    double limit;           /* result: upper limit of the frame's error, rms */
    float marched_from;     /* result: indicator of groups above which they have to be marched to meet the request */
} CtsErrorPrediction;

CtsStatus cts_error_control_predict(const CtsScene *scene, CtsErrorPrediction *prediction, CtsError *err);
/* Upper limit of the frame's error, rms. */
double cts_error_control_rmse(const CtsErrorControl *control);
/* Fills report->bound, and adds a warning where the error may be larger than requested. Nothing for a frame that
 * cts_error_control_enforce() has not seen. */
void cts_error_control_report(const CtsErrorControl *control, CtsReport *report);
