/* Rules for a peer's answer to storing an object, by C-STORE or STOW-RS, on plain data. */
#pragma once

#include "ctsplat/api.h"
#include "dicom/net/peer.h"

CTS_C_BEGIN

/* Words of a status of PS3.4 (B.2.3, C.4.2.1.5), which STOW-RS gives as FailureReason and WarningReason (PS3.18 I.2.2):
 * " (out of resources)"; "" for an unknown one. */
const char *cts_status_words(unsigned status);

/* The entries for one object in the answer of STOW-RS. */
typedef struct CtsStoreAnswer {
    bool stored, failed;       /* it is in ReferencedSOPSequence (0008,1199), in FailedSOPSequence (0008,1198) */
    unsigned failure, warning; /* FailureReason (0008,1197), WarningReason (0008,1196); 0: none */
} CtsStoreAnswer;
/* text: DICOM's JSON model. */
CtsStoreAnswer cts_store_answer_read(const char *text, size_t n, const char *sop_uid);

/* Marks the object as sent: the peer has stored it, `failed` false, maybe with a warning's status, or has it already.
 * Otherwise *result gets the failure: `how` is the peer's answer, as "refuses it with status". */
void cts_outgoing_file_answered(CtsOutgoingFile *outgoing, const CtsNet *net, bool failed, unsigned status,
                                const char *how, CtsAttempt *result);

CTS_C_END
