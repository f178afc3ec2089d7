/* The texts of many slices in a few blocks: what repeats stands there once, and all go at once. */
#ifndef CTS_DICOM_TEXTS_H
#define CTS_DICOM_TEXTS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Zero-initialise; free with cts_texts_free(). One thread at a time. */
typedef struct CtsTexts {
    struct CtsTextBlock *blocks;
    const char **shared; /* n_shared texts in n_slots slots, a power of two, by their hashes */
    size_t n_shared, n_slots;
} CtsTexts;

/* A copy of n bytes and a 0 after them. NULL without memory. */
const char *cts_texts_keep(CtsTexts *texts, const char *text, size_t n);
/* The same pointer for the same text; what follows a 0 byte is left out. NULL without memory. */
const char *cts_texts_share(CtsTexts *texts, const char *text, size_t n);
void cts_texts_free(CtsTexts *texts);

#ifdef __cplusplus
}
#endif
#endif
