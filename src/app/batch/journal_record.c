#include "app/batch/journal.h"

#include "app/contact/journal_lines.h"
#include "base/hash.h"
#include "base/json.h"
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

CtsStatus cts_journal_record_hash(const CtsBatchSettings *s, const CtsBatchPicture *picture, bool is_dcm, char hex[65],
                                  CtsError *err)
{
    CtsHash *hash = cts_hash_start(NULL);
    CtsStatus st = CTS_OK;
    cts_hash_text(hash, CTS_VERSION);
    cts_hash_text(hash, s->lists->options);
    for (int i = 0; i < s->lists->n_presets && !st; i++) {
        if (picture && picture->preset != i)
            continue;
        char *text = cts_preset_to_json(&s->lists->presets[i]);
        if (text)
            cts_hash_text(hash, text);
        else
            st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        free(text);
    }
    for (int i = 0; i < s->lists->n_views; i++)
        if (!picture || picture->view == i) {
            cts_hash_text(hash, s->lists->views[i].name);
            cts_hash_text(hash, s->lists->views[i].is_montage ? s->lists->montage_options : "");
        }
    for (int i = 0; i < s->lists->n_formats && !picture; i++)
        cts_hash_text(hash, s->lists->formats[i]);
    cts_hash_text(hash, is_dcm ? s->lists->dcm_options : "");
    const CtsStatus finished = cts_hash_hex(&hash, hex, st ? NULL : err);
    return st ? st : finished;
}

void cts_journal_record_stem(const CtsBatchSettings *s, const CtsBatchPicture *picture, char stem[CTS_RECORD_STEM])
{
    const CtsBatchView *const view = &s->lists->views[picture->view];
    snprintf(stem, CTS_RECORD_STEM, "%s%s%s", view->is_montage ? "" : s->lists->presets[picture->preset].name,
             view->is_montage ? "" : "-", view->name);
    if (stem[0] == '.' || stem[0] == '-')
        stem[0] = '_';
    for (char *c = stem; *c; c++)
        if (!isascii((unsigned char)*c) || (!isalnum((unsigned char)*c) && !strchr("._-,", *c)))
            *c = '_';
}

bool cts_journal_record_path(const CtsBatchSettings *s, const json_t *entry, char *path, size_t size)
{
    const char *name = cts_json_text_of(entry, "path");
    const int n = cts_journal_path_is_safe(name) ? snprintf(path, size, "%s/%s", s->options->output_dir, name) : -1;
    return n > 0 && (size_t)n < size;
}

static CtsStatus hash_file(const char *path, char hex[65], CtsError *err)
{
    enum { AT_ONCE = 1 << 18 };
    char *const bytes = malloc(AT_ONCE);
    CtsHash *hash = cts_hash_start(NULL);
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    ssize_t n = -1;
    while (bytes && fd >= 0 && (n = TEMP_FAILURE_RETRY(read(fd, bytes, AT_ONCE))) > 0)
        cts_hash_bytes(hash, bytes, (size_t)n);
    if (n)
        cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be read back: %s", path, strerror(errno));
    const CtsStatus st = cts_hash_hex(&hash, hex, n ? NULL : err);
    if (fd >= 0)
        close(fd);
    free(bytes);
    return n ? CTS_ERR_OUTPUT : st;
}

static json_int_t mtime_of(const struct stat *info)
{
    return (json_int_t)info->st_mtim.tv_sec * 1000000000 + info->st_mtim.tv_nsec;
}

CtsStatus cts_journal_record_file_facts(const CtsBatchSettings *s, json_t *entry, CtsError *err)
{
    char full[PATH_MAX], hex[65];
    struct stat info;
    CtsStatus st;
    if (!cts_journal_record_path(s, entry, full, sizeof full) || stat(full, &info))
        return cts_fail(err, CTS_ERR_OUTPUT, "%s: has disappeared", cts_json_text_of(entry, "path"));
    if ((st = hash_file(full, hex, err)))
        return st;
    json_object_set_new(entry, "bytes", json_integer((json_int_t)info.st_size));
    json_object_set_new(entry, "sha256", json_string(hex));
    json_object_set_new(entry, "mtime_ns", json_integer(mtime_of(&info)));
    return CTS_OK;
}

/* A file of the same size and time is the same; one of another time may have been copied. */
static bool file_is_up_to_date(const CtsBatchSettings *s, const json_t *entry, bool by_hash)
{
    char full[PATH_MAX], hex[65];
    struct stat info;
    if (!cts_journal_record_path(s, entry, full, sizeof full) || lstat(full, &info) || !S_ISREG(info.st_mode) ||
        info.st_size != json_integer_value(json_object_get(entry, "bytes")))
        return false;
    if (!by_hash || mtime_of(&info) == json_integer_value(json_object_get(entry, "mtime_ns")))
        return true;
    return !hash_file(full, hex, NULL) && !strcmp(hex, cts_json_text_of(entry, "sha256"));
}

static bool is_of(const json_t *entry, const CtsBatchSettings *s, const CtsBatchPicture *picture, const char *format)
{
    return !strcmp(cts_json_text_of(entry, "preset"), s->lists->presets[picture->preset].name) &&
           !strcmp(cts_json_text_of(entry, "view"), s->lists->views[picture->view].name) &&
           (!format || !strcmp(cts_json_text_of(entry, "format"), format));
}

bool cts_journal_record_is_up_to_date(const CtsBatchSettings *s, const json_t *record, const CtsBatchPicture *picture,
                                      const char *format)
{
    const json_t *list = json_object_get(record, format ? "outputs" : "thumbnails");
    const CtsFormatInfo *info = NULL;
    char hex[65];
    int n_found = 0;
    size_t i;
    json_t *entry;
    if ((format && cts_format_of(format, &info, NULL)) ||
        cts_journal_record_hash(s, picture, info && info->is_object, hex, NULL))
        return false;
    json_array_foreach(list, i, entry)
    {
        if (!is_of(entry, s, picture, format))
            continue;
        if (strcmp(cts_json_text_of(entry, "settings_sha256"), hex) || !file_is_up_to_date(s, entry, format))
            return false;
        n_found++;
    }
    if (!format)
        return n_found == (s->options->rotation > 1 ? 2 : 1);
    return n_found == (s->options->rotation && !info->many_frames ? s->options->rotation : 1);
}

void cts_journal_record_redact(const void *settings, json_t *record)
{
    const CtsBatchSettings *const s = settings;
    static const char *const patient[] = {"study_date", "series_number", "description"};
    size_t i;
    json_t *diagnostic;
    for (i = 0; i < sizeof patient / sizeof *patient && !s->options->show_patient; i++)
        json_object_del(json_object_get(record, "geometry"), patient[i]);
    if (s->options->show_paths)
        return;
    json_object_del(record, "sources");
    json_object_del(record, "reason_file");
    json_array_foreach(json_object_get(record, "findings"), i, diagnostic) json_object_del(diagnostic, "files");
}

/* True if the record has all details that the settings request. */
static bool has_requested_details(const json_t *record, const CtsBatchSettings *s)
{
    const json_t *geometry = json_object_get(record, "geometry");
    return (!s->options->show_paths || json_object_get(record, "sources")) &&
           (!s->options->show_patient || !geometry || json_object_get(geometry, "study_date"));
}

static int place_among(const char *name, const char *const *names, int n, int fallback)
{
    for (int i = 0; i < n; i++)
        if (!strcmp(name, names[i]))
            return i;
    return fallback;
}

bool cts_journal_record_takes(const CtsBatchSettings *s, const json_t *record, int preset, int view)
{
    const json_t *const about = json_object_get(record, "geometry");
    const int modality =
        place_among(cts_json_text_of(about, "modality"), cts_modality_names, CTS_N_MODALITIES, CTS_MODALITY_CT);
    const int quantity =
        place_among(cts_json_text_of(about, "quantity"), cts_quantity_names, CTS_N_QUANTITIES, CTS_QUANTITY_HU);
    return cts_batch_takes(s->lists, preset, view, (CtsModality)modality, (CtsQuantity)quantity);
}

bool cts_journal_record_is_unsent(const CtsBatchSettings *s, const json_t *record, const json_t *entry)
{
    const json_t *sent_to = json_object_get(entry, "sent_to");
    bool asked_for = false;
    for (int p = 0; s->lists->send_to[0] && p < s->lists->n_presets; p++)
        for (int v = 0; v < s->lists->n_views; v++) {
            const CtsBatchPicture picture = {.preset = p, .view = v};
            asked_for |= is_of(entry, s, &picture, "dcm") && cts_journal_record_takes(s, record, p, v);
        }
    for (size_t i = 0; i < json_array_size(sent_to) && asked_for; i++) {
        const char *peer = json_string_value(json_array_get(sent_to, i));
        asked_for = !peer || strcmp(peer, s->lists->send_to);
    }
    return asked_for;
}

int cts_journal_record_n_unsent(const CtsBatchSettings *s, const json_t *record)
{
    int n = 0;
    size_t i;
    json_t *entry;
    json_array_foreach(json_object_get(record, "outputs"), i, entry) n +=
        cts_journal_record_is_unsent(s, record, entry);
    return n;
}

/* True if the image of a series that is no volume is there, and one that may name the patient is shown as asked. */
static bool image_is_up_to_date(const CtsBatchSettings *s, const json_t *record)
{
    const json_t *const image = json_array_get(json_object_get(record, "thumbnails"), 0);
    return (!image || file_is_up_to_date(s, image, false)) &&
           (!json_is_true(json_object_get(record, "may_name")) || !image == !s->options->show_patient);
}

bool cts_journal_record_is_settled(const CtsBatchSettings *s, const json_t *record, const char *input_sha256)
{
    const char *status = cts_json_text_of(record, "status");
    char hex[65];
    if (strcmp(cts_json_text_of(record, "input_sha256"), input_sha256) || !has_requested_details(record, s))
        return false;
    /* Before version 0.5.0 series without a volume were skipped. Those of a modality left out (exit code 3) may be
     * wanted now. */
    if (!strcmp(status, "skipped"))
        return json_integer_value(json_object_get(record, "exit_code")) != 3 &&
               !json_is_true(json_object_get(json_object_get(record, "geometry"), "passed"));
    if (!strcmp(status, "thumbnail"))
        return image_is_up_to_date(s, record);
    /* Unreadable files may be readable now; geometry and pixels do not change. */
    if (!strcmp(status, "refused"))
        return json_integer_value(json_object_get(record, "exit_code")) == 4 &&
               !cts_journal_record_hash(s, NULL, true, hex, NULL) &&
               !strcmp(hex, cts_json_text_of(record, "options_sha256"));
    /* All but sending it went well. */
    if (strcmp(status, "done") && !json_object_get(record, "unsent"))
        return false;
    for (int p = 0; p < s->lists->n_presets; p++)
        for (int v = 0; v < s->lists->n_views; v++) {
            const CtsBatchPicture picture = {.preset = p, .view = v};
            if (!cts_journal_record_takes(s, record, p, v))
                continue;
            for (int f = 0; f < s->lists->n_formats; f++)
                if (!cts_journal_record_is_up_to_date(s, record, &picture, s->lists->formats[f]))
                    return false;
            if (!cts_journal_record_is_up_to_date(s, record, &picture, NULL))
                return false;
        }
    return true;
}

void cts_journal_record_drop(json_t *record, const char *list, const CtsBatchSettings *s,
                             const CtsBatchPicture *picture, const char *format)
{
    json_t *entries = json_object_get(record, list);
    for (size_t i = json_array_size(entries); i-- > 0;) {
        const json_t *entry = json_array_get(entries, i);
        char full[PATH_MAX];
        if (picture && !is_of(entry, s, picture, format))
            continue;
        if (cts_journal_record_path(s, entry, full, sizeof full))
            unlink(full);
        json_array_remove(entries, i);
    }
}
