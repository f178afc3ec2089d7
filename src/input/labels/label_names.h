/* Names for the numbers of a label map: from --label-names, or from the extension of a NIfTI file. */
#ifndef CTS_LABELS_LABEL_NAMES_H
#define CTS_LABELS_LABEL_NAMES_H

#include "ctsplat/status.h"
#include <stddef.h>

typedef struct CtsLabelName {
    int number;
    char *name;
} CtsLabelName;

typedef struct CtsLabelNames {
    CtsLabelName *items;
    size_t n;
} CtsLabelNames;

/* A JSON object of names by number or of numbers by name, nnU-Net's dataset.json, which has one as its "labels", or a
 * table of ITK-SNAP. what: how messages call it. CTS_ERR_USAGE when it is none of these. */
CtsStatus cts_label_names_parse(const char *what, const char *text, size_t n, CtsLabelNames *names, CtsError *err);
CtsStatus cts_label_names_read(const char *path, CtsLabelNames *names, CtsError *err);
/* Caret's XML (<Label Key="1">liver</Label>); names stays as it was where there is none. */
CtsStatus cts_label_names_xml(const char *text, size_t n, CtsLabelNames *names, CtsError *err);
void cts_label_names_free(CtsLabelNames *names);

/* NULL: it has none. */
const char *cts_label_names_find(const CtsLabelNames *names, int number);

#endif
