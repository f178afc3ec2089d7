/* JPEG by libjpeg: 8 bits, over black; for previews. */
#include "output/export/format.h"

#include "base/mem.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h> /* needs FILE and size_t */

enum { MAX_SIDE = 65500, DOTS_PER_CM = 2 };

typedef struct JpgWriter {
    const CtsExportJob *job;
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    unsigned char *bytes; /* the compressed picture, n_bytes */
    unsigned long n_bytes;
    CtsError *err; /* of the current call */
    CtsStatus status;
    jmp_buf failed;
    uint8_t *row;
} JpgWriter;

static void on_error(j_common_ptr jpeg)
{
    JpgWriter *const w = jpeg->client_data;
    char text[JMSG_LENGTH_MAX];
    jpeg->err->format_message(jpeg, text);
    w->status = cts_fail(w->err, CTS_ERR_OUTPUT, "%s: libjpeg: %s", w->job->path, text);
    longjmp(w->failed, 1);
}

static void on_message(j_common_ptr jpeg)
{
    (void)jpeg;
}

/* Colours at full resolution: the edges of a render are where its colours change. */
static void start_jpg(JpgWriter *w)
{
    const CtsExportHead *head = &w->job->head;
    const int quality = w->job->settings.quality;
    const double mm_per_pixel = head->info.mm_per_pixel, per_cm = mm_per_pixel > 0 ? floor(10 / mm_per_pixel + 0.5) : 0;
    w->jpeg.image_width = (JDIMENSION)head->width;
    w->jpeg.image_height = (JDIMENSION)head->height;
    w->jpeg.input_components = head->grey ? 1 : 3;
    w->jpeg.in_color_space = head->grey ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&w->jpeg);
    jpeg_set_quality(&w->jpeg, quality ? quality : CTS_QUALITY_DEFAULT, TRUE);
    w->jpeg.comp_info[0].h_samp_factor = w->jpeg.comp_info[0].v_samp_factor = 1;
    if (per_cm >= 1 && per_cm <= UINT16_MAX) {
        w->jpeg.density_unit = DOTS_PER_CM;
        w->jpeg.X_density = w->jpeg.Y_density = (UINT16)per_cm;
    }
    jpeg_start_compress(&w->jpeg, TRUE);
    char text[CTS_DESCRIPTION];
    cts_describe_picture(&head->info, text);
    jpeg_write_marker(&w->jpeg, JPEG_COM, (const JOCTET *)text, (unsigned)strlen(text));
}

static CtsStatus begin(CtsExportJob *job, CtsError *err)
{
    JpgWriter *w = job->state;
    w->job = job;
    w->err = err;
    w->jpeg.err = jpeg_std_error(&w->errors);
    w->errors.error_exit = on_error;
    w->errors.output_message = on_message;
    w->jpeg.client_data = w;
    if (setjmp(w->failed))
        return w->status;
    jpeg_create_compress(&w->jpeg);
    jpeg_mem_dest(&w->jpeg, &w->bytes, &w->n_bytes);
    const CtsStatus st = cts_alloc_array(&w->row, (size_t)job->head.width * 3, err);
    if (!st)
        start_jpg(w);
    return st;
}

static CtsStatus add_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    JpgWriter *const w = job->state;
    w->err = err;
    if (setjmp(w->failed))
        return w->status;
    for (int y = 0; y < band->height; y++) {
        cts_samples_row8(band, y, w->jpeg.input_components, w->row);
        jpeg_write_scanlines(&w->jpeg, &w->row, 1);
    }
    return CTS_OK;
}

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    JpgWriter *const w = job->state;
    w->err = err;
    if (setjmp(w->failed))
        return w->status;
    jpeg_finish_compress(&w->jpeg);
    return cts_temp_write(job->temp, w->bytes, w->n_bytes, err);
}

static void release(CtsExportJob *job)
{
    JpgWriter *const w = job->state;
    jpeg_destroy_compress(&w->jpeg);
    free(w->bytes);
    cts_free(&w->row);
}

const CtsFormat cts_format_jpg = {
    .info = {.name = "jpg", .about = "JPEG, 8 bits a channel", .media_type = "image/jpeg"},
    .max_side = MAX_SIDE,
    CTS_FORMAT_STEPS(JpgWriter),
};
