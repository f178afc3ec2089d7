/* What a series has and the PACS has not goes there, in a process of its own. */
#include "app/batch/child.h"
#include "base/exit_code.h"
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Paths of the captures that are to be sent, in the order of the line's entries; each and the list to be freed. */
static CtsStatus list_captures(const CtsBatchChild *c, char ***paths, int *n, CtsError *err)
{
    size_t i;
    json_t *entry;
    *n = 0;
    if (!(*paths = calloc((size_t)cts_line_n_waiting(c->settings, c->line) + 1, sizeof **paths)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    json_array_foreach(json_object_get(c->line, "outputs"), i, entry)
    {
        char path[PATH_MAX];
        if (!cts_line_waits(c->settings, entry) || !cts_line_path(c->settings, entry, path, sizeof path))
            continue;
        if (!((*paths)[*n] = strdup(path)))
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        ++*n;
    }
    return CTS_OK;
}

/* The PACS has it, and whatever happens from here on, the journal knows. */
static void on_sent(void *context, const char *sent)
{
    CtsBatchChild *c = context;
    size_t i;
    json_t *entry;
    json_array_foreach(json_object_get(c->line, "outputs"), i, entry)
    {
        char path[PATH_MAX];
        if (!cts_line_path(c->settings, entry, path, sizeof path) || strcmp(path, sent))
            continue;
        if (!json_object_get(entry, "sent_to"))
            json_object_set_new(entry, "sent_to", json_array());
        json_array_append_new(json_object_get(entry, "sent_to"), json_string(c->settings->lists->send_to));
    }
    json_object_set_new(c->line, "unsent", json_integer(cts_line_n_waiting(c->settings, c->line)));
    cts_child_send_line(c, CTS_CHILD_LINE, NULL);
}

static void run_sender(CtsBatchChild *c)
{
    CtsError err = {0};
    char **paths;
    int n;
    CtsNet net = c->settings->options->net;
    net.sent = on_sent;
    net.context = c;
    CtsStatus st = list_captures(c, &paths, &n, &err);
    if (!st)
        st = cts_net_send(&c->settings->options->send.peer, &net, (const char *const *)paths, n, NULL, &err);
    if (st == CTS_ERR_INTERRUPTED)
        _exit(130);
    if (!st)
        json_object_del(c->line, "unsent");
    cts_child_set_status(c->line, cts_exit_code(st), st ? err.text : "");
    cts_child_send_line(c, CTS_CHILD_LAST, NULL);
    _exit(0);
}

CtsStatus cts_sender_start(const CtsBatchSettings *settings, CtsJournal *journal, const json_t *line, pid_t *pid,
                           int *socket, CtsError *err)
{
    CtsBatchChild child = {.settings = settings, .journal = journal, .line = json_deep_copy(line)};
    if (!child.line)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsStatus st = cts_child_fork(&child, run_sender, pid, socket, err);
    json_decref(child.line);
    return st;
}
