/* The files that one job writes: names for each frame, checked before any work. */
#ifndef CTS_JOB_OUTPUTS_H
#define CTS_JOB_OUTPUTS_H

#include "ctsplat/export.h"
#include <stdbool.h>

typedef struct CtsOutputs {
    const char *const *paths; /* the endings pick the formats */
    int n;
    const char *state; /* a presentation state beside them, or NULL */
    int rotation;      /* frames, or 0: one picture, and paths as they are */
} CtsOutputs;

/* Frame 7 of 36 of "a/head.png" is "a/head-007.png"; a file that holds all frames has its path as it is. Free with
 * free(); NULL when memory runs out. */
char *cts_output_name(const CtsOutputs *outputs, int output, int frame);

/* How many frames this output's file holds: all, where its format holds several. */
int cts_output_n_frames(const CtsOutputs *outputs, int output);

/* Its format is DICOM. */
bool cts_output_is_dicom(const CtsOutputs *outputs, int output);

/* Some output has a place for depth. */
bool cts_outputs_hold_depth(const CtsOutputs *outputs);

/* Every path has a known ending, is given once, can be written, and is no CT slice that force would destroy. */
CtsStatus cts_outputs_check(const CtsOutputs *outputs, const CtsExportSettings *settings, CtsError *err);

#endif
