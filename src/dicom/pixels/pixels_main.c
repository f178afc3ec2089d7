/* The program ctsplat-pixels. */
#include "base/file_bytes.h"
#include "dicom/pixels/pixel_tasks.h"
#include <string.h>

/* Inflates the start of a stream. */
static CtsStatus inflate_start(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                               CtsError *err)
{
    size_t got = 0;
    (void)order;
    const CtsStatus st = cts_inflate(stream, n, 0, (uint8_t *)answer + sizeof got, n_answer - sizeof got, &got, err);
    memcpy(answer, &got, sizeof got);
    return st;
}

int main(int argc, char **argv)
{
    static const CtsSandboxTask tasks[CTS_N_PIXELS_TASKS] = {
        [CTS_PIXELS_DECODE] = {cts_pixels_decode, cts_dcm_start_decoders},
        [CTS_PIXELS_INFLATE] = {inflate_start, NULL},
        [CTS_PIXELS_GUNZIP] = {cts_pixels_gunzip, NULL},
        [CTS_PIXELS_UNZIP] = {cts_pixels_unzip, NULL},
        [CTS_PIXELS_IMAGE] = {cts_pixels_image, cts_dcm_start_images},
        [CTS_PIXELS_ENCODE] = {cts_pixels_encode, cts_dcm_start_encoders},
    };
    return cts_sandbox_serve(argc, argv, tasks, CTS_N_PIXELS_TASKS);
}
