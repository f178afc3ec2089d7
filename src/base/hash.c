/* The plain functions: EVP makes itself ready with code that memory may fail under. */
#define OPENSSL_API_COMPAT 10100
#include "base/hash.h"

#include <openssl/sha.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_BYTES = 64 };

struct CtsHash {
    SHA256_CTX context;
    bool failed, keyed;
    uint8_t outer[BLOCK_BYTES];
};

CtsStatus cts_hash_start(CtsHash **hash, CtsError *err)
{
    CtsHash *h = *hash = calloc(1, sizeof *h);
    if (!h)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    h->failed = SHA256_Init(&h->context) != 1;
    return CTS_OK;
}

CtsStatus cts_hash_start_keyed(CtsHash **hash, const CtsKey *key, CtsError *err)
{
    uint8_t inner[BLOCK_BYTES];
    const CtsStatus st = cts_hash_start(hash, err);
    if (st || !key)
        return st;
    (*hash)->keyed = true;
    for (int i = 0; i < BLOCK_BYTES; i++) {
        const uint8_t byte = i < CTS_KEY_BYTES ? key->bytes[i] : 0;
        inner[i] = byte ^ 0x36;
        (*hash)->outer[i] = byte ^ 0x5c;
    }
    cts_hash_bytes(*hash, inner, sizeof inner);
    return CTS_OK;
}

void cts_hash_bytes(CtsHash *hash, const void *bytes, size_t n)
{
    if (SHA256_Update(&hash->context, bytes, n) != 1)
        hash->failed = true;
}

void cts_hash_text(CtsHash *hash, const char *text)
{
    cts_hash_bytes(hash, text, strlen(text) + 1);
}

CtsStatus cts_hash_finish(CtsHash **hash, uint8_t digest[CTS_DIGEST_BYTES], CtsError *err)
{
    CtsHash *h = *hash;
    bool bad = SHA256_Final(digest, &h->context) != 1 || h->failed;
    if (h->keyed)
        bad |= SHA256_Init(&h->context) != 1 || SHA256_Update(&h->context, h->outer, BLOCK_BYTES) != 1 ||
               SHA256_Update(&h->context, digest, CTS_DIGEST_BYTES) != 1 || SHA256_Final(digest, &h->context) != 1;
    free(h);
    *hash = NULL;
    return bad ? cts_fail(err, CTS_ERR_INTERNAL, "SHA-256 failed in libcrypto") : CTS_OK;
}

CtsStatus cts_hash_hex(CtsHash **hash, char hex[2 * CTS_DIGEST_BYTES + 1], CtsError *err)
{
    uint8_t digest[CTS_DIGEST_BYTES];
    const CtsStatus st = cts_hash_finish(hash, digest, err);
    for (int i = 0; !st && i < CTS_DIGEST_BYTES; i++)
        snprintf(hex + 2 * i, 3, "%02x", digest[i]);
    return st;
}
