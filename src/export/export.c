#include "ctsplat/export.h"

#include "base/clock.h"
#include "export/format.h"
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { MAGIC_BYTES = 4, HEAD_BYTES = 132 };

static const CtsFormat formats[] = {
    {"png", false, 0, "\x89PNG", NULL, cts_png_write, cts_png_read},
    {"exr", false, 0, "\x76\x2f\x31\x01", NULL, cts_exr_write, cts_exr_read},
    {"dcm", true, 128, "DICM", cts_sc_check, cts_sc_write, cts_sc_read},
};
enum { N_FORMATS = sizeof formats / sizeof *formats };

static const CtsFormat *format_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    for (int i = 0; dot && i < N_FORMATS; i++)
        if (strcasecmp(dot + 1, formats[i].name) == 0)
            return &formats[i];
    return NULL;
}

const char *cts_export_format(const char *path)
{
    const CtsFormat *format = format_of(path);
    return format ? format->name : NULL;
}

static CtsStatus fail_unknown(const char *path, CtsStatus status, const char *what, CtsError *err)
{
    char names[64] = "";
    for (int i = 0; i < N_FORMATS; i++)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s.%s", i ? " " : "", formats[i].name);
    return cts_fail(err, status, "%s: %s (one of: %s)", path, what, names);
}

CtsStatus cts_export_check(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    const CtsFormat *format = format_of(path);
    if (!format)
        return fail_unknown(path, CTS_ERR_USAGE, "its ending names no picture format", err);
    const CtsStatus st = cts_file_check_writable(path, settings->force, err);
    if (st || !format->check)
        return st;
    return format->check(path, settings, err);
}

static CtsStatus check_frames(const CtsFormat *format, const CtsPicture *const *frames, int n_frames, const char *path,
                              CtsError *err)
{
    if (n_frames < 1 || (n_frames > 1 && !format->many_frames))
        return cts_fail(err, CTS_ERR_USAGE, "%s: a .%s file holds one picture, not %d", path, format->name, n_frames);
    for (int i = 1; i < n_frames; i++)
        if (frames[i]->width != frames[0]->width || frames[i]->height != frames[0]->height)
            return cts_fail(err, CTS_ERR_USAGE, "%s: picture %d is %dx%d, the first one %dx%d", path, i + 1,
                            frames[i]->width, frames[i]->height, frames[0]->width, frames[0]->height);
    return CTS_OK;
}

CtsStatus cts_export(const CtsPicture *const *frames, int n_frames, const char *path, const CtsExportSettings *settings,
                     uint64_t *bytes, CtsReport *report, CtsError *err)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    const CtsFormat *format = format_of(path);
    CtsExportJob job = {.frames = frames, .n_frames = n_frames, .path = path, .settings = settings, .report = report};
    uint64_t size = 0;
    CtsStatus st = cts_export_check(path, settings, err);
    if (st || (st = check_frames(format, frames, n_frames, path, err)) || (st = cts_temp_open(&job.temp, path, err)) ||
        (st = format->write(&job, err)) || (st = cts_temp_commit(&job.temp, settings->force, &size, err)))
        goto end;
    if (bytes)
        *bytes = size;
    cts_report_stage(report, CTS_STAGE_EXPORT, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms,
                     (uint64_t)frames[0]->width * (uint64_t)frames[0]->height * (uint64_t)n_frames, size);
end:
    cts_temp_discard(&job.temp);
    return st;
}

CtsStatus cts_picture_read(const char *path, CtsPicture **picture, CtsError *err)
{
    char head[HEAD_BYTES];
    *picture = NULL;
    FILE *file = fopen(path, "rbe");
    if (!file)
        return cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
    const size_t n = fread(head, 1, sizeof head, file);
    const int failed = ferror(file) ? errno : 0;
    fclose(file);
    if (failed)
        return cts_fail(err, CTS_ERR_READ, "%s: cannot be read: %s", path, strerror(failed));
    for (int i = 0; i < N_FORMATS; i++)
        if (n >= formats[i].magic_offset + MAGIC_BYTES &&
            memcmp(head + formats[i].magic_offset, formats[i].magic, MAGIC_BYTES) == 0)
            return formats[i].read(path, picture, err);
    return fail_unknown(path, CTS_ERR_READ, "is no picture that can be read", err);
}
