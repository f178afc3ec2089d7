/* Pictures of 8 bits per channel: independent decoders read what was written. */
#include "output/image/samples.h"
#include "pictures.h"

#include <jpeglib.h>
#include <webp/decode.h>
#include <webp/demux.h>

/* Largest distance, 0 to 255, between what was decoded (n_bytes a pixel) and the picture over black. */
static int farthest(const CtsPicture *p, const uint8_t *decoded, int n_bytes)
{
    int most = 0;
    for (int i = 0; i < p->width * p->height; i++)
        for (int c = 0; c < 3; c++) {
            const int off = abs((int)cts_round8(p->pixels[4 * i + c]) - decoded[n_bytes * i + c]);
            most = off > most ? off : most;
        }
    return most;
}

/* The middle's highlight is too small for blocks of 8 x 8 pixels: it is taken out. */
static CtsPicture *smooth_picture(bool has_alpha)
{
    CtsPicture *p = make_picture(96, 64, 4, has_alpha);
    for (int i = 0; i < 96 * 64 && !has_alpha; i++)
        p->pixels[4 * i] = (float)((i % 96 + 0.5) / 96);
    return p;
}

static void write_file(const CtsPicture *const *frames, int n_frames, const char *path, CtsExportSettings settings)
{
    CtsError err = {0};
    settings.n_threads = 1;
    if (cts_export(frames, n_frames, path, &settings, NULL, NULL, &err))
        fail_msg("%s", err.text);
}

static void test_jpg(void **state)
{
    char folder[64], path[200];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.jpg", folder);
    CtsPicture *p = smooth_picture(false);
    size_t n, n_default;
    write_file(&(const CtsPicture *){p}, 1, path, (CtsExportSettings){0});
    free(slurp(path, &n_default));
    write_file(&(const CtsPicture *){p}, 1, path, (CtsExportSettings){.quality = 100, .force = true});
    uint8_t *bytes = slurp(path, &n), *pixels = malloc(96 * 64 * 3);
    struct jpeg_error_mgr errors;
    struct jpeg_decompress_struct jpeg = {.err = jpeg_std_error(&errors)};
    jpeg_create_decompress(&jpeg);
    jpeg_mem_src(&jpeg, bytes, n);
    jpeg_save_markers(&jpeg, JPEG_COM, 0xffff);
    assert_int_equal(jpeg_read_header(&jpeg, TRUE), JPEG_HEADER_OK);
    assert_true(jpeg.marker_list &&
                memmem(jpeg.marker_list->data, jpeg.marker_list->data_length, "not for diagnostic", 18));
    assert_int_equal(jpeg.density_unit, 2);
    assert_int_equal(jpeg.X_density, 20); /* 0.5 mm a pixel */
    jpeg_start_decompress(&jpeg);
    assert_int_equal(jpeg.output_components, 3);
    for (uint8_t *row = pixels; jpeg.output_scanline < jpeg.output_height; row += 96 * 3)
        jpeg_read_scanlines(&jpeg, &row, 1);
    jpeg_finish_decompress(&jpeg);
    jpeg_destroy_decompress(&jpeg);
    assert_in_range(farthest(p, pixels, 3), 0, 6);
    assert_true(n_default < n);
    cts_picture_free(&p);
    free(bytes);
    free(pixels);
    remove_folder(folder);
}

static void test_webp_alpha(void **state)
{
    char folder[64], path[200];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.webp", folder);
    CtsPicture *p = smooth_picture(true);
    write_file(&(const CtsPicture *){p}, 1, path, (CtsExportSettings){.quality = 100});
    size_t n;
    int width, height;
    uint8_t *bytes = slurp(path, &n), *pixels = WebPDecodeRGBA(bytes, n, &width, &height);
    assert_true(pixels && width == 96 && height == 64);
    for (int i = 0; i < 96 * 64; i++)
        assert_in_range(abs((int)cts_round8(p->pixels[4 * i + 3]) - pixels[4 * i + 3]), 0, 2);
    WebPFree(pixels);
    cts_picture_free(&p);
    free(bytes);
    remove_folder(folder);
}

static void test_webp_rotation(void **state)
{
    char folder[64], path[200];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.webp", folder);
    CtsPicture *p = smooth_picture(false), *q = smooth_picture(false);
    for (int i = 0; i < 96 * 64 * 4; i++)
        q->pixels[i] = i % 4 == 3 ? 1 : 1 - p->pixels[i];
    write_file((const CtsPicture *[]){p, q, p}, 3, path, (CtsExportSettings){0});
    size_t n;
    uint8_t *bytes = slurp(path, &n), *pixels;
    WebPAnimDecoder *decoder = WebPAnimDecoderNew(&(WebPData){bytes, n}, NULL);
    WebPAnimInfo info;
    assert_true(decoder && WebPAnimDecoderGetInfo(decoder, &info));
    assert_int_equal(info.frame_count, 3);
    assert_int_equal(info.loop_count, 0); /* for ever */
    for (int k = 1, ms; k <= 3; k++) {
        assert_true(WebPAnimDecoderGetNext(decoder, &pixels, &ms));
        assert_int_equal(ms, 100 * k);
        assert_in_range(farthest(k == 2 ? q : p, pixels, 4), 0, 40);
        assert_true(farthest(k == 2 ? p : q, pixels, 4) > 100);
    }
    WebPAnimDecoderDelete(decoder);
    cts_picture_free(&p);
    cts_picture_free(&q);
    free(bytes);
    remove_folder(folder);
}

static void test_png_8(void **state)
{
    static const int colour_types[] = {0, 2, 6};
    char folder[64], path[200];
    CtsError err;
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.png", folder);
    for (int kind = 0; kind < 3; kind++) {
        CtsPicture *p = make_picture(37, 21, kind ? 4 : 1, kind == 2), *q = NULL;
        write_file(&(const CtsPicture *){p}, 1, path, (CtsExportSettings){.png_8_bits = true, .force = true});
        size_t n;
        uint8_t *bytes = slurp(path, &n);
        assert_int_equal(bytes[24], 8); /* IHDR's bit depth */
        assert_int_equal(bytes[25], colour_types[kind]);
        free(bytes);
        assert_int_equal(cts_picture_read(path, &q, &err), CTS_OK);
        for (int i = 0; i < 37 * 21 && kind < 2; i++) {
            const float *a = p->pixels + i * p->n_channels, *b = q->pixels + i * q->n_channels;
            for (int c = 0; c < (kind ? 3 : 1); c++)
                assert_int_equal(cts_round8(b[c]), cts_round8(a[c]));
        }
        cts_picture_free(&p);
        cts_picture_free(&q);
    }
    remove_folder(folder);
}

static void test_sizes(void **state)
{
    CtsError err;
    const CtsExportSettings settings = {0};
    assert_int_equal(cts_export_check_size("a.jpg", 65500, 65500, 1, false, &settings, &err), CTS_OK);
    assert_int_equal(cts_export_check_size("a.jpg", 65501, 1, 1, false, &settings, &err), CTS_ERR_USAGE);
    assert_int_equal(cts_export_check_size("a.webp", 16383, 16383, 9, false, &settings, &err), CTS_OK);
    assert_int_equal(cts_export_check_size("a.webp", 1, 16384, 1, false, &settings, &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, "16383"));
    assert_int_equal(cts_export_check_size("a.jpg", 10, 10, 2, false, &settings, &err), CTS_ERR_USAGE);
}

/* The largest estimate of a file's pictures stands in it, once, and only where there is one; its pixels stay. */
static void test_error_estimate(void **state)
{
    static const char *const endings[] = {"png", "exr", "webp"};
    static const CtsErrorBound bounds[] = {{.rmse = 1}, {.known = true, .rmse = 0.4 / 255}, {.known = true}};
    char folder[64], path[100], bare[100];
    CtsError err = {0};
    CtsPicture *p = make_picture(64, 32, 4, true);
    make_folder(folder);
    for (int i = 0; i < 3; i++) {
        size_t n, n_bare;
        CtsExport *export;
        snprintf(path, sizeof path, "%s/a.%s", folder, endings[i]);
        snprintf(bare, sizeof bare, "%s/bare.%s", folder, endings[i]);
        assert_int_equal(cts_export_begin(&export, path, p, 1, &(CtsExportSettings){0}, NULL, &err), CTS_OK);
        assert_int_equal(cts_export_rows(export, p, &err), CTS_OK);
        for (int k = 0; k < 3; k++)
            cts_export_error(export, &bounds[k]);
        assert_int_equal(cts_export_end(&export, NULL, &err), CTS_OK);
        assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, bare, &(CtsExportSettings){0}, NULL, NULL, &err),
                         CTS_OK);
        uint8_t *const bytes = slurp(path, &n), *const without = slurp(bare, &n_bare);
        const uint8_t *const text = memmem(bytes, n, "0.4/255 rms", 11);
        assert_non_null(text);
        assert_null(memmem(text + 11, n - (size_t)(text + 11 - bytes), "/255 rms", 8));
        assert_null(memmem(without, n_bare, "/255 rms", 8));
        if (!strcmp(endings[i], "webp")) {
            int width, height, width_bare, height_bare;
            uint8_t *const a = WebPDecodeRGBA(bytes, n, &width, &height);
            uint8_t *const b = WebPDecodeRGBA(without, n_bare, &width_bare, &height_bare);
            assert_true(a && b && width == width_bare && height == height_bare);
            assert_memory_equal(a, b, (size_t)(4 * width * height));
            WebPFree(a);
            WebPFree(b);
        } else {
            CtsPicture *q, *r;
            assert_int_equal(cts_picture_read(path, &q, &err), CTS_OK);
            assert_int_equal(cts_picture_read(bare, &r, &err), CTS_OK);
            assert_memory_equal(q->pixels, r->pixels, (size_t)(64 * 32 * 4) * sizeof *q->pixels);
            cts_picture_free(&q);
            cts_picture_free(&r);
        }
        free(bytes);
        free(without);
    }
    cts_picture_free(&p);
    remove_folder(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_jpg),   cmocka_unit_test(test_webp_alpha), cmocka_unit_test(test_webp_rotation),
        cmocka_unit_test(test_png_8), cmocka_unit_test(test_sizes),      cmocka_unit_test(test_error_estimate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
