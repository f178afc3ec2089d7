/* Marks on pictures: what the option `annotate` names. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/picture.h"
#include "ctsplat/report.h"

typedef struct CtsMarks {
    bool orientation, scale, labels;
    bool captions;        /* captions above the labels; in formats with depth the pixels stay without them */
    bool captioned_later; /* the labels leave its line free */
} CtsMarks;

/* Draws all marks but the caption on a band. The report (NULL: none) gets those that are left out. */
CtsStatus cts_marks_draw(const CtsMarks *marks, const CtsModel *model, CtsPicture *band, CtsReport *report,
                         CtsError *err);
/* Draws the caption: UTF-8; number: precedes one that cannot be drawn completely. */
CtsStatus cts_marks_caption(const CtsMarks *marks, const char *text, int number, CtsPicture *band, CtsReport *report,
                            CtsError *err);
