#include "base/helper_process.h"

#include "base/clock.h"
#include "base/isolation.h"
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum { QUIET_MS = 20000, TRIES = 3 };

/* To the helper, with a socket where a process is to be forked; and back. */
typedef struct HelperRequest {
    CtsHelperOrder order;
    pid_t end; /* the process that is to be ended; 0: fork one */
} HelperRequest;

typedef struct Reply {
    CtsStatus status;
    pid_t pid; /* the new process, or the helper's own */
    int how;   /* a wait status */
    struct rusage usage;
    char text[240];
} Reply;

/* Global state of this file: the connection to the helper. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int way = -1;
static pid_t helper;
static bool kept;
/* of a helper that is our child process: subtracted when it is reaped, since they are counted then */
static double reported_cpu_ms;

static bool receive_reply(int socket, Reply *reply)
{
    struct pollfd wait = {.fd = socket, .events = POLLIN};
    return TEMP_FAILURE_RETRY(poll(&wait, 1, QUIET_MS)) > 0 &&
           recv(socket, reply, sizeof *reply, 0) == (ssize_t)sizeof *reply;
}

static bool transmit_request(int socket, HelperRequest *request, int fd)
{
    char control[CMSG_SPACE(sizeof fd)] = {0};
    struct iovec bytes = {request, sizeof *request};
    struct msghdr message = {.msg_iov = &bytes, .msg_iovlen = 1};
    if (fd >= 0) {
        message.msg_control = control;
        message.msg_controllen = sizeof control;
        struct cmsghdr *rights = CMSG_FIRSTHDR(&message);
        rights->cmsg_level = SOL_SOCKET;
        rights->cmsg_type = SCM_RIGHTS;
        rights->cmsg_len = CMSG_LEN(sizeof fd);
        memcpy(CMSG_DATA(rights), &fd, sizeof fd);
    }
    return TEMP_FAILURE_RETRY(sendmsg(socket, &message, MSG_NOSIGNAL)) == (ssize_t)sizeof *request;
}

static bool receive_request(int socket, HelperRequest *request, int *fd)
{
    char control[CMSG_SPACE(sizeof *fd)];
    struct iovec bytes = {request, sizeof *request};
    struct msghdr message = {
        .msg_iov = &bytes, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    const ssize_t got = TEMP_FAILURE_RETRY(recvmsg(socket, &message, MSG_CMSG_CLOEXEC));
    const struct cmsghdr *rights = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    *fd = -1;
    if (rights)
        memcpy(fd, CMSG_DATA(rights), sizeof *fd);
    return got == (ssize_t)sizeof *request;
}

/* The helper's side. */
static void fork_one(const CtsHelperOrder *order, int socket, Reply *reply)
{
    CtsError why = {0};
    const pid_t self = getpid();
    reply->status = order->prepare ? order->prepare(&why) : CTS_OK;
    if (!reply->status && (reply->pid = fork()) < 0)
        reply->status = cts_fail(&why, CTS_ERR_MEMORY, "%s", strerror(errno));
    if (!reply->status && reply->pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() == self)
            order->live(order->order, socket);
        _exit(1);
    }
    snprintf(reply->text, sizeof reply->text, "%.*s", (int)sizeof reply->text - 1, why.text);
}

static void end_one(pid_t pid, Reply *reply)
{
    pid_t got = wait4(pid, &reply->how, WNOHANG, &reply->usage);
    if (got == 0) {
        kill(pid, SIGKILL);
        got = wait4(pid, &reply->how, 0, &reply->usage);
    }
    if (got != pid)
        reply->how = SIGKILL; /* it went with the helper before */
}

static _Noreturn void serve_requests(int socket)
{
    HelperRequest request;
    Reply reply = {.pid = getpid()};
    int fd;
    if (cts_isolation_leave_all(socket))
        _exit(1);
    signal(SIGCHLD, SIG_DFL);
    prctl(PR_SET_NAME, "ctsplat-helper");
    while (send(socket, &reply, sizeof reply, MSG_NOSIGNAL) > 0 && receive_request(socket, &request, &fd)) {
        reply = (Reply){0};
        if (request.end)
            end_one(request.end, &reply);
        else
            fork_one(&request.order, fd, &reply);
        if (fd >= 0)
            close(fd);
    }
    _exit(0);
}

/* The program's side; all with the lock. */
static void leave(bool kill_it)
{
    const bool is_child = kept && helper;
    struct pollfd end = {.fd = way};
    if (kill_it && way >= 0 && poll(&end, 1, 0) == 0) /* else it has ended */
        kill(helper, SIGKILL);
    if (way >= 0)
        close(way);
    way = -1;
    if (is_child) {
        TEMP_FAILURE_RETRY(waitpid(helper, NULL, 0));
        cts_cpu_add_ms(-reported_cpu_ms);
    }
    reported_cpu_ms = 0;
    helper = 0;
}

/* A fork of the program has no helper; the lock may be another thread's. */
static void forget_helper(void)
{
    lock = (pthread_mutex_t)PTHREAD_MUTEX_INITIALIZER;
    if (way >= 0)
        close(way);
    way = -1;
    helper = 0;
    reported_cpu_ms = 0;
}

static void mind_forks(void)
{
    pthread_atfork(NULL, NULL, forget_helper);
}

static CtsStatus begin_helper(CtsError *err)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    int ends[2];
    Reply hello;
    pthread_once(&once, mind_forks);
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends))
        return cts_fail(err, CTS_ERR_MEMORY, "a helper process cannot be reached: %s", strerror(errno));
    const pid_t pid = fork();
    if (pid == 0) {
        if (!kept && fork() != 0) /* a process whose parent ends is adopted by init */
            _exit(0);
        serve_requests(ends[1]);
    }
    const int why = errno;
    close(ends[1]);
    if (pid > 0 && !kept)
        TEMP_FAILURE_RETRY(waitpid(pid, NULL, 0));
    if (pid > 0 && receive_reply(ends[0], &hello)) {
        way = ends[0];
        helper = hello.pid;
        return CTS_OK;
    }
    close(ends[0]);
    if (pid > 0 && kept)
        TEMP_FAILURE_RETRY(waitpid(pid, NULL, 0));
    return cts_fail(err, CTS_ERR_MEMORY, "a helper process cannot be started: %s",
                    pid < 0 ? strerror(why) : "it ended at once");
}

CtsStatus cts_helper_start(CtsError *err)
{
    pthread_mutex_lock(&lock);
    const CtsStatus st = way < 0 ? begin_helper(err) : CTS_OK;
    pthread_mutex_unlock(&lock);
    return st;
}

/* One try, with a socket of its own: where the reply is lost, a process may exist nevertheless until the helper dies,
 * and must not answer on a socket that another one has. */
static bool try_fork(HelperRequest *request, Reply *reply, int *socket, CtsStatus *st, CtsError *err)
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends)) {
        *st = cts_fail(err, CTS_ERR_MEMORY, "it cannot be reached: %s", strerror(errno));
        return false;
    }
    *st = way < 0 ? begin_helper(err) : CTS_OK;
    const bool done = !*st && transmit_request(way, request, ends[1]) && receive_reply(way, reply);
    if (!done && !*st)
        leave(true);
    close(ends[1]);
    if (!done || reply->status)
        close(ends[0]);
    else
        *socket = ends[0];
    return done;
}

CtsStatus cts_helper_fork(const CtsHelperOrder *order, pid_t *pid, int *socket, CtsError *err)
{
    HelperRequest request = {.order = *order};
    Reply reply;
    CtsStatus st = CTS_OK;
    bool done = false;
    pthread_mutex_lock(&lock);
    for (int tries = 0; !done && !st && tries < TRIES; tries++)
        done = try_fork(&request, &reply, socket, &st, err);
    pthread_mutex_unlock(&lock);
    if (!done)
        return st ? st : cts_fail(err, CTS_ERR_INTERNAL, "the helper process does not answer");
    *pid = reply.pid;
    return reply.status ? cts_fail(err, reply.status, "%.*s", (int)sizeof reply.text, reply.text) : CTS_OK;
}

int cts_helper_end(pid_t pid)
{
    HelperRequest request = {.end = pid};
    Reply reply = {.how = SIGKILL};
    pthread_mutex_lock(&lock);
    if (way >= 0 && transmit_request(way, &request, -1) && receive_reply(way, &reply)) {
        reported_cpu_ms += cts_cpu_add_usage(&reply.usage);
    } else {
        leave(true);
    }
    pthread_mutex_unlock(&lock);
    return reply.how;
}

void cts_helper_renew(void)
{
    pthread_mutex_lock(&lock);
    leave(true);
    pthread_mutex_unlock(&lock);
}

void cts_helper_keep(void)
{
    kept = true;
}

void cts_helper_stop(void)
{
    pthread_mutex_lock(&lock);
    leave(false);
    pthread_mutex_unlock(&lock);
}
