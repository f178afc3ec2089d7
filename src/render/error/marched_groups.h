/* Groups of pixels that the exact march renders in place of an engine whose errors are too large there. */
#pragma once

#include "core/scene/engine.h"

/* Pixels each way of a group; corners are multiples of it. As the groups of engine sheets: an edge that its samples
 * miss passes through neighbouring pixels. */
enum { CTS_GROUP_SIDE = 4 };

/* A sampled pixel. */
typedef struct CtsGroupSample {
    float group;    /* largest indicator of its group; 0 where marching it would change nothing */
    CtsTerms terms; /* of the estimated sum of squared errors */
} CtsGroupSample;

/* True if an estimate of these terms meets the request. */
typedef bool (*cts_group_accept_fn)(void *context, const CtsTerms *terms);

/* Largest threshold such that the samples of groups up to it are accepted; 0 if none are. Sorts the samples. */
float cts_group_threshold(CtsGroupSample *samples, size_t n, cts_group_accept_fn accept, void *context);

/* Largest indicator of the engine's own pixels in a group whose first pixel is (x, y), of a row-major array. origin:
 * NULL if all are the engine's own. */
float cts_group_indicator(const float *indicator, const uint8_t *origin, int width, int height, int x, int y);

/* Adds the pixels of rows y0 to y1 - 1 of a band, whose groups' indicators are larger than `from`, to the n in `place`,
 * which has room for all. Returns the new n. */
size_t cts_list_groups(const CtsPicture *band, const CtsErrorMap *errors, int y0, int y1, float from, uint32_t *place,
                       size_t n);

/* Renders n pixels of a band by the exact march to the requested error. Their origin is then CTS_PIXEL_MARCHED, their
 * indicator the march's bound. */
CtsStatus cts_march_groups(const CtsEngine *march, const CtsScene *scene, const uint32_t *place, size_t n,
                           CtsPicture *band, CtsErrorMap *errors, CtsError *err);
/* Raises the indicators of rendered pixels around one of the same strip whose error has been found. */
void cts_expect_error_beside(const CtsPicture *band, CtsErrorMap *errors, size_t at, float error);
