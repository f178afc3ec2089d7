/* Sandboxed codecs: their failures do not affect the program. */
#include "base/clock.h"
#include "base/helper_process.h"
#include "base/isolation.h"
#include "base/sandbox.h"
#include "codec_frames.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* A codec whose behaviour is determined by the stream's first byte. */
static CtsStatus act(const void *order, const uint8_t *stream, size_t n, void *pixels, size_t n_pixels, CtsError *err)
{
    const CtsFrameFormat *const f = order;
    volatile int *nowhere = NULL;
    volatile unsigned turns = 0;
    int locked = 1;
    char *memory;
    assert_true(n_pixels >= cts_frame_bytes(f));
    switch (stream[0]) {
    case 'd': /* decode */
        for (size_t i = 0; i < cts_frame_bytes(f); i++)
            ((uint8_t *)pixels)[i] = stream[i % n];
        return CTS_OK;
    case 's':
        *nowhere = 1;
        break;
    case 'a':
        abort();
    case 'e':
        _exit(7);
    case 'K':
        raise(SIGKILL);
        break;
    case 'k': /* once */
        *(uint8_t *)(uintptr_t)stream = 'd';
        raise(SIGKILL);
        break;
    case 'l': /* a deadlock */
        syscall(SYS_futex, &locked, FUTEX_WAIT, 1, NULL, NULL, 0);
        break;
    case 'b': /* busy for half a second: within the second that it has */
        while (clock() < CLOCKS_PER_SEC / 2)
            turns++;
        memset(pixels, 'b', cts_frame_bytes(f));
        return CTS_OK;
    case 'h':
        for (;;)
            turns++;
    case 'm':
        for (size_t got = 0; (memory = malloc(64 << 20)); got++)
            if (got > 4096 || !memset(memory, 1, 4096))
                return CTS_OK;
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    case 'o':
        return open("/dev/null", O_RDONLY) >= 0 ? CTS_OK : cts_fail(err, CTS_ERR_PIXELS, "no file");
    case 'n':
        return socket(AF_INET, SOCK_STREAM, 0) >= 0 ? CTS_OK : cts_fail(err, CTS_ERR_PIXELS, "no socket");
    case 't': /* another process */
        return syscall(SYS_tgkill, 1, 1, 0) ? CTS_OK : cts_fail(err, CTS_ERR_PIXELS, "no signal");
    case 'f':
        return fork() >= 0 ? CTS_OK : cts_fail(err, CTS_ERR_PIXELS, "no fork");
    case 'x':
        memory = mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        return memory == MAP_FAILED ? cts_fail(err, CTS_ERR_PIXELS, "no code") : CTS_OK;
    default:
        break;
    }
    return cts_fail(err, CTS_ERR_PIXELS, "byte %d", stream[0]);
}

static CtsStatus run(CtsSandbox *d, const char *what, const void **pixels, CtsError *err)
{
    const CtsFrameFormat format = format_16(20, 10);
    const size_t n = strlen(what);
    uint8_t *stream;
    *err = (CtsError){0};
    const CtsStatus st = cts_codec_room(d, &format, n, &stream, err);
    if (st)
        return st;
    memcpy(stream, what, n);
    return run_frame(d, &format, stream, n, pixels, err);
}

static void expect_decoded(CtsSandbox *d)
{
    const void *pixels;
    CtsError err;
    if (run(d, "d123", &pixels, &err))
        fail_msg("%s", err.text);
    assert_memory_equal(pixels, "d123d123", 8);
}

static int open_files(void)
{
    int n = 0;
    DIR *dir = opendir("/proc/self/fd");
    while (readdir(dir))
        n++;
    closedir(dir);
    return n;
}

/* Each ends its frame with a reason; the next frame is decoded by another process. */
static void test_deaths(void **state)
{
    static const struct {
        const char *what, *reason, *relaxed; /* relaxed: under sanitizers, "" for "not to be tried" */
    } deaths[] = {
        {"s", "crashed (signal 11)", ""},
        {"a", "crashed (signal 6)", "crashed (signal 6)"},
        {"e", "exit code 7", "exit code 7"},
        {"h", "after 1 s of computing", "after 1 s of computing"},
        {"l", "made no progress for 2 s", "made no progress for 2 s"},
        {"m", "more memory", ""},
        {"o", "no file", ""},
        {"n", "system call", "system call"},
        {"f", "system call", ""},
        {"t", "system call", ""},
        {"x", "system call", ""},
        {"?", "byte 63", "byte 63"},
    };
    assert_int_equal(cts_helper_start(NULL), CTS_OK);
    const int files = open_files();
    CtsSandbox d = cts_sandbox_make(act, "decoder");
    for (size_t i = 0; i < sizeof deaths / sizeof *deaths; i++) {
        const char *reason = CTS_SANITIZED ? deaths[i].relaxed : deaths[i].reason;
        const void *pixels;
        CtsError err;
        if (!reason[0])
            continue;
        expect_decoded(&d);
        d.cpu_limit_s = 1;
        d.quiet_limit_s = 2;
        const CtsStatus st = run(&d, deaths[i].what, &pixels, &err);
        d.cpu_limit_s = 0;
        if (st != CTS_ERR_PIXELS || !strstr(err.text, reason))
            fail_msg("%s: %d %s, wanted %s", deaths[i].what, st, err.text, reason);
    }
    expect_decoded(&d);
    const void *pixels;
    CtsError err;
    d.cpu_limit_s = 1;
    if (run(&d, "b", &pixels, &err))
        fail_msg("%s", err.text);
    assert_int_equal(*(const char *)pixels, 'b');
    cts_sandbox_stop(&d);
    assert_int_equal(open_files(), files);
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1); /* no child is left, dead or alive */
}

/* Killed between frames, and in the middle of one: the frame is decoded by another process, but not without limit. */
static void test_killed(void **state)
{
    CtsSandbox d = cts_sandbox_make(act, "decoder");
    const void *pixels;
    CtsError err;
    for (int round = 0; round < 3; round++) {
        expect_decoded(&d);
        kill(d.pid, SIGKILL);
        expect_decoded(&d);
        if (run(&d, "k123", &pixels, &err))
            fail_msg("%s", err.text);
        assert_memory_equal(pixels, "d123d123", 8);
        assert_int_equal(run(&d, "K", &pixels, &err), CTS_ERR_PIXELS);
        assert_non_null(strstr(err.text, "killed"));
    }
    expect_decoded(&d);
    cts_sandbox_stop(&d);
}

static void hand_over(CtsSandbox *d, const char *what)
{
    const CtsFrameFormat format = format_16(20, 10);
    const size_t n = strlen(what);
    uint8_t *stream;
    CtsError err;
    assert_true(cts_codec_fits(d, &format, n));
    if (cts_codec_room(d, &format, n, &stream, &err))
        fail_msg("%s", err.text);
    memcpy(stream, what, n);
    cts_codec_send(d, &format, stream, n);
}

/* reason: NULL for pixels that begin with the stream. */
static void take(CtsSandbox *d, const char *stream, const char *reason)
{
    const void *pixels;
    CtsError err = {0};
    const CtsStatus st = cts_sandbox_take(d, &pixels, &err);
    if ((reason != NULL) != (st == CTS_ERR_PIXELS) || (reason && !strstr(err.text, reason)))
        fail_msg("%s: %d %s, wanted %s", stream, st, err.text, reason ? reason : "pixels");
    if (!reason)
        assert_memory_equal(pixels, stream, strlen(stream));
}

/* Two in progress: each has its own answer, independent of the other. */
static void test_two_frames(void **state)
{
    const CtsFrameFormat small = format_16(20, 10), large = format_16(1200, 1000);
    CtsError err;
    CtsSandbox *d = NULL;
    assert_int_equal(cts_sandbox_new(&d, act, "decoder", 2, &err), CTS_OK);
    hand_over(d, "d1");
    for (int i = 0; i < 3; i++) {
        hand_over(d, "d23");
        assert_false(cts_codec_fits(d, &small, 1));
        take(d, "d1", NULL);
        assert_true(cts_codec_fits(d, &small, 1));
        assert_false(cts_codec_fits(d, &large, 1));
        hand_over(d, "d1");
        take(d, "d23", NULL);
    }
    take(d, "d1", NULL);
    hand_over(d, "e");
    hand_over(d, "d45");
    take(d, "e", "exit code 7");
    take(d, "d45", NULL);
    hand_over(d, "d67");
    hand_over(d, "e");
    take(d, "d67", NULL);
    take(d, "e", "exit code 7");
    hand_over(d, "K");
    hand_over(d, "d89");
    take(d, "K", "killed");
    take(d, "d89", NULL);
    hand_over(d, "d10");
    hand_over(d, "d11");
    kill(d->pid, SIGKILL);
    take(d, "d10", NULL);
    take(d, "d11", NULL);
    hand_over(d, "?");
    hand_over(d, "d12");
    take(d, "?", "byte 63");
    take(d, "d12", NULL);
    hand_over(d, "h"); /* not waiting for it to end */
    cts_sandbox_free(&d);
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
}

static pid_t parent_of(pid_t pid)
{
    char path[64], line[256];
    int parent = 0;
    snprintf(path, sizeof path, "/proc/%d/status", (int)pid);
    FILE *file = fopen(path, "r");
    while (file && fgets(line, sizeof line, file))
        if (sscanf(line, "PPid: %d", &parent) == 1)
            break;
    if (file)
        fclose(file);
    return parent;
}

/* Within some seconds, for it ends by itself. */
static bool is_gone(pid_t pid)
{
    const struct timespec pause = {0, 10000000};
    for (int i = 0; i < 1000 && !kill(pid, 0); i++)
        nanosleep(&pause, NULL);
    return kill(pid, 0) && errno == ESRCH;
}

static atomic_int n_signals;

static void count_signal(int number)
{
    n_signals++;
}

/* A program that ignores SIGCHLD, waits for all its child processes, or has a handler: the helper's processes are
 * unaffected, and their deaths are reported. */
static void test_children_taken(void **state)
{
    void (*const ways[])(int) = {SIG_IGN, SIG_DFL, count_signal};
    CtsSandbox d = cts_sandbox_make(act, "decoder");
    const void *pixels;
    CtsError err;
    for (int i = 0; i < 3; i++) {
        signal(SIGCHLD, ways[i]);
        cts_helper_renew();
        assert_int_equal(cts_helper_start(&err), CTS_OK);
        n_signals = 0;
        expect_decoded(&d);
        assert_int_equal(waitpid(-1, NULL, 0), -1);
        assert_int_equal(errno, ECHILD);
        assert_int_equal(run(&d, "e", &pixels, &err), CTS_ERR_PIXELS);
        assert_non_null(strstr(err.text, "exit code 7"));
        expect_decoded(&d);
        assert_int_equal(waitpid(-1, NULL, 0), -1);
        assert_int_equal(n_signals, 0);
    }
    cts_sandbox_stop(&d);
    signal(SIGCHLD, SIG_DFL);
}

/* One helper for all; when it is killed its processes end, and another one continues the streams in progress. */
static void test_helper(void **state)
{
    CtsSandbox d = cts_sandbox_make(act, "decoder"), e = d;
    expect_decoded(&d);
    expect_decoded(&e);
    const pid_t helper = parent_of(d.pid), child = d.pid;
    assert_true(helper > 1 && helper != getpid() && helper == parent_of(e.pid));
    hand_over(&d, "d1");
    kill(helper, SIGKILL);
    assert_true(is_gone(helper) && is_gone(child));
    take(&d, "d1", NULL);
    expect_decoded(&e);
    assert_int_not_equal(parent_of(d.pid), helper);
    cts_sandbox_stop(&d);
    cts_sandbox_stop(&e);
}

/* A helper that dies between its fork and its reply, once: both processes live, one of them unknown. */
static struct LostReply {
    atomic_int n_forked, first_answered;
} * lost;

static void wait_for(const atomic_int *count, int wanted)
{
    const struct timespec pause = {0, 1000000};
    for (int i = 0; i < 10000 && *count < wanted; i++)
        nanosleep(&pause, NULL);
}

static void die_after_fork(void)
{
    wait_for(&lost->n_forked, 1);
    raise(SIGKILL);
}

static CtsStatus lose_reply(CtsError *err)
{
    if (!lost->n_forked)
        pthread_atfork(NULL, die_after_fork, NULL);
    return CTS_OK;
}

/* The first one outlives its helper and is the first to answer. */
static void live(const void *order, int socket)
{
    prctl(PR_SET_PDEATHSIG, 0);
    const int number = ++lost->n_forked;
    wait_for(number == 1 ? &lost->n_forked : &lost->first_answered, number == 1 ? 2 : 1);
    send(socket, &number, sizeof number, MSG_NOSIGNAL);
    lost->first_answered = 1;
}

/* After a retry the answer comes from the process that was reported, and no other. */
static void test_lost_reply(void **state)
{
    const CtsHelperOrder order = {.prepare = lose_reply, .live = live};
    int socket, number = 0;
    pid_t pid;
    CtsError err;
    lost = mmap(NULL, sizeof *lost, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(lost != MAP_FAILED);
    cts_helper_renew();
    assert_int_equal(cts_helper_fork(&order, &pid, &socket, &err), CTS_OK);
    assert_int_equal(recv(socket, &number, sizeof number, 0), sizeof number);
    assert_int_equal(number, 2);
    assert_int_equal(lost->n_forked, 2);
    close(socket);
    cts_helper_end(pid);
    munmap(lost, sizeof *lost);
}

/* A fork of the program has a helper of its own, and no process is left when it ends, however it does. */
static void test_forked(void **state)
{
    CtsSandbox d = cts_sandbox_make(act, "decoder");
    expect_decoded(&d);
    for (int how = 0; how < 2; how++) {
        pid_t pids[3] = {0}; /* the helper in here, in there, and its process */
        int ends[2];
        assert_int_equal(pipe(ends), 0);
        const pid_t forked = fork();
        if (forked == 0) {
            CtsSandbox own = cts_sandbox_make(act, "decoder");
            expect_decoded(&own);
            pids[1] = parent_of(own.pid);
            pids[2] = own.pid;
            if (write(ends[1], pids, sizeof pids) != sizeof pids || how == 0)
                _exit(0);
            pause();
        }
        assert_int_equal(read(ends[0], pids, sizeof pids), sizeof pids);
        pids[0] = parent_of(d.pid);
        assert_true(pids[1] > 1 && pids[0] != pids[1]);
        kill(forked, how ? SIGKILL : 0);
        assert_int_equal(waitpid(forked, NULL, 0), forked);
        assert_true(is_gone(pids[1]) && is_gone(pids[2]));
        close(ends[0]);
        close(ends[1]);
        expect_decoded(&d);
        assert_int_equal(parent_of(d.pid), pids[0]);
    }
    cts_sandbox_stop(&d);
}

/* CPU time of the processes counts as the program's, once: also where the helper is its child process. */
static void test_computing_counts(void **state)
{
    const void *pixels;
    CtsError err;
    for (int keep = 0; keep < 2; keep++) {
        int how = 0;
        const pid_t forked = fork();
        if (forked == 0) {
            CtsSandbox d = cts_sandbox_make(act, "decoder");
            if (keep)
                cts_helper_keep();
            const double before = cts_cpu_ms();
            const bool done = run(&d, "b", &pixels, &err) == CTS_OK;
            cts_sandbox_stop(&d);
            const double counted = cts_cpu_ms() - before;
            cts_helper_stop();
            const double after = cts_cpu_ms() - before;
            struct rusage children;
            getrusage(RUSAGE_CHILDREN, &children);
            const bool is_child = children.ru_utime.tv_usec + children.ru_stime.tv_usec > 400000;
            _exit(!(done && counted > 450 && counted < 800 && after > 450 && after < 800 && is_child == keep));
        }
        assert_int_equal(waitpid(forked, &how, 0), forked);
        assert_int_equal(how, 0);
    }
}

/* Larger frames get more room; the process with the smaller room is replaced. */
static void test_room(void **state)
{
    CtsSandbox d = cts_sandbox_make(act, "decoder");
    CtsError err;
    const void *pixels;
    uint8_t *stream;
    expect_decoded(&d);
    const pid_t first = d.pid;
    expect_decoded(&d);
    assert_int_equal(d.pid, first);
    const CtsFrameFormat large = format_16(1200, 1000);
    assert_int_equal(cts_codec_room(&d, &large, 5 << 20, &stream, &err), CTS_OK);
    assert_int_not_equal(d.pid, first);
    stream[(5 << 20) - 1] = 'd';
    assert_int_equal(run_frame(&d, &large, stream + (5 << 20) - 1, 1, &pixels, &err), CTS_OK);
    assert_int_equal(((const uint8_t *)pixels)[2 * 1200 * 1000 - 1], 'd');
    expect_decoded(&d);
    cts_sandbox_stop(&d);
}

/* Threads that start processes at the same time, while another one uses malloc and stdio all the time, also when the
 * helper is forked; and the program ignores SIGCHLD. */
static void *start_many(void *failed)
{
    for (int i = 0; i < 20; i++) {
        CtsSandbox d = cts_sandbox_make(act, "decoder");
        const void *pixels;
        CtsError err;
        *(int *)failed |= run(&d, "d123", &pixels, &err) != CTS_OK;
        cts_sandbox_stop(&d);
    }
    return NULL;
}

static void *be_busy(void *stop)
{
    while (!__atomic_load_n((int *)stop, __ATOMIC_RELAXED)) {
        char *p = malloc(1000), line[64];
        snprintf(line, sizeof line, "%p", (void *)p);
        free(p);
    }
    return NULL;
}

static void test_many_threads(void **state)
{
    /* A sanitizer's malloc is not reset after a fork: there the helper must be forked before threads start, else its
     * processes may wait for a lock that a thread held. */
    const int n_busy = CTS_SANITIZED ? 0 : 1;
    pthread_t starters[4], busy;
    int failed[4] = {0}, stop = 0;
    signal(SIGCHLD, SIG_IGN);
    cts_helper_renew();
    if (!n_busy)
        assert_int_equal(cts_helper_start(NULL), CTS_OK);
    if (n_busy)
        pthread_create(&busy, NULL, be_busy, &stop);
    for (int t = 0; t < 4; t++)
        assert_int_equal(pthread_create(&starters[t], NULL, start_many, &failed[t]), 0);
    for (int t = 0; t < 4; t++) {
        pthread_join(starters[t], NULL);
        assert_int_equal(failed[t], 0);
    }
    __atomic_store_n(&stop, 1, __ATOMIC_RELAXED);
    if (n_busy)
        pthread_join(busy, NULL);
    signal(SIGCHLD, SIG_DFL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_deaths),     cmocka_unit_test(test_killed),
        cmocka_unit_test(test_two_frames), cmocka_unit_test(test_children_taken),
        cmocka_unit_test(test_helper),     cmocka_unit_test(test_lost_reply),
        cmocka_unit_test(test_forked),     cmocka_unit_test(test_computing_counts),
        cmocka_unit_test(test_room),       cmocka_unit_test(test_many_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
