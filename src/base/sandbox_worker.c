#include "base/sandbox_worker.h"

#include "base/isolation.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <unistd.h>

typedef struct Service {
    const CtsSandboxTask *task;
    int socket, lifeline; /* the other end of a pipe that the program has */
    int memory_id;
    size_t memory_limit;
    uint8_t *shared;
} Service;

static bool read_argument(Service *w, const char *argument, const CtsSandboxTask *tasks, int n_tasks)
{
    char version[16];
    int task;
    if (sscanf(argument, CTS_SANDBOX_ARGUMENT, version, &task, &w->socket, &w->lifeline, &w->memory_id,
               &w->memory_limit) != 6 ||
        strcmp(version, CTS_VERSION) != 0 || task < 0 || task >= n_tasks)
        return false;
    w->task = &tasks[task];
    return true;
}

/* The kernel kills this process when the last program that has the pipe's other end closes it or ends: at once, even
 * when the process does something else, and also when a stream controls it. */
static void hang_by(int lifeline)
{
    fcntl(lifeline, F_SETOWN, getpid());
    fcntl(lifeline, F_SETSIG, SIGKILL);
    fcntl(lifeline, F_SETFL, O_ASYNC);
}

static CtsStatus isolate(const Service *w, CtsError *err)
{
    const int keep[] = {w->socket, w->lifeline};
    const int wall = cts_isolation_enter(keep, w->memory_limit);
    if (!wall || cts_isolation_is_waived())
        return CTS_OK;
    return cts_fail(err, CTS_ERR_INTERNAL,
                    "it cannot be sandboxed: %s (allow seccomp in this container or emulator, or set "
                    "CTSPLAT_NO_SANDBOX=1 for files that you trust)",
                    strerror(wall));
}

static CtsStatus begin(Service *w, CtsError *err)
{
    hang_by(w->lifeline);
    w->shared = shmat(w->memory_id, NULL, 0);
    if (w->shared == (void *)-1)
        return cts_fail(err, CTS_ERR_MEMORY, "it cannot share memory: %s", strerror(errno));
    const CtsStatus st = w->task->prepare ? w->task->prepare(err) : CTS_OK;
    return st ? st : isolate(w, err);
}

static bool send_answer(const Service *w, CtsStatus status, const CtsError *why)
{
    CtsSandboxAnswer a = {.status = status};
    struct rusage used;
    if (!getrusage(RUSAGE_SELF, &used)) {
        a.cpu_us =
            (used.ru_utime.tv_sec + used.ru_stime.tv_sec) * 1000000L + used.ru_utime.tv_usec + used.ru_stime.tv_usec;
        a.peak_kib = used.ru_maxrss;
    }
    snprintf(a.text, sizeof a.text, "%.*s", (int)sizeof a.text - 1, why->text);
    return TEMP_FAILURE_RETRY(send(w->socket, &a, sizeof a, MSG_NOSIGNAL)) == sizeof a;
}

int cts_sandbox_serve(int argc, char **argv, const CtsSandboxTask *tasks, int n_tasks)
{
    Service w;
    CtsSandboxJob job;
    CtsError why = {0};
    if (argc != 2 || !read_argument(&w, argv[1], tasks, n_tasks)) {
        fputs("this program is a part of ctsplat " CTS_VERSION ", which starts it\n", stderr);
        return EXIT_FAILURE;
    }
    CtsStatus st = begin(&w, &why);
    const bool ready = !st;
    while (send_answer(&w, st, &why) && ready &&
           TEMP_FAILURE_RETRY(recv(w.socket, &job, sizeof job, 0)) == (ssize_t)sizeof job) {
        why = (CtsError){0};
        st = w.task->work(job.order, w.shared + job.stream, job.n, w.shared + job.answer, job.n_answer, &why);
    }
    _exit(ready ? EXIT_SUCCESS : EXIT_FAILURE);
}
