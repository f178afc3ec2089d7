#include "report/page.h"

#include <cairo.h>
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

typedef struct Base64 {
    FILE *file;
    unsigned held, bits;
} Base64;

static const char base64_digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

static cairo_status_t write_base64(void *context, const unsigned char *data, unsigned n)
{
    Base64 *b = context;
    for (unsigned i = 0; i < n; i++) {
        b->held = b->held << 8 | data[i];
        b->bits += 8;
        while (b->bits >= 6) {
            b->bits -= 6;
            fputc(base64_digits[b->held >> b->bits & 63], b->file);
        }
        b->held &= (1u << b->bits) - 1;
    }
    return CAIRO_STATUS_SUCCESS;
}

static void end_base64(Base64 *b)
{
    if (b->bits)
        fputc(base64_digits[b->held << (6 - b->bits) & 63], b->file);
    fputs(b->bits == 2 ? "==" : b->bits == 4 ? "=" : "", b->file);
}

CtsStatus cts_page_image(FILE *file, const uint8_t *rgb, int width, int height, CtsError *err)
{
    Base64 base64 = {.file = file};
    cairo_surface_t *surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height);
    cairo_status_t status = cairo_surface_status(surface);
    if (status == CAIRO_STATUS_SUCCESS) {
        unsigned char *data = cairo_image_surface_get_data(surface);
        const int stride = cairo_image_surface_get_stride(surface);
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                const uint8_t *p = rgb + 3 * ((size_t)y * (size_t)width + (size_t)x);
                const uint32_t pixel = (uint32_t)p[0] << 16 | (uint32_t)p[1] << 8 | p[2];
                memcpy(data + (size_t)y * (size_t)stride + 4 * (size_t)x, &pixel, sizeof pixel);
            }
        cairo_surface_mark_dirty(surface);
        fputs("data:image/png;base64,", file);
        status = cairo_surface_write_to_png_stream(surface, write_base64, &base64);
        end_base64(&base64);
    }
    cairo_surface_destroy(surface);
    if (status != CAIRO_STATUS_SUCCESS)
        return cts_fail(err, CTS_ERR_MEMORY, "a picture for a page: %s", cairo_status_to_string(status));
    return CTS_OK;
}
