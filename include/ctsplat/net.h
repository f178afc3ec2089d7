/* Series from a PACS, pictures to one: DIMSE (C-GET, C-MOVE, C-STORE) or DICOMweb (WADO-RS, STOW-RS). */
#pragma once

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <signal.h>
#include <stdbool.h>

CTS_API_BEGIN

/* AET@HOST:PORT, or the root of a DICOMweb service: http://... or https://... */
typedef struct CtsPeer {
    bool web;
    char aet[17], host[256];
    int port;
    char url[1024]; /* without a slash at the end */
} CtsPeer;

/* CTS_ERR_USAGE for an invalid peer; a URL must not contain a password. */
CtsStatus cts_peer_parse(const char *text, CtsPeer *peer, CtsError *err);

/* Strings stay the caller's. */
typedef struct CtsNet {
    const char *own_aet; /* calling AE title; NULL: CTSPLAT */
    const char *tls_ca;  /* PEM file of certificates to trust. With any of the three, DIMSE uses TLS; */
    const char *tls_key, *tls_certificate; /* PEM files that name this side; NULL: anonymous */
    const char *credentials; /* DICOMweb: file with "user:password" or "Bearer token"; NULL: $CTSPLAT_CREDENTIALS */
    int timeout_s;           /* timeout for a peer that does not answer; 0: 30 */
    int n_tries;             /* to send, with pauses that double between them; 0: 4 */
    int move_port;           /* fetch by C-MOVE to this port of ours; 0: by C-GET */
    bool insecure_http;      /* allow credentials over plain http to other machines */
    const volatile sig_atomic_t *stop;             /* cancels with CTS_ERR_INTERRUPTED when set; may be NULL */
    void (*sent)(void *context, const char *path); /* a file that the peer has confirmed; may be NULL */
    void *context;                                 /* for sent */
    CtsReport *report; /* gets what a peer warns of when searching and storing; may be NULL */
} CtsNet;

/* Checks before any work; peer may be NULL. */
CtsStatus cts_net_check(const CtsPeer *peer, const CtsNet *net, CtsError *err);

/* Sends DICOM files. No file is lost when a peer is down, refuses or fails: CTS_ERR_OUTPUT names the first file not
 * sent and the way to send it again. *n_sent counts confirmed ones (may be NULL). */
CtsStatus cts_net_send(const CtsPeer *peer, const CtsNet *net, const char *const *paths, int n_paths, int *n_sent,
                       CtsError *err);

/* Search keys of series: each that is not NULL must match, as the peer implements it (PS3.4 C.2.2.2): * and ? stand for
 * any characters, two dates with - between them for a range. */
typedef struct CtsSeriesQuery {
    const char *study_uid, *series_uid, *accession, *patient_id, *study_date, *modality;
} CtsSeriesQuery;

/* The peer's attributes of a series; "" if missing. Date and description may identify the patient. */
typedef struct CtsFoundSeries {
    char study_uid[65], series_uid[65], modality[17], study_date[9], description[65];
    int n_objects; /* 0: unknown */
} CtsFoundSeries;

enum { CTS_MAX_FOUND = 20000 };
typedef struct CtsFound {
    CtsFoundSeries *items; /* n, owned */
    int n;
} CtsFound;

/* The series that a query names, by C-FIND or QIDO-RS, in the peer's order, each once. Answers with an attribute that
 * contradicts a key are left out, and reported. CTS_ERR_USAGE where the query names nothing but a modality, for that
 * would be a whole archive. Free with cts_found_free(), in any case. */
CtsStatus cts_net_find(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *query, CtsFound *found,
                       CtsError *err);
void cts_found_free(CtsFound *found);

/* Fetched files. The folder of a killed program is removed when the next one fetches. */
typedef struct CtsFetched {
    char *folder; /* NULL: none */
    int lock;     /* lock that marks the folder as in use */
} CtsFetched;

/* Fetches the CT images of the study wanted, or of one of its series (series_uid not NULL), as files in a folder that
 * only this user can read, under names independent of the peer. CTS_ERR_READ when nothing arrives, or more than the
 * limits allow, or when an object's PatientID contradicts patient_id; other keys do not matter. Remove the folder with
 * cts_net_fetched_remove() in any case. */
CtsStatus cts_net_fetch(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *wanted, CtsFetched *fetched,
                        CtsReport *report, CtsError *err);

/* Removes the folder with its contents; does nothing when there is none. */
void cts_net_fetched_remove(CtsFetched *fetched);

CTS_API_END
