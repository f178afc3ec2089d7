/* What a frame's pixels may be off by: what the engine's bounds are worth, from rays that are cast, and the worst
 * pixels put right.
 *
 * The engine's bound b of a pixel is cheap and lies some ten times above its error e. What the picture's error is, a
 * sample tells, whatever the ratios e / b are like: a pixel is cast with a chance p that grows with b^2 + f^2, f a
 * floor that lets every pixel have its chance. Then e^2 / p, summed over those cast, has the sum of all e^2 for its
 * expectation, and each term is at most a weight that is known, as long as e^2 <= b^2 + f^2: Chernoff's bound makes an
 * upper limit of that, which holds in 999 of 1000 pictures (cts_expectation_limit()). It asks of b only to be a bound,
 * not to be a good one; where a ray shows that it is none, the weight grows by as much.
 *
 * Strips of CTS_BAND_ROWS rows are judged one by one, so that a picture is the same in bands of any size. Where a
 * strip's own rays say that it errs by more than half of what is asked for, the pixels with the largest bounds are cast
 * too, until what is left should be below that. */
#ifndef CTS_RENDER_BOUND_H
#define CTS_RENDER_BOUND_H

#include "engine/raycast/raycaster.h"
#include "core/scene/engine.h"

/* Zeroed, it is a frame of which nothing is known. */
typedef struct CtsFrameBound {
    CtsRaycaster *caster;          /* made when a pixel has to be cast */
    uint64_t pixels, judged, cast; /* judged: those that the rays stand for */
    double most;                   /* the largest of the engine's bounds that are left */
    double found, weight;          /* sum of e^2 / p of the rays that judge, and the largest that a term may have */
    double beyond;                 /* the largest e^2 / (b^2 + f^2) that a ray has shown */
    uint64_t pieces, refined;      /* of a draft: pieces that judge it, pixels that were rendered without one, */
    double piece_squares;          /* the sum of the pieces' e^2, each the mean of its pixels, */
    double piece_most;             /* and the largest; */
    uint64_t at_half;              /* pixels of one at half the resolution (render/draft/half.h), */
    double half_rays;              /* of how many evenly drawn rays those that judge them are worth, */
    double half_squares;           /* the sum of their e^2, */
    double half_most;              /* and the largest */
    double wall_ms, cpu_ms;
} CtsFrameBound;

/* Pixels and the engine's bounds of them; the caller's. Pixel i is number first + place[i], or first + i, of the view,
 * counted row by row. */
typedef struct CtsBoundPixels {
    size_t first;
    const uint32_t *place;
    float *pixels, *bound;
} CtsBoundPixels;

/* Pixels drawn by chance, in strips of which each ends before strip_end[]. */
typedef struct CtsBoundSample {
    CtsBoundPixels of;
    const size_t *strip_end;
    size_t n_strips;
    double n_rays, n_pixels; /* of the whole view: how many rays are to judge how many such pixels */
} CtsBoundSample;

/* What a pixel, as it shows on the preset's background, is off by against rgba: its square, the mean of the channels.
 */
double cts_square_of_error(const CtsPreset *preset, const float *pixel, const double rgba[4]);

/* Takes a band whose bounds the engine gave, and puts its worst pixels right. A ray costs some hundred times a pixel of
 * the march: of a strip whose rays say that it errs too much, one pixel in 512 is cast by default, one in 32 where an
 * error was asked for. */
CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsScene *scene, CtsPicture *band, CtsError *err);
/* Judges a sample by rays, and changes none of its pixels. */
CtsStatus cts_bound_judge(CtsFrameBound *bound, const CtsScene *scene, const CtsBoundSample *sample, CtsError *err);
/* The frame's ray caster, which is made when it is first asked for and stays the bound's. */
CtsStatus cts_bound_caster(CtsFrameBound *bound, const CtsScene *scene, const CtsRaycaster **caster, CtsError *err);
/* What the frame's error is at most, rms. */
double cts_bound_rmse(const CtsFrameBound *bound);
/* The report's bound, and a warning where the error may be larger than it should be. */
void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report);
void cts_bound_free(CtsFrameBound *bound);

#endif
