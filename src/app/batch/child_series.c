/* A series as its own process makes it: what is missing of it, and what came of it. */
#include "app/batch/batch.h"
#include "app/batch/child.h"
#include "base/clock.h"
#include "base/exit_code.h"
#include "base/json.h"
#include "base/mem.h"
#include "output/report/log.h"
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>

static void free_pictures(CtsBatchChild *c)
{
    for (int i = 0; i < c->n_pictures; i++) {
        CtsBatchPicture *p = &c->pictures[i];
        for (int f = 0; p->paths && p->paths[f]; f++)
            free((char *)p->paths[f]);
        free(p->paths);
        free((char *)p->thumb_stem);
    }
    free(c->pictures);
    c->pictures = NULL;
    c->n_pictures = c->n_left = 0;
}

/* The line to go on from: what an earlier run made of the same files, or an empty one. */
static void take_line(CtsBatchChild *c, const char *uid)
{
    const char *input;
    c->known = cts_journal_find(c->journal, uid);
    input = json_string_value(json_object_get(c->known, "input_sha256"));
    c->line = cts_child_new_line(c->settings, c->series, uid, c->folder);
    if (c->known && (!input || strcmp(input, c->series->input_sha256))) {
        cts_line_drop(c->known, "outputs", c->settings, NULL, NULL);
        cts_line_drop(c->known, "thumbnails", c->settings, NULL, NULL);
        json_decref(c->known);
        c->known = NULL;
    }
    static const char *const lists[] = {"outputs", "thumbnails", "errors"};
    for (int i = 0; i < 3; i++)
        if (json_is_array(json_object_get(c->known, lists[i])))
            json_object_set(c->line, lists[i], json_object_get(c->known, lists[i]));
}

/* What of one picture is missing; nothing: its paths and stem stay NULL. */
static CtsStatus find_missing(CtsBatchChild *c, CtsBatchPicture *p, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    char stem[CTS_LINE_STEM];
    int n = 0;
    cts_line_stem(s, p, stem);
    if (!(p->paths = calloc((size_t)s->lists->n_formats + 1, sizeof *p->paths)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int f = 0; f < s->lists->n_formats; f++) {
        char *path;
        if (cts_line_stands(s, c->line, p, s->lists->formats[f]))
            continue;
        cts_line_drop(c->line, "outputs", s, p, s->lists->formats[f]);
        if (asprintf(&path, "%s/%s/%s.%s", s->options->output_dir, c->folder, stem, s->lists->formats[f]) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        p->paths[n++] = path;
    }
    if (n)
        cts_line_drop(c->line, "errors", s, p, NULL);
    if (n || !cts_line_stands(s, c->line, p, NULL)) {
        char *path;
        cts_line_drop(c->line, "thumbnails", s, p, NULL);
        if (asprintf(&path, "%s/%s/thumbs/%s", s->options->output_dir, c->folder, stem) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        p->thumb_stem = path;
    }
    return CTS_OK;
}

static CtsStatus make_folders(CtsBatchChild *c, CtsError *err)
{
    char path[PATH_MAX];
    for (int deep = 0; deep < 2; deep++) {
        if (snprintf(path, sizeof path, "%s/%s%s", c->settings->options->output_dir, c->folder,
                     deep ? "/thumbs" : "") >= PATH_MAX)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: the path is too long", c->settings->options->output_dir);
        if (mkdir(path, 0777) && errno != EEXIST)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s", path, strerror(errno));
        struct stat info;
        if (lstat(path, &info) || !S_ISDIR(info.st_mode))
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: is no folder (a link is not followed out of -O)", path);
        cts_sweep(path, "");
    }
    return CTS_OK;
}

/* The finding of the list that says the same. */
static json_t *same_finding(json_t *list, const json_t *entry)
{
    static const char *const keys[] = {"code", "text", "preset"};
    for (size_t i = json_array_size(list); i-- > 0;) {
        json_t *other = json_array_get(list, i);
        bool same = true;
        for (int k = 0; k < 3 && same; k++) {
            const json_t *a = json_object_get(other, keys[k]), *b = json_object_get(entry, keys[k]);
            same = a == b || json_equal(a, b);
        }
        if (same)
            return other;
    }
    return NULL;
}

/* What is said again is counted, and each file that it is said of is named. preset: whose finding it is, or NULL. */
static void add_finding(CtsBatchChild *c, const CtsFinding *finding, const char *preset)
{
    json_t *list = json_object_get(c->line, "findings"), *entry = cts_finding_json(finding);
    char *file = NULL, *text = cts_without_names(finding->text, &c->names, &file);
    json_object_set_new(entry, "text", cts_json_new_text(text ? text : ""));
    if (preset)
        json_object_set_new(entry, "preset", json_string(preset));
    json_t *told = same_finding(list, entry);
    if (told) {
        const json_int_t count = json_integer_value(json_object_get(told, "count"));
        json_object_set_new(told, "count", json_integer((count ? count : 1) + 1));
    } else {
        json_array_append(list, told = entry);
    }
    if (file && !json_object_get(told, "files"))
        json_object_set_new(told, "files", json_array());
    if (file)
        json_array_append_new(json_object_get(told, "files"), cts_json_new_text(file));
    json_decref(entry);
    free(file);
    free(text);
}

static void tell_geometry(CtsBatchChild *c, const CtsPixelFacts *facts)
{
    json_t *geometry = cts_info_json(c->now, facts, true);
    CtsKey key;
    if (c->settings->options->export.deidentify) {
        const bool known = *c->now->study_uid && !cts_key_load(c->settings->options->export.key, false, &key, NULL);
        char *study = known ? cts_uid_hash(&key, c->now->study_uid) : NULL;
        json_object_set_new(geometry, "study", study ? json_string(study) : json_null());
        free(study);
    }
    json_object_del(geometry, "findings");
    json_object_del(geometry, "series_uid");
    json_object_set_new(c->line, "geometry", geometry);
    json_array_clear(json_object_get(c->line, "findings"));
    for (size_t i = 0; i < c->now->findings.n; i++)
        add_finding(c, &c->now->findings.items[i], NULL);
    for (size_t i = 0; i < facts->findings.n; i++)
        add_finding(c, &facts->findings.items[i], NULL);
}

static CtsStatus list_pictures(CtsBatchChild *c, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    CtsStatus st = CTS_OK;
    if (!(c->pictures = calloc((size_t)s->lists->n_presets * (size_t)s->lists->n_views, sizeof *c->pictures)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int p = 0; p < s->lists->n_presets && !st; p++)
        for (int v = 0; v < s->lists->n_views && !st; v++) {
            CtsBatchPicture *picture = &c->pictures[c->n_pictures++];
            *picture = (CtsBatchPicture){.preset = p, .view = v};
            st = find_missing(c, picture, err);
            if (!st && !picture->thumb_stem) {
                free(picture->paths);
                c->n_pictures--;
            }
        }
    c->n_left = c->n_pictures;
    return st;
}

CtsStatus cts_child_begin(CtsBatchChild *c, const CtsSeries *series, CtsError *err)
{
    char uid[96];
    CtsStatus st;
    snprintf(uid, sizeof uid, series->part ? "%s#%d" : "%s", c->series->uid, series->part);
    snprintf(c->folder, sizeof c->folder, series->part ? "%s-%d" : "%s", c->series->folder, series->part);
    take_line(c, uid);
    c->now = series;
    tell_geometry(c, &(CtsPixelFacts){0});
    if (series->renderable && ((st = list_pictures(c, err)) || (c->n_pictures && (st = make_folders(c, err)))))
        return st;
    json_object_set_new(c->line, "unfinished", json_integer(c->n_left));
    return cts_child_send_line(c, CTS_CHILD_BEGUN, err);
}

CtsStatus cts_child_loaded(CtsBatchChild *c, const CtsPixelFacts *facts, CtsError *err)
{
    char go;
    const double start_ms = cts_wall_ms();
    tell_geometry(c, facts);
    CtsStatus st = cts_child_send(c, CTS_CHILD_LOADED "\n", err);
    while (!st) {
        const ssize_t n = recv(c->socket, &go, 1, 0);
        if (n == 1)
            break;
        if (n == 0 || errno != EINTR || (c->settings->stop && *c->settings->stop))
            st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    }
    c->waited_ms += cts_wall_ms() - start_ms;
    return st;
}

/* Of the file PATH, or of PATH with a suffix behind it. */
static json_t *new_entry(const CtsBatchChild *c, const CtsBatchPicture *picture, const char *path, const char *suffix)
{
    const CtsBatchSettings *s = c->settings;
    const size_t n = strlen(s->options->output_dir) + 1;
    char hex[65] = "";
    const char *dot = strrchr(path, '.');
    cts_line_hash(s, picture, dot && !strcmp(dot, ".dcm"), hex, NULL);
    return json_pack("{s:s+,s:s,s:s,s:s}", "path", path + n, suffix, "preset", s->lists->presets[picture->preset].name,
                     "view", s->lists->views[picture->view].name, "settings_sha256", hex);
}

/* Files in the order of their names, whichever of them were made anew. Takes the entry over. */
static void add_in_order(json_t *list, json_t *entry)
{
    size_t i = json_array_size(list);
    while (i > 0 && strcmp(cts_json_text_of(json_array_get(list, i - 1), "path"), cts_json_text_of(entry, "path")) > 0)
        i--;
    json_array_insert_new(list, i, entry);
}

CtsStatus cts_child_output(CtsBatchChild *c, const CtsBatchPicture *picture, const char *path, int frame, CtsError *err)
{
    json_t *entry = new_entry(c, picture, path, "");
    const char *dot = strrchr(path, '.');
    if (frame >= 0)
        json_object_set_new(entry, "frame", json_integer(frame));
    json_object_set_new(entry, "format", json_string(dot ? dot + 1 : ""));
    const CtsStatus st = cts_line_file_facts(c->settings, entry, err);
    if (st)
        json_decref(entry);
    else
        add_in_order(json_object_get(c->line, "outputs"), entry);
    return st;
}

CtsStatus cts_child_thumbnail(CtsBatchChild *c, const CtsBatchPicture *picture, const CtsThumbnailFile *file,
                              CtsError *err)
{
    json_t *entry = new_entry(c, picture, picture->thumb_stem, file->suffix);
    json_object_update_new(entry, json_pack("{s:i,s:I,s:i,s:i}", "frames", file->n_frames, "bytes",
                                            (json_int_t)file->bytes, "width", file->width, "height", file->height));
    return json_array_append_new(json_object_get(c->line, "thumbnails"), entry)
               ? cts_fail(err, CTS_ERR_MEMORY, "out of memory")
               : CTS_OK;
}

/* Among the thumbnails, so that it goes where they go. */
CtsStatus cts_child_label_slices(CtsBatchChild *c, const char *path, uint64_t bytes, CtsError *err)
{
    json_t *list = json_object_get(c->line, "thumbnails");
    for (size_t i = json_array_size(list); i-- > 0;)
        if (json_object_get(json_array_get(list, i), "labels"))
            json_array_remove(list, i);
    return json_array_append_new(list,
                                 json_pack("{s:s,s:b,s:I}", "path", path + strlen(c->settings->options->output_dir) + 1,
                                           "labels", 1, "bytes", (json_int_t)bytes))
               ? cts_fail(err, CTS_ERR_MEMORY, "out of memory")
               : CTS_OK;
}

/* The report's findings up to n that the line does not have yet; preset: whose they are, or NULL: of the series, which
 * the report has once each time that it is read. */
static void tell_findings(CtsBatchChild *c, const CtsFindings *findings, size_t n, const char *preset)
{
    for (; c->n_findings < n; c->n_findings++) {
        const CtsFinding *f = &findings->items[c->n_findings];
        if (!cts_findings_have(&c->now->findings, f) &&
            (preset || !cts_findings_have(&(CtsFindings){findings->items, c->n_findings}, f)))
            add_finding(c, f, preset);
    }
}

/* What stands and is told outlasts the process: pictures that were made stand even when the next ones never are. */
CtsStatus cts_child_picture_done(CtsBatchChild *c, const CtsBatchPicture *picture, const CtsReport *report,
                                 size_t first_finding, CtsError *err)
{
    const CtsBatchSettings *s = c->settings;
    const char *preset = s->lists->presets[picture->preset].name;
    tell_findings(c, &report->findings, first_finding, NULL);
    tell_findings(c, &report->findings, report->findings.n, preset);
    if (report->verified.pixels) {
        json_t *entry = json_pack("{s:s,s:s}", "preset", preset, "view", s->lists->views[picture->view].name);
        json_t *error = cts_error_json(report);
        json_object_update(entry, error);
        json_decref(error);
        if (!json_is_array(json_object_get(c->line, "errors")))
            json_object_set_new(c->line, "errors", json_array());
        json_array_append_new(json_object_get(c->line, "errors"), entry);
    }
    json_object_set_new(c->line, "unfinished", json_integer(--c->n_left));
    return c->n_left > 0 ? cts_child_send_line(c, CTS_CHILD_LINE, err) : CTS_OK;
}

static void tell_labels(CtsBatchChild *c, const CtsReport *report)
{
    json_t *labels = report->n_labels ? json_array() : NULL;
    for (size_t i = 0; i < report->n_labels; i++)
        json_array_append_new(labels, cts_label_json(&report->labels[i]));
    if (labels)
        json_object_set_new(c->line, "labels", labels);
}

static void tell_times(CtsBatchChild *c, const CtsReport *report)
{
    json_t *stages = json_object();
    for (int s = 0; s < CTS_N_STAGES; s++)
        if (report->stages[s].ran)
            json_object_set_new(stages, cts_stage_names[s],
                                json_pack("{s:f,s:f}", "wall_ms", round(report->stages[s].wall_ms * 1000) / 1000,
                                          "cpu_ms", round(report->stages[s].cpu_ms * 1000) / 1000));
    json_object_update_new(c->line,
                           json_pack("{s:o,s:f,s:f,s:f,s:I,s:i}", "stages", stages, "wall_ms",
                                     round(cts_wall_ms() - c->start_wall_ms - c->waited_ms), "waited_ms",
                                     round(c->waited_ms), "cpu_ms", round(cts_cpu_ms() - c->start_cpu_ms),
                                     "peak_rss_bytes", (json_int_t)cts_peak_rss_bytes(), "threads", c->n_threads));
}

/* What an earlier run found with presets that this one makes nothing with. */
static void keep_findings(CtsBatchChild *c)
{
    size_t i;
    json_t *entry;
    json_array_foreach(json_object_get(c->known, "findings"), i, entry)
    {
        const char *preset = json_string_value(json_object_get(entry, "preset"));
        bool kept = preset;
        for (int k = 0; k < c->n_pictures && kept; k++)
            kept = strcmp(c->settings->lists->presets[c->pictures[k].preset].name, preset);
        if (kept)
            json_array_append(json_object_get(c->line, "findings"), entry);
    }
}

/* Nothing had to be made: what the run told that made it stays. */
static void keep_times(CtsBatchChild *c)
{
    static const char *const kept[] = {"geometry",  "findings", "labels",         "stages", "wall_ms",
                                       "waited_ms", "cpu_ms",   "peak_rss_bytes", "threads"};
    json_t *geometry = json_incref(json_object_get(c->line, "geometry"));
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
        if (json_object_get(c->known, kept[i]))
            json_object_set(c->line, kept[i], json_object_get(c->known, kept[i]));
    json_object_update_missing(json_object_get(c->line, "geometry"), geometry);
    json_decref(geometry);
}

CtsStatus cts_child_end(CtsBatchChild *c, const CtsReport *report, CtsStatus status, const CtsError *why)
{
    CtsError err;
    CtsStatus st = CTS_OK;
    const bool stands = !status && c->known && c->n_pictures == 0;
    /* What is interrupted stays as it was told last. */
    if (status != CTS_ERR_INTERRUPTED) {
        tell_findings(c, &report->findings, report->findings.n, NULL);
        tell_labels(c, report);
        if (report->table.known)
            json_object_set_new(c->line, "table", cts_table_json(&report->table));
        tell_times(c, report);
        if (stands)
            keep_times(c);
        else
            keep_findings(c);
        cts_child_tell_status(c, status, status ? why->text : "");
        if (status && c->now && c->now->passed)
            json_object_set_new(c->line, "status", json_string("passed"));
        st = cts_child_send_line(c, stands ? CTS_CHILD_STANDS : CTS_CHILD_LAST, &err);
        c->told = true;
    }
    json_decref(c->line);
    json_decref(c->known);
    c->line = c->known = NULL;
    free_pictures(c);
    c->start_wall_ms = cts_wall_ms();
    c->start_cpu_ms = cts_cpu_ms();
    c->waited_ms = 0;
    c->n_findings = 0;
    return st;
}
