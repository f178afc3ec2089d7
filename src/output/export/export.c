#include "ctsplat/export.h"

#include "base/cpu.h"
#include "base/enum_table.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "base/stage_timer.h"
#include "output/export/format.h"
#include "output/image/samples.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const long long last_second = 253402300799; /* 9999-12-31 23:59:59: DICOM dates have four digits a year */

bool cts_date_now(struct tm *date)
{
    const char *text = getenv("SOURCE_DATE_EPOCH");
    if (text && *text >= '0' && *text <= '9') {
        char *end;
        errno = 0;
        const long long seconds = strtoll(text, &end, 10);
        if (!errno && !*end && seconds <= last_second && gmtime_r(&(time_t){(time_t)seconds}, date))
            return true;
    }
    const time_t now = time(NULL);
    localtime_r(&now, date);
    return false;
}

void cts_date_texts(char date[9], char time[7])
{
    struct tm now;
    cts_date_now(&now);
    strftime(date, 9, "%Y%m%d", &now);
    strftime(time, 7, "%H%M%S", &now);
}

CTS_ENUM_TABLE(
    char *const, cts_sc_compression_names,
    CTS_SC_N_COMPRESSIONS, [CTS_SC_NONE] = "none", [CTS_SC_RLE] = "rle", [CTS_SC_JPEG_LOSSLESS] = "jpeg-lossless");

enum { MAGIC_BYTES = 4, HEAD_BYTES = 132 };

static const CtsFormat *const formats[] = {&cts_format_png,  &cts_format_exr, &cts_format_dcm, &cts_format_jpg,
                                           &cts_format_webp, &cts_format_mp4, &cts_format_gif};
enum { N_FORMATS = sizeof formats / sizeof *formats };

static const CtsFormat *format_of_path(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    const char *ending = !dot ? "" : strcasecmp(dot, ".jpeg") ? dot + 1 : "jpg";
    for (int i = 0; i < N_FORMATS; i++)
        if (strcasecmp(ending, formats[i]->info.name) == 0)
            return formats[i];
    return NULL;
}

const CtsFormatInfo *cts_format(size_t index)
{
    return index < N_FORMATS ? &formats[index]->info : NULL;
}

const char *cts_format_endings(bool (*wanted)(const CtsFormatInfo *format), char text[CTS_ENDINGS_MAX])
{
    const char *names[N_FORMATS];
    int n = 0;
    for (int i = 0; i < N_FORMATS; i++)
        if (!wanted || wanted(&formats[i]->info))
            names[n++] = formats[i]->info.name;
    text[0] = 0;
    for (int i = 0; i < n; i++)
        snprintf(text + strlen(text), CTS_ENDINGS_MAX - strlen(text), "%s.%s",
                 i == 0       ? ""
                 : i == n - 1 ? " or "
                              : ", ",
                 names[i]);
    return text;
}

const CtsFormatInfo *cts_export_format(const char *path)
{
    const CtsFormat *format = format_of_path(path);
    return format ? &format->info : NULL;
}

static CtsStatus fail_unknown_format(const char *path, CtsError *err)
{
    char names[CTS_ENDINGS_MAX];
    return cts_fail(err, CTS_ERR_USAGE, "%s: its ending names no picture format (%s)", path,
                    cts_format_endings(NULL, names));
}

CtsStatus cts_export_check(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    const CtsFormat *format = format_of_path(path);
    if (!format)
        return fail_unknown_format(path, err);
    const CtsStatus st = cts_file_check_writable(path, settings->force, err);
    if (st || !format->check)
        return st;
    return format->check(path, settings, err);
}

CtsStatus cts_export_check_size(const char *path, int width, int height, int n_frames, bool grey,
                                const CtsExportSettings *settings, CtsError *err)
{
    const CtsFormat *format = format_of_path(path);
    if (!format)
        return fail_unknown_format(path, err);
    if (n_frames < 1 || (n_frames > 1 && !format->info.many_frames))
        return cts_fail(err, CTS_ERR_USAGE, "%s: a .%s file holds one picture, not %d", path, format->info.name,
                        n_frames);
    if (format->max_side && (width > format->max_side || height > format->max_side))
        return cts_fail(err, CTS_ERR_USAGE, "%s: a .%s has at most %d pixels a side, not %dx%d (take .png)", path,
                        format->info.name, format->max_side, width, height);
    return format->check_size ? format->check_size(path, width, height, n_frames, grey, settings, err) : CTS_OK;
}

struct CtsExport {
    const CtsFormat *format;
    CtsExportJob job;
    int frame, row; /* the next ones expected */
};

void cts_export_discard(CtsExport **output)
{
    CtsExport *e = *output;
    if (!e)
        return;
    if (e->job.state)
        e->format->close(&e->job);
    free(e->job.state);
    cts_temp_discard(&e->job.temp);
    free(e->job.path);
    free(e);
    *output = NULL;
}

CtsStatus cts_export_begin(CtsExport **output, const char *path, const CtsPicture *first, int n_frames,
                           const CtsExportSettings *settings, CtsReport *report, CtsError *err)
{
    const CtsStageTimer timer = cts_stage_timer_start(report);
    const bool grey = first->n_channels == 1 || first->info.grey;
    CtsStatus st;
    *output = NULL;
    if ((st = cts_export_check(path, settings, err)) ||
        (st = cts_export_check_size(path, first->width, first->whole_height, n_frames, grey, settings, err)))
        return st;
    CtsExport *e = *output = calloc(1, sizeof *e);
    if (!e)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    e->format = format_of_path(path);
    e->job = (CtsExportJob){.path = strdup(path), .settings = *settings, .report = report, .rmse = -1};
    e->job.head = (CtsExportHead){
        .width = first->width,
        .height = first->whole_height,
        .n_frames = n_frames,
        .grey = grey,
        .has_alpha = first->n_channels == 4 && first->has_alpha,
        .has_depth = first->depth_mm,
        .info = first->info,
    };
    e->job.state = calloc(1, e->format->state_bytes);
    if (!e->job.path || !e->job.state)
        st = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    else if (!(st = cts_temp_open(&e->job.temp, path, err)))
        st = e->format->begin(&e->job, err);
    if (!st && settings->scratch)
        cts_temp_do_not_sync(e->job.temp);
    cts_stage_timer_stop(timer, report, CTS_STAGE_EXPORT);
    if (st)
        cts_export_discard(output);
    return st;
}

CtsStatus cts_export_rows(CtsExport *e, const CtsPicture *band, CtsError *err)
{
    const CtsStageTimer timer = cts_stage_timer_start(e->job.report);
    const CtsExportHead *head = &e->job.head;
    const bool last = band->first_row + band->height == head->height;
    if (band->width != head->width || band->whole_height != head->height)
        return cts_fail(err, CTS_ERR_USAGE, "%s: picture %d is %dx%d, the first one %dx%d", e->job.path, e->frame + 1,
                        band->width, band->whole_height, head->width, head->height);
    if (e->frame >= head->n_frames || band->first_row != e->row || (!last && band->height % CTS_BAND_ROWS) ||
        !band->depth_mm != !head->has_depth)
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: a band that does not follow the one before", e->job.path);
    e->row = last ? 0 : band->first_row + band->height;
    e->frame += last;
    const CtsStatus st = e->format->rows(&e->job, band, err);
    cts_stage_timer_stop(timer, e->job.report, CTS_STAGE_EXPORT);
    return st;
}

typedef struct BandPacking {
    CtsExportJob *job;
    const CtsPicture *band;
    const CtsRowPacking *packing;
    CtsPackedRows *parts;
} BandPacking;

static void pack_parts(void *context, int worker, size_t first, size_t end)
{
    const BandPacking *const b = context;
    (void)worker;
    for (size_t i = first; i < end; i++) {
        CtsPackedRows *const rows = &b->parts[i];
        const int y = (int)i * b->packing->n_rows, left = b->band->height - y;
        rows->y = y;
        rows->n_rows = left < b->packing->n_rows ? left : b->packing->n_rows;
        rows->status = b->packing->pack(b->job, b->band, rows);
    }
}

CtsStatus cts_export_packed(CtsExportJob *job, const CtsPicture *band, const CtsRowPacking *packing, CtsError *err)
{
    const size_t n = (size_t)((band->height + packing->n_rows - 1) / packing->n_rows);
    BandPacking b = {job, band, packing, NULL};
    CtsStatus st = cts_alloc_zeroed(&b.parts, n, err);
    if (st)
        return st;
    cts_parallel(cts_threads(job->settings.n_threads), n, 1, pack_parts, &b);
    for (size_t i = 0; i < n; i++) {
        if (!st && (st = b.parts[i].status))
            cts_fail(err, st, "%s: the picture's rows could not be packed", job->path);
        if (!st)
            st = packing->write(job, band, &b.parts[i], err);
        cts_free(&b.parts[i].bytes);
    }
    cts_free(&b.parts);
    return st;
}

void cts_export_error(CtsExport *e, const CtsErrorBound *bound)
{
    if (bound->known && bound->rmse > e->job.rmse)
        e->job.rmse = bound->rmse;
}

CtsStatus cts_export_end(CtsExport **output, uint64_t *bytes, CtsError *err)
{
    CtsExport *e = *output;
    const CtsStageTimer timer = cts_stage_timer_start(e->job.report);
    const CtsExportHead *head = &e->job.head;
    uint64_t size = 0;
    CtsStatus st;
    if (e->format->info.is_object && !e->job.settings.deidentify)
        cts_temp_keep_private(e->job.temp);
    if (e->frame < head->n_frames)
        st = cts_fail(err, CTS_ERR_INTERNAL, "%s: rows are missing", e->job.path);
    else if (!(st = e->format->finish(&e->job, err)))
        st = cts_temp_commit(&e->job.temp, e->job.settings.force, &size, err);
    cts_stage_timer_stop(timer, e->job.report, CTS_STAGE_EXPORT);
    if (!st)
        cts_report_stage(e->job.report, CTS_STAGE_EXPORT, 0, 0,
                         (uint64_t)head->width * (uint64_t)head->height * (uint64_t)head->n_frames, size);
    if (bytes && !st)
        *bytes = size;
    cts_export_discard(output);
    return st;
}

CtsStatus cts_export(const CtsPicture *const *frames, int n_frames, const char *path, const CtsExportSettings *settings,
                     uint64_t *bytes, CtsReport *report, CtsError *err)
{
    CtsExport *output = NULL;
    if (n_frames < 1)
        return cts_fail(err, CTS_ERR_USAGE, "%s: no picture to write", path);
    CtsPicture first = *frames[0];
    first.info.grey = true;
    for (int k = 0; k < n_frames; k++)
        first.info.grey = first.info.grey && cts_picture_is_grey(frames[k]);
    CtsStatus st = cts_export_begin(&output, path, &first, n_frames, settings, report, err);
    for (int k = 0; k < n_frames && !st; k++)
        st = cts_export_rows(output, frames[k], err);
    if (!st)
        st = cts_export_end(&output, bytes, err);
    cts_export_discard(&output);
    return st;
}

static bool is_read_back(const CtsFormatInfo *format)
{
    return format->read_back;
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
        if (formats[i]->info.read_back && n >= formats[i]->magic_offset + MAGIC_BYTES &&
            memcmp(head + formats[i]->magic_offset, formats[i]->magic, MAGIC_BYTES) == 0)
            return formats[i]->read(path, picture, err);
    char names[CTS_ENDINGS_MAX];
    return cts_fail(err, CTS_ERR_READ, "%s: is no picture of a format that is read (%s)", path,
                    cts_format_endings(is_read_back, names));
}
