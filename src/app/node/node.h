/* The receiver: listens on one address, and serves each peer that may send in a process of its own. */
#pragma once

#include "app/options/options.h"
#include "dicom/net/store_scp.h"
#include <sys/socket.h>
#include <sys/types.h>

/* allow.c: the permitted peers, by AE titles and addresses. An address is stored as IPv6; one of IPv4 is mapped (RFC
 * 4291, 2.5.5.2). */
typedef struct CtsAddress {
    uint8_t bytes[16];
} CtsAddress;

typedef struct CtsAllow {
    char aet[17]; /* "" for any */
    CtsAddress address;
    int n_bits; /* of the address that count */
} CtsAllow;

typedef struct CtsAllowList {
    CtsAllow *items; /* owned */
    int n;           /* 0: this machine alone, under any AE title */
} CtsAllowList;

CtsAddress cts_address_of(const struct sockaddr_storage *from);
void cts_address_text(const CtsAddress *address, char *text, socklen_t size);

/* Each text is AET@ADDRESS or AET@ADDRESS/BITS; the AE title may be *. CTS_ERR_USAGE names an invalid text. */
CtsStatus cts_allow_parse(const char *const *texts, int n, CtsAllowList *list, CtsError *err);
/* True if the address may send under this AE title; NULL: under any. */
bool cts_allow_has(const CtsAllowList *list, const CtsAddress *address, const char *aet);
void cts_allow_free(CtsAllowList *list);

/* spool.c: the folder of received slices: one folder per study, file names of our own, limits on objects and on the
 * disk. */
typedef struct CtsSpool {
    const char *folder;
    uint64_t max_object_bytes;
    double free_percent; /* of the disk that stay free */
    int lock;
} CtsSpool;

/* Makes the folder (0750) where it is missing, and locks it. CTS_ERR_INTERNAL when another receiver is running there.
 */
CtsStatus cts_spool_open(CtsSpool *spool, CtsError *err);
void cts_spool_close(CtsSpool *spool);
/* The path of the object that peer process i is receiving. */
void cts_spool_temp(const CtsSpool *spool, int i, char *path, size_t size);
/* True if there is room for an object of n_bytes. */
bool cts_spool_has_room(const CtsSpool *spool, uint64_t n_bytes);

enum { CTS_SPOOL_STUDY = 80 }; /* bytes of a folder's name: ST_ and a UID of up to 64, or a hash */
/* Moves a complete object into its study's folder (returned in study) once it is on the disk; removes one that is not a
 * CT image or not the announced one. *replaced: it replaced the same instance. */
CtsStoredAs cts_spool_keep(const CtsSpool *spool, const char *path, const char *sop_uid, char study[CTS_SPOOL_STUDY],
                           bool *replaced);

/* CTS_MAX_ASSOCIATIONS: processes at a time; with the default, 8 addresses have all theirs. CTS_MAX_STUDY_COUNTS:
 * studies that an association's record names; further ones are counted together. */
enum { CTS_MAX_ASSOCIATIONS = 64, CTS_MAX_STUDY_COUNTS = 16 };

/* associations.c: current peers, one process each, and their limits. This part is memory shared with the process that
 * serves the peer; it writes it, and may be compromised. */
typedef struct CtsAssociationRecord {
    CtsAssociationInfo info;
    uint64_t n_replaced; /* objects that took the place of the same instance */
    int n_studies;
    struct CtsStudyCount {
        char name[CTS_SPOOL_STUDY];
        uint64_t n_objects;
    } studies[CTS_MAX_STUDY_COUNTS]; /* the last one counts all others too */
} CtsAssociationRecord;

typedef struct CtsAssociationProcess {
    pid_t pid; /* 0: none */
    CtsAddress address;
    double start_ms;
    CtsAssociationRecord *record;
} CtsAssociationProcess;

/* Number of associations that an address has begun in this minute. */
typedef struct CtsRate {
    CtsAddress address;
    double since_ms;
    int n;
} CtsRate;

typedef struct CtsAssociations {
    CtsAssociationProcess peer_processes[CTS_MAX_ASSOCIATIONS];
    CtsAssociationRecord *shared; /* of all */
    CtsRate rates[256];           /* of the last 256 addresses: the oldest makes room */
    int max_of_one, max_a_minute;
} CtsAssociations;

CtsStatus cts_associations_open(CtsAssociations *associations, CtsError *err);
void cts_associations_close(CtsAssociations *associations);
/* A place for a peer at this address, emptied; NULL when it, or all together, have as many as they may. */
CtsAssociationProcess *cts_associations_admit(CtsAssociations *associations, const CtsAddress *address, double now_ms);
CtsAssociationProcess *cts_associations_find(CtsAssociations *associations, pid_t pid);
/* One more object of a study, by the process that serves the peer. */
void cts_association_count_object(CtsAssociationRecord *record, const char *study, bool replaced);

/* The record of associations (sender, time, amount): a JSON Lines file, opened for each line, so that it may be moved
 * away. CTS_ERR_OUTPUT when the file (0640; "-" is standard error) cannot be written. */
CtsStatus cts_record_check(const char *path, CtsError *err);
/* Records an association that has ended; how: the wait status of its process. Of that process's own report only the
 * reason's text is trusted. */
CtsStatus cts_record_association(const char *path, const CtsAssociationProcess *peer_process, int how, double now_ms,
                                 CtsError *err);
/* Connections that were closed at once, the last of them from this address. */
CtsStatus cts_record_rejections(const char *path, uint64_t n, const CtsAddress *last, CtsError *err);

/* Runs until options->net.stop is set: CTS_OK. Options are those of the command `receive`; on_text gets each line for
 * the user. */
CtsStatus cts_receive(const CtsOptions *options, void (*on_text)(const char *text), CtsError *err);
