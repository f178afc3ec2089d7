#include "ctsplat/series.h"

#include "dicom/codec/pixels.h"
#include <string.h>

/* MAX_BYTES of a file. MEMORY: of DCMTK beside the file's bytes, which it copies; a frame has up to 3 bytes a value,
 * and DCMTK holds it twice. CPU_S: measured, the largest mammogram of 27 MB takes less than 2 s. */
enum { MAX_BYTES = 1 << 30, MEMORY = 1 << 30, CPU_S = 60 };

/* The image, of *size, is at *rgb until the sandbox ends. */
static CtsStatus read_image(CtsSandbox *sandbox, const CtsSlice *slice, CtsImageBox box, CtsImageBox *size,
                            const uint8_t **rgb, CtsError *err)
{
    CtsFileBytes file = {.fd = -1};
    uint8_t *stream;
    const void *answer;
    CtsStatus st = cts_slice_open(slice, &file, err);
    const size_t n = (size_t)file.n_bytes;
    if (!st && file.n_bytes > MAX_BYTES)
        st = cts_fail(err, CTS_ERR_PIXELS, "its file is larger than 1 GiB");
    *sandbox = cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_IMAGE, "decoder");
    sandbox->cpu_limit_s = CPU_S;
    sandbox->memory_limit = MEMORY + 3 * n;
    if (!st && !(st = cts_sandbox_room(sandbox, n, cts_image_bytes(box), &stream, err)) &&
        !(st = cts_file_bytes_read(&file, stream, n, 0, err))) {
        cts_sandbox_send(sandbox, &box, sizeof box, stream, n, cts_image_bytes(box));
        st = cts_sandbox_take(sandbox, &answer, err);
    }
    cts_file_bytes_close(&file);
    if (st)
        return st;
    memcpy(size, answer, sizeof *size);
    *rgb = (const uint8_t *)answer + sizeof *size;
    return size->width >= 1 && size->width <= box.width && size->height >= 1 && size->height <= box.height
               ? CTS_OK
               : cts_fail(err, CTS_ERR_PIXELS, "its thumbnail has no size");
}

CtsStatus cts_series_image(const CtsSeries *series, CtsImage *image, CtsError *err)
{
    CtsSandbox sandbox;
    CtsImageBox size;
    const uint8_t *rgb;
    const CtsStatus st = read_image(&sandbox, series->slices[series->n_slices / 2],
                                    (CtsImageBox){CTS_IMAGE_SIDE, CTS_IMAGE_SIDE}, &size, &rgb, err);
    if (!st) {
        image->width = size.width;
        image->height = size.height;
        memcpy(image->rgb, rgb, cts_image_bytes(size) - sizeof size);
    }
    cts_sandbox_stop(&sandbox);
    return st;
}

CtsStatus cts_slice_picture(const CtsSlice *slice, int width, int height, CtsPicture **picture, CtsError *err)
{
    CtsSandbox sandbox;
    CtsImageBox size;
    const uint8_t *rgb;
    CtsStatus st = read_image(&sandbox, slice, (CtsImageBox){width, height}, &size, &rgb, err);
    if (!st && !(st = cts_picture_new(picture, size.width, size.height, 4, err))) {
        (*picture)->has_alpha = false;
        for (size_t i = 0; i < 4 * (size_t)size.width * (size_t)size.height; i++)
            (*picture)->pixels[i] = i % 4 == 3 ? 1 : (float)rgb[i / 4 * 3 + i % 4] / 255;
    }
    cts_sandbox_stop(&sandbox);
    return st;
}
