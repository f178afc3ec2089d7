/* One setting in a process of its own, so that its peak of memory is its own, and a crash costs one row. */
#include "base/clock.h"
#include "base/compare.h"
#include "base/file.h"
#include "base/parallel.h"
#include "lab/bench/bench.h"
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { MIN_RUNS = 3, MAX_RUNS = 7 };
#define QUICK_MS 4000 /* further runs only while all took less */

typedef struct Child {
    const CtsBenchSettings *settings;
    CtsReference *const *own;
    CtsBenchRow *row;
    CtsStatus status;
    CtsError err;
} Child;

/* Sorts them. */
static double median(double *values, int n)
{
    qsort(values, (size_t)n, sizeof *values, cts_compare_double);
    return n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

static CtsStatus evaluate(Child *c, const CtsPicture *picture, const CtsReport *report)
{
    c->row->voxels = report->voxels;
    c->row->bound = report->bound;
    const CtsStatus st = cts_reference_compare(c->own[c->row->kernel], picture, &c->row->own, &c->err);
    return st ? st : cts_reference_compare(c->own[CTS_KERNEL_TENT], picture, &c->row->trilinear, &c->err);
}

/* Resets the peak memory, which is inherited from the parent; where that is impossible, it stays. */
static void reset_peak(void)
{
    const int file = open("/proc/self/clear_refs", O_WRONLY | O_CLOEXEC);
    if (file < 0)
        return;
    if (write(file, "5", 1) != 1)
        errno = 0;
    close(file);
}

static CtsStatus render_runs(Child *c)
{
    CtsRenderSettings s = c->settings->render;
    CtsBenchRow *row = c->row;
    double wall_ms[MAX_RUNS], serial_ms[MAX_RUNS], spent_ms = 0;
    CtsStatus st = CTS_OK;
    struct rusage usage;
    s.engine = row->engine;
    s.kernel = row->kernel;
    s.samples = row->samples;
    s.max_error = row->max_error;
    s.tolerance_hu = row->tolerance_hu;
    s.void_key = row->void_key;
    reset_peak();
    for (row->runs = 0; row->runs < MAX_RUNS && !st; row->runs++) {
        if (row->runs >= MIN_RUNS && spent_ms > QUICK_MS)
            break;
        CtsPicture *picture = NULL;
        CtsReport report = {0};
        const double start_ms = cts_wall_ms(), parallel_ms = cts_parallel_ms();
        st = cts_render(c->settings->model, c->settings->preset, &s, &picture, &report, &c->err);
        wall_ms[row->runs] = cts_wall_ms() - start_ms;
        serial_ms[row->runs] = fmax(wall_ms[row->runs] - (cts_parallel_ms() - parallel_ms), 0);
        spent_ms += wall_ms[row->runs];
        if (!st && row->runs == 0) {
            getrusage(RUSAGE_SELF, &usage);
            row->peak_rss_bytes = (uint64_t)usage.ru_maxrss * 1024;
            st = evaluate(c, picture, &report);
        }
        cts_picture_free(&picture);
        cts_report_free(&report);
    }
    if (st)
        return st;
    row->wall_ms = median(wall_ms, row->runs);
    row->serial_ms = median(serial_ms, row->runs);
    row->wall_ms_spread = wall_ms[row->runs - 1] - wall_ms[0];
    row->measured = true;
    return CTS_OK;
}

/* Reads the worker process's result; forwards a request to stop. */
static bool read_result(int file, pid_t pid, const volatile sig_atomic_t *stop, void *data, size_t n)
{
    bool reported = false;
    for (char *p = data; n > 0;) {
        struct pollfd wait = {.fd = file, .events = POLLIN};
        const int ready = poll(&wait, 1, 100);
        if (!reported && stop && *stop) {
            kill(pid, SIGTERM);
            reported = true;
        }
        if (ready == 0 || (ready < 0 && errno == EINTR))
            continue;
        const ssize_t got = TEMP_FAILURE_RETRY(read(file, p, n));
        if (got <= 0)
            return false;
        p += got;
        n -= (size_t)got;
    }
    return true;
}

/* Never returns. */
static void run_child(Child *c, int file)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    c->status = render_runs(c);
    c->row->measured = !c->status;
    if (c->status)
        snprintf(c->row->why, sizeof c->row->why, "%s", c->err.text);
    const bool sent = cts_write_all(file, &c->status, sizeof c->status) && cts_write_all(file, c->row, sizeof *c->row);
    _exit(sent ? 0 : 1);
}

CtsStatus cts_bench_measure(const CtsBenchSettings *settings, CtsReference *const own[CTS_N_KERNELS], CtsBenchRow *row,
                            CtsError *err)
{
    int ends[2], how = 0;
    if (pipe(ends))
        return cts_fail(err, CTS_ERR_MEMORY, "no pipe: %s", strerror(errno));
    const pid_t pid = fork();
    if (pid < 0) {
        close(ends[0]);
        close(ends[1]);
        return cts_fail(err, CTS_ERR_MEMORY, "no process: %s", strerror(errno));
    }
    if (pid == 0) {
        Child child = {.settings = settings, .own = own, .row = row};
        close(ends[0]);
        run_child(&child, ends[1]);
    }
    close(ends[1]);
    CtsStatus status = CTS_ERR_INTERNAL;
    CtsBenchRow measured;
    const volatile sig_atomic_t *stop = settings->render.stop;
    const bool whole = read_result(ends[0], pid, stop, &status, sizeof status) &&
                       read_result(ends[0], pid, stop, &measured, sizeof measured);
    close(ends[0]);
    TEMP_FAILURE_RETRY(waitpid(pid, &how, 0));
    if (stop && *stop)
        return cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    if (whole)
        *row = measured;
    else if (WIFSIGNALED(how))
        snprintf(row->why, sizeof row->why, "its process was ended by signal %d", WTERMSIG(how));
    else
        snprintf(row->why, sizeof row->why, "its process ended with status %d", WEXITSTATUS(how));
    return whole && status == CTS_ERR_INTERRUPTED ? cts_fail(err, status, "interrupted") : CTS_OK;
}
