#include "app/batch/child.h"

#include "base/clock.h"
#include "base/exit_code.h"
#include "base/json.h"
#include "base/mem.h"
#include "base/sanitized.h"
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

static const char *status_word(int exit_code)
{
    return !exit_code ? "done" : exit_code == 3 || exit_code == 4 ? "refused" : "failed";
}

void cts_child_set_status(json_t *line, int exit_code, const char *reason)
{
    json_object_set_new(line, "status", json_string(status_word(exit_code)));
    json_object_set_new(line, "reason", cts_json_new_text(reason));
    json_object_set_new(line, "exit_code", json_integer(exit_code));
    json_object_set_new(line, "ended", json_string(cts_utc_now().text));
    json_object_del(line, "unfinished");
    json_object_del(line, "reason_file");
}

void cts_child_tell_status(CtsBatchChild *child, CtsStatus status, const char *reason)
{
    char *file = NULL, *text = cts_without_names(reason, &child->names, &file);
    cts_child_set_status(child->line, cts_exit_code(status), text ? text : "");
    if (file)
        json_object_set_new(child->line, "reason_file", cts_json_new_text(file));
    free(file);
    free(text);
}

/* Folders, how many files in each, and the first of them, in order of path. */
static json_t *new_sources(const CtsPlanSeries *series)
{
    json_t *list = json_array(), *last = NULL;
    for (int i = 0; i < series->n_paths; i++) {
        const char *path = series->paths[i], *slash = strrchr(path, '/');
        char *folder = slash ? strndup(path, (size_t)(slash - path)) : strdup(".");
        json_t *name = folder ? cts_json_new_text(folder) : NULL;
        if (last && json_equal(json_object_get(last, "folder"), name)) {
            json_object_set_new(last, "files", json_integer(json_integer_value(json_object_get(last, "files")) + 1));
        } else {
            last = json_pack("{s:O,s:o,s:i}", "folder", name, "first", cts_json_new_text(slash ? slash + 1 : path),
                             "files", 1);
            json_array_append_new(list, last);
        }
        json_decref(name);
        free(folder);
    }
    return list;
}

json_t *cts_child_new_line(const CtsBatchSettings *settings, const CtsPlanSeries *series, const char *uid,
                           const char *folder)
{
    char hex[65] = "";
    cts_line_hash(settings, NULL, true, hex, NULL);
    json_t *line = json_pack("{s:o,s:s}", "series_uid", cts_json_new_text(uid), "folder", folder);
    cts_child_set_status(line, 1, "not finished");
    json_object_update_new(line, json_pack("{s:o,s:s,s:s,s:i,s:[],s:[],s:[]}", "sources", new_sources(series),
                                           "input_sha256", series->input_sha256, "options_sha256", hex, "files",
                                           series->n_paths, "outputs", "thumbnails", "findings"));
    return line;
}

CtsStatus cts_child_send(const CtsBatchChild *child, const char *message, CtsError *err)
{
    ssize_t done;
    for (size_t n = strlen(message); n > 0; message += done, n -= (size_t)done)
        if ((done = TEMP_FAILURE_RETRY(send(child->socket, message, n, MSG_NOSIGNAL))) < 0)
            return cts_fail(err, CTS_ERR_INTERRUPTED, "the batch is gone: %s", strerror(errno));
    return CTS_OK;
}

/* The text with the series' name in the batch wherever reasons and findings have its own; NULL without memory. */
static char *renamed(const char *text, const CtsPlanSeries *series)
{
    char *out = NULL;
    size_t size;
    FILE *stream = open_memstream(&out, &size);
    if (!stream)
        return NULL;
    const char *own = series && strcmp(series->own_uid, series->uid) ? series->own_uid : "";
    const size_t n = strlen(own);
    for (const char *at; n && (at = strstr(text, own)); text = at + n)
        fprintf(stream, "%.*s%s", (int)(at - text), text, at[n] >= '0' && at[n] <= '9' ? own : series->uid);
    fputs(text, stream);
    if (!fclose(stream))
        return out;
    free(out);
    return NULL;
}

CtsStatus cts_child_send_line(const CtsBatchChild *child, const char *word, CtsError *err)
{
    char *whole = json_dumps(child->line, JSON_COMPACT | JSON_REAL_PRECISION(12)), *message = NULL;
    char *object = whole ? renamed(whole, child->series) : NULL;
    CtsStatus st = object && asprintf(&message, "%s%s\n", word, object) > 0
                       ? CTS_OK
                       : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st)
        st = cts_child_send(child, message, err);
    free(whole);
    free(object);
    free(message);
    return st;
}

/* A picture is never worth the machine: this process goes first when memory runs out, and no further than it may. */
static void limit(double mib)
{
    const struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const uint64_t bytes = mib > 0 ? (uint64_t)(mib * 1048576) : cts_memory_available() / 10 * 9;
    const struct rlimit data = {bytes, bytes};
    /* A sanitizer's own memory counts as data. */
    if (bytes && !CTS_SANITIZED)
        setrlimit(RLIMIT_DATA, &data);
    const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
    if (fd >= 0) {
        const ssize_t n = write(fd, "1000", 4);
        (void)n;
        close(fd);
    }
}

CtsStatus cts_child_fork(CtsBatchChild *child, void (*run)(CtsBatchChild *child), pid_t *pid, int *socket,
                         CtsError *err)
{
    int ends[2];
    const pid_t parent = getpid();
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends))
        return cts_fail(err, CTS_ERR_INTERNAL, "no socket: %s", strerror(errno));
    fflush(NULL);
    *pid = fork();
    if (*pid < 0) {
        close(ends[0]);
        close(ends[1]);
        return cts_fail(err, CTS_ERR_INTERNAL, "no process: %s", strerror(errno));
    }
    if (*pid == 0) {
        child->socket = ends[1];
        child->start_wall_ms = cts_wall_ms();
        child->start_cpu_ms = cts_cpu_ms();
        close(ends[0]);
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (getppid() != parent)
            _exit(1);
        limit(child->settings->options->series_mib);
        cts_journal_leave(child->journal);
        run(child);
    }
    close(ends[1]);
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
    *socket = ends[0];
    return CTS_OK;
}
