#include "app/job/files.h"

#include "base/meter.h"
#include <stdlib.h>

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

static CtsStatus end_file(CtsFiles *files, int output, int frame, CtsError *err)
{
    uint64_t bytes;
    char *name = cts_output_name(files->outputs, output, frame);
    const CtsStatus st =
        name ? cts_export_end(&files->exports[output], &bytes, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st && files->watch->output)
        files->watch->output(files->watch->context, name, cts_export_format(name)->name, bytes);
    free(name);
    return st;
}

CtsStatus cts_files_frame_done(CtsFiles *files, int frame, CtsReport *report, CtsError *err)
{
    const CtsMeter meter = cts_meter_start(report);
    CtsStatus st = CTS_OK;
    for (int i = 0; i < files->outputs->n && !st; i++)
        if (files->exports[i] && (cts_output_n_frames(files->outputs, i) == 1 || frame == files->outputs->rotation - 1))
            st = end_file(files, i, frame, err);
    cts_meter_stop(meter, report, CTS_STAGE_EXPORT);
    return st;
}

void cts_files_end(CtsFiles *files)
{
    for (int i = 0; files->exports && i < files->outputs->n; i++)
        cts_export_discard(&files->exports[i]);
    free(files->exports);
    files->exports = NULL;
}
