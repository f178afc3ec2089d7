/* Work shared out among threads, and how many there are to be. */
#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "folder.h"
#include "unit.h"
#include <dirent.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

enum { MOST = 3000, MAX_THREADS = 9 };

typedef struct Tally {
    atomic_int times[MOST];     /* that an item was worked on */
    atomic_int at[MAX_THREADS]; /* calls of a worker under way */
    atomic_int wrong;           /* two calls of one worker at once, or a range that is none */
    size_t n, chunk;
} Tally;

static void count(void *context, int worker, size_t first, size_t end)
{
    Tally *const t = context;
    t->wrong += worker < 0 || worker >= MAX_THREADS || first >= end || end > t->n;
    t->wrong += t->chunk > 0 && (first % t->chunk || end - first > t->chunk);
    t->wrong += atomic_fetch_add(&t->at[worker], 1) > 0;
    for (size_t i = first; i < end; i++)
        t->times[i]++;
    if (first % 7 == 0)
        sched_yield();
    t->at[worker]--;
}

static void check_loop(int n_threads, size_t n, size_t chunk)
{
    Tally *t = calloc(1, sizeof *t);
    assert_non_null(t);
    t->n = n;
    t->chunk = chunk;
    cts_parallel(n_threads, n, chunk, count, t);
    for (size_t i = 0; i < MOST; i++)
        assert_int_equal(t->times[i], i < n);
    assert_int_equal(t->wrong, 0);
    free(t);
}

static void test_each_item_once(void **state)
{
    const size_t n[] = {0, 1, 2, 8, 100, 2999, MOST}, chunks[] = {0, 1, 3, 64, 5000};
    for (int n_threads = 0; n_threads <= MAX_THREADS; n_threads++)
        for (size_t i = 0; i < sizeof n / sizeof *n; i++)
            for (size_t c = 0; c < sizeof chunks / sizeof *chunks; c++)
                check_loop(n_threads, n[i], chunks[c]);
}

/* An inner loop for each item of an outer one. */
static void nest(void *context, int worker, size_t first, size_t end)
{
    for (size_t i = first; i < end; i++) {
        check_loop(3, 100 + i, 1);
        atomic_fetch_add((atomic_int *)context, 1);
    }
}

static void test_nested(void **state)
{
    atomic_int n = 0;
    cts_parallel(4, 50, 1, nest, &n);
    assert_int_equal(n, 50);
}

/* Time counts once, in loops that can be shared, with one thread as with many. */
static void doze(void *context, int worker, size_t first, size_t end)
{
    const size_t *inner = context;
    for (size_t i = first; i < end; i++) {
        usleep(3000);
        if (inner)
            cts_parallel(2, *inner, 1, doze, NULL);
    }
}

static void test_shared_time(void **state)
{
    size_t inner = 2;
    double before = cts_parallel_ms();
    cts_parallel(2, 1, 0, doze, NULL);
    cts_parallel(1, 3, 3, doze, NULL);
    assert_true(cts_parallel_ms() == before);
    for (int n_threads = 1; n_threads <= 3; n_threads++) {
        before = cts_parallel_ms();
        const double start = cts_wall_ms();
        cts_parallel(n_threads, 4, 0, doze, &inner);
        const double took = cts_wall_ms() - start, counted = cts_parallel_ms() - before;
        assert_true(counted > 3 && counted <= took);
    }
    before = cts_parallel_ms();
    cts_parallel(1, 1, 1, doze, &inner); /* which holds one that can */
    assert_true(cts_parallel_ms() - before > 3);
}

static void *loop_often(void *unused)
{
    for (size_t i = 0; i < 200; i++)
        check_loop(2 + (int)i % 3, 10 + i, 1);
    return unused;
}

static void test_many_callers(void **state)
{
    pthread_t threads[4];
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, loop_often, NULL), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(threads[i], NULL);
}

static atomic_int max_threads;

static int threads_listed(void)
{
    int n = 0;
    DIR *const tasks = opendir("/proc/self/task");
    assert_non_null(tasks);
    for (const struct dirent *task; (task = readdir(tasks));)
        n += task->d_name[0] != '.';
    closedir(tasks);
    return n;
}

/* Registered before the pool's own, so it runs after that. The system lists a thread that has been joined for a moment
 * longer: one that idles stays. */
static void count_threads(void)
{
    int n = threads_listed();
    for (int i = 0; i < 1000 && n > 1 && max_threads <= 1; i++) {
        usleep(1000);
        n = threads_listed();
    }
    max_threads = n > max_threads ? n : max_threads;
}

static void test_alone_at_fork(void **state)
{
    for (int i = 0; i < 200; i++) {
        check_loop(4, 8, 1);
        const pid_t child = fork();
        assert_true(child >= 0);
        if (!child)
            _exit(0);
        assert_int_equal(waitpid(child, NULL, 0), child);
    }
    assert_int_equal(max_threads, 1);
}

static void test_after_fork(void **state)
{
    check_loop(4, 1000, 1);
    for (int i = 0; i < 20; i++) {
        const pid_t child = fork();
        assert_true(child >= 0);
        if (!child) {
            for (int k = 0; k < 20; k++)
                check_loop(4, 1000, 1);
            _exit(0);
        }
        check_loop(4, 1000, 1);
        int status = -1;
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_int_equal(status, 0);
    }
}

static void write_text(const char *folder, const char *name, const char *text, char path[400])
{
    snprintf(path, 400, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

/* A hierarchy whose own files have the expected value. */
typedef double (*Quota)(const char *groups_path, const char *mount);

static void check_limit(Quota quota, const char *groups, const char *const files[][2], double expected)
{
    char folder[64], path[400], groups_path[400];
    make_folder(folder);
    for (int i = 0; files[i][0]; i++)
        write_text(folder, files[i][0], files[i][1], path);
    write_text(folder, "groups", groups, groups_path);
    const double found = quota(groups_path, folder);
    if (isinf(expected) ? !isinf(found) : !(fabs(found - expected) < 1e-12))
        fail_msg("groups %s, file %s: expected %g, found %g", groups, files[0][0], expected, found);
    remove_folder(folder);
}

static void check_quota(const char *groups, const char *const files[][2], double expected)
{
    check_limit(cts_cpu_quota, groups, files, expected);
}

/* A helper forks in its last items, when the loop has nothing left for others and its caller waits. */
static void fork_late(void *context, int worker, size_t first, size_t end)
{
    atomic_int *const begun = context;
    if (worker == 0) {
        while (!atomic_load(begun))
            sched_yield();
        return;
    }
    atomic_store(begun, 1);
    usleep(20000);
    const pid_t child = fork();
    if (child == 0)
        _exit(0);
    waitpid(child, NULL, 0);
}

static void test_fork_by_helper(void **state)
{
    for (int i = 0; i < 5; i++) {
        atomic_int begun = 0;
        cts_parallel(2, 2, 1, fork_late, &begun);
        assert_int_equal(begun, 1);
    }
}

static void test_quota(void **state)
{
    const char *const none[][2] = {{NULL, NULL}};
    const char *const max[][2] = {{"cpu.max", "max 100000\n"}, {NULL, NULL}};
    const char *const half[][2] = {{"cpu.max", "150000 100000\n"}, {NULL, NULL}};
    const char *const bad[][2] = {{"cpu.max", "0 0"}, {NULL, NULL}};
    check_quota("0::/\n", none, INFINITY);
    check_quota("0::/\n", max, INFINITY);
    check_quota("0::/\n", half, 1.5);
    /* The group lies deeper than the one with the quota; or the folder shown is the group itself. */
    check_quota("4:memory:/x\n0::/a/b\n", half, 1.5);
    check_quota("0::/\n", bad, INFINITY);
    check_quota("nonsense\n", half, INFINITY);
    assert_true(isinf(cts_cpu_quota("absent", "absent")));
}

/* A limit less what is in use, files in memory aside; groups around the process's own count too. */
static void test_memory_quota(void **state)
{
    const char *const none[][2] = {{"memory.current", "1000\n"}, {NULL, NULL}};
    const char *const max[][2] = {{"memory.max", "max\n"}, {"memory.current", "1000\n"}, {NULL, NULL}};
    const char *const limit[][2] = {{"memory.max", "536870912\n"},
                                    {"memory.high", "max\n"},
                                    {"memory.current", "136870912\n"},
                                    {"memory.stat", "anon 90\nfile 5\ninactive_file 20000000\nactive_file 16870912\n"},
                                    {NULL, NULL}};
    const char *const high[][2] = {
        {"memory.max", "536870912\n"}, {"memory.high", "300000000\n"}, {"memory.current", "400000000\n"}, {NULL, NULL}};
    const struct {
        const char *groups;
        const char *const (*files)[2];
        double expected;
    } cases[] = {
        {"0::/\n", none, INFINITY},      {"0::/\n", max, INFINITY}, {"0::/\n", limit, 436870912},
        {"0::/a/b\n", limit, 436870912}, {"0::/\n", high, 0},
    };
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++)
        check_limit(cts_memory_quota, cases[n].groups, cases[n].files, cases[n].expected);
    assert_true(isinf(cts_memory_quota("absent", "absent")));
    assert_true(cts_memory_available() > 0);
}

static void test_environment(void **state)
{
    const char *why;
    cpu_set_t before, one;
    unsetenv("OMP_NUM_THREADS");
    const int all = cts_threads(0);
    assert_true(all >= 1 && all <= cts_cpu_cores());
    setenv("OMP_NUM_THREADS", "1,4", 1);
    assert_int_equal(cts_threads_why(0, &why), 1);
    assert_true(all == 1 || !strcmp(why, "OMP_NUM_THREADS"));
    assert_int_equal(cts_threads_why(5, &why), 5);
    assert_string_equal(why, "as asked for");
    setenv("OMP_NUM_THREADS", "100000", 1);
    assert_int_equal(cts_threads(0), all);
    setenv("OMP_NUM_THREADS", "many", 1);
    assert_int_equal(cts_threads(0), all);
    unsetenv("OMP_NUM_THREADS");
    assert_int_equal(sched_getaffinity(0, sizeof before, &before), 0);
    CPU_ZERO(&one);
    for (int cpu = 0; cpu < CPU_SETSIZE && !CPU_COUNT(&one); cpu++)
        if (CPU_ISSET(cpu, &before))
            CPU_SET(cpu, &one);
    assert_int_equal(sched_setaffinity(0, sizeof one, &one), 0);
    assert_int_equal(cts_threads(0), 1);
    sched_setaffinity(0, sizeof before, &before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_item_once), cmocka_unit_test(test_nested),
        cmocka_unit_test(test_many_callers),   cmocka_unit_test(test_alone_at_fork),
        cmocka_unit_test(test_after_fork),     cmocka_unit_test(test_fork_by_helper),
        cmocka_unit_test(test_quota),          cmocka_unit_test(test_memory_quota),
        cmocka_unit_test(test_environment),    cmocka_unit_test(test_shared_time),
    };
    if (pthread_atfork(count_threads, NULL, NULL))
        return 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
