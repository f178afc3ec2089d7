#include "base/hash.h"

#include <openssl/evp.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct CtsHash {
    EVP_MD_CTX *context;
    bool failed;
};

CtsStatus cts_hash_start(CtsHash **hash, CtsError *err)
{
    CtsHash *h = *hash = calloc(1, sizeof *h);
    if (!h || !(h->context = EVP_MD_CTX_new())) {
        free(h);
        *hash = NULL;
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    h->failed = EVP_DigestInit_ex(h->context, EVP_sha256(), NULL) != 1;
    return CTS_OK;
}

void cts_hash_bytes(CtsHash *hash, const void *bytes, size_t n)
{
    if (EVP_DigestUpdate(hash->context, bytes, n) != 1)
        hash->failed = true;
}

void cts_hash_text(CtsHash *hash, const char *text)
{
    cts_hash_bytes(hash, text, strlen(text) + 1);
}

CtsStatus cts_hash_finish(CtsHash **hash, uint8_t digest[CTS_DIGEST_BYTES], CtsError *err)
{
    CtsHash *h = *hash;
    unsigned n = 0;
    const bool bad = EVP_DigestFinal_ex(h->context, digest, &n) != 1 || n != CTS_DIGEST_BYTES || h->failed;
    EVP_MD_CTX_free(h->context);
    free(h);
    *hash = NULL;
    return bad ? cts_fail(err, CTS_ERR_INTERNAL, "SHA-256 failed in libcrypto") : CTS_OK;
}
