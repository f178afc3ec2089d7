#include "ctsplat/series.h"

#include "dicom/codec/pixels.h"
#include <string.h>

/* MAX_BYTES of a file. MEMORY: of DCMTK beside the file's bytes, which it copies; a frame has up to 3 bytes a value,
 * and DCMTK holds it twice. CPU_S: measured, the largest mammogram of 27 MB takes less than 2 s. */
enum { MAX_BYTES = 1 << 30, MEMORY = 1 << 30, CPU_S = 60 };

static CtsStatus read_image(CtsSandbox *sandbox, const CtsFileBytes *file, CtsImage *image, CtsError *err)
{
    const size_t n = (size_t)file->n_bytes;
    uint8_t *stream;
    const void *answer;
    if (file->n_bytes > MAX_BYTES)
        return cts_fail(err, CTS_ERR_PIXELS, "its file is larger than 1 GiB");
    sandbox->cpu_limit_s = CPU_S;
    sandbox->memory_limit = MEMORY + 3 * n;
    CtsStatus st = cts_sandbox_room(sandbox, n, sizeof *image, &stream, err);
    if (st || (st = cts_file_bytes_read(file, stream, n, 0, err)))
        return st;
    cts_sandbox_send(sandbox, NULL, 0, stream, n, sizeof *image);
    if ((st = cts_sandbox_take(sandbox, &answer, err)))
        return st;
    memcpy(image, answer, sizeof *image);
    if (image->width < 1 || image->width > CTS_IMAGE_SIDE || image->height < 1 || image->height > CTS_IMAGE_SIDE)
        return cts_fail(err, CTS_ERR_PIXELS, "its thumbnail has no size");
    return CTS_OK;
}

CtsStatus cts_series_image(const CtsSeries *series, CtsImage *image, CtsError *err)
{
    CtsSandbox sandbox = cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_IMAGE, "decoder");
    CtsFileBytes file = {.fd = -1};
    CtsStatus st = cts_slice_open(series->slices[series->n_slices / 2], &file, err);
    if (!st)
        st = read_image(&sandbox, &file, image, err);
    cts_file_bytes_close(&file);
    cts_sandbox_stop(&sandbox);
    return st;
}
