#include "app/batch/later.h"

#include "app/batch/worker.h"
#include "base/json.h"
#include <stdio.h>
#include <string.h>
#include <time.h>

/* The interval before a try doubles up to 2^6 = 64 times the first one: half an hour with 30 s. */
enum { MAX_DOUBLINGS = 6 };
/* Status and text of a series to which files still come. */
static const char WAITING[] = "waiting";

static void note_due(CtsUtc *due, const char *at)
{
    if (!due->text[0] || strcmp(at, due->text) < 0)
        snprintf(due->text, sizeof due->text, "%s", at);
}

bool cts_later_waits(CtsUtc *due, const CtsBatchSettings *settings, const CtsPlanSeries *series, json_t **record,
                     bool *changed)
{
    const int64_t settled_s = settings->options->settled_s, due_s = series->newest_ns / 1000000000 + settled_s + 1;
    char reason[80];
    if (!settled_s || due_s <= (int64_t)time(NULL))
        return false;
    note_due(due, cts_utc_at(due_s).text);
    *changed = !*record || strcmp(cts_json_text_of(*record, "status"), WAITING);
    if (!*record)
        *record = cts_worker_new_record(settings, series, series->uid, series->folder);
    snprintf(reason, sizeof reason, "a file came less than %d s before", (int)settled_s);
    cts_worker_set_status(*record, 0, reason);
    json_object_set_new(*record, "status", json_string(WAITING));
    return true;
}

/* True if another try of the series may succeed: geometry and pixels that were refused do not change. */
static bool may_succeed(const json_t *record)
{
    const char *status = cts_json_text_of(record, "status");
    return !strcmp(status, "failed") ||
           (!strcmp(status, "refused") && json_integer_value(json_object_get(record, "exit_code")) != 4);
}

bool cts_later_is_held(CtsUtc *due, const CtsBatchSettings *settings, const json_t *record, const char *input_sha256)
{
    char hex[65];
    const char *at = cts_json_text_of(record, "try_again");
    if (!settings->options->settled_s || !at[0] || !may_succeed(record) ||
        strcmp(cts_json_text_of(record, "input_sha256"), input_sha256) ||
        cts_journal_record_hash(settings, NULL, true, hex, NULL) ||
        strcmp(cts_json_text_of(record, "options_sha256"), hex) || strcmp(at, cts_utc_now().text) <= 0)
        return false;
    note_due(due, at);
    return true;
}

void cts_later_set_try(CtsUtc *due, const CtsBatchSettings *settings, json_t *record)
{
    const int n = (int)json_integer_value(json_object_get(record, "tries"));
    json_object_del(record, "tries");
    json_object_del(record, "try_again");
    if (!settings->options->settled_s || !may_succeed(record))
        return;
    const int64_t pause_s = (int64_t)settings->options->settled_s << (n < MAX_DOUBLINGS ? n : MAX_DOUBLINGS);
    const CtsUtc at = cts_utc_at((int64_t)time(NULL) + pause_s);
    json_object_set_new(record, "tries", json_integer(n + 1));
    json_object_set_new(record, "try_again", json_string(at.text));
    note_due(due, at.text);
}
