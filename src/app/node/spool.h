/* The folder that received slices go to: one folder a study, names of our own, a limit on each object and on the disk.
 */
#ifndef CTS_NODE_SPOOL_H
#define CTS_NODE_SPOOL_H

#include "output/net/accept.h"

typedef struct CtsSpool {
    const char *folder;
    uint64_t most_object_bytes;
    double free_percent; /* of the disk that stay free */
    int lock;
} CtsSpool;

/* Makes the folder (0750) where it is missing, and locks it. CTS_ERR_INTERNAL when another receiver is at work there.
 */
CtsStatus cts_spool_open(CtsSpool *spool, CtsError *err);
void cts_spool_close(CtsSpool *spool);
/* The path of visitor i's object while it comes. */
void cts_spool_temp(const CtsSpool *spool, int i, char *path, size_t size);
/* Whether an object of n_bytes may be there. */
bool cts_spool_has_room(const CtsSpool *spool, uint64_t n_bytes);

enum { CTS_SPOOL_STUDY = 80 };
/* A complete object moves into its study's folder, whose name is told, once it is on the disk; what is no CT image, or
 * not the one that its sender named, is removed. The same instance takes its former one's place (*replaced). */
CtsStoredAs cts_spool_keep(const CtsSpool *spool, const char *path, const char *sop_uid, char study[CTS_SPOOL_STUDY],
                           bool *replaced);

#endif
