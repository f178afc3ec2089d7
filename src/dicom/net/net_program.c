/* The protocols, spoken by the program ctsplat-net: its dependencies are no part of the library, and it ends with the
 * process that started it. */
#include "base/libexec.h"
#include "base/mem.h"
#include "dicom/net/wire.h"
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/* TICK_MS: interval at which a request to stop is seen. GRACE_MS: time for an orderly end after it, in which an
 * association is aborted and its connection closed. */
enum { TICK_MS = 50, GRACE_MS = 3000 };

/* A run of the program, and where its answers go. */
typedef struct NetCall {
    const CtsNetRequest *request;
    CtsFound *found;
    CtsNetAnswer *answer; /* the last one */
    int socket;
    pid_t pid;
} NetCall;

/* Waits for an answer. Once a stop is requested the program is notified, and killed after its grace. */
static bool await_answer(NetCall *c, int *left_ms)
{
    struct pollfd ready = {.fd = c->socket, .events = POLLIN};
    while (poll(&ready, 1, TICK_MS) <= 0) {
        if (*left_ms == GRACE_MS && cts_net_stopped(&c->request->net))
            cts_send_all(c->socket, "", 1);
        if (cts_net_stopped(&c->request->net) && (*left_ms -= TICK_MS) <= 0)
            kill(c->pid, SIGKILL);
    }
    return cts_wire_read(c->socket, c->answer, sizeof *c->answer);
}

/* The peer's texts end within their fields, and what is counted is there. */
static CtsStatus use_answer(NetCall *c, CtsError *err)
{
    const CtsNetRequest *const r = c->request;
    CtsNetAnswer *const a = c->answer;
    CtsFoundSeries *const s = &a->found;
    a->result.error.text[sizeof a->result.error.text - 1] = a->result.remedy[sizeof a->result.remedy - 1] = 0;
    cts_text_clean(a->result.error.text);
    s->study_uid[sizeof s->study_uid - 1] = s->series_uid[sizeof s->series_uid - 1] = 0;
    s->modality[sizeof s->modality - 1] = s->study_date[sizeof s->study_date - 1] = 0;
    s->description[sizeof s->description - 1] = 0;
    if (a->kind == CTS_NET_SENT && a->number >= 0 && a->number < r->n_outgoing) {
        r->outgoing[a->number].sent = true;
        if (r->net.sent)
            r->net.sent(r->net.context, r->outgoing[a->number].path);
    } else if (a->kind == CTS_NET_DIAGNOSTIC && a->number >= 0 && a->number < CTS_N_DIAGNOSTICS) {
        cts_report_diagnostic(r->net.report, (CtsDiagnosticId)a->number, "%s", a->result.error.text);
    } else if (a->kind == CTS_NET_FOUND && c->found && c->found->n < CTS_MAX_FOUND && s->n_objects >= 0 &&
               cts_uid_is_valid(s->study_uid) && cts_uid_is_valid(s->series_uid)) {
        const CtsStatus st = cts_grow(&c->found->items, c->found->n, err);
        if (st)
            return st;
        c->found->items[c->found->n++] = *s;
    } else if (a->kind != CTS_NET_END)
        return cts_fail(err, CTS_ERR_INTERNAL, "ctsplat-net gives an invalid answer");
    return CTS_OK;
}

static CtsStatus start_call(NetCall *c, CtsError *err)
{
    int pair[2];
    char number[16];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
        return cts_fail(err, CTS_ERR_INTERNAL, "no socket pair: %s", strerror(errno));
    snprintf(number, sizeof number, "%d", pair[1]);
    const CtsStatus st = cts_libexec_start("ctsplat-net", number, &pair[1], 1, &c->pid, err);
    close(pair[1]);
    c->socket = pair[0];
    return st;
}

CtsStatus cts_program_run(const CtsNetRequest *request, CtsFound *found, CtsNetAnswer *last)
{
    NetCall c = {.request = request, .found = found, .answer = last, .socket = -1};
    CtsError why = {0};
    int left_ms = GRACE_MS;
    CtsStatus st = start_call(&c, &why);
    bool alive = !st && cts_wire_write_request(c.socket, request);
    do {
        alive = alive && await_answer(&c, &left_ms);
        st = alive ? use_answer(&c, &why) : st;
    } while (alive && !st && last->kind != CTS_NET_END);
    if (!st && !alive)
        st = cts_fail(&why, CTS_ERR_INTERNAL, "ctsplat-net ended unexpectedly");
    if (st)
        *last = (CtsNetAnswer){.result.error = why};
    if (c.socket >= 0)
        close(c.socket);
    while (c.pid > 0 && waitpid(c.pid, NULL, 0) < 0 && errno == EINTR)
        continue;
    return last->result.error.status;
}
