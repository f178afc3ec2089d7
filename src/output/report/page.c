#include "output/report/page.h"

#include "base/mem.h"
#include <png.h>
#include <stdlib.h>
#include <string.h>

void cts_page_text(FILE *file, const char *text)
{
    for (; *text; text++)
        switch (*text) {
        case '<':
            fputs("&lt;", file);
            break;
        case '>':
            fputs("&gt;", file);
            break;
        case '&':
            fputs("&amp;", file);
            break;
        case '"':
            fputs("&quot;", file);
            break;
        default:
            fputc(*text, file);
        }
}

static const char base64_digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

static void write_base64(FILE *file, const uint8_t *data, size_t n)
{
    for (size_t i = 0; i < n; i += 3) {
        const unsigned n_bytes = n - i < 3 ? (unsigned)(n - i) : 3;
        const unsigned bits = (unsigned)data[i] << 16 | (n_bytes > 1 ? (unsigned)data[i + 1] << 8 : 0) |
                              (n_bytes > 2 ? (unsigned)data[i + 2] : 0);
        for (unsigned k = 0; k < 4; k++)
            fputc(k <= n_bytes ? base64_digits[bits >> (18 - 6 * k) & 63] : '=', file);
    }
}

CtsStatus cts_page_image(FILE *file, const uint8_t *rgb, int width, int height, CtsError *err)
{
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)width,
                       .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGB};
    png_alloc_size_t n = PNG_IMAGE_PNG_SIZE_MAX(image);
    uint8_t *bytes = NULL;
    CtsStatus st = cts_alloc_array(&bytes, n, err);
    if (!st && !png_image_write_to_memory(&image, bytes, &n, 0, rgb, 0, NULL))
        st = cts_fail(err, CTS_ERR_MEMORY, "a picture for a page: %s", image.message);
    if (!st) {
        fputs("data:image/png;base64,", file);
        write_base64(file, bytes, n);
    }
    cts_free(&bytes);
    return st;
}
