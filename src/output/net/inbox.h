/* The folder that fetched files go to: private, with names of our own, under limits. */
#ifndef CTS_NET_INBOX_H
#define CTS_NET_INBOX_H

#include "ctsplat/status.h"
#include <stdint.h>

CTS_C_BEGIN

enum {
    CTS_INBOX_MAX_FILES = 50000,
    CTS_INBOX_MAX_FILE_MIB = 4096, /* an enhanced object holds all slices */
    CTS_INBOX_MAX_MIB = 65536
};

typedef struct CtsInbox {
    char *folder; /* owned */
    int lock;     /* held while the folder is in use */
    int n_files;
    uint64_t n_bytes; /* of the files that are complete */
} CtsInbox;

/* In $TMPDIR or /tmp, mode 0700. Removes those there whose programs were killed. */
CtsStatus cts_inbox_make(CtsInbox *inbox, CtsError *err);
/* The next file's path, to be freed with free(); it does not exist. CTS_ERR_READ past the limits, the disk's free space
 * (of which a tenth is left) among them. */
CtsStatus cts_inbox_next(CtsInbox *inbox, char **path, CtsError *err);
/* The file being received has n_bytes by now. CTS_ERR_READ when that is too much for a file, the inbox or the disk. */
CtsStatus cts_inbox_grows(const CtsInbox *inbox, uint64_t n_bytes, CtsError *err);
/* That file is complete. CTS_ERR_READ when it made the inbox too large. */
CtsStatus cts_inbox_keep(CtsInbox *inbox, const char *path, CtsError *err);
/* Without the files after the first n. */
void cts_inbox_cut(CtsInbox *inbox, int n);
/* Folder and files, and the lock. */
void cts_inbox_remove(char **folder, int *lock);

CTS_C_END
#endif
