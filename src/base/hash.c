#define OPENSSL_API_COMPAT 10100 /* the plain functions: EVP makes itself ready with code that memory may fail under   \
                                  */
#include "base/hash.h"

#include <openssl/sha.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct CtsHash {
    SHA256_CTX context;
    bool failed;
};

CtsStatus cts_hash_start(CtsHash **hash, CtsError *err)
{
    CtsHash *h = *hash = calloc(1, sizeof *h);
    if (!h)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    h->failed = SHA256_Init(&h->context) != 1;
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
    const bool bad = SHA256_Final(digest, &h->context) != 1 || h->failed;
    free(h);
    *hash = NULL;
    return bad ? cts_fail(err, CTS_ERR_INTERNAL, "SHA-256 failed in libcrypto") : CTS_OK;
}
