/* PNG of any kind read back through libpng. */
#include "output/export/format.h"

#include "base/mem.h"
#include "ctsplat/bounds.h"
#include <errno.h>
#include <png.h>
#include <string.h>
#include <sys/stat.h>

/* Deflate cannot shrink more than 1032 times: a file that promises more is cut short or a trap. */
enum { MAX_CHUNK_BYTES = 16 << 20, MAX_RATIO = 1040 };

typedef struct PngReader {
    const char *path;
    FILE *file;
    uint64_t file_bytes;
    CtsError *err;
    CtsStatus status;
    CtsPicture *picture;
    uint8_t *samples; /* the whole picture: an interlaced file comes in passes */
    png_bytep *rows;
} PngReader;

static void on_read_error(png_structp png, png_const_charp message)
{
    PngReader *r = png_get_error_ptr(png);
    r->status = cts_fail(r->err, CTS_ERR_READ, "%s: not a sound PNG file: %s", r->path, message);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* Ask libpng for 16-bit samples, grey, RGB or RGBA. */
static void set_transforms(png_structp png, png_infop info)
{
    const int type = png_get_color_type(png, info);
    const bool transparent = png_get_valid(png, info, PNG_INFO_tRNS);
    png_set_expand_16(png);
    if (type == PNG_COLOR_TYPE_GRAY_ALPHA || (type == PNG_COLOR_TYPE_GRAY && transparent))
        png_set_gray_to_rgb(png);
    if (transparent)
        png_set_tRNS_to_alpha(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
}

static void fill_row(CtsPicture *picture, int y, int n_samples, const uint8_t *bytes)
{
    float *p = picture->pixels + (size_t)y * picture->width * picture->n_channels;
    for (int x = 0; x < picture->width; x++, bytes += 2 * n_samples, p += picture->n_channels) {
        double v[4] = {0, 0, 0, 1};
        for (int c = 0; c < n_samples; c++)
            v[c] = (bytes[2 * c] << 8 | bytes[2 * c + 1]) / 65535.0;
        for (int c = 0; c < picture->n_channels; c++)
            p[c] = (float)(c < 3 ? v[c] * v[3] : v[3]);
    }
}

static void read_all(png_structp png, png_infop info, PngReader *r)
{
    if (setjmp(png_jmpbuf(png)))
        return;
    png_init_io(png, r->file);
    png_set_user_limits(png, CTS_MAX_SIDE, CTS_MAX_SIDE);
    png_set_chunk_malloc_max(png, MAX_CHUNK_BYTES);
    png_read_info(png, info);
    const int width = (int)png_get_image_width(png, info), height = (int)png_get_image_height(png, info);
    if (png_get_rowbytes(png, info) * (uint64_t)height > r->file_bytes * MAX_RATIO)
        png_error(png, "it is too short for its size in pixels");
    set_transforms(png, info);
    const int n_samples = png_get_channels(png, info);
    const size_t row_bytes = png_get_rowbytes(png, info);
    if (png_get_bit_depth(png, info) != 16 || row_bytes != (size_t)width * n_samples * 2 || n_samples == 2)
        png_error(png, "its samples cannot be widened to 16 bits");
    if ((r->status = cts_picture_new(&r->picture, width, height, n_samples == 1 ? 1 : 4, r->err)) ||
        (r->status = cts_alloc_array(&r->samples, (size_t)height * row_bytes, r->err)) ||
        (r->status = cts_alloc_array(&r->rows, (size_t)height, r->err)))
        return;
    for (int y = 0; y < height; y++)
        r->rows[y] = r->samples + (size_t)y * row_bytes;
    png_read_image(png, r->rows);
    png_read_end(png, NULL);
    r->picture->has_alpha = n_samples == 4;
    for (int y = 0; y < height; y++)
        fill_row(r->picture, y, n_samples, r->rows[y]);
}

CtsStatus cts_png_read(const char *path, CtsPicture **picture, CtsError *err)
{
    PngReader r = {.path = path, .err = err};
    struct stat about;
    png_infop info = NULL;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r, on_read_error, on_warning);
    if (!png || !(info = png_create_info_struct(png)))
        r.status = cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    else if (!(r.file = fopen(path, "rbe")) || fstat(fileno(r.file), &about))
        r.status = cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
    else {
        r.file_bytes = (uint64_t)about.st_size;
        read_all(png, info, &r);
    }
    png_destroy_read_struct(&png, &info, NULL);
    if (r.file)
        fclose(r.file);
    cts_free(&r.samples);
    cts_free(&r.rows);
    if (r.status)
        cts_picture_free(&r.picture);
    *picture = r.picture;
    return r.status;
}
