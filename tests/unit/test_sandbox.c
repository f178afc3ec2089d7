/* Sandboxed codecs: their failures do not affect the program. */
#include "base/clock.h"
#include "base/isolation.h"
#include "base/sandbox_worker.h"
#include "codec_frames.h"
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <pthread.h>
#include <sched.h>
#include <seccomp.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/mount.h>
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
    case 'A':
        return cts_fail(err, (CtsStatus)12345, "a\033[31mb");
    case 'x':
        memory = mmap(NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        return memory == MAP_FAILED ? cts_fail(err, CTS_ERR_PIXELS, "no code") : CTS_OK;
    default:
        break;
    }
    return cts_fail(err, CTS_ERR_PIXELS, "byte %d", stream[0]);
}

/* This program is its own sandbox. */
static CtsSandbox make_actor(void)
{
    return cts_sandbox_make("test_sandbox", 0, "decoder");
}

static CtsStatus begin(CtsSandbox *d, const char *what, CtsError *err)
{
    const CtsFrameFormat format = format_16(20, 10);
    const size_t n = strlen(what), n_pixels = cts_frame_bytes(&format);
    uint8_t *stream;
    *err = (CtsError){0};
    const CtsStatus st = cts_sandbox_room(d, n, n_pixels, &stream, err);
    if (st)
        return st;
    memcpy(stream, what, n);
    cts_sandbox_send(d, &format, sizeof format, stream, n, n_pixels);
    return CTS_OK;
}

static CtsStatus run(CtsSandbox *d, const char *what, const void **pixels, CtsError *err)
{
    const CtsStatus st = begin(d, what, err);
    return st ? st : cts_sandbox_take(d, pixels, err);
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
    const int files = open_files();
    CtsSandbox d = make_actor();
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
    CtsSandbox d = make_actor();
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

enum { SMALL = 2 * 20 * 10, LARGE = 2 * 1200 * 1000 }; /* bytes of frames */

static void hand_over(CtsSandbox *d, const char *what)
{
    CtsError err;
    assert_true(cts_sandbox_fits(d, strlen(what), SMALL));
    if (begin(d, what, &err))
        fail_msg("%s", err.text);
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
    CtsSandbox *d = NULL;
    assert_int_equal(cts_sandbox_new(&d, "test_sandbox", 0, "decoder", 2, NULL), CTS_OK);
    hand_over(d, "d1");
    for (int i = 0; i < 3; i++) {
        hand_over(d, "d23");
        assert_false(cts_sandbox_fits(d, 1, SMALL));
        take(d, "d1", NULL);
        assert_true(cts_sandbox_fits(d, 1, SMALL));
        assert_false(cts_sandbox_fits(d, 1, LARGE));
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

/* Within some seconds, for it ends by itself. */
static bool is_gone(pid_t pid)
{
    const struct timespec pause = {0, 10000000};
    for (int i = 0; i < 1000 && !kill(pid, 0); i++)
        nanosleep(&pause, NULL);
    return kill(pid, 0) && errno == ESRCH;
}

/* A program that ignores SIGCHLD, or a thread of which reaps all its child processes: deaths are noticed, of an unknown
 * reason. */
static void *reap_all(void *stop)
{
    while (!__atomic_load_n((int *)stop, __ATOMIC_RELAXED))
        waitpid(-1, NULL, 0);
    return NULL;
}

static void test_children_taken(void **state)
{
    CtsSandbox d = make_actor();
    const void *pixels;
    CtsError err;
    for (int reaps = 0; reaps < 2; reaps++) {
        pthread_t reaper;
        int stop = 0;
        signal(SIGCHLD, reaps ? SIG_DFL : SIG_IGN);
        if (reaps)
            assert_int_equal(pthread_create(&reaper, NULL, reap_all, &stop), 0);
        for (int i = 0; i < 3; i++) {
            expect_decoded(&d);
            assert_int_equal(run(&d, "e", &pixels, &err), CTS_ERR_PIXELS);
            assert_non_null(strstr(err.text, "ended without an answer"));
            expect_decoded(&d);
            kill(d.pid, SIGKILL);
            expect_decoded(&d);
        }
        cts_sandbox_stop(&d);
        __atomic_store_n(&stop, 1, __ATOMIC_RELAXED);
        if (reaps)
            pthread_join(reaper, NULL);
    }
    signal(SIGCHLD, SIG_DFL);
}

/* Answers of a process that a stream controls are read with care. */
static void test_hostile_answer(void **state)
{
    CtsSandbox d = make_actor();
    const void *pixels;
    CtsError err;
    expect_decoded(&d);
    const double before = cts_cpu_ms();
    assert_int_equal(run(&d, "A", &pixels, &err), CTS_ERR_PIXELS);
    if (strcmp(err.text, "a?[31mb"))
        fail_msg("a text with controls: %s", err.text);
    assert_true(cts_cpu_ms() >= before);
    expect_decoded(&d);
    cts_sandbox_stop(&d);
}

/* A fork of the program leaves its parent's process alone and starts its own, which ends with it, however it does: also
 * in the middle of a stream. */
static void test_forked(void **state)
{
    CtsSandbox d = make_actor();
    CtsError err;
    expect_decoded(&d);
    const pid_t first = d.pid;
    for (int how = 0; how < 3; how++) {
        int ends[2];
        pid_t own = 0;
        assert_int_equal(pipe(ends), 0);
        const pid_t forked = fork();
        if (forked == 0) {
            expect_decoded(&d);
            if (how == 2 && begin(&d, "l", &err))
                _exit(1);
            own = d.pid;
            if (write(ends[1], &own, sizeof own) != sizeof own || how == 0)
                _exit(0);
            pause();
        }
        assert_int_equal(read(ends[0], &own, sizeof own), sizeof own);
        assert_int_not_equal(own, first);
        kill(forked, how ? SIGKILL : 0);
        assert_int_equal(waitpid(forked, NULL, 0), forked);
        assert_true(is_gone(own));
        close(ends[0]);
        close(ends[1]);
        expect_decoded(&d);
        assert_int_equal(d.pid, first);
    }
    cts_sandbox_stop(&d);
}

/* CPU time of the processes counts as the program's, as they report it, also where the program does not reap them. */
static void test_computing_counts(void **state)
{
    const void *pixels;
    CtsError err;
    for (int ignored = 0; ignored < 2; ignored++) {
        CtsSandbox d = make_actor();
        signal(SIGCHLD, ignored ? SIG_IGN : SIG_DFL);
        const double before = cts_cpu_ms();
        assert_int_equal(run(&d, "b", &pixels, &err), CTS_OK);
        cts_sandbox_stop(&d);
        const double counted = cts_cpu_ms() - before;
        if (counted < 450 || counted > 800)
            fail_msg("%.0f ms are counted of 500", counted);
    }
    signal(SIGCHLD, SIG_DFL);
}

/* Programs that are missing, that may not be executed, and that are of another version. */
static void test_programs(void **state)
{
    static const struct {
        const char *program, *libexec, *reason;
    } cases[] = {
        {"ctsplat-nothing", NULL, "is not where it was installed"},
        {"test_sandbox", "/nowhere", "not in the folder of CTSPLAT_LIBEXEC, /nowhere"},
        {"passwd", "/etc", "cannot be started: "},
        {"true", "/bin", "does not start"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsSandbox d = cts_sandbox_make(cases[i].program, 0, "decoder");
        const void *pixels;
        CtsError err;
        if (cases[i].libexec)
            setenv("CTSPLAT_LIBEXEC", cases[i].libexec, 1);
        const CtsStatus st = run(&d, "d", &pixels, &err);
        if (st != CTS_ERR_INTERNAL || !strstr(err.text, cases[i].reason))
            fail_msg("%s: %d %s, wanted %s", cases[i].program, st, err.text, cases[i].reason);
        unsetenv("CTSPLAT_LIBEXEC");
        cts_sandbox_stop(&d);
    }
}

/* Runs one check in a process of its own, which may change its surroundings; 77: they cannot be changed here. */
static void expect_apart(int (*check)(void))
{
    int how = 0;
    const pid_t forked = fork();
    if (forked == 0)
        _exit(check());
    assert_int_equal(waitpid(forked, &how, 0), forked);
    if (WIFEXITED(how) && WEXITSTATUS(how) == 77)
        skip();
    assert_int_equal(how, 0);
}

static bool is_refused(CtsSandbox *d, const char *reason)
{
    const void *pixels;
    CtsError err;
    return run(d, "d", &pixels, &err) == CTS_ERR_INTERNAL && strstr(err.text, reason);
}

/* A system that refuses seccomp, as emulators and some containers do, decodes nothing unless the user says so. */
static int decode_without_seccomp(void)
{
    CtsSandbox d = make_actor();
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(seccomp), 0);
    seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(prctl), 1, SCMP_A0(SCMP_CMP_EQ, PR_SET_SECCOMP, 0));
    if (seccomp_load(filter))
        return 77;
    for (int i = 0; i < 50; i++) /* the process may end before or after it is sent the stream */
        if (!is_refused(&d, "CTSPLAT_NO_SANDBOX=1"))
            return 1;
    setenv(CTS_ISOLATION_WAIVED, "1", 1);
    expect_decoded(&d);
    cts_sandbox_stop(&d);
    return 0;
}

static void test_without_seccomp(void **state)
{
    expect_apart(decode_without_seccomp);
}

/* Without /proc, and with the programs on a file system that is mounted noexec, which is named. */
static int decode_without_proc(void)
{
    CtsSandbox d = make_actor();
    if (unshare(CLONE_NEWUSER | CLONE_NEWNS) || mount("none", "/proc", "tmpfs", 0, NULL))
        return 77;
    expect_decoded(&d);
    cts_sandbox_stop(&d);
    if (mount("none", "/proc", "tmpfs", MS_NOEXEC, NULL) || creat("/proc/test_sandbox", 0700) < 0)
        return 77;
    setenv("CTSPLAT_LIBEXEC", "/proc", 1);
    return !is_refused(&d, "mounted noexec");
}

static void test_without_proc(void **state)
{
    expect_apart(decode_without_proc);
}

/* Larger frames get more room; the process with the smaller room is replaced. */
static void test_room(void **state)
{
    CtsSandbox d = make_actor();
    CtsError err;
    const void *pixels;
    uint8_t *stream;
    expect_decoded(&d);
    const pid_t first = d.pid;
    expect_decoded(&d);
    assert_int_equal(d.pid, first);
    const CtsFrameFormat large = format_16(1200, 1000);
    assert_int_equal(cts_sandbox_room(&d, 5 << 20, LARGE, &stream, &err), CTS_OK);
    assert_int_not_equal(d.pid, first);
    stream[(5 << 20) - 1] = 'd';
    cts_sandbox_send(&d, &large, sizeof large, stream + (5 << 20) - 1, 1, LARGE);
    assert_int_equal(cts_sandbox_take(&d, &pixels, &err), CTS_OK);
    assert_int_equal(((const uint8_t *)pixels)[LARGE - 1], 'd');
    expect_decoded(&d);
    cts_sandbox_stop(&d);
}

/* Threads that start processes at the same time, in a program that ignores SIGCHLD. */
static void *start_many(void *failed)
{
    for (int i = 0; i < 20; i++) {
        CtsSandbox d = make_actor();
        const void *pixels;
        CtsError err;
        *(int *)failed |= run(&d, "d123", &pixels, &err) != CTS_OK;
        cts_sandbox_stop(&d);
    }
    return NULL;
}

static void test_many_threads(void **state)
{
    pthread_t starters[4];
    int failed[4] = {0};
    const int files = open_files();
    signal(SIGCHLD, SIG_IGN);
    for (int t = 0; t < 4; t++)
        assert_int_equal(pthread_create(&starters[t], NULL, start_many, &failed[t]), 0);
    for (int t = 0; t < 4; t++) {
        pthread_join(starters[t], NULL);
        assert_int_equal(failed[t], 0);
    }
    signal(SIGCHLD, SIG_DFL);
    assert_int_equal(open_files(), files);
}

int main(int argc, char **argv)
{
    static const CtsSandboxTask tasks[] = {{act, NULL}};
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_deaths),       cmocka_unit_test(test_killed),
        cmocka_unit_test(test_two_frames),   cmocka_unit_test(test_children_taken),
        cmocka_unit_test(test_forked),       cmocka_unit_test(test_computing_counts),
        cmocka_unit_test(test_room),         cmocka_unit_test(test_hostile_answer),
        cmocka_unit_test(test_programs),     cmocka_unit_test(test_without_seccomp),
        cmocka_unit_test(test_without_proc), cmocka_unit_test(test_many_threads),
    };
    if (argc == 2)
        return cts_sandbox_serve(argc, argv, tasks, 1);
    unsetenv("CTSPLAT_LIBEXEC"); /* the sandbox lies beside this program */
    return cmocka_run_group_tests(tests, NULL, NULL);
}
