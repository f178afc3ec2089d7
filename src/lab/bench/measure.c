/* One setting in a process of its own, so that its peak of memory is its own, and a crash costs one row. */
#include "base/clock.h"
#include "base/compare.h"
#include "base/parallel.h"
#include "lab/bench/bench.h"
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { MIN_RUNS = 3, MAX_RUNS = 7 };
#define QUICK_MS 4000 /* further runs only while all took less */

/* In memory that the child shares. */
typedef struct Child {
    const CtsBenchSettings *settings;
    CtsReference *const *own;
    CtsBenchRow row;
    CtsStatus status;
    CtsError err;
    bool ended; /* the row and the status are whole */
} Child;

/* Sorts them. */
static double median(double *values, int n)
{
    qsort(values, (size_t)n, sizeof *values, cts_compare_double);
    return n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

static CtsStatus evaluate(Child *c, const CtsPicture *picture, const CtsReport *report)
{
    c->row.voxels = report->voxels;
    c->row.bound = report->bound;
    const CtsStatus st = cts_reference_compare(c->own[c->row.kernel], picture, &c->row.own, &c->err);
    return st ? st : cts_reference_compare(c->own[CTS_KERNEL_TENT], picture, &c->row.trilinear, &c->err);
}

static CtsStatus render_runs(Child *c)
{
    CtsRenderSettings s = c->settings->render;
    CtsBenchRow *row = &c->row;
    double wall_ms[MAX_RUNS], serial_ms[MAX_RUNS], spent_ms = 0;
    CtsStatus st = CTS_OK;
    struct rusage usage;
    s.engine = row->engine;
    s.kernel = row->kernel;
    s.samples = row->samples;
    s.max_error = row->max_error;
    s.tolerance_hu = row->tolerance_hu;
    s.void_key = row->void_key;
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

/* Waits for the end of the child; forwards a request to stop. */
static int wait_for(pid_t pid, const volatile sig_atomic_t *stop)
{
    enum { TICK_US = 20000 };
    bool forwarded = false;
    int how = 0;
    for (; TEMP_FAILURE_RETRY(waitpid(pid, &how, WNOHANG)) == 0; usleep(TICK_US))
        if (!forwarded && stop && *stop) {
            kill(pid, SIGTERM);
            forwarded = true;
        }
    return how;
}

/* Never returns. */
static void run_child(Child *c)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    c->status = render_runs(c);
    c->row.measured = !c->status;
    if (c->status)
        snprintf(c->row.why, sizeof c->row.why, "%s", c->err.text);
    c->ended = true;
    _exit(0);
}

CtsStatus cts_bench_measure(const CtsBenchSettings *settings, CtsReference *const own[CTS_N_KERNELS], CtsBenchRow *row,
                            CtsError *err)
{
    const volatile sig_atomic_t *stop = settings->render.stop;
    Child *const child = mmap(NULL, sizeof *child, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (child == MAP_FAILED)
        return cts_fail(err, CTS_ERR_MEMORY, "no shared memory: %s", strerror(errno));
    *child = (Child){.settings = settings, .own = own, .row = *row};
    const pid_t pid = fork();
    if (pid == 0)
        run_child(child);
    const int fork_error = errno, how = pid < 0 ? 0 : wait_for(pid, stop);
    CtsStatus st = CTS_OK;
    if (pid < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "no process: %s", strerror(fork_error));
    else if ((stop && *stop) || (child->ended && child->status == CTS_ERR_INTERRUPTED))
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    else if (child->ended)
        *row = child->row;
    else if (WIFSIGNALED(how))
        snprintf(row->why, sizeof row->why, "its process was ended by signal %d", WTERMSIG(how));
    else
        snprintf(row->why, sizeof row->why, "its process ended with status %d", WEXITSTATUS(how));
    munmap(child, sizeof *child);
    return st;
}
