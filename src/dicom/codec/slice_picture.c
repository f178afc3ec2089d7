#include "dicom/codec/pixels.h"

#include <string.h>

/* MAX_BYTES of a file. MEMORY: of DCMTK beside the file's bytes, which it copies; a frame has up to 3 bytes a value,
 * and DCMTK holds it twice. CPU_S: measured, the largest mammogram of 27 MB takes less than 2 s. */
enum { MAX_BYTES = 1 << 30, MEMORY = 1 << 30, CPU_S = 60 };

CtsStatus cts_slice_picture(const CtsSlice *slice, int width, int height, CtsPicture **picture, CtsError *err)
{
    const CtsImageBox box = {width, height};
    const size_t n_answer = cts_image_bytes(box);
    CtsSandbox sandbox = cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_IMAGE, "decoder");
    CtsFileBytes file = {.fd = -1};
    CtsImageBox size = {0, 0};
    uint8_t *stream;
    const void *answer;
    CtsStatus st = cts_slice_open(slice, &file, err);
    const size_t n = (size_t)file.n_bytes;
    if (!st && file.n_bytes > MAX_BYTES)
        st = cts_fail(err, CTS_ERR_PIXELS, "its file is larger than 1 GiB");
    sandbox.cpu_limit_s = CPU_S;
    sandbox.memory_limit = MEMORY + 3 * n;
    if (!st && !(st = cts_sandbox_room(&sandbox, n, n_answer, &stream, err)) &&
        !(st = cts_file_bytes_read(&file, stream, n, 0, err))) {
        cts_sandbox_send(&sandbox, &box, sizeof box, stream, n, n_answer);
        if (!(st = cts_sandbox_take(&sandbox, &answer, err)))
            memcpy(&size, answer, sizeof size);
    }
    if (!st && (size.width < 1 || size.width > width || size.height < 1 || size.height > height))
        st = cts_fail(err, CTS_ERR_PIXELS, "its thumbnail has no size");
    if (!st && !(st = cts_picture_new(picture, size.width, size.height, 4, err))) {
        const uint8_t *const rgb = (const uint8_t *)answer + sizeof size;
        (*picture)->has_alpha = false;
        for (size_t i = 0; i < 4 * (size_t)size.width * (size_t)size.height; i++)
            (*picture)->pixels[i] = i % 4 == 3 ? 1 : (float)rgb[i / 4 * 3 + i % 4] / 255;
    }
    cts_file_bytes_close(&file);
    cts_sandbox_stop(&sandbox);
    return st;
}
