/* What the ways to a peer share. */
#ifndef CTS_NET_PEER_H
#define CTS_NET_PEER_H

#include "base/text.h"
#include "ctsplat/net.h"
#include "input/header/head.h"
#include "output/net/inbox.h"
#include <stddef.h>

CTS_C_BEGIN

bool cts_aet_is_valid(const char *aet, size_t n);
/* Whether a URL names this machine. */
bool cts_url_is_here(const char *url);

/* One file on its way to a peer. */
typedef struct CtsParcel {
    const char *path;
    CtsDcmIds ids;
    bool sent;
} CtsParcel;

/* A failure of one try; `again`: another one may do better. */
typedef struct CtsTry {
    bool again;
    CtsError error;
} CtsTry;

typedef struct CtsRequest {
    const char *study_uid, *series_uid; /* series_uid may be NULL */
    CtsInbox *inbox;
    CtsReport *report;
    int *n_promised; /* objects that there are by the peer's own count, as far as it tells */
} CtsRequest;

struct CtsAcceptRules;
struct CtsVisit;

/* Both ways in one table. send takes the parcels that are not sent yet, in order, and marks those that are. */
typedef struct CtsWay {
    void (*send)(const CtsPeer *peer, const CtsNet *net, CtsParcel *parcels, int n_parcels, CtsTry *result);
    CtsStatus (*fetch)(const CtsPeer *peer, const CtsNet *net, const CtsRequest *request, CtsError *err);
    CtsStatus (*find)(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *query, CtsFound *found,
                      CtsError *err);
    /* Of DIMSE alone: output/net/accept.h. */
    void (*accept)(const struct CtsAcceptRules *rules, int socket, struct CtsVisit *visit);
    CtsStatus (*accept_check)(const CtsNet *net, CtsError *err);
} CtsWay;

/* The ways stand in a library of their own, CTS_NET_PART, with all that only the network needs: loading it takes
 * longer than starting the rest of the program. It shows cts_net_way() alone; the ways use none of the program's state.
 */
extern const CtsWay cts_way_dimse, cts_way_web;
typedef const CtsWay *(*cts_net_way_fn)(bool web);
const CtsWay *cts_net_way(bool web);
/* Loads the library when first called, and makes DCMTK ready. */
CtsStatus cts_way_find(const CtsPeer *peer, const CtsWay **way, CtsError *err);

/* What is 0 or NULL stands for what the header says. */
CtsNet cts_net_with_defaults(const CtsNet *net);
/* One more; what names no series by UIDs is left out. */
CtsStatus cts_found_add(CtsFound *found, const CtsFoundSeries *series, CtsError *err);
bool cts_net_stopped(const CtsNet *net);
/* The peer has confirmed it. */
void cts_parcel_is_sent(CtsParcel *parcel, const CtsNet *net);

CTS_C_END
#endif
