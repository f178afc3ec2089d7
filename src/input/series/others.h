/* What files are that are no CT slices: counted by kind. */
#ifndef CTS_DICOM_OTHERS_H
#define CTS_DICOM_OTHERS_H

#include "ctsplat/series.h"

/* n files that are no DICOM; packed: NULL, or what they seem to be packed with. */
CtsStatus cts_others_add_files(CtsSeriesList *list, int n, const char *packed, CtsError *err);
/* n that are no files, and are not followed. */
CtsStatus cts_others_add_special(CtsSeriesList *list, int n, CtsError *err);
/* A DICOM object of this SOP class; "" where it names none. */
CtsStatus cts_others_add_object(CtsSeriesList *list, const char *class_uid, CtsError *err);
/* Once all are there: most frequent first, then by name. */
void cts_others_sort(CtsSeriesList *list);

#endif
