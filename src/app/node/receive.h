/* The receiver: listens on one address, and serves each peer that may send in a process of its own. */
#ifndef CTS_NODE_RECEIVE_H
#define CTS_NODE_RECEIVE_H

#include "ctsplat/net.h"

typedef struct CtsReceiveSettings {
    const char *folder, *listen; /* ADDRESS:PORT; port 0 is any */
    const char *record;          /* NULL: FOLDER/received.jsonl */
    const char *const *allow;    /* as cts_allow_parse() has them; n_allow */
    int n_allow;
    const CtsNet *net;   /* own AE title, TLS, how long a silent peer is waited for, and when to stop */
    int most_of_one;     /* associations of one address at a time, */
    int most_a_minute;   /* and begun in a minute */
    int deadline_s;      /* of one association */
    double object_mib;   /* the largest object */
    double free_percent; /* of the disk that stay free */
    void (*told)(const char *text);
} CtsReceiveSettings;

/* Until net->stop is set: CTS_OK. */
CtsStatus cts_receive(const CtsReceiveSettings *settings, CtsError *err);

#endif
