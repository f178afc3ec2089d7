/* Who is being received from: one process a peer, under limits, and what it tells of itself. */
#ifndef CTS_NODE_VISITS_H
#define CTS_NODE_VISITS_H

#include "app/node/allow.h"
#include "app/node/spool.h"
#include <sys/types.h>

enum { CTS_MOST_VISITS = 64, CTS_MOST_STUDIES_TOLD = 16 };

/* Shared with the process that serves the peer, which writes it and may be no friend's any more. */
typedef struct CtsVisitTold {
    CtsVisit visit;
    uint64_t n_replaced; /* objects that took the place of the same instance */
    int n_studies;
    struct CtsStudyTold {
        char name[CTS_SPOOL_STUDY];
        uint64_t n_objects;
    } studies[CTS_MOST_STUDIES_TOLD]; /* the last one counts all others too */
} CtsVisitTold;

typedef struct CtsVisitor {
    pid_t pid; /* 0: none */
    CtsAddress address;
    double start_ms;
    CtsVisitTold *told;
} CtsVisitor;

/* How many associations an address has begun in this minute. */
typedef struct CtsRate {
    CtsAddress address;
    double since_ms;
    int n;
} CtsRate;

typedef struct CtsVisits {
    CtsVisitor visitors[CTS_MOST_VISITS];
    CtsVisitTold *shared; /* of all */
    CtsRate rates[256];   /* the oldest makes room */
    int most_of_one, most_a_minute;
} CtsVisits;

CtsStatus cts_visits_open(CtsVisits *visits, CtsError *err);
void cts_visits_close(CtsVisits *visits);
/* A place for a peer at this address, emptied; NULL when it, or all together, have as many as they may. */
CtsVisitor *cts_visits_admit(CtsVisits *visits, const CtsAddress *address, double now_ms);
CtsVisitor *cts_visits_find(CtsVisits *visits, pid_t pid);
/* One more object of a study, by the process that serves the peer. */
void cts_told_object(CtsVisitTold *told, const char *study, bool replaced);

#endif
