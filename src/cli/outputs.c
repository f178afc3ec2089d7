#include "cli/outputs.h"

#include "cli/message.h"
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

char *cli_output_name(const char *path, int frame, int n_frames)
{
    if (!n_frames)
        return strdup(path);
    int n_digits = 3;
    for (int n = n_frames - 1; n > 999; n /= 10)
        n_digits++;
    const char *dot = strrchr(path, '.');
    char *name;
    return asprintf(&name, "%.*s-%0*d%s", (int)(dot - path), path, n_digits, frame, dot) < 0 ? NULL : name;
}

bool cli_output_is_multi_frame(const char *path)
{
    const char *format = cts_export_format(path);
    return format && !strcmp(format, "dcm");
}

bool cli_outputs_hold_depth(const CliOptions *options)
{
    for (int i = 0; i < options->n_outputs; i++) {
        const char *format = cts_export_format(options->outputs[i]);
        if (format && !strcmp(format, "exr"))
            return true;
    }
    return false;
}

/* With --force a slice of the series itself could be overwritten: a picture is worth less. */
static CtsStatus refuse_ct_slice(const char *path, CtsError *err)
{
    CtsSeriesList *list = NULL;
    CtsError why;
    if (access(path, F_OK) || cts_series_find(&path, 1, 1, &list, NULL, &why))
        return CTS_OK;
    cts_series_list_free(&list);
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: is a CT slice, which --force does not overwrite (choose another name)",
                    path);
}

static CtsStatus check_one(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    const CtsStatus st = cts_export_check(path, settings, err);
    return st || !settings->force ? st : refuse_ct_slice(path, err);
}

/* Two names of one file: the same name in the same folder, however that is written. */
static bool same_file(const char *a, const char *b)
{
    char folder_a[PATH_MAX], folder_b[PATH_MAX];
    char *copy_a = strdup(a), *copy_b = strdup(b), *copy_c = strdup(a), *copy_d = strdup(b);
    const bool same = copy_a && copy_b && copy_c && copy_d && !strcmp(basename(copy_a), basename(copy_b)) &&
                      realpath(dirname(copy_c), folder_a) && realpath(dirname(copy_d), folder_b) &&
                      !strcmp(folder_a, folder_b);
    free(copy_a);
    free(copy_b);
    free(copy_c);
    free(copy_d);
    return same;
}

CtsStatus cli_outputs_check(const CliOptions *options, const CtsExportSettings *settings, CtsError *err)
{
    CtsStatus st = CTS_OK;
    bool any_dcm = false;
    for (int i = 0; i < options->n_outputs; i++) {
        const char *path = options->outputs[i];
        if (!cts_export_format(path))
            return cts_fail(err, CTS_ERR_USAGE, "%s: the ending names no format (.png, .exr or .dcm)", path);
        any_dcm |= cli_output_is_multi_frame(path);
        for (int before = 0; before < i; before++)
            if (same_file(options->outputs[before], path))
                return cts_fail(err, CTS_ERR_USAGE, "%s: given twice with -o", path);
        const int n_frames = cli_output_is_multi_frame(path) ? 0 : options->rotation;
        for (int frame = 0; frame < n_frames || frame == 0; frame++) {
            char *name = cli_output_name(path, frame, n_frames);
            st = name ? check_one(name, settings, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
            free(name);
            if (st)
                return st;
        }
    }
    if (!any_dcm && (options->compression != CTS_SC_NONE || options->new_uids || options->deidentify))
        cli_warning("--compress, --new-uids and --deidentify act on .dcm outputs, and there is none");
    return CTS_OK;
}
