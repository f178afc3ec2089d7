#include "app/job/outputs.h"

#include "base/did_you_mean.h"
#include "base/file.h"
#include "base/file_bytes.h"
#include "base/mem.h"
#include "base/stage_timer.h"
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool holds_frames(const char *path)
{
    const CtsFormatInfo *format = cts_export_format(path);
    return format && format->many_frames;
}

bool cts_output_is_dicom(const CtsOutputs *outputs, int output)
{
    const CtsFormatInfo *format = cts_export_format(outputs->paths[output]);
    return format && format->is_object;
}

int cts_output_n_frames(const CtsOutputs *outputs, int output)
{
    return outputs->rotation > 0 && holds_frames(outputs->paths[output]) ? outputs->rotation : 1;
}

typedef struct OutputName {
    char text[PATH_MAX + 16];
} OutputName;

/* Frame 7 of 36 of "a/head.png" is "a/head-007.png"; a file that holds all frames has its path as it is. */
static OutputName name_of_frame(const CtsOutputs *outputs, int output, int frame)
{
    const char *const path = outputs->paths[output], *const dot = strrchr(path, '.');
    OutputName name;
    int n_digits = 3;
    for (int n = outputs->rotation - 1; n > 999; n /= 10)
        n_digits++;
    if (!outputs->rotation || holds_frames(path))
        snprintf(name.text, sizeof name.text, "%s", path);
    else
        snprintf(name.text, sizeof name.text, "%.*s-%0*d%s", (int)(dot - path), path, n_digits, frame, dot);
    return name;
}

bool cts_outputs_hold_frames(const CtsOutputs *outputs)
{
    bool any = false;
    for (int i = 0; i < outputs->n; i++)
        any |= holds_frames(outputs->paths[i]);
    return any;
}

bool cts_outputs_hold_depth(const CtsOutputs *outputs)
{
    bool any = false;
    for (int i = 0; i < outputs->n; i++) {
        const CtsFormatInfo *const format = cts_export_format(outputs->paths[i]);
        any |= format && format->has_depth;
    }
    return any;
}

/* With --force a slice of the series itself could be overwritten: a picture is worth less. */
static CtsStatus refuse_ct_slice(const char *path, CtsError *err)
{
    CtsSeriesList *list = NULL;
    CtsError why;
    if (access(path, F_OK) || cts_series_find(&path, 1, 1, &list, NULL, &why))
        return CTS_OK;
    cts_series_list_free(&list);
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: is a CT slice, which `force` does not overwrite (choose another name)",
                    path);
}

/* Two names of one file: the same name in the same folder, however that is written. */
static bool same_file(const char *a, const char *b)
{
    const char *const slash_a = strrchr(a, '/'), *const slash_b = strrchr(b, '/');
    const char *const name_a = slash_a ? slash_a + 1 : a, *const name_b = slash_b ? slash_b + 1 : b;
    char folder_a[PATH_MAX], folder_b[PATH_MAX];
    struct stat x, y;
    snprintf(folder_a, sizeof folder_a, "%.*s.", (int)(name_a - a), a);
    snprintf(folder_b, sizeof folder_b, "%.*s.", (int)(name_b - b), b);
    return !strcmp(name_a, name_b) && !stat(folder_a, &x) && !stat(folder_b, &y) && x.st_dev == y.st_dev &&
           x.st_ino == y.st_ino;
}

static CtsHint near_ending(const char *path)
{
    const char *const dot = strrchr(path, '.');
    CtsDidYouMean nearest_word = {.written = dot ? dot + 1 : "", .length = dot ? strlen(dot + 1) : 0};
    for (size_t i = 0; cts_format(i); i++)
        cts_did_you_mean_try(&nearest_word, cts_format(i)->name);
    return cts_did_you_mean_hint(&nearest_word);
}

CtsStatus cts_outputs_check(const CtsOutputs *outputs, const CtsExportSettings *settings, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char endings[CTS_ENDINGS_MAX];
    for (int i = 0; i < outputs->n; i++) {
        const char *path = outputs->paths[i];
        const CtsFormatInfo *format = cts_export_format(path);
        if (!format)
            return cts_fail(err, CTS_ERR_USAGE, "%s: the ending names no format (%s)%s", path,
                            cts_format_endings(NULL, endings), near_ending(path).text);
        for (int before = 0; before < i; before++)
            if (same_file(outputs->paths[before], path))
                return cts_fail(err, CTS_ERR_USAGE, "%s: given twice with -o", path);
        if (strlen(path) >= PATH_MAX)
            return cts_fail(err, CTS_ERR_OUTPUT, "%s: the path is too long", path);
        const int n_files = outputs->rotation && !holds_frames(path) ? outputs->rotation : 1;
        for (int frame = 0; frame < n_files; frame++) {
            const OutputName name = name_of_frame(outputs, i, frame);
            if ((st = cts_export_check(name.text, settings, err)) ||
                (settings->force && (st = refuse_ct_slice(name.text, err))))
                return st;
        }
    }
    if (outputs->state) {
        if (settings->deidentify)
            return cts_fail(
                err, CTS_ERR_USAGE,
                "`write-state`: a presentation state names the slices it is of, which `deidentify` forbids");
        for (int i = 0; i < outputs->n; i++)
            if (same_file(outputs->paths[i], outputs->state))
                return cts_fail(err, CTS_ERR_USAGE, "%s: given for -o and `write-state`", outputs->state);
        if ((st = cts_file_check_writable(outputs->state, settings->force, err)) ||
            (settings->force && (st = refuse_ct_slice(outputs->state, err))))
            return st;
    }
    return CTS_OK;
}

CtsStatus cts_files_begin(CtsFiles *files, CtsError *err)
{
    files->exports = calloc((size_t)files->outputs->n + 1, sizeof *files->exports);
    return files->exports ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

static CtsStatus write_rows(CtsFiles *files, int output, int frame, const CtsPicture *band, CtsReport *report,
                            CtsError *err)
{
    CtsExport **export = &files->exports[output];
    CtsStatus st = CTS_OK;
    if (!*export)
        st = cts_export_begin(export, name_of_frame(files->outputs, output, frame).text, band,
                              cts_output_n_frames(files->outputs, output), files->settings, report, err);
    return st ? st : cts_export_rows(*export, band, err);
}

CtsStatus cts_files_rows(CtsFiles *files, int frame, const CtsPicture *band, bool captioned, CtsReport *report,
                         CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (frame == 0 && band->first_row == 0)
        files->first = band->info;
    for (int i = 0; i < files->outputs->n && !st; i++)
        if (cts_export_format(files->outputs->paths[i])->has_depth != captioned &&
            !(files->same && !holds_frames(files->outputs->paths[i])))
            st = write_rows(files, i, frame, band, report, err);
    return st;
}

static CtsStatus tell_watch(const CtsFiles *files, const OutputName *name, int frame, uint64_t bytes, CtsError *err)
{
    if (!files->watch->output)
        return CTS_OK;
    return files->watch->output(files->watch->context,
                                files->outputs->rotation && !holds_frames(name->text) ? frame : -1, name->text,
                                cts_export_format(name->text)->name, bytes, err);
}

static CtsStatus end_output(CtsFiles *files, int output, int frame, CtsError *err)
{
    uint64_t bytes;
    const OutputName name = name_of_frame(files->outputs, output, frame);
    const CtsStatus st = cts_export_end(&files->exports[output], &bytes, err);
    return st ? st : tell_watch(files, &name, frame, bytes, err);
}

/* The file of the frame with the same view, under this frame's name. */
static CtsStatus copy_output(CtsFiles *files, int output, int frame, CtsReport *report, CtsError *err)
{
    const OutputName name = name_of_frame(files->outputs, output, frame),
                     earlier = name_of_frame(files->outputs, output, files->same - 1);
    CtsFileBytes from;
    CtsTempFile *to = NULL;
    uint8_t *bytes = NULL;
    CtsStatus st = cts_file_bytes_open(&from, &(CtsFile){.path = earlier.text, .named = true}, err);
    if (!st && !(st = cts_alloc_array(&bytes, from.n_bytes, err)) &&
        !(st = cts_file_bytes_read(&from, bytes, from.n_bytes, 0, err)) && !(st = cts_temp_open(&to, name.text, err)))
        st = cts_temp_write(to, bytes, from.n_bytes, err);
    if (!st && files->settings->scratch)
        cts_temp_do_not_sync(to);
    if (!st && !(st = cts_temp_commit(&to, files->settings->force, NULL, err)))
        cts_report_stage(report, CTS_STAGE_EXPORT, 0, 0, 0, from.n_bytes);
    cts_temp_discard(&to);
    cts_free(&bytes);
    cts_file_bytes_close(&from);
    return st ? st : tell_watch(files, &name, frame, from.n_bytes, err);
}

CtsStatus cts_files_frame_done(CtsFiles *files, int frame, CtsReport *report, CtsError *err)
{
    const CtsStageTimer meter = cts_stage_timer_start(report);
    CtsStatus st = CTS_OK;
    for (int i = 0; i < files->outputs->n && !st; i++) {
        if (files->same && !holds_frames(files->outputs->paths[i]))
            st = copy_output(files, i, frame, report, err);
        if (files->exports[i])
            cts_export_error(files->exports[i], &report->bound);
        if (!st && files->exports[i] &&
            (cts_output_n_frames(files->outputs, i) == 1 || frame == files->outputs->rotation - 1))
            st = end_output(files, i, frame, err);
    }
    cts_stage_timer_stop(meter, report, CTS_STAGE_EXPORT);
    return st;
}

void cts_files_end(CtsFiles *files)
{
    for (int i = 0; files->exports && i < files->outputs->n; i++)
        cts_export_discard(&files->exports[i]);
    free(files->exports);
    files->exports = NULL;
}
