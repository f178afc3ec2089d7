#include "output/export/uid.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

enum { UUID_BYTES = 16, MAX_DECIMALS = 40 };

/* Set the version and variant bits, then print the 128 bits as one decimal number. */
static void format_uuid(const uint8_t bytes[UUID_BYTES], unsigned version, char uid[65])
{
    uint8_t uuid[UUID_BYTES];
    memcpy(uuid, bytes, sizeof uuid);
    uuid[6] = (uint8_t)((uuid[6] & 0x0f) | version << 4);
    uuid[8] = (uint8_t)((uuid[8] & 0x3f) | 0x80);
    unsigned __int128 number = 0;
    for (int i = 0; i < UUID_BYTES; i++)
        number = number << 8 | uuid[i];
    char digits[MAX_DECIMALS + 1] = "";
    char *p = digits + MAX_DECIMALS;
    for (*p = 0; number > 0; number /= 10)
        *--p = (char)('0' + (int)(number % 10));
    snprintf(uid, 65, "2.25.%s", p);
}

void cts_uid_from_digest(const uint8_t digest[CTS_DIGEST_BYTES], char uid[65])
{
    format_uuid(digest, 8, uid);
}

CtsStatus cts_uid_keyed(const CtsKey *key, const char *purpose, const char *uid, char keyed[65], CtsError *err)
{
    CtsHash *hash;
    uint8_t digest[CTS_DIGEST_BYTES];
    CtsStatus st = cts_hash_start_keyed(&hash, key, err);
    if (st)
        return st;
    cts_hash_text(hash, "ctsplat");
    cts_hash_text(hash, purpose);
    cts_hash_text(hash, uid);
    if (!(st = cts_hash_finish(&hash, digest, err)))
        cts_uid_from_digest(digest, keyed);
    return st;
}

CtsStatus cts_uid_random(char uid[65], CtsError *err)
{
    uint8_t bytes[UUID_BYTES];
    ssize_t n;
    do
        n = getrandom(bytes, sizeof bytes, 0);
    while (n < 0 && errno == EINTR);
    if (n != UUID_BYTES)
        return cts_fail(err, CTS_ERR_INTERNAL, "the system gave no random numbers for a UID");
    format_uuid(bytes, 4, uid);
    return CTS_OK;
}
