/* Interface shared by DIMSE and DICOMweb. */
#pragma once

#include "base/text.h"
#include "ctsplat/net.h"
#include "dicom/header/dicom_object.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

enum {
    CTS_FETCH_MAX_FILES = 50000,   /* a series has at most 20000 slices; a study of several series fits */
    CTS_FETCH_MAX_FILE_MIB = 4096, /* an enhanced object holds all slices: 8000 of 512 x 512 */
    CTS_FETCH_MAX_MIB = 65536      /* 50000 slices of 512 x 512 take 25 GiB */
};

/* A folder for fetched files: private, with our own file names, under limits. */
typedef struct CtsFetchFolder {
    const char *folder;
    int n_files;
    int n_promised;   /* objects by the peer's own count, if given */
    uint64_t n_bytes; /* of the files that are complete */
} CtsFetchFolder;

/* In $TMPDIR or /tmp, mode 0700, and locked. Removes those there whose programs were killed. */
CtsStatus cts_fetch_folder_make(CtsFetched *fetched, CtsError *err);
/* The next file's path, to be freed with free(); it does not exist. CTS_ERR_READ past the limits, the disk's free space
 * (of which a tenth is left) among them. */
CtsStatus cts_fetch_folder_next(CtsFetchFolder *fetch_folder, char **path, CtsError *err);
/* The file being received has n_bytes by now. CTS_ERR_READ when that is too much for a file, the folder or the disk. */
CtsStatus cts_fetch_folder_grows(const CtsFetchFolder *fetch_folder, uint64_t n_bytes, CtsError *err);
/* The file is complete. CTS_ERR_READ when it exceeds the folder's limits. */
CtsStatus cts_fetch_folder_keep(CtsFetchFolder *fetch_folder, const char *path, CtsError *err);
/* Without the files after the first n. */
void cts_fetch_folder_limit(CtsFetchFolder *fetch_folder, int n);

bool cts_aet_is_valid(const char *aet, size_t n);
/* True if a URL names this machine. */
bool cts_url_is_here(const char *url);

/* A file to be sent to a peer. */
typedef struct CtsOutgoingFile {
    const char *path;
    CtsDcmIds ids;
    bool sent;
} CtsOutgoingFile;

/* A failed try. */
typedef struct CtsAttempt {
    bool again;       /* another try may succeed */
    char remedy[100]; /* of a permanent failure; "": the file may be sent by hand */
    CtsError error;
} CtsAttempt;

/* The functions of a protocol. send transmits the files not yet sent, in order, and marks them; fetch takes a
 * study_uid, and a series_uid or NULL. */
typedef struct CtsProtocol {
    void (*send)(const CtsPeer *peer, const CtsNet *net, CtsOutgoingFile *outgoing_files, int n_outgoing,
                 CtsAttempt *result);
    CtsStatus (*fetch)(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *wanted, CtsFetchFolder *folder,
                       CtsError *err);
    CtsStatus (*find)(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *query, CtsFound *found,
                      CtsError *err);
} CtsProtocol;

/* The protocols, which are in the program ctsplat-net alone, since starting their dependencies takes longer than the
 * rest of the program's start. */
extern const CtsProtocol cts_protocol_dimse, cts_protocol_web;

bool cts_net_stopped(const CtsNet *net);

CTS_C_END
