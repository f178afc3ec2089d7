#include "app/node/node.h"

#include "base/clock.h"
#include "base/json.h"
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

CtsStatus cts_associations_open(CtsAssociations *v, CtsError *err)
{
    void *shared =
        mmap(NULL, CTS_MAX_ASSOCIATIONS * sizeof *v->shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        return cts_fail(err, CTS_ERR_MEMORY, "memory cannot be shared: %s", strerror(errno));
    v->shared = shared;
    for (int i = 0; i < CTS_MAX_ASSOCIATIONS; i++)
        v->peer_processes[i].record = &v->shared[i];
    return CTS_OK;
}

void cts_associations_close(CtsAssociations *v)
{
    if (v->shared)
        munmap(v->shared, CTS_MAX_ASSOCIATIONS * sizeof *v->shared);
    v->shared = NULL;
}

static CtsRate *rate_of(CtsAssociations *v, const CtsAddress *address, double now_ms)
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
    /* 60000: rates are numbers in a minute. */
    if (memcmp(&oldest->address, address, sizeof *address) || now_ms - oldest->since_ms > 60000)
        *oldest = (CtsRate){.address = *address, .since_ms = now_ms};
    return oldest;
}

CtsAssociationProcess *cts_associations_admit(CtsAssociations *v, const CtsAddress *address, double now_ms)
{
    CtsAssociationProcess *place = NULL;
    int n = 0;
    for (int i = 0; i < CTS_MAX_ASSOCIATIONS; i++) {
        if (!v->peer_processes[i].pid)
            place = &v->peer_processes[i];
        else
            n += !memcmp(&v->peer_processes[i].address, address, sizeof *address);
    }
    CtsRate *rate = rate_of(v, address, now_ms);
    if (!place || n >= v->max_of_one || rate->n >= v->max_a_minute)
        return NULL;
    rate->n++;
    memset(place->record, 0, sizeof *place->record);
    place->address = *address;
    place->start_ms = now_ms;
    return place;
}

CtsAssociationProcess *cts_associations_find(CtsAssociations *v, pid_t pid)
{
    for (int i = 0; i < CTS_MAX_ASSOCIATIONS; i++)
        if (v->peer_processes[i].pid == pid)
            return &v->peer_processes[i];
    return NULL;
}

void cts_association_count_object(CtsAssociationRecord *record, const char *study, bool replaced)
{
    int i = 0;
    record->n_replaced += replaced;
    while (i < record->n_studies && strcmp(record->studies[i].name, study))
        i++;
    const bool full = i == CTS_MAX_STUDY_COUNTS;
    if (i == record->n_studies) {
        record->n_studies += !full;
        i -= full;
        snprintf(record->studies[i].name, sizeof record->studies[i].name, "%s", full ? "others" : study);
    }
    record->studies[i].n_objects++;
}

static int open_record(const char *path)
{
    return strcmp(path, "-") ? open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640)
                             : fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
}

CtsStatus cts_record_check(const char *path, CtsError *err)
{
    const int fd = open_record(path);
    if (fd < 0)
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s (the record of what is received)", path, strerror(errno));
    close(fd);
    return CTS_OK;
}

static json_t *new_record(const char *event, const CtsAddress *address)
{
    char address_text[INET6_ADDRSTRLEN];
    cts_address_text(address, address_text, sizeof address_text);
    return json_pack("{s:s,s:s,s:s}", "event", event, "time", cts_utc_now().text, "address", address_text);
}

/* Takes ownership of line. Uses one write, so that lines of several writers do not mix. */
static CtsStatus append_record(const char *path, json_t *line, CtsError *err)
{
    char *text = json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(12));
    const size_t n = text ? strlen(text) : 0;
    const int fd = open_record(path);
    ssize_t put = -1;
    json_decref(line);
    if (fd >= 0 && text) {
        text[n] = '\n'; /* in place of the final 0 */
        put = write(fd, text, n + 1);
    }
    const CtsStatus st = put == (ssize_t)n + 1
                             ? CTS_OK
                             : cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be written: %s", path, strerror(errno));
    if (fd >= 0)
        close(fd);
    free(text);
    return st;
}

static json_t *json_text_of(const char *text, size_t size)
{
    char *copy = strndup(text, size);
    json_t *value = cts_json_new_text(copy ? copy : "");
    free(copy);
    return value;
}

static json_t *studies_of(const CtsAssociationRecord *record)
{
    json_t *studies = json_array();
    for (int i = 0; i < record->n_studies && i < CTS_MAX_STUDY_COUNTS; i++)
        json_array_append_new(studies,
                              json_pack("{s:o,s:I}", "study", json_text_of(record->studies[i].name, CTS_SPOOL_STUDY),
                                        "objects", (json_int_t)record->studies[i].n_objects));
    return studies;
}

static json_t *end_record(const CtsAssociationInfo *info, int how)
{
    if (!WIFSIGNALED(how))
        return json_text_of(info->end, sizeof info->end);
    if (WTERMSIG(how) == SIGALRM)
        return json_string("broken off: it took longer than it may");
    if (WTERMSIG(how) == SIGTERM)
        return json_string("broken off: the receiver was stopped");
    return json_sprintf("broken off: its process ended by signal %d", WTERMSIG(how));
}

CtsStatus cts_record_association(const char *path, const CtsAssociationProcess *peer_process, int how, double now_ms,
                                 CtsError *err)
{
    const CtsAssociationInfo *info = &peer_process->record->info;
    json_t *line = new_record("association", &peer_process->address);
    json_t *certificate = info->certificate[0] ? json_text_of(info->certificate, sizeof info->certificate) : NULL;
    json_object_update_new(
        line, json_pack("{s:o,s:o,s:o*,s:o,s:I,s:I,s:I,s:I,s:o,s:o}", "calling_aet",
                        json_text_of(info->calling_aet, sizeof info->calling_aet), "called_aet",
                        json_text_of(info->called_aet, sizeof info->called_aet), "certificate", certificate, "seconds",
                        cts_json_new_number(round(now_ms - peer_process->start_ms) / 1000), "objects",
                        (json_int_t)info->n_objects, "refused", (json_int_t)info->n_refused, "replaced",
                        (json_int_t)peer_process->record->n_replaced, "bytes", (json_int_t)info->n_bytes, "studies",
                        studies_of(peer_process->record), "end", end_record(info, how)));
    return append_record(path, line, err);
}

CtsStatus cts_record_rejections(const char *path, uint64_t n, const CtsAddress *last, CtsError *err)
{
    json_t *line = new_record("turned_away", last);
    json_object_set_new(line, "connections", json_integer((json_int_t)n));
    return append_record(path, line, err);
}
