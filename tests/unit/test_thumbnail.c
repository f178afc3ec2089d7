/* Thumbnails: means in linear light, frames in their slots, the same bytes for any division into bands. */
#include "app/contact/contact_sheet.h"
#include "base/mem.h"
#include "pictures.h"
#include <webp/decode.h>

static char folder[64], stem[128];

static int enter(void **state)
{
    make_folder(folder);
    snprintf(stem, sizeof stem, "%s/bone-anterior", folder);
    return 0;
}

static int leave(void **state)
{
    remove_folder(folder);
    return 0;
}

/* Every frame is the same picture, times shade[frame] where shade is given. */
static int make_thumb(const CtsPicture *picture, int n_frames, const float *shade, int n_rows,
                      CtsThumbnailFile files[2])
{
    CtsThumbnail *thumb = NULL;
    CtsError err = {0};
    int n_files = 0;
    const size_t row = (size_t)picture->width * (size_t)picture->n_channels;
    float *rows;
    assert_int_equal(cts_alloc_array(&rows, row * (size_t)n_rows, &err), CTS_OK);
    for (int k = 0; k < n_frames; k++)
        for (int y = 0; y < picture->height; y += n_rows) {
            CtsPicture band = *picture;
            band.first_row = y;
            band.height = picture->height - y < n_rows ? picture->height - y : n_rows;
            band.pixels = rows;
            for (size_t i = 0; i < row * (size_t)band.height; i++)
                rows[i] = picture->pixels[row * (size_t)y + i] * (shade ? shade[k] : 1);
            if (!thumb)
                assert_int_equal(cts_thumbnail_begin(&thumb, stem, CTS_THUMBNAIL_SIDE, &band, n_frames, &err), CTS_OK);
            assert_int_equal(cts_thumbnail_rows(thumb, &band, &err), CTS_OK);
        }
    assert_int_equal(cts_thumbnail_end(&thumb, files, &n_files, &err), CTS_OK);
    assert_null(thumb);
    cts_free(&rows);
    return n_files;
}

/* Red, green, blue, alpha of a file; the caller frees them with WebPFree(). */
static uint8_t *decode(const char *suffix, int *width, int *height)
{
    char path[160];
    size_t n;
    snprintf(path, sizeof path, "%s%s", stem, suffix);
    uint8_t *bytes = slurp(path, &n), *pixels = WebPDecodeRGBA(bytes, n, width, height);
    assert_non_null(pixels);
    free(bytes);
    return pixels;
}

static void assert_near(int value, int expected, int bound)
{
    if (value < expected - bound || value > expected + bound)
        fail_msg("%d, expected %d +- %d", value, expected, bound);
}

static CtsPicture *new_picture(int width, int height, int n_channels)
{
    CtsPicture *p = NULL;
    CtsError err;
    assert_int_equal(cts_picture_new(&p, width, height, n_channels, &err), CTS_OK);
    p->has_alpha = false;
    return p;
}

/* Half black and half white is half the light, which is 188 in sRGB, not 128. */
static void test_linear_light(void **state)
{
    CtsThumbnailFile files[2];
    for (int n_channels = 1; n_channels <= 4; n_channels += 3) {
        CtsPicture *p = new_picture(961, 500, n_channels);
        for (int y = 0; y < p->height; y++)
            for (int x = 0; x < p->width; x++)
                for (int c = 0; c < n_channels; c++)
                    p->pixels[((size_t)y * p->width + x) * n_channels + c] = c == 3 ? 1 : (float)((x + y) & 1);
        int width, height;
        assert_int_equal(make_thumb(p, 1, NULL, 64, files), 1);
        uint8_t *rgba = decode(".webp", &width, &height);
        assert_int_equal(width, 240);
        assert_int_equal(height, 125);
        assert_int_equal(files[0].width, width);
        assert_int_equal(files[0].height, height);
        for (int i = 0; i < width * height; i++) {
            for (int c = 0; c < 3; c++)
                assert_near(rgba[4 * i + c], 188, 6);
            assert_int_equal(rgba[4 * i + 3], 255);
        }
        WebPFree(rgba);
        cts_picture_free(&p);
    }
}

/* Transparent pixels contribute no colour: an edge of a red disc stays red. */
static void test_alpha(void **state)
{
    CtsThumbnailFile files[2];
    CtsPicture *p = new_picture(480, 480, 4);
    p->has_alpha = true;
    for (int y = 0; y < 480; y++)
        for (int x = 0; x < 480; x++)
            if (hypot(x - 239.5, y - 239.5) < 200)
                p->pixels[4 * (480 * (size_t)y + x)] = p->pixels[4 * (480 * (size_t)y + x) + 3] = 0.5f;
    int width, height;
    make_thumb(p, 1, NULL, 128, files);
    uint8_t *rgba = decode(".webp", &width, &height);
    assert_int_equal(rgba[3], 0);
    const uint8_t *middle = rgba + 4 * (120 * width + 120);
    assert_near(middle[0], 255, 6);
    assert_near(middle[1], 0, 6);
    assert_near(middle[3], 128, 2);
    WebPFree(rgba);
    cts_picture_free(&p);
}

/* Of 90 frames 36 are side by side: slot i has frame floor(i * 90 / 36). */
static void test_turn(void **state)
{
    enum { FRAMES = 90 };
    float shade[FRAMES];
    CtsThumbnailFile files[2];
    CtsPicture *p = new_picture(300, 300, 1);
    for (int i = 0; i < 300 * 300; i++)
        p->pixels[i] = 1;
    for (int k = 0; k < FRAMES; k++)
        shade[k] = (float)k / FRAMES;
    assert_int_equal(make_thumb(p, FRAMES, shade, 64, files), 2);
    assert_string_equal(files[1].suffix, "-turn.webp");
    assert_int_equal(files[1].n_frames, 36);
    int width, height;
    uint8_t *rgba = decode("-turn.webp", &width, &height);
    assert_int_equal(width, 36 * 240);
    assert_int_equal(height, 240);
    for (int i = 0; i < 36; i++)
        assert_near(rgba[4 * (120 * width + i * 240 + 120)], (int)(255 * shade[i * FRAMES / 36] + 0.5f), 3);
    WebPFree(rgba);
    cts_picture_free(&p);
}

static void test_same_bytes(void **state)
{
    static const int sizes[][2] = {{1, 1}, {5000, 3}, {3, 700}, {240, 240}, {1000, 1001}};
    CtsThumbnailFile files[2];
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        CtsPicture *p = make_picture(sizes[i][0], sizes[i][1], 4, i & 1);
        char path[160];
        size_t n, n_again;
        snprintf(path, sizeof path, "%s.webp", stem);
        make_thumb(p, 2, NULL, 64, files);
        uint8_t *bytes = slurp(path, &n);
        assert_int_equal(files[0].bytes, n);
        make_thumb(p, 2, NULL, p->height, files);
        uint8_t *again = slurp(path, &n_again);
        assert_int_equal(n, n_again);
        assert_memory_equal(bytes, again, n);
        free(bytes);
        free(again);
        cts_picture_free(&p);
    }
}

/* Frames that are missing or come in another size are a caller's fault, and nothing is written. */
static void test_faults(void **state)
{
    CtsThumbnail *thumb;
    CtsThumbnailFile files[2];
    CtsError err;
    int n_files;
    CtsPicture *p = make_picture(64, 64, 4, false), *q = make_picture(32, 64, 4, false);
    assert_int_equal(cts_thumbnail_begin(&thumb, stem, CTS_THUMBNAIL_SIDE, p, 2, &err), CTS_OK);
    assert_int_equal(cts_thumbnail_rows(thumb, q, &err), CTS_ERR_INTERNAL);
    assert_int_equal(cts_thumbnail_rows(thumb, p, &err), CTS_OK);
    assert_int_equal(cts_thumbnail_end(&thumb, files, &n_files, &err), CTS_ERR_INTERNAL);
    assert_null(thumb);
    assert_int_equal(n_files, 0);
    cts_thumbnail_discard(&thumb);
    assert_int_equal(count_files(folder), 0);
    assert_int_equal(cts_thumbnail_begin(&thumb, "no-such-folder/x", CTS_THUMBNAIL_SIDE, p, 1, &err), CTS_OK);
    assert_int_equal(cts_thumbnail_rows(thumb, p, &err), CTS_OK);
    assert_int_equal(cts_thumbnail_end(&thumb, files, &n_files, &err), CTS_ERR_OUTPUT);
    cts_picture_free(&p);
    cts_picture_free(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_linear_light, enter, leave),
        cmocka_unit_test_setup_teardown(test_alpha, enter, leave),
        cmocka_unit_test_setup_teardown(test_turn, enter, leave),
        cmocka_unit_test_setup_teardown(test_same_bytes, enter, leave),
        cmocka_unit_test_setup_teardown(test_faults, enter, leave),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
