/* What a secondary capture says of itself in words, codes and numbers, and what it is called. */
#ifndef CTS_EXPORT_SC_WORDS_H
#define CTS_EXPORT_SC_WORDS_H

#include "base/hash.h"
#include "dicom/objects/objects.h"
#include "output/export/format.h"
#include <stddef.h>
#include <stdint.h>

/* DICOM UIDs of ctsplat's own making: "2.25." and a UUID as a decimal number (PS3.5 B.2). The UID that stands for
 * another one under a key. */
CtsStatus cts_uid_keyed(const CtsKey *key, const char *purpose, const char *uid, char keyed[65], CtsError *err);

void cts_sc_words(const CtsExportJob *job, CtsScWords *words);

/* What UIDs are made of: what one is for and the slices that it is of, under a key (NULL: none), and whatever is added
 * before it is finished. */
CtsStatus cts_sc_hash_start(CtsHash **hash, const CtsKey *key, const char *purpose, const CtsSeries *source,
                            CtsError *err);
CtsStatus cts_sc_hash_finish(CtsHash **hash, char uid[65], CtsError *err);

/* The number of a series made of the source's: own (1 to 999) behind the source's number. */
int cts_sc_series_number(const CtsSeries *source, int own);

/* pixels: the digest of all frames' views and samples. */
CtsStatus cts_sc_names(const CtsExportJob *job, const CtsScWords *words, const uint8_t pixels[CTS_DIGEST_BYTES],
                       CtsScNames *names, CtsError *err);

/* The pixels of a secondary capture wait in a file of their own until the last has come: what the header says depends
 * on them. Compressed ones are compressed on the way there, frame by frame, so that no more than one is in memory. */
typedef struct CtsScSpool {
    CtsTempFile *file;
    const char *syntax_uid; /* NULL: not compressed */
    CtsScFrame frame;       /* one frame; its samples are there only when they are compressed */
    size_t n_frame_bytes;   /* that came so far */
    uint32_t *offsets;      /* of each frame's first fragment behind the table of them */
    int n_frames, max_frames;
    uint64_t n_bytes; /* in the file */
} CtsScSpool;

/* frame: all but samples. The file stands beside path. */
CtsStatus cts_sc_spool_open(CtsScSpool *spool, const char *path, const char *syntax_uid, const CtsScFrame *frame,
                            int n_frames, CtsError *err);
/* Samples in the order of the rows; words in this machine's order. */
CtsStatus cts_sc_spool_write(CtsScSpool *spool, void *samples, size_t n_bytes, CtsError *err);
/* The whole element PixelData (7FE0,0010), once all frames are there. */
CtsStatus cts_sc_spool_copy(const CtsScSpool *spool, CtsTempFile *to, CtsError *err);
void cts_sc_spool_close(CtsScSpool *spool);

#endif
