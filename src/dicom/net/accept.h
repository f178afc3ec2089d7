/* One association that a peer has opened, served on its socket: verification (C-ECHO) and storage of CT (C-STORE), bit
 * by bit into files. Whom to listen to, how much and for how long is the caller's to say. */
#ifndef CTS_DICOM_ACCEPT_H
#define CTS_DICOM_ACCEPT_H

#include "ctsplat/api.h"
#include "dicom/net/peer.h"
#include <stdint.h>

CTS_C_BEGIN

/* What the peer is told of an object. */
typedef enum CtsStoredAs { CTS_STORED, CTS_STORED_NOT_CT, CTS_STORED_NO_ROOM } CtsStoredAs;

/* Who the peer says it is, and how the association went; filled on the way. */
typedef struct CtsVisit {
    char calling_aet[17], called_aet[17];
    char certificate[256];                  /* the subject of the peer's; "" without TLS or without one */
    uint64_t n_objects, n_bytes, n_refused; /* n_bytes of what was stored */
    char end[200];                          /* how it ended, for people */
} CtsVisit;

typedef struct CtsAcceptRules {
    const CtsNet *net;   /* own AE title, TLS files, timeout for a peer that does not answer */
    bool takes_captures; /* for peers that fail at a series which they may not send whole */
    bool (*allows)(void *context, const char *calling_aet);
    /* Where the next object goes, to be freed with free(); NULL: there is no room. */
    char *(*begin)(void *context);
    /* It has n_bytes by now; false breaks the association off. */
    bool (*grows)(void *context, uint64_t n_bytes);
    /* It is complete: keep it, or remove it. */
    CtsStoredAs (*keep)(void *context, const char *path, const char *sop_uid);
    void *context;
} CtsAcceptRules;

/* Takes the socket over. Of several threads one at a time is served until its association stands, for DCMTK takes a
 * socket from outside in a variable of its own. */
void cts_accept(const CtsAcceptRules *rules, int socket, CtsVisit *visit);
/* Whether the TLS files are good: before any peer comes. */
CtsStatus cts_accept_check(const CtsNet *net, CtsError *err);

CTS_C_END
#endif
