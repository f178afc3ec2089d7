/* The program ctsplat-pixels. */
#include "dicom/pixels/pixel_tasks.h"

int main(int argc, char **argv)
{
    static const CtsSandboxTask tasks[CTS_N_PIXELS_TASKS] = {
        [CTS_PIXELS_DECODE] = {cts_pixels_decode, cts_dcm_start_decoders},
        [CTS_PIXELS_GUNZIP] = {cts_pixels_gunzip, NULL},
        [CTS_PIXELS_UNZIP] = {cts_pixels_unzip, NULL},
        [CTS_PIXELS_IMAGE] = {cts_pixels_image, cts_dcm_start_images},
        [CTS_PIXELS_ENCODE] = {cts_pixels_encode, cts_dcm_start_encoders},
    };
    return cts_sandbox_serve(argc, argv, tasks, CTS_N_PIXELS_TASKS);
}
