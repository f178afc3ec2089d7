/* Who may send: AE titles and addresses. */
#ifndef CTS_NODE_ALLOW_H
#define CTS_NODE_ALLOW_H

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>

/* An address as IPv6 has it; one of IPv4 is mapped (RFC 4291, 2.5.5.2). */
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

/* Each text is AET@ADDRESS or AET@ADDRESS/BITS; the AE title may be *. CTS_ERR_USAGE names what is neither. */
CtsStatus cts_allow_parse(const char *const *texts, int n, CtsAllowList *list, CtsError *err);
/* Whether the address may send under this AE title; NULL: under any. */
bool cts_allow_has(const CtsAllowList *list, const CtsAddress *address, const char *aet);
void cts_allow_free(CtsAllowList *list);

#endif
