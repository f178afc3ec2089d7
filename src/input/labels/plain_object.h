/* A DICOM object whose header is held in memory and whose pixels are read frame by frame. */
#ifndef CTS_LABELS_PLAIN_OBJECT_H
#define CTS_LABELS_PLAIN_OBJECT_H

#include "ctsplat/status.h"
#include "input/files/file_bytes.h"
#include "input/files/syntax.h"
#include "input/header/elements.h"

typedef struct CtsPlainObject {
    const CtsFileBytes *file;
    uint8_t *header; /* owned: the file up to its pixels, or a deflated data set whole */
    size_t capacity;
    char class_uid[65], syntax_uid[65], charset[65];
    const CtsSyntax *syntax;
    CtsElements elements; /* in front of the pixels */
    bool has_pixels, encapsulated;
    CtsFileBytes source;                /* of the pixels */
    uint64_t pixel_offset, pixel_bytes; /* of the value; where encapsulated all that is left of the source */
} CtsPlainObject;

/* Whether a file that begins so is DICOM; class_uid may then be "" (no meta header, or deflated). */
bool cts_plain_is_dicom(const uint8_t *head, size_t n, char class_uid[65]);

/* Close in any case. CTS_ERR_READ for what is damaged or claims more bytes than the file has. */
CtsStatus cts_plain_open(CtsPlainObject *object, const CtsFileBytes *file, CtsError *err);
void cts_plain_close(CtsPlainObject *object);

/* A text as UTF-8, by the object's character set, cut to its size. */
void cts_plain_text(const CtsPlainObject *object, CtsElements elements, uint32_t tag, char *text, size_t size);

#endif
