/* The pixels of a secondary capture wait in a file of their own until the last has come: what the header says depends
 * on them. Compressed ones are compressed on the way there, frame by frame, so that no more than one is in memory. */
#ifndef CTS_EXPORT_SC_SPOOL_H
#define CTS_EXPORT_SC_SPOOL_H

#include "base/file.h"
#include "output/objects/dcm_sc.h"

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
