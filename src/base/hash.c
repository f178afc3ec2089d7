#include "base/hash.h"

#include <openssl/evp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A digest, or under a key a signature, as OpenSSL has HMAC in steps. */
struct CtsHash {
    EVP_MD_CTX *context;
    bool failed, keyed;
};

CtsHash *cts_hash_start(const CtsKey *key)
{
    CtsHash *h = calloc(1, sizeof *h);
    if (!h)
        return NULL;
    h->context = EVP_MD_CTX_new();
    h->keyed = key;
    EVP_PKEY *const pkey = key ? EVP_PKEY_new_mac_key(EVP_PKEY_HMAC, NULL, key->bytes, CTS_KEY_BYTES) : NULL;
    if (key)
        h->failed = !pkey || !h->context || EVP_DigestSignInit(h->context, NULL, EVP_sha256(), NULL, pkey) != 1;
    else
        h->failed = !h->context || EVP_DigestInit_ex(h->context, EVP_sha256(), NULL) != 1;
    EVP_PKEY_free(pkey);
    return h;
}

void cts_hash_bytes(CtsHash *hash, const void *bytes, size_t n)
{
    if (hash)
        hash->failed = hash->failed || (hash->keyed ? EVP_DigestSignUpdate(hash->context, bytes, n)
                                                    : EVP_DigestUpdate(hash->context, bytes, n)) != 1;
}

void cts_hash_text(CtsHash *hash, const char *text)
{
    cts_hash_bytes(hash, text, strlen(text) + 1);
}

CtsStatus cts_hash_finish(CtsHash **hash, uint8_t digest[CTS_DIGEST_BYTES], CtsError *err)
{
    CtsHash *h = *hash;
    size_t n = CTS_DIGEST_BYTES;
    if (!h)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const bool bad = h->failed || (h->keyed ? EVP_DigestSignFinal(h->context, digest, &n)
                                            : EVP_DigestFinal_ex(h->context, digest, NULL)) != 1;
    EVP_MD_CTX_free(h->context);
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
