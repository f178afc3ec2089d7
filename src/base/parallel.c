#include "base/parallel.h"

#include "base/clock.h"
#include "base/thread.h"

#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

/* A running loop, on its caller's stack. */
typedef struct Loop {
    cts_work_fn work;
    void *context;
    size_t n, chunk;
    atomic_size_t taken;  /* items claimed by workers, counted past n too */
    int n_wanted;         /* helpers that may still join */
    int n_joined, n_busy; /* helpers so far, and those that have not left */
    pthread_cond_t left;  /* the last helper did */
    struct Loop *next;
} Loop;

/* The state of this file: helpers serve whichever loop has work, so that many callers need no more threads than
 * one. */
static struct {
    pthread_mutex_t lock;
    pthread_cond_t work; /* loops need helpers */
    Loop *loops;
    int n_helpers, n_idle, n_busy; /* busy: in a loop, listed or already over for its caller */
    bool stopping, has_ended;      /* helpers that find no work end; one did */
    pthread_t ended;               /* the last that did, which joins the one before */
    pthread_cond_t gone;           /* a helper ends */
} pool = {.lock = PTHREAD_MUTEX_INITIALIZER, .work = PTHREAD_COND_INITIALIZER, .gone = PTHREAD_COND_INITIALIZER};

/* The other: see cts_parallel_ms(). */
static _Atomic uint64_t shared_ns;
static _Thread_local bool inside_shared;

static pthread_once_t once = PTHREAD_ONCE_INIT;

/* Idle helper threads end before a fork. A thread that has just begun, or ends, may hold a lock of the C library or of
 * a sanitizer, which would stay locked in the child process. */
static void before_fork(void)
{
    pthread_mutex_lock(&pool.lock);
    pool.stopping = true;
    pthread_cond_broadcast(&pool.work);
    while (pool.n_helpers > pool.n_busy && !pool.loops) /* one that is busy may be the one that forks */
        pthread_cond_wait(&pool.gone, &pool.lock);
    pool.stopping = false;
    if (pool.has_ended)
        pthread_join(pool.ended, NULL);
    pool.has_ended = false;
}

static void after_fork(void)
{
    pthread_mutex_unlock(&pool.lock);
}

/* Threads do not pass through a fork. */
static void in_child(void)
{
    pthread_mutex_init(&pool.lock, NULL);
    pthread_cond_init(&pool.work, NULL);
    pthread_cond_init(&pool.gone, NULL);
    pool.loops = NULL;
    pool.n_helpers = pool.n_idle = pool.n_busy = 0;
}

static void prepare_forks(void)
{
    pthread_atfork(before_fork, after_fork, in_child);
}

static void take_items(Loop *loop, int worker)
{
    for (;;) {
        const size_t first = atomic_fetch_add_explicit(&loop->taken, loop->chunk, memory_order_relaxed);
        if (first >= loop->n)
            return;
        loop->work(loop->context, worker, first, loop->n - first < loop->chunk ? loop->n : first + loop->chunk);
    }
}

static Loop *find_loop(void)
{
    Loop *loop = pool.loops;
    while (loop && (!loop->n_wanted || atomic_load_explicit(&loop->taken, memory_order_relaxed) >= loop->n))
        loop = loop->next;
    return loop;
}

static void *help(void *unused)
{
    inside_shared = true;
    pthread_mutex_lock(&pool.lock);
    for (;;) {
        Loop *const loop = find_loop();
        if (!loop && pool.stopping)
            break;
        if (!loop) {
            pool.n_idle++;
            pthread_cond_wait(&pool.work, &pool.lock);
            pool.n_idle--;
            continue;
        }
        const int worker = ++loop->n_joined;
        loop->n_wanted--;
        loop->n_busy++;
        pool.n_busy++;
        pthread_mutex_unlock(&pool.lock);
        take_items(loop, worker);
        pthread_mutex_lock(&pool.lock);
        pool.n_busy--;
        if (--loop->n_busy == 0)
            pthread_cond_signal(&loop->left);
    }
    const bool is_first = !pool.has_ended;
    const pthread_t before = pool.ended;
    pool.ended = pthread_self();
    pool.has_ended = true;
    pool.n_helpers--;
    pthread_cond_signal(&pool.gone);
    pthread_mutex_unlock(&pool.lock);
    if (!is_first)
        pthread_join(before, NULL);
    return unused;
}

static bool add_helper(void)
{
    pthread_t thread;
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    const bool added = !cts_thread_start(&thread, help, NULL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pool.n_helpers += added;
    return added;
}

static void begin_loop(Loop *loop)
{
    pthread_once(&once, prepare_forks);
    pthread_mutex_lock(&pool.lock);
    while (pool.n_helpers < loop->n_wanted && add_helper())
        ;
    loop->next = pool.loops;
    pool.loops = loop;
    for (int i = 0; i < loop->n_wanted && i < pool.n_idle; i++)
        pthread_cond_signal(&pool.work);
    pthread_mutex_unlock(&pool.lock);
}

static void end_loop(Loop *loop)
{
    pthread_mutex_lock(&pool.lock);
    Loop **link = &pool.loops;
    while (*link != loop)
        link = &(*link)->next;
    *link = loop->next;
    while (loop->n_busy)
        pthread_cond_wait(&loop->left, &pool.lock);
    pthread_mutex_unlock(&pool.lock);
}

void cts_parallel(int n_threads, size_t n, size_t chunk, cts_work_fn work, void *context)
{
    const bool can_share = n > (chunk ? chunk : 1);
    if (!chunk)
        chunk = n_threads > 1 ? n / (8 * (size_t)n_threads) + 1 : n + 1;
    const size_t n_chunks = n / chunk + (n % chunk > 0);
    Loop loop = {.work = work,
                 .context = context,
                 .n = n,
                 .chunk = chunk,
                 .n_wanted = n_threads <= 1 || n_chunks <= 1 ? 0
                             : (size_t)n_threads < n_chunks  ? n_threads - 1
                                                             : (int)n_chunks - 1,
                 .left = PTHREAD_COND_INITIALIZER};
    const bool alone = loop.n_wanted == 0, counts = can_share && !inside_shared;
    const double start_ms = counts ? cts_wall_ms() : 0;
    inside_shared |= counts;
    if (!alone)
        begin_loop(&loop);
    take_items(&loop, 0);
    if (!alone)
        end_loop(&loop);
    pthread_cond_destroy(&loop.left);
    if (counts) {
        inside_shared = false;
        atomic_fetch_add(&shared_ns, (uint64_t)((cts_wall_ms() - start_ms) * 1e6));
    }
}

double cts_parallel_ms(void)
{
    return (double)atomic_load(&shared_ns) * 1e-6;
}
