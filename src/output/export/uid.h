/* DICOM UIDs of ctsplat's own making: "2.25." and a UUID as a decimal number (PS3.5 B.2). */
#ifndef CTS_EXPORT_UID_H
#define CTS_EXPORT_UID_H

#include "base/hash.h"

/* A UUID of version 8 (RFC 9562) from the first 16 bytes of a digest: the same digest gives the same UID, and the UID
 * tells nothing of what was hashed. */
void cts_uid_from_digest(const uint8_t digest[CTS_DIGEST_BYTES], char uid[65]);

/* The UID that stands for another one under a key. */
CtsStatus cts_uid_keyed(const CtsKey *key, const char *purpose, const char *uid, char keyed[65], CtsError *err);

/* A UUID of version 4. CTS_ERR_INTERNAL when the system has no random numbers. */
CtsStatus cts_uid_random(char uid[65], CtsError *err);

#endif
