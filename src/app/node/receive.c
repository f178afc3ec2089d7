#include "app/node/node.h"

#include "base/clock.h"
#include "base/isolation.h"
#include "base/sanitized.h"
#include "dicom/net/listener.h"
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

/* REPORT_MS: at most one record of rejections in a minute, so that a port scan does not fill the disk. GRACE_MS: time
 * for a peer's process to end by itself before it is killed. PAUSE_MS: between two checks of an unavailable resource.
 * CHILD_BYTES, CHILD_FILES: limits of a peer's process, which writes objects to a file as they come. */
enum { REPORT_MS = 60000, GRACE_MS = 2000, PAUSE_MS = 10, CHILD_BYTES = 512 << 20, CHILD_FILES = 64 };

typedef struct Receiver {
    const CtsOptions *options;
    const CtsProtocol *protocol;
    CtsNet net;
    char record[PATH_MAX];
    CtsAllowList allow;
    CtsSpool spool;
    CtsAssociations associations;
    int listener;
    uint64_t n_turned_away;
    CtsAddress last_away;
    double reported_ms;
    CtsError *err;
    CtsStatus status;
} Receiver;

/* State of the process that serves one peer. */
typedef struct Served {
    Receiver *receiver;
    CtsAssociationProcess *peer_process;
    int place;
} Served;

static bool allows(void *context, const char *calling_aet)
{
    const Served *s = context;
    alarm((unsigned)s->receiver->options->deadline_s);
    return cts_allow_has(&s->receiver->allow, &s->peer_process->address, calling_aet);
}

static bool grows(void *context, uint64_t n_bytes)
{
    const Served *s = context;
    if (cts_spool_has_room(&s->receiver->spool, n_bytes))
        return true;
    snprintf(s->peer_process->record->info.end, sizeof s->peer_process->record->info.end,
             n_bytes > s->receiver->spool.max_object_bytes ? "broken off: its object is larger than allowed"
                                                           : "broken off: the disk is nearly full");
    return false;
}

static char *begin(void *context)
{
    const Served *s = context;
    char path[PATH_MAX];
    cts_spool_temp(&s->receiver->spool, s->place, path, sizeof path);
    return grows(context, 0) ? strdup(path) : NULL;
}

static CtsStoredAs keep(void *context, const char *path, const char *sop_uid)
{
    const Served *s = context;
    char study[CTS_SPOOL_STUDY];
    bool replaced = false;
    const CtsStoredAs stored = cts_spool_keep(&s->receiver->spool, path, sop_uid, study, &replaced);
    if (stored == CTS_STORED)
        cts_association_count_object(s->peer_process->record, study, replaced);
    return stored;
}

/* No more memory and files than a peer may cost, nothing that the receiver does not need, and an end. */
static bool shut_in(const Receiver *r, pid_t parent)
{
    const struct rlimit data = {CHILD_BYTES, CHILD_BYTES}, files = {CHILD_FILES, CHILD_FILES};
    static const int numbers[] = {SIGTERM, SIGINT, SIGHUP, SIGALRM, SIGCHLD};
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        signal(numbers[i], SIG_DFL);
    alarm((unsigned)r->net.timeout_s);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    prctl(PR_SET_DUMPABLE, 0);
    umask(0027);
    return getppid() == parent && (CTS_SANITIZED || !setrlimit(RLIMIT_DATA, &data)) &&
           !setrlimit(RLIMIT_NOFILE, &files) && !cts_isolation_stay_inside();
}

static _Noreturn void serve_association(Receiver *r, CtsAssociationProcess *peer_process, int socket, pid_t parent)
{
    Served served = {
        .receiver = r, .peer_process = peer_process, .place = (int)(peer_process - r->associations.peer_processes)};
    const CtsStoreScpRules rules = {
        .net = &r->net, .allows = allows, .begin = begin, .grows = grows, .keep = keep, .context = &served};
    close(r->listener);
    cts_spool_close(&r->spool);
    if (!shut_in(r, parent))
        _exit(1);
    r->protocol->accept(&rules, socket, &peer_process->record->info);
    _exit(0);
}

static void take_one(Receiver *r)
{
    struct sockaddr_storage from = {0};
    socklen_t n = sizeof from;
    const int socket = accept4(r->listener, (struct sockaddr *)&from, &n, SOCK_CLOEXEC);
    if (socket < 0) {
        poll(NULL, 0, PAUSE_MS); /* no free descriptors or memory: the connection stays queued */
        return;
    }
    const CtsAddress address = cts_address_of(&from);
    CtsAssociationProcess *peer_process = cts_allow_has(&r->allow, &address, NULL)
                                              ? cts_associations_admit(&r->associations, &address, cts_wall_ms())
                                              : NULL;
    const pid_t parent = getpid(), pid = peer_process ? fork() : -1;
    if (pid == 0)
        serve_association(r, peer_process, socket, parent);
    close(socket);
    if (pid > 0) {
        peer_process->pid = pid;
    } else {
        r->n_turned_away++;
        r->last_away = address;
    }
}

static void give_up_receiving(Receiver *r, CtsStatus status)
{
    if (!r->status)
        r->status = status;
}

/* Removes an object that was received incompletely. */
static void remove_part(const Receiver *r, int place)
{
    char path[PATH_MAX];
    cts_spool_temp(&r->spool, place, path, sizeof path);
    unlink(path);
}

static void take_dead(Receiver *r)
{
    pid_t pid;
    int how;
    while ((pid = waitpid(-1, &how, WNOHANG)) > 0) {
        CtsAssociationProcess *peer_process = cts_associations_find(&r->associations, pid);
        if (!peer_process)
            continue;
        remove_part(r, (int)(peer_process - r->associations.peer_processes));
        give_up_receiving(r, cts_record_association(r->record, peer_process, how, cts_wall_ms(), r->err));
        peer_process->pid = 0;
    }
}

static void report_rejections(Receiver *r, bool now)
{
    const double now_ms = cts_wall_ms();
    if (!r->n_turned_away || (!now && now_ms - r->reported_ms < REPORT_MS))
        return;
    give_up_receiving(r, cts_record_rejections(r->record, r->n_turned_away, &r->last_away, r->err));
    r->n_turned_away = 0;
    r->reported_ms = now_ms;
}

static void end_associations(Receiver *r)
{
    const double end_ms = cts_wall_ms() + GRACE_MS;
    bool any = true;
    for (int round = 0; any; round++) {
        const bool late = cts_wall_ms() > end_ms;
        any = false;
        for (int i = 0; i < CTS_MAX_ASSOCIATIONS; i++) {
            any |= r->associations.peer_processes[i].pid;
            if (r->associations.peer_processes[i].pid && (round == 0 || late))
                kill(r->associations.peer_processes[i].pid, late ? SIGKILL : SIGTERM);
        }
        poll(NULL, 0, any ? PAUSE_MS : 0);
        take_dead(r);
    }
}

static void on_child(int number)
{
    (void)number; /* interrupts the wait */
}

static void mind_children(sigset_t *while_waiting)
{
    struct sigaction action = {.sa_handler = on_child};
    sigset_t child;
    sigemptyset(&child);
    sigaddset(&child, SIGCHLD);
    sigaction(SIGCHLD, &action, NULL);
    sigprocmask(SIG_BLOCK, &child, while_waiting);
}

static void receive_all(Receiver *r)
{
    const struct timespec tick = {.tv_sec = 1};
    sigset_t while_waiting;
    mind_children(&while_waiting);
    while (!r->status && !cts_net_stopped(&r->net)) {
        struct pollfd wait = {.fd = r->listener, .events = POLLIN};
        if (ppoll(&wait, 1, &tick, &while_waiting) > 0)
            take_one(r);
        take_dead(r);
        report_rejections(r, false);
    }
    end_associations(r);
    report_rejections(r, true);
}

static void take_settings(Receiver *r)
{
    const CtsOptions *o = r->options;
    r->net = cts_net_with_defaults(&o->net);
    r->associations.max_of_one = o->max_of_one;
    r->associations.max_a_minute = o->max_a_minute;
    r->spool = (CtsSpool){.folder = o->output_dir,
                          .max_object_bytes = (uint64_t)(o->object_mib * 1048576),
                          .free_percent = o->free_percent,
                          .lock = -1};
    if (o->log)
        snprintf(r->record, sizeof r->record, "%s", o->log);
    else
        snprintf(r->record, sizeof r->record, "%.4000s/received.jsonl", o->output_dir);
}

static CtsStatus prepare_receiver(Receiver *r, CtsError *err)
{
    const CtsOptions *o = r->options;
    const CtsPeer dimse = {0};
    CtsStatus st;
    if (o->net.tls_ca && !o->net.tls_key)
        return cts_fail(err, CTS_ERR_USAGE,
                        "`tls-ca` asks peers for certificates, and ours is missing (give `tls-key`)");
    if ((st = cts_net_check(NULL, &o->net, err)) ||
        (st = cts_allow_parse(o->allow.items, o->allow.n, &r->allow, err)) ||
        (st = cts_protocol_find(&dimse, &r->protocol, err)) || (st = r->protocol->accept_check(&r->net, err)) ||
        (st = cts_associations_open(&r->associations, err)) || (st = cts_spool_open(&r->spool, err)) ||
        (st = cts_record_check(r->record, err)))
        return st;
    for (int i = 0; i < CTS_MAX_ASSOCIATIONS; i++)
        remove_part(r, i);
    return cts_listen(o->listen, &r->listener, err);
}

CtsStatus cts_receive(const CtsOptions *options, void (*on_text)(const char *text), CtsError *err)
{
    char text[200], where[80];
    Receiver *r = calloc(1, sizeof *r);
    if (!r)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    r->options = options;
    r->listener = -1;
    take_settings(r);
    r->err = err;
    CtsStatus st = prepare_receiver(r, err);
    if (!st) {
        cts_listener_name(r->listener, where, sizeof where);
        snprintf(text, sizeof text, "listens at %s as %s", where, r->net.own_aet);
        on_text(text);
        if (!options->allow.n)
            on_text("only this machine may send (--allow AET@ADDRESS admits others)");
        receive_all(r);
        st = r->status;
    }
    if (r->listener >= 0)
        close(r->listener);
    cts_spool_close(&r->spool);
    cts_associations_close(&r->associations);
    cts_allow_free(&r->allow);
    free(r);
    return st;
}
