#include "app/node/node.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>

CtsStatus cts_visits_open(CtsVisits *v, CtsError *err)
{
    void *shared =
        mmap(NULL, CTS_MOST_VISITS * sizeof *v->shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        return cts_fail(err, CTS_ERR_MEMORY, "memory cannot be shared: %s", strerror(errno));
    v->shared = shared;
    for (int i = 0; i < CTS_MOST_VISITS; i++)
        v->visitors[i].told = &v->shared[i];
    return CTS_OK;
}

void cts_visits_close(CtsVisits *v)
{
    if (v->shared)
        munmap(v->shared, CTS_MOST_VISITS * sizeof *v->shared);
    v->shared = NULL;
}

static CtsRate *rate_of(CtsVisits *v, const CtsAddress *address, double now_ms)
{
    CtsRate *oldest = &v->rates[0];
    for (size_t i = 0; i < sizeof v->rates / sizeof *v->rates; i++) {
        CtsRate *r = &v->rates[i];
        if (!memcmp(&r->address, address, sizeof *address)) {
            oldest = r;
            break;
        }
        if (r->since_ms < oldest->since_ms)
            oldest = r;
    }
    if (memcmp(&oldest->address, address, sizeof *address) || now_ms - oldest->since_ms > 60000)
        *oldest = (CtsRate){.address = *address, .since_ms = now_ms};
    return oldest;
}

CtsVisitor *cts_visits_admit(CtsVisits *v, const CtsAddress *address, double now_ms)
{
    CtsVisitor *place = NULL;
    int n = 0;
    for (int i = 0; i < CTS_MOST_VISITS; i++) {
        if (!v->visitors[i].pid)
            place = &v->visitors[i];
        else
            n += !memcmp(&v->visitors[i].address, address, sizeof *address);
    }
    CtsRate *rate = rate_of(v, address, now_ms);
    if (!place || n >= v->most_of_one || rate->n >= v->most_a_minute)
        return NULL;
    rate->n++;
    memset(place->told, 0, sizeof *place->told);
    place->address = *address;
    place->start_ms = now_ms;
    return place;
}

CtsVisitor *cts_visits_find(CtsVisits *v, pid_t pid)
{
    for (int i = 0; i < CTS_MOST_VISITS; i++)
        if (v->visitors[i].pid == pid)
            return &v->visitors[i];
    return NULL;
}

void cts_told_object(CtsVisitTold *told, const char *study, bool replaced)
{
    int i = 0;
    told->n_replaced += replaced;
    while (i < told->n_studies && strcmp(told->studies[i].name, study))
        i++;
    if (i == CTS_MOST_STUDIES_TOLD)
        i--;
    if (i == told->n_studies) {
        snprintf(told->studies[i].name, sizeof told->studies[i].name, "%s", study);
        told->n_studies++;
    } else if (i == CTS_MOST_STUDIES_TOLD - 1 && strcmp(told->studies[i].name, study)) {
        snprintf(told->studies[i].name, sizeof told->studies[i].name, "others");
    }
    told->studies[i].n_objects++;
}
