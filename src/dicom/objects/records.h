/* The attributes of an object that is written, composed as records (dicom/header/elements.h). The program ctsplat-dicom
 * inserts them by their tags' VRs: numbers of DS, IS, US, AT or FD. */
#pragma once

#include "dicom/header/elements.h"
#include "dicom/objects/objects.h"

/* Tags by their keywords of PS3.6. */
enum {
#include <dicom_names.inc>
};

void cts_put_numbers(CtsRecords *to, uint32_t tag, const double *values, size_t n);

/* Single values: CTS_PUT_TEXTS(to, {DCM_Modality, "PR"}, {DCM_Manufacturer, "ctsplat"}). */
typedef struct CtsPutText {
    uint32_t tag;
    const char *text;
} CtsPutText;
typedef struct CtsPutNumber {
    uint32_t tag;
    double number;
} CtsPutNumber;
void cts_put_all_texts(CtsRecords *to, const CtsPutText *rows, size_t n);
void cts_put_all_numbers(CtsRecords *to, const CtsPutNumber *rows, size_t n);
#define CTS_PUT_TEXTS(to, ...)                                                                                         \
    cts_put_all_texts((to), (const CtsPutText[]){__VA_ARGS__},                                                         \
                      sizeof((const CtsPutText[]){__VA_ARGS__}) / sizeof(CtsPutText))
#define CTS_PUT_NUMBERS(to, ...)                                                                                       \
    cts_put_all_numbers((to), (const CtsPutNumber[]){__VA_ARGS__},                                                     \
                        sizeof((const CtsPutNumber[]){__VA_ARGS__}) / sizeof(CtsPutNumber))

/* Another item at the end of a sequence: its attributes stand between the two calls. */
size_t cts_put_item(CtsRecords *to, uint32_t sequence);
void cts_put_item_end(CtsRecords *to, size_t item);
void cts_put_code(CtsRecords *to, uint32_t sequence, CtsScCode code);
/* An item that references an object; to be ended. */
size_t cts_put_reference(CtsRecords *to, uint32_t sequence, const char *class_uid, const char *uid);
/* References to all objects of the source's slices; complete adds to each item. NULL: nothing. */
void cts_put_sources(CtsRecords *to, uint32_t sequence, const CtsSeries *source, void (*complete)(CtsRecords *to));
/* References by their series: of the source, and of labels in one study. NULL: no labels. */
void cts_put_source_series(CtsRecords *to, const CtsSeries *source);
void cts_put_label_series(CtsRecords *to, const CtsLabels *labels, const char *study_uid);
/* The ICC profile of ctsplat's colours (sRGB). */
void cts_put_profile(CtsRecords *to);

/* Frees the records, after writing the object up to its pixels to a file: they and what is copied of the source. */
CtsStatus cts_records_write(CtsRecords *records, CtsReaderOrder order, const CtsSlice *source, CtsTempFile *file,
                            CtsError *err);
