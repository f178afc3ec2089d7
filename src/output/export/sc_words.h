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
    CtsScCode mode, view;
} CtsScWords;

void cts_sc_words(const CtsExportJob *job, CtsScWords *words);

/* What UIDs are made of: what one is for and the slices that it is of, under a key (NULL: none), and whatever is added
 * before it is finished. */
CtsStatus cts_sc_hash_start(CtsHash **hash, const CtsKey *key, const char *purpose, const CtsSeries *source,
                            CtsError *err);
CtsStatus cts_sc_hash_finish(CtsHash **hash, char uid[65], CtsError *err);

/* The number of a series made of the source's: own (1 to 999) behind the source's number. */
int cts_sc_series_number(const CtsSeries *source, int own);

typedef struct CtsScNames {
    char study_uid[65], series_uid[65], sop_uid[65];
    char pseudonym[65]; /* "" where the identity stays */
    int series_number, instance_number;
} CtsScNames;

/* pixels: the digest of all frames' views and samples. */
CtsStatus cts_sc_names(const CtsExportJob *job, const CtsScWords *words, const uint8_t pixels[CTS_DIGEST_BYTES],
                       CtsScNames *names, CtsError *err);

#endif
