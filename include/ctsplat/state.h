/* How a picture was made, as a DICOM object beside it: Volume Rendering Volumetric Presentation State (PS3.3 A.80.2).
 */
#ifndef CTSPLAT_STATE_H
#define CTSPLAT_STATE_H

#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

CTS_API_BEGIN

struct CtsLabels;
struct CtsLabelChoice;

/* One thing that ctsplat is told, in its own words: an option's name and its argument (ctsplat/job.h). from: who says
 * so, such as a file, for messages; NULL: the caller. */
typedef struct CtsWord {
    const char *name, *value, *from;
} CtsWord;

/* A picture as it was made. The standard's attributes say what they can say of it; preset and options stand beside them
 * in private ones, to the last bit. */
typedef struct CtsStateScene {
    const CtsPreset *preset;
    const CtsPictureInfo *info;
    int width, height;
    bool shaded, cropped;
    double crop_low_lps[3], crop_high_lps[3];
    const CtsSeries *source;
    const char *capture;  /* the .dcm of the picture, or NULL */
    const CtsWord *words; /* what ctsplat was told besides the preset; n_words */
    int n_words;
    const struct CtsLabels *labels; /* (ctsplat/labels.h) that the picture shows or hides, or NULL; and what of them */
    const struct CtsLabelChoice *choice;
    CtsReport *report; /* gets what of the labels the standard's attributes cannot say; may be NULL */
} CtsStateScene;

/* Written whole or not at all. CTS_ERR_OUTPUT where path exists, without force. The UIDs follow from the scene. */
CtsStatus cts_state_write(const char *path, const CtsStateScene *scene, bool force, CtsError *err);

typedef struct CtsState {
    CtsPreset preset;
    CtsWord *words;
    int n_words;
    char *text;          /* what the words point into */
    char source_uid[65]; /* the series that it is of; "" where it does not tell */
} CtsState;

/* CTS_ERR_READ for what is no such object, or none that ctsplat wrote. */
CtsStatus cts_state_read(const char *path, CtsState **state, CtsError *err);
/* The SOPInstanceUID of such an object, whoever wrote it; CTS_ERR_READ for what is none. */
CtsStatus cts_state_uid(const char *path, char sop_uid[65], CtsError *err);
void cts_state_free(CtsState **state);

CTS_API_END
#endif
