/* The settings of a picture as a DICOM object beside it: Volume Rendering Volumetric Presentation State (PS3.3
 * A.80.2). */
#pragma once

#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

CTS_API_BEGIN

struct CtsLabels;
struct CtsLabelChoice;

/* An option of ctsplat: its name and argument (ctsplat/job.h). from: its source, such as a file, for messages; NULL:
 * the caller. */
typedef struct CtsJobOption {
    const char *name, *value, *from;
} CtsJobOption;

/* A picture and its settings. The standard's attributes represent them as far as possible; private ones contain preset
 * and options exactly. */
typedef struct CtsStateScene {
    const CtsPreset *preset;
    const CtsPictureInfo *info;
    int width, height;
    bool shaded, cropped;
    double crop_low_lps[3], crop_high_lps[3];
    const CtsSeries *source;
    const char *capture;         /* the .dcm of the picture, or NULL */
    const CtsJobOption *options; /* besides the preset; n_options */
    int n_options;
    const struct CtsLabels *labels; /* (ctsplat/labels.h) labels of the picture, or NULL; and their visibility */
    const struct CtsLabelChoice *choice;
    CtsReport *report; /* gets warnings about labels that the standard's attributes cannot represent; may be NULL */
} CtsStateScene;

/* Written whole or not at all. CTS_ERR_OUTPUT where path exists, without force. The UIDs follow from the scene. */
CtsStatus cts_state_write(const char *path, const CtsStateScene *scene, bool force, CtsError *err);

typedef struct CtsState {
    CtsPreset preset;
    CtsJobOption *options;
    int n_options;
    char *text;          /* memory of the words' strings */
    char source_uid[65]; /* UID of its series; "" if missing */
    char slice_uid[65];  /* SOPInstanceUID of the first slice of its volume; "" if missing */
    int slice_frame;     /* of this object, from 1, if the volume is a part of it; else 0 */
} CtsState;

/* CTS_ERR_READ for another object, or one that ctsplat did not write. */
CtsStatus cts_state_read(const char *path, CtsState **state, CtsError *err);
/* True if the volume of the state, or any if it names none, is this one. */
bool cts_state_is_of(const CtsState *state, const CtsSeries *series);
/* The SOPInstanceUID of a presentation state, of any writer; CTS_ERR_READ for another object. */
CtsStatus cts_state_uid(const char *path, char sop_uid[65], CtsError *err);
void cts_state_free(CtsState **state);

CTS_API_END
