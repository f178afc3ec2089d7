/* Series that are asked for, and those that are found. */
#include "output/net/peer.h"

#include <stdlib.h>
#include <string.h>

void cts_found_free(CtsFound *found)
{
    free(found->items);
    *found = (CtsFound){0};
}

/* A value of a query goes out as it is given: one value, of the length that all these may have. */
static CtsStatus check_value(const char *value, CtsError *err)
{
    if (!value)
        return CTS_OK;
    const size_t n = strlen(value);
    bool good = n > 0 && n <= 64;
    for (size_t i = 0; i < n; i++)
        good &= (unsigned char)value[i] >= 0x20 && value[i] != 0x7f && value[i] != '\\';
    return good ? CTS_OK
                : cts_fail(err, CTS_ERR_USAGE, "%.80s: is no value to look for (1 to 64 characters, no backslash)",
                           value);
}

static CtsStatus check_query(const CtsSeriesQuery *q, CtsError *err)
{
    const char *const uids[] = {q->study_uid, q->series_uid};
    const char *const values[] = {q->accession, q->patient_id, q->study_date, q->modality};
    CtsStatus st = CTS_OK;
    if (!q->study_uid && !q->accession && !q->patient_id && !q->study_date)
        return cts_fail(err, CTS_ERR_USAGE,
                        "what to look for is not said (give `study-uid`, `accession`, `patient-id` or `study-date`)");
    for (int i = 0; i < 2 && !st; i++)
        if (uids[i] && !cts_uid_is_valid(uids[i]))
            st = cts_fail(err, CTS_ERR_USAGE, "%.80s: is no UID", uids[i]);
    for (int i = 0; i < 4 && !st; i++)
        st = check_value(values[i], err);
    return st;
}

CtsStatus cts_net_find(const CtsPeer *peer, const CtsNet *given, const CtsSeriesQuery *query, CtsFound *found,
                       CtsError *err)
{
    const CtsNet net = cts_net_with_defaults(given);
    const CtsWay *way;
    CtsStatus st;
    *found = (CtsFound){0};
    if ((st = cts_net_check(peer, given, err)) || (st = check_query(query, err)) ||
        (st = cts_way_find(peer, &way, err)))
        return st;
    st = way->find(peer, &net, query, found, err);
    return cts_net_stopped(&net) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : st;
}
