#include "app/job/files.h"

#include "base/meter.h"
#include <stdlib.h>

CtsStatus cts_files_begin(CtsFiles *files, CtsError *err)
{
    files->exports = calloc((size_t)files->outputs->n + 1, sizeof *files->exports);
    files->ended = calloc((size_t)files->outputs->n + 1, sizeof *files->ended);
    return files->exports && files->ended ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

static CtsStatus write_rows(CtsFiles *files, int output, int frame, const CtsPicture *band, CtsReport *report,
                            CtsError *err)
{
    CtsExport **export = &files->exports[output];
    CtsStatus st = CTS_OK;
    char *name = cts_output_name(files->outputs, output, frame);
    if (!name)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!*export)
        st = cts_export_begin(export, name, band, cts_output_n_frames(files->outputs, output), files->settings, report,
                              err);
    if (!st)
        st = cts_export_rows(*export, band, err);
    free(name);
    return st;
}

CtsStatus cts_files_rows(CtsFiles *files, int frame, const CtsPicture *band, CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (frame == 0 && band->first_row == 0)
        files->first = band->info;
    for (int i = 0; i < files->outputs->n && !st; i++)
        st = write_rows(files, i, frame, band, report, err);
    return st;
}

CtsStatus cts_files_frame_done(CtsFiles *files, int frame, CtsReport *report, CtsError *err)
{
    const CtsMeter meter = cts_meter_start(report);
    CtsStatus st = CTS_OK;
    for (int i = 0; i < files->outputs->n && !st; i++) {
        const int n_frames = cts_output_n_frames(files->outputs, i);
        CtsFileEnded *const ended = &files->ended[i];
        if (!files->exports[i] || (n_frames > 1 && frame < n_frames - 1))
            continue;
        char *name = cts_output_name(files->outputs, i, frame);
        st = name ? cts_export_end(&files->exports[i], &ended->bytes, err)
                  : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        if (st)
            free(name);
        else
            ended->name = name;
    }
    cts_meter_stop(meter, report, CTS_STAGE_EXPORT);
    return st;
}

void cts_files_tell(CtsFiles *files)
{
    for (int i = 0; files->ended && i < files->outputs->n; i++) {
        CtsFileEnded *const ended = &files->ended[i];
        if (ended->name && files->watch->output)
            files->watch->output(files->watch->context, ended->name, cts_export_format(ended->name)->name,
                                 ended->bytes);
        free(ended->name);
        ended->name = NULL;
    }
}

void cts_files_end(CtsFiles *files)
{
    for (int i = 0; files->exports && i < files->outputs->n; i++)
        cts_export_discard(&files->exports[i]);
    cts_files_tell(files);
    free(files->exports);
    free(files->ended);
    files->exports = NULL;
    files->ended = NULL;
}
