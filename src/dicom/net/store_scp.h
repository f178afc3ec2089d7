/* Serves one incoming association on its socket: verification (C-ECHO) and storage of CT (C-STORE) into files,
 * unchanged. The caller decides on peers, limits and times. */
#pragma once

#include "ctsplat/api.h"
#include "dicom/net/peer.h"
#include <stdint.h>

CTS_C_BEGIN

/* The status for an object. */
typedef enum CtsStoredAs { CTS_STORED, CTS_STORED_NOT_CT, CTS_STORED_NO_ROOM } CtsStoredAs;

/* The peer's identity, and statistics of the association; updated while it runs. */
typedef struct CtsAssociationInfo {
    char calling_aet[17], called_aet[17];
    char certificate[256];                  /* the subject of the peer's; "" without TLS or without one */
    uint64_t n_objects, n_bytes, n_refused; /* n_bytes: of stored objects */
    char end[200];                          /* how it ended, for messages */
} CtsAssociationInfo;

typedef struct CtsStoreScpRules {
    const CtsNet *net;   /* own AE title, TLS files, timeout for a peer that does not answer */
    bool takes_captures; /* for peers that fail at a series which they may not send whole */
    bool (*allows)(void *context, const char *calling_aet);
    /* The path for the next object, to be freed with free(); NULL: there is no room. */
    char *(*begin)(void *context);
    /* It has n_bytes by now; false breaks the association off. */
    bool (*grows)(void *context, uint64_t n_bytes);
    /* The object is complete: keep or remove it. */
    CtsStoredAs (*keep)(void *context, const char *path, const char *sop_uid);
    void *context;
} CtsStoreScpRules;

/* Takes ownership of socket. Associations of several threads are negotiated one at a time, since DCMTK passes an
 * external socket in a global variable. */
void cts_store_scp_serve(const CtsStoreScpRules *rules, int socket, CtsAssociationInfo *info);
/* Checks the TLS files before any peer connects. */
CtsStatus cts_store_scp_check(const CtsNet *net, CtsError *err);

CTS_C_END
