#include "app/node/node.h"

#include "base/mem.h"
#include "dicom/net/peer.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const uint8_t mapped[12] = {[10] = 0xff, [11] = 0xff};

CtsAddress cts_address_of(const struct sockaddr_storage *from)
{
    CtsAddress address = {{0}};
    struct sockaddr_in v4;
    struct sockaddr_in6 v6;
    if (from->ss_family == AF_INET6) {
        memcpy(&v6, from, sizeof v6);
        memcpy(address.bytes, &v6.sin6_addr, 16);
    } else {
        memcpy(&v4, from, sizeof v4);
        memcpy(address.bytes, mapped, sizeof mapped);
        memcpy(address.bytes + sizeof mapped, &v4.sin_addr, 4);
    }
    return address;
}

void cts_address_text(const CtsAddress *address, char *text, socklen_t size)
{
    const bool v4 = !memcmp(address->bytes, mapped, sizeof mapped);
    inet_ntop(v4 ? AF_INET : AF_INET6, address->bytes + (v4 ? sizeof mapped : 0), text, size);
}

static CtsStatus parse_one(const char *text, CtsAllow *allow, CtsError *err)
{
    const char *at = strrchr(text, '@'), *slash = at ? strchr(at, '/') : NULL;
    char address[64], *end = "";
    const size_t n_aet = at ? (size_t)(at - text) : 0;
    const bool any = n_aet == 1 && *text == '*';
    *allow = (CtsAllow){.n_bits = 128};
    if (!at || (!any && !cts_aet_is_valid(text, n_aet)))
        return cts_fail(err, CTS_ERR_USAGE, "`allow` %.80s: has no AE title (AET@ADDRESS, or *@ADDRESS for any)", text);
    if (!any)
        memcpy(allow->aet, text, n_aet);
    snprintf(address, sizeof address, "%.*s", slash ? (int)(slash - at - 1) : 60, at + 1);
    const bool v4 = inet_pton(AF_INET, address, allow->address.bytes + sizeof mapped) == 1;
    if (v4)
        memcpy(allow->address.bytes, mapped, sizeof mapped);
    else if (inet_pton(AF_INET6, address, allow->address.bytes) != 1)
        return cts_fail(err, CTS_ERR_USAGE, "`allow` %.80s: has no numeric address, such as 192.0.2.10", text);
    if (slash) {
        const long n = slash[1] ? strtol(slash + 1, &end, 10) : -1, most = v4 ? 32 : 128;
        if (n < 0 || n > most || *end)
            return cts_fail(err, CTS_ERR_USAGE, "`allow` %.80s: what follows / is not 0 to %ld bits", text, most);
        allow->n_bits = (int)(n + 128 - most);
    }
    return CTS_OK;
}

CtsStatus cts_allow_parse(const char *const *texts, int n, CtsAllowList *list, CtsError *err)
{
    *list = (CtsAllowList){.n = n};
    CtsStatus st = cts_alloc_array(&list->items, (size_t)n + 1, err);
    for (int i = 0; i < n && !st; i++)
        st = parse_one(texts[i], &list->items[i], err);
    if (st)
        cts_allow_free(list);
    return st;
}

static bool is_within(const CtsAddress *address, const CtsAddress *net, int n_bits)
{
    const int whole = n_bits / 8, rest = n_bits % 8;
    const uint8_t mask = (uint8_t)(0xff00 >> rest);
    return !memcmp(address->bytes, net->bytes, (size_t)whole) &&
           (!rest || ((address->bytes[whole] ^ net->bytes[whole]) & mask) == 0);
}

bool cts_allow_has(const CtsAllowList *list, const CtsAddress *address, const char *aet)
{
    static const CtsAllow here[] = {{.address = {{[10] = 0xff, 0xff, 127}}, .n_bits = 104},
                                    {.address = {{[15] = 1}}, .n_bits = 128}};
    const CtsAllow *items = list->n ? list->items : here;
    const int n = list->n ? list->n : 2;
    for (int i = 0; i < n; i++)
        if (is_within(address, &items[i].address, items[i].n_bits) &&
            (!aet || !*items[i].aet || !strcmp(items[i].aet, aet)))
            return true;
    return false;
}

void cts_allow_free(CtsAllowList *list)
{
    cts_free(&list->items);
    *list = (CtsAllowList){0};
}
