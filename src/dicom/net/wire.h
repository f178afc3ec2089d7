/* Messages between the library and the program ctsplat-net, over a socket: a request, then answers up to the last one.
 * Both are of one build, so that structures go as they lie in memory. */
#pragma once

#include "base/file.h"
#include "dicom/net/peer.h"

typedef enum CtsNetTask { CTS_NET_SEND, CTS_NET_FETCH, CTS_NET_FIND, CTS_N_NET_TASKS } CtsNetTask;

/* Its texts may be NULL. */
typedef struct CtsNetRequest {
    CtsNetTask task;
    CtsPeer peer;
    CtsNet net;                /* of which functions and what is no text are each side's own */
    CtsSeriesQuery query;      /* of a fetch its UIDs */
    const char *folder;        /* of a fetch */
    CtsOutgoingFile *outgoing; /* n_outgoing files to be sent */
    int n_outgoing;
} CtsNetRequest;

typedef enum CtsNetAnswerKind { CTS_NET_SENT, CTS_NET_DIAGNOSTIC, CTS_NET_FOUND, CTS_NET_END } CtsNetAnswerKind;

typedef struct CtsNetAnswer {
    CtsNetAnswerKind kind;
    int number;                  /* SENT: index of the file; DIAGNOSTIC: its id */
    CtsFoundSeries found;        /* FOUND */
    CtsAttempt result;           /* END, with the error's text; DIAGNOSTIC: its text */
    CtsFetchFolder fetch_folder; /* END of a fetch: its counts */
} CtsNetAnswer;

/* False when the other side is gone. */
bool cts_wire_read(int socket, void *bytes, size_t n);
/* A request with its texts and files; the one read owns them. False also without memory, and for a text past 64 KiB. */
bool cts_wire_write_request(int socket, const CtsNetRequest *request);
bool cts_wire_read_request(int socket, CtsNetRequest *request);

/* The library's way to the protocols: runs a request by the program. found (NULL: none are asked for) gets what is
 * found. *last is the last answer; the status is that of its error. */
CtsStatus cts_program_run(const CtsNetRequest *request, CtsFound *found, CtsNetAnswer *last);
