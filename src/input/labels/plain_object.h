/* A DICOM object whose header is held in memory and whose pixels are read frame by frame. */
#ifndef CTS_LABELS_PLAIN_OBJECT_H
#define CTS_LABELS_PLAIN_OBJECT_H

#include "ctsplat/status.h"
#include "input/header/head.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct CtsPlainObject {
    CtsHead head;
    CtsScratch scratch;
    char class_uid[65], charset[65];
    const CtsSyntax *syntax;
    CtsElements elements; /* in front of the pixels */
    bool has_pixels, encapsulated;
    CtsFileBytes source;                /* of the pixels: the file, or a deflated data set */
    uint8_t *inflated;                  /* owned: that data set; else NULL */
    uint64_t pixel_offset, pixel_bytes; /* of the value; where encapsulated all that is left of the source */
} CtsPlainObject;

/* Whether a file that begins so is DICOM; class_uid may then be "" (no meta header, or deflated). */
bool cts_plain_is_dicom(const uint8_t *head, size_t n, char class_uid[65]);

/* Close in any case. CTS_ERR_READ for what is damaged or claims more bytes than the file has. */
CtsStatus cts_plain_open(CtsPlainObject *object, const CtsFile *file, CtsError *err);
void cts_plain_close(CtsPlainObject *object);

/* A text as UTF-8, by the object's character set, cut to its size. */
void cts_plain_text(const CtsPlainObject *object, CtsElements elements, uint32_t tag, char *text, size_t size);

#endif
