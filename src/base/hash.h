/* SHA-256 through OpenSSL's libcrypto, and names made from it. */
#pragma once

#include "base/site_key.h"
#include "ctsplat/status.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

enum { CTS_DIGEST_BYTES = 32 };

typedef struct CtsHash CtsHash;

/* HMAC-SHA256 (RFC 2104) under a key; NULL: plain SHA-256. A failure of this or an intermediate step is returned by
 * cts_hash_finish(), which frees the hash in any case. */
CtsHash *cts_hash_start(const CtsKey *key);
void cts_hash_bytes(CtsHash *hash, const void *bytes, size_t n);
/* With its final 0, so that neighbouring texts cannot run into each other. */
void cts_hash_text(CtsHash *hash, const char *text);
CtsStatus cts_hash_finish(CtsHash **hash, uint8_t digest[CTS_DIGEST_BYTES], CtsError *err);
/* The same as 64 hex digits and a 0. */
CtsStatus cts_hash_hex(CtsHash **hash, char hex[2 * CTS_DIGEST_BYTES + 1], CtsError *err);

CTS_C_END
