/* A frame of a rotation that is rendered and not written yet: it goes into its files while the next one is rendered. */
#ifndef CTS_JOB_HELD_H
#define CTS_JOB_HELD_H

#include "app/job/files.h"

typedef struct CtsHeld {
    CtsPicture picture; /* without pixels: none is held */
    int frame;
    CtsVerified verified;
    CtsReport *writing; /* one for all frames, as a file may hold them all */
    double cpu_ms;      /* of its writing */
} CtsHeld;

/* Takes what the band holds, which is a whole picture, and leaves it without. */
void cts_held_take(CtsHeld *held, CtsPicture *band, int frame);
/* Into the files, once; other frames may be rendered meanwhile. */
CtsStatus cts_held_write(CtsHeld *held, CtsFiles *files, CtsError *err);
/* What was written while all the rest of `report` since `before` went on: its findings, its share of the time by CPU
 * time, and who watches is told. */
void cts_held_tell(CtsHeld *held, CtsFiles *files, const CtsStageTime before[CTS_N_STAGES], CtsReport *report);
void cts_held_free(CtsHeld *held);

#endif
