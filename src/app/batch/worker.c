#include "app/batch/worker.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

/* GRACE_MS: time for a worker to end by itself before it is killed. MAX_MESSAGE: longest message in bytes, a journal
 * record with all files of a series; a longer one ends the worker. */
enum { GRACE_MS = 2000, MAX_MESSAGE = 64 << 20 };

bool cts_worker_read(CtsWorker *w, void (*take)(void *context, CtsWorker *worker, const char *message), void *context)
{
    for (;;) {
        if (w->capacity - w->n_text < 4096) {
            const size_t capacity = w->capacity ? 2 * w->capacity : 1 << 16;
            char *grown = capacity > MAX_MESSAGE ? NULL : realloc(w->text, capacity);
            if (!grown)
                return false;
            w->text = grown;
            w->capacity = capacity;
        }
        const ssize_t n = TEMP_FAILURE_RETRY(recv(w->socket, w->text + w->n_text, w->capacity - w->n_text - 1, 0));
        if (n <= 0)
            return n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
        w->n_text += (size_t)n;
        w->text[w->n_text] = 0;
        char *start = w->text;
        for (char *end; (end = memchr(start, '\n', (size_t)(w->text + w->n_text - start))); start = end + 1) {
            *end = 0;
            take(context, w, start);
        }
        w->n_text -= (size_t)(start - w->text);
        memmove(w->text, start, w->n_text);
    }
}

void cts_worker_reason(const CtsWorker *w, int how, char *reason, size_t size)
{
    if (w->killed)
        snprintf(reason, size, "%s", w->killed);
    else if (WIFSIGNALED(how) && WTERMSIG(how) == SIGKILL)
        snprintf(reason, size, "its process was killed, as happens when memory runs out");
    else if (WIFSIGNALED(how))
        snprintf(reason, size, "its process crashed: signal %d (%s)", WTERMSIG(how), strsignal(WTERMSIG(how)));
    else if (WEXITSTATUS(how) == CTS_WORKER_NO_MEMORY)
        snprintf(reason, size, "it ran out of memory, and had none left to report where");
    else
        snprintf(reason, size, "its process ended with status %d and no report", WEXITSTATUS(how));
}

void cts_worker_stop(CtsWorker *w, double now_ms)
{
    if (w->stop_ms <= 0) {
        w->stop_ms = now_ms;
        kill(w->pid, SIGTERM);
    } else if (now_ms - w->stop_ms > GRACE_MS) {
        kill(w->pid, SIGKILL);
    }
}

void cts_worker_free(CtsWorker *w)
{
    close(w->socket);
    cts_plan_series_free(&w->series);
    json_decref(w->record);
    free(w->text);
    *w = (CtsWorker){0};
}
