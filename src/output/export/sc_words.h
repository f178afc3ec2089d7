/* What a secondary capture says of itself in words, codes and numbers, and what it is called. */
#ifndef CTS_EXPORT_SC_WORDS_H
#define CTS_EXPORT_SC_WORDS_H

#include "base/hash.h"
#include "output/export/format.h"
#include "output/objects/dcm_sc.h"

/* Texts are ASCII and fit their attribute. */
typedef struct CtsScWords {
    const char *image_type;
    char series_description[65], description[65]; /* of all views; of this one */
    char derivation[1000], patient_orientation[17];
    char preset_urn[80], preset_meaning[65], engine_urn[80], engine_meaning[65], error_urn[80];
    CtsScCode codes[CTS_SC_MAX_CODES], view;
    int n_codes;
} CtsScWords;

CtsStatus cts_sc_words(const CtsExportJob *job, CtsScWords *words, CtsError *err);

/* The number of a series made of the source's: own (1 to 999) behind the source's number. */
int cts_sc_series_number(const CtsScSource *facts, int own);

typedef struct CtsScNames {
    char study_uid[65], series_uid[65], sop_uid[65];
    char pseudonym[65]; /* "" where the identity stays */
    int series_number, instance_number;
} CtsScNames;

/* pixels: the digest of all frames' views and samples. */
CtsStatus cts_sc_names(const CtsExportJob *job, const CtsScSource *facts, const CtsScWords *words,
                       const uint8_t pixels[CTS_DIGEST_BYTES], CtsScNames *names, CtsError *err);

#endif
