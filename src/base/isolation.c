#include "base/isolation.h"

#include <errno.h>
#include <limits.h>
#include <malloc.h>
#include <seccomp.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

/* System calls of malloc, exit, and the communication with the parent. */
static const int allowed[] = {
    SCMP_SYS(brk),         SCMP_SYS(munmap),          SCMP_SYS(mremap),         SCMP_SYS(madvise),
    SCMP_SYS(futex),       SCMP_SYS(recvfrom),        SCMP_SYS(sendto),         SCMP_SYS(exit),
    SCMP_SYS(exit_group),  SCMP_SYS(rt_sigreturn),    SCMP_SYS(rt_sigprocmask), SCMP_SYS(getpid),
    SCMP_SYS(gettid),      SCMP_SYS(clock_gettime),   SCMP_SYS(getrusage),      SCMP_SYS(gettimeofday),
    SCMP_SYS(sched_yield), SCMP_SYS(restart_syscall),
};

/* System calls that the C library tries, and can do without. */
static const int refused[] = {
    SCMP_SYS(open),  SCMP_SYS(openat),    SCMP_SYS(stat),    SCMP_SYS(fstat), SCMP_SYS(newfstatat),
    SCMP_SYS(ioctl), SCMP_SYS(readlink),  SCMP_SYS(sysinfo), SCMP_SYS(uname), SCMP_SYS(sched_getaffinity),
    SCMP_SYS(write), SCMP_SYS(prlimit64),
};

/* System calls that neither a codec nor a sanitizer needs. */
static const int denied[] = {
    SCMP_SYS(execve),  SCMP_SYS(execveat), SCMP_SYS(fork),    SCMP_SYS(vfork),  SCMP_SYS(socket),
    SCMP_SYS(connect), SCMP_SYS(bind),     SCMP_SYS(sendmsg), SCMP_SYS(ptrace),
};

/* Allow mapping memory, except executable memory. */
static int allow_data_memory(scmp_filter_ctx filter)
{
    const struct scmp_arg_cmp no_exec = SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0);
    const int result = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mmap), 1, no_exec);
    return result ? result : seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1, no_exec);
}

/* abort() signals its own process, and no other one may be signalled. */
static int allow_own_signals(scmp_filter_ctx filter)
{
    const struct scmp_arg_cmp own = SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)getpid(), 0);
    return seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 1, own);
}

static int add_calls(scmp_filter_ctx filter, uint32_t action, const int *calls, size_t n)
{
    int result = filter ? 0 : -EPERM; /* libseccomp makes none where the system refuses them */
    for (size_t i = 0; !result && i < n; i++)
        result = seccomp_rule_add(filter, action, calls[i], 0);
    return result;
}
#define ADD_CALLS(filter, action, calls) add_calls(filter, action, calls, sizeof calls / sizeof *calls)

static int load_filter(void)
{
    scmp_filter_ctx filter = seccomp_init(CTS_SANITIZED ? SCMP_ACT_ALLOW : SCMP_ACT_KILL_PROCESS);
    int result;
    if (CTS_SANITIZED)
        result = ADD_CALLS(filter, SCMP_ACT_KILL_PROCESS, denied);
    else
        (void)((result = ADD_CALLS(filter, SCMP_ACT_ALLOW, allowed)) ||
               (result = ADD_CALLS(filter, SCMP_ACT_ERRNO(EACCES), refused)) || (result = allow_data_memory(filter)) ||
               (result = allow_own_signals(filter)));
    if (!result)
        result = seccomp_load(filter); /* sets "no new privileges" too */
    seccomp_release(filter);
    return -result;
}

static int limit_resource(int resource, size_t value)
{
    struct rlimit both;
    if (getrlimit(resource, &both))
        return errno;
    both.rlim_max = value < both.rlim_max ? value : both.rlim_max; /* the user's limit may be smaller */
    both.rlim_cur = both.rlim_max;
    return setrlimit(resource, &both) ? errno : 0;
}

static int limit_resources(size_t n_bytes)
{
    int result = 0;
    if (!CTS_SANITIZED)
        (void)((result = limit_resource(RLIMIT_FSIZE, 0)) || (result = limit_resource(RLIMIT_AS, n_bytes)) ||
               (result = limit_resource(RLIMIT_NOFILE, 0)));
    return result;
}

static void leave_signals(void)
{
    static const int ignored[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGUSR1, SIGUSR2, SIGALRM, SIGCHLD};
    static const int ending[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGSYS};
    sigset_t none;
    for (size_t i = 0; i < sizeof ignored / sizeof *ignored; i++)
        signal(ignored[i], SIG_IGN);
    for (size_t i = 0; i < sizeof ending / sizeof *ending && !CTS_SANITIZED; i++)
        signal(ending[i], SIG_DFL);
    signal(SIGXCPU, SIG_DFL);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
}

static int close_between(int first, int end)
{
    return first < end && close_range((unsigned)first, (unsigned)end - 1, 0) ? errno : 0;
}

static int close_others(const int keep[2])
{
    const int first = CTS_SANITIZED ? 3 : 0, low = keep[0] < keep[1] ? keep[0] : keep[1],
              high = keep[0] < keep[1] ? keep[1] : keep[0];
    int result = close_between(first, low);
    if (!result)
        result = close_between(low + 1, high);
    return result ? result : close_between(high + 1, INT_MAX);
}

int cts_isolation_enter(const int keep[2], size_t n_bytes)
{
    mallopt(M_ARENA_MAX, 1); /* else malloc counts the processors, in a file, at a thread's first call */
    free(malloc(1));
    leave_signals();
    /* a core file would contain patient data; if this fails, the limit on core files still holds */
    prctl(PR_SET_DUMPABLE, 0);
    int result = limit_resource(RLIMIT_CORE, 0);
    if (!result)
        result = close_others(keep);
    if (!result)
        result = limit_resources(n_bytes);
    return result ? result : load_filter();
}

bool cts_isolation_is_waived(void)
{
    const char *const value = secure_getenv(CTS_ISOLATION_WAIVED);
    return value && !strcmp(value, "1");
}
