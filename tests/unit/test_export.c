/* Picture files: a round trip keeps the picture, and files are written whole or not at all. */
#include "base/hash.h"
#include "base/mem.h"
#include "base/vec3.h"
#include "ctsplat/export.h"
#include "output/image/samples.h"
#include "pictures.h"
#include <openexr.h>
#include <png.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <zlib.h>

static const CtsExportSettings plain = {.n_threads = 2};

static void write_one(const CtsPicture *p, const char *path)
{
    CtsError err = {0};
    uint64_t bytes = 0;
    CtsReport report = {0};
    struct stat info;
    const CtsStatus st = cts_export(&p, 1, path, &plain, &bytes, &report, &err);
    if (st)
        fail_msg("%s", err.text);
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(bytes, info.st_size);
    assert_true(report.stages[CTS_STAGE_EXPORT].ran);
    assert_int_equal(report.stages[CTS_STAGE_EXPORT].items, (uint64_t)p->width * p->height);
    assert_int_equal(report.stages[CTS_STAGE_EXPORT].bytes, bytes);
    cts_report_free(&report);
}

static void assert_samples_equal(const CtsPicture *a, const CtsPicture *b, int n_samples)
{
    uint16_t row_a[4 * 700], row_b[4 * 700];
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    for (int y = 0; y < a->height; y++) {
        cts_samples_row16(a, y, n_samples, row_a);
        cts_samples_row16(b, y, n_samples, row_b);
        assert_memory_equal(row_a, row_b, (size_t)a->width * n_samples * 2);
    }
}

/* The filtered rows. The IDAT chunks together are one zlib stream of this length with a valid checksum: readers differ
 * in whether they check it. */
static uint8_t *inflated_rows(const char *path, size_t n_expected)
{
    size_t n, n_idat = 0;
    uint8_t *bytes = slurp(path, &n), *idat = malloc(n), *rows = malloc(n_expected + 1);
    assert_true(idat && rows);
    for (size_t at = 8; at < n;) {
        const size_t length =
            (size_t)bytes[at] << 24 | (size_t)bytes[at + 1] << 16 | (size_t)bytes[at + 2] << 8 | (size_t)bytes[at + 3];
        if (memcmp(bytes + at + 4, "IDAT", 4) == 0) {
            memcpy(idat + n_idat, bytes + at + 8, length);
            n_idat += length;
        }
        at += 12 + length;
    }
    uLongf n_rows = n_expected + 1;
    assert_int_equal(uncompress(rows, &n_rows, idat, n_idat), Z_OK);
    assert_int_equal(n_rows, n_expected);
    free(bytes);
    free(idat);
    return rows;
}

/* Grey, RGB and RGBA, of sizes that are no multiple of anything, come back to the last of 16 bits, and twice the same
 * picture gives twice the same bytes. */
static void test_png_round_trip(void **state)
{
    const struct {
        int width, height, n_channels;
        bool has_alpha;
        int n_samples, colour_type;
    } cases[] = {{97, 41, 1, false, 1, PNG_COLOR_TYPE_GRAY},  {97, 41, 4, false, 3, PNG_COLOR_TYPE_RGB},
                 {97, 41, 4, true, 4, PNG_COLOR_TYPE_RGBA},   {1, 1, 4, true, 4, PNG_COLOR_TYPE_RGBA},
                 {300, 1, 1, false, 1, PNG_COLOR_TYPE_GRAY},  {1, 300, 4, false, 3, PNG_COLOR_TYPE_RGB},
                 {256, 256, 4, true, 4, PNG_COLOR_TYPE_RGBA}, {700, 300, 4, true, 4, PNG_COLOR_TYPE_RGBA},
                 {700, 300, 1, false, 1, PNG_COLOR_TYPE_GRAY}};
    char folder[64], a[100], b[100];
    make_folder(folder);
    snprintf(a, sizeof a, "%s/a.png", folder);
    snprintf(b, sizeof b, "%s/B.PNG", folder);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsPicture *p = make_picture(cases[i].width, cases[i].height, cases[i].n_channels, cases[i].has_alpha), *q;
        CtsError err;
        write_one(p, a);
        for (int n_threads = 1; n_threads <= 7; n_threads += 3) {
            const CtsExportSettings again = {.n_threads = n_threads, .force = true};
            assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, b, &again, NULL, NULL, &err), CTS_OK);
            assert_same_bytes(a, b);
        }
        free(inflated_rows(a, (size_t)(p->width * cases[i].n_samples * 2 + 1) * p->height));
        assert_int_equal(cts_picture_read(a, &q, &err), CTS_OK);
        assert_int_equal(q->has_alpha, cases[i].has_alpha);
        assert_int_equal(q->n_channels, cases[i].n_channels);
        assert_samples_equal(p, q, cases[i].n_samples);
        size_t n;
        uint8_t *bytes = slurp(a, &n);
        assert_int_equal(bytes[24], 16);
        assert_int_equal(bytes[25], cases[i].colour_type);
        assert_int_equal(bytes[28], 0);
        assert_int_equal(memmem(bytes, n, "bKGD", 4) != NULL, cases[i].has_alpha);
        free(bytes);
        cts_picture_free(&p);
        cts_picture_free(&q);
        unlink(a);
        unlink(b);
    }
    remove_folder(folder);
}

/* A picture written in bands has the bytes of the whole one: rows that fill no strip wait for the next band, more than
 * a batch of strips is written at once. Rows in the wrong order are refused, without a remaining file. */
static void test_bands(void **state)
{
    const struct {
        int width, height, n_channels;
        bool has_alpha, depth;
    } cases[] = {
        {300, 400, 4, false, true}, {300, 400, 4, true, false}, {41, 1000, 1, false, false}, {1, 65, 4, true, true}};
    static const char *const endings[] = {"png", "exr"};
    char folder[64], a[100], b[100];
    CtsError err;
    make_folder(folder);
    for (size_t i = 0; i < 2 * sizeof cases / sizeof *cases; i++) {
        CtsPicture *p =
            make_picture(cases[i / 2].width, cases[i / 2].height, cases[i / 2].n_channels, cases[i / 2].has_alpha);
        const size_t n = (size_t)p->width * p->height;
        if (cases[i / 2].depth)
            assert_int_equal(cts_alloc_array(&p->depth_mm, n, &err), CTS_OK);
        for (size_t k = 0; k < n && p->depth_mm; k++)
            p->depth_mm[k] = k % 5 ? (float)k : INFINITY;
        snprintf(a, sizeof a, "%s/a.%s", folder, endings[i % 2]);
        snprintf(b, sizeof b, "%s/b.%s", folder, endings[i % 2]);
        write_one(p, a);
        for (int n_rows = CTS_BAND_ROWS; n_rows <= 3 * CTS_BAND_ROWS; n_rows += 2 * CTS_BAND_ROWS) {
            export_in_bands(&(const CtsPicture *){p}, 1, false, n_rows, b, &plain);
            assert_same_bytes(a, b);
            unlink(b);
        }
        CtsExport *export;
        assert_int_equal(cts_export_begin(&export, b, p, 1, &plain, NULL, &err), CTS_OK);
        p->first_row = CTS_BAND_ROWS;
        p->height -= CTS_BAND_ROWS;
        assert_int_equal(cts_export_rows(export, p, &err), CTS_ERR_INTERNAL);
        assert_int_equal(cts_export_end(&export, NULL, &err), CTS_ERR_INTERNAL);
        assert_null(export);
        assert_int_equal(count_files(folder), 1);
        p->height += CTS_BAND_ROWS;
        cts_picture_free(&p);
        unlink(a);
    }
    /* More than the 16 MiB of strips that wait for each other. */
    CtsPicture *large = make_picture(3000, 1100, 4, false);
    snprintf(a, sizeof a, "%s/a.png", folder);
    snprintf(b, sizeof b, "%s/b.png", folder);
    write_one(large, a);
    export_in_bands(&(const CtsPicture *){large}, 1, false, 2 * CTS_BAND_ROWS, b, &plain);
    assert_same_bytes(a, b);
    cts_picture_free(&large);
    remove_folder(folder);
}

/* A stored hash of PNG files: their chunks before the rows, except the text that names ctsplat's version, and the
 * inflated rows, since each version of zlib may pack them in its own way. */
static void test_png_bytes(void **state)
{
    static const char expected[] = "d871f348b357960abccb92f0bd5fec64f55a28f371d0045ef58998eaeef22114";
    static const int channels[] = {1, 4, 4, 4}; /* grey, RGB, RGBA, RGB of 8 bits */
    char folder[64], path[100], hex[2 * CTS_DIGEST_BYTES + 1];
    CtsHash *hash;
    CtsError err;
    make_folder(folder);
    assert_non_null(hash = cts_hash_start(NULL));
    for (int i = 0; i < 4; i++) {
        const CtsExportSettings settings = {.n_threads = 2, .png_8_bits = i == 3};
        CtsPicture *p = make_picture(61, 83, channels[i], i == 2);
        if (i == 3)
            snprintf(p->info.preset, sizeof p->info.preset,
                     "Kn\xc3\xb6"
                     "chel");
        for (int k = 0; k < 61 * 83 * p->n_channels; k++) /* no function of a mathematics library */
            p->pixels[k] = k % 4 == 3 ? 1 : (float)(k * 7 % 1021) / 1021;
        snprintf(path, sizeof path, "%s/%d.png", folder, i);
        assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, path, &settings, NULL, NULL, &err), CTS_OK);
        size_t n;
        uint8_t *bytes = slurp(path, &n);
        const uint8_t *const text = memmem(bytes, n, "tEXtSoftware", 12);
        assert_non_null(text);
        const size_t begin = (size_t)(text - bytes) - 4, end = begin + 12 + bytes[begin + 3];
        cts_hash_bytes(hash, bytes, begin);
        const uint8_t *const idat = memmem(bytes, n, "IDAT", 4);
        const size_t n_rows = 83 * (61 * (size_t)(i == 0 ? 1 : i == 2 ? 4 : 3) * (i == 3 ? 1 : 2) + 1);
        uint8_t *const rows = inflated_rows(path, n_rows);
        cts_hash_bytes(hash, bytes + end, (size_t)(idat - bytes) - end);
        cts_hash_bytes(hash, rows, n_rows);
        free(rows);
        free(bytes);
        cts_picture_free(&p);
    }
    assert_int_equal(cts_hash_hex(&hash, hex, &err), CTS_OK);
    assert_string_equal(hex, expected);
    remove_folder(folder);
}

static const char *text_of(png_structp png, png_infop info, const char *key)
{
    png_textp text;
    int n;
    png_get_text(png, info, &text, &n);
    for (int i = 0; i < n; i++)
        if (strcmp(text[i].key, key) == 0)
            return text[i].text;
    return "";
}

/* libpng, an independent reader, finds colour space, scale and texts in the file. */
static void test_png_metadata(void **state)
{
    char folder[64], path[100];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.png", folder);
    CtsPicture *p = make_picture(20, 10, 1, false);
    p->info.occlusion = 0.45;
    write_one(p, path);
    FILE *file = fopen(path, "rb");
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    assert_int_equal(setjmp(png_jmpbuf(png)), 0);
    png_init_io(png, file);
    png_read_png(png, info, PNG_TRANSFORM_IDENTITY, NULL);
    int intent, unit;
    double gamma;
    png_uint_32 res_x, res_y;
    assert_true(png_get_sRGB(png, info, &intent) && intent == 0);
    assert_true(png_get_gAMA(png, info, &gamma) && fabs(gamma - 0.45455) < 1e-9);
    assert_true(png_get_valid(png, info, PNG_INFO_cHRM) != 0);
    assert_true(png_get_valid(png, info, PNG_INFO_tIME) == 0);
    assert_true(png_get_pHYs(png, info, &res_x, &res_y, &unit) && res_x == 2000 && res_y == 2000);
    assert_int_equal(unit, PNG_RESOLUTION_METER);
    assert_string_equal(text_of(png, info, "Software"), "ctsplat " CTS_VERSION);
    assert_string_equal(text_of(png, info, "Disclaimer"), "not for diagnostic use");
    assert_string_equal(text_of(png, info, "ctsplat:preset"), "bone");
    assert_string_equal(text_of(png, info, "ctsplat:view"), "-30,20");
    assert_string_equal(text_of(png, info, "ctsplat:mm_per_pixel"), "0.5");
    assert_string_equal(text_of(png, info, "ctsplat:window"), "-100,900.5");
    assert_string_equal(text_of(png, info, "ctsplat:occlusion"), "0.45");
    png_destroy_read_struct(&png, &info, NULL);
    fclose(file);
    cts_picture_free(&p);
    remove_folder(folder);
}

/* PNG files of other makers: 8 bits, palettes, grey with alpha, interlaced. */
static void test_png_foreign(void **state)
{
    char folder[64], path[100];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.png", folder);
    const struct {
        uint32_t format;
        int n_channels;
        uint8_t pixels[8];
        float expected[8];
    } cases[] = {{PNG_FORMAT_GRAY, 1, {0, 51}, {0, 0.2f}},
                 {PNG_FORMAT_RGB, 4, {0, 51, 255, 102, 0, 0}, {0, 0.2f, 1, 1, 0.4f, 0, 0, 1}},
                 {PNG_FORMAT_GA, 4, {255, 51, 255, 255}, {0.2f, 0.2f, 0.2f, 0.2f, 1, 1, 1, 1}},
                 {PNG_FORMAT_RGBA, 4, {255, 0, 51, 51, 0, 255, 0, 255}, {0.2f, 0, 0.04f, 0.2f, 0, 1, 0, 1}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        png_image image = {.version = PNG_IMAGE_VERSION, .width = 2, .height = 1, .format = cases[i].format};
        CtsPicture *p;
        CtsError err;
        assert_true(png_image_write_to_file(&image, path, 0, cases[i].pixels, 0, NULL) != 0);
        assert_int_equal(cts_picture_read(path, &p, &err), CTS_OK);
        assert_int_equal(p->n_channels, cases[i].n_channels);
        for (int k = 0; k < 2 * p->n_channels; k++)
            assert_true(fabsf(p->pixels[k] - cases[i].expected[k]) < 1e-6f);
        cts_picture_free(&p);
    }
    remove_folder(folder);
}

static double nearest_half_step(double v)
{
    return v < 0x1p-14 ? 0x1p-24 : ldexp(1, ilogb(v) - 10);
}

/* The round trip keeps the picture to half a step of a half float in linear light, and depth to the bit. */
static void check_exr(const CtsPicture *p, const CtsPicture *q)
{
    const size_t n = (size_t)p->width * p->height;
    bool lets_through = false;
    for (size_t i = 0; i < n && p->has_alpha; i++)
        lets_through |= p->pixels[4 * i + 3] < 1;
    assert_true(q->n_channels == 4 && q->has_alpha == lets_through);
    for (size_t i = 0; i < n; i++) {
        const float *a = p->pixels + i * p->n_channels, *b = q->pixels + 4 * i;
        const double alpha_a = p->has_alpha ? a[3] : 1, alpha_b = b[3];
        assert_true(fabs(alpha_a - alpha_b) <= 0.5 * nearest_half_step(alpha_a));
        for (int c = 0; c < 3; c++) {
            const double v = p->n_channels == 1 ? a[0] : a[c];
            const double linear_a = alpha_a > 0 ? alpha_a * cts_srgb_to_linear(v / alpha_a) : 0;
            const double linear_b = alpha_b > 0 ? alpha_b * cts_srgb_to_linear(b[c] / alpha_b) : 0;
            assert_true(fabs(linear_a - linear_b) <= 0.501 * nearest_half_step(linear_a));
        }
    }
    assert_int_equal(p->depth_mm != NULL, q->depth_mm != NULL);
    if (p->depth_mm)
        assert_memory_equal(p->depth_mm, q->depth_mm, n * sizeof(float));
}

static void test_exr_round_trip(void **state)
{
    const struct {
        int width, height, n_channels;
        bool has_alpha, depth;
    } cases[] = {{97, 41, 1, false, false}, {97, 41, 4, false, true},  {97, 41, 4, true, true},
                 {1, 1, 4, true, false},    {300, 1, 4, false, false}, {1, 300, 4, true, true}};
    char folder[64], a[100], b[100];
    make_folder(folder);
    snprintf(a, sizeof a, "%s/a.exr", folder);
    snprintf(b, sizeof b, "%s/b.exr", folder);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsPicture *p = make_picture(cases[i].width, cases[i].height, cases[i].n_channels, cases[i].has_alpha), *q;
        CtsError err;
        const size_t n = (size_t)p->width * p->height;
        if (cases[i].depth)
            assert_int_equal(cts_alloc_array(&p->depth_mm, n, &err), CTS_OK);
        for (size_t k = 0; k < n && cases[i].depth; k++)
            p->depth_mm[k] = k % 3 ? (float)k * 1234.567f : INFINITY;
        write_one(p, a);
        const CtsExportSettings one_thread = {.n_threads = 1};
        assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, b, &one_thread, NULL, NULL, &err), CTS_OK);
        assert_same_bytes(a, b);
        assert_int_equal(cts_picture_read(a, &q, &err), CTS_OK);
        check_exr(p, q);
        cts_picture_free(&p);
        cts_picture_free(&q);
        unlink(a);
        unlink(b);
    }
    remove_folder(folder);
}

/* The matrices map points of the patient to their pixels. */
static void test_exr_camera(void **state)
{
    char folder[64], path[100];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.exr", folder);
    CtsPicture *p = make_picture(200, 100, 4, false);
    const double a = 0.3, e = -0.7;
    CtsPictureInfo *info = &p->info;
    const double right[3] = {cos(a), sin(a), 0}, up[3] = {sin(e) * sin(a), -sin(e) * cos(a), cos(e)};
    memcpy(info->right_lps, right, sizeof right);
    memcpy(info->up_lps, up, sizeof up);
    cts_cross3(up, right, info->forward_lps);
    info->camera_mm = 150;
    info->occlusion = 0.5;
    write_one(p, path);
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t file;
    exr_attr_m44f_t camera, ndc;
    exr_attr_chromaticities_t colours;
    float occlusion;
    int32_t length;
    const char *text;
    assert_int_equal(exr_start_read(&file, path, &setup), EXR_ERR_SUCCESS);
    assert_int_equal(exr_attr_get_m44f(file, 0, "worldToCamera", &camera), EXR_ERR_SUCCESS);
    assert_int_equal(exr_attr_get_m44f(file, 0, "worldToNDC", &ndc), EXR_ERR_SUCCESS);
    assert_int_equal(exr_attr_get_chromaticities(file, 0, "chromaticities", &colours), EXR_ERR_SUCCESS);
    assert_int_equal(exr_attr_get_string(file, 0, "ctsplat.preset", &length, &text), EXR_ERR_SUCCESS);
    assert_string_equal(text, "bone");
    assert_int_equal(exr_attr_get_float(file, 0, "ctsplat.occlusion", &occlusion), EXR_ERR_SUCCESS);
    assert_true(occlusion == 0.5f);
    /* Pixel (150, 20) at depth 60, by the picture geometry of the contract. */
    double world[4] = {0, 0, 0, 1}, found[4] = {0}, place[4] = {0};
    const double x_mm = (150.5 - 100) * 0.5, y_mm = (50 - 20 - 0.5) * 0.5;
    for (int k = 0; k < 3; k++)
        world[k] = info->centre_lps[k] + x_mm * right[k] + y_mm * up[k] + (60 - 150) * info->forward_lps[k];
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++) {
            found[k] += world[i] * camera.m[4 * i + k];
            place[k] += world[i] * ndc.m[4 * i + k];
        }
    const double expected[4] = {x_mm, y_mm, 60, 1};
    for (int k = 0; k < 4; k++)
        assert_true(fabs(found[k] - expected[k]) < 1e-3);
    assert_true(fabs(place[0] - 150.5 / 200) < 1e-5 && fabs(place[1] - 20.5 / 100) < 1e-5);
    exr_finish(&file);
    cts_picture_free(&p);
    remove_folder(folder);
}

/* exrheader reads the file and prints its main attributes. */
static void test_exrheader(void **state)
{
    if (system("command -v exrheader >/dev/null"))
        skip();
    char folder[64], path[100], command[300], out[4000];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.exr", folder);
    CtsPicture *p = make_picture(200, 100, 4, true);
    unsetenv("SOURCE_DATE_EPOCH"); /* with it a file has a date */
    write_one(p, path);
    snprintf(command, sizeof command, "exrheader %s", path);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    const size_t n = fread(out, 1, sizeof out - 1, pipe);
    out[n] = 0;
    assert_int_equal(pclose(pipe), 0);
    static const char *const wanted[] = {"A, 16-bit floating-point", "zip, multi-scanline", "worldToCamera",
                                         "ctsplat.view (type string): \"-30,20\"", "not for diagnostic use"};
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
        assert_non_null(strstr(out, wanted[i]));
    assert_null(strstr(out, "capDate"));
    cts_picture_free(&p);
    remove_folder(folder);
}

static void put_file(const char *path, const void *bytes, size_t n)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
}

/* A file truncated anywhere is refused with one line and never read as a picture. */
static void refuse_every_cut(const char *ending)
{
    char folder[64], whole[100], cut[100];
    make_folder(folder);
    snprintf(whole, sizeof whole, "%s/whole.%s", folder, ending);
    snprintf(cut, sizeof cut, "%s/cut.%s", folder, ending);
    CtsPicture *p = make_picture(13, 9, 4, true), *q;
    write_one(p, whole);
    size_t n;
    uint8_t *bytes = slurp(whole, &n);
    CtsError err;
    for (size_t k = 0; k < n; k += k < 200 ? 1 : 7) {
        put_file(cut, bytes, k);
        assert_int_equal(cts_picture_read(cut, &q, &err), CTS_ERR_READ);
        assert_null(q);
        assert_non_null(strstr(err.text, cut));
    }
    free(bytes);
    cts_picture_free(&p);
    remove_folder(folder);
}

static void test_png_cut(void **state)
{
    refuse_every_cut("png");
}

static void test_exr_cut(void **state)
{
    refuse_every_cut("exr");
}

static void test_png_promises_too_much(void **state)
{
    static const uint8_t head[] = {0x89, 'P',  'N',  'G',  13, 10, 26, 10,   0,   0,   0,   13,   'I',  'H',  'D',
                                   'R',  0,    0,    0x80, 0,  0,  0,  0x80, 0,   16,  6,   0,    0,    0,    0xb2,
                                   0x8b, 0xe0, 0x11, 0,    0,  0,  0,  'I',  'D', 'A', 'T', 0x35, 0xaf, 0x06, 0x1e};
    char folder[64], path[100];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.png", folder);
    uint8_t bytes[sizeof head];
    memcpy(bytes, head, sizeof head);
    const uint32_t crc = (uint32_t)crc32(0, bytes + 12, 17);
    for (int i = 0; i < 4; i++)
        bytes[29 + i] = (uint8_t)(crc >> (24 - 8 * i));
    put_file(path, bytes, sizeof bytes);
    CtsPicture *p;
    CtsError err;
    assert_int_equal(cts_picture_read(path, &p, &err), CTS_ERR_READ);
    assert_non_null(strstr(err.text, "too short"));
    remove_folder(folder);
}

static void test_check(void **state)
{
    char folder[64], path[200];
    CtsError err;
    make_folder(folder);
    CtsPicture *p = make_picture(4, 4, 4, false);
    assert_string_equal(cts_export_format("a/b.png")->name, "png");
    assert_string_equal(cts_export_format("b.PnG")->name, "png");
    assert_null(cts_export_format("b.bmp"));
    assert_null(cts_export_format("a.png/b"));
    assert_null(cts_export_format("b"));
    assert_int_equal(cts_export_check("b.bmp", &plain, &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, ".png"));
    snprintf(path, sizeof path, "%s/none/a.png", folder);
    assert_int_equal(cts_export_check(path, &plain, &err), CTS_ERR_OUTPUT);
    assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, path, &plain, NULL, NULL, &err), CTS_ERR_OUTPUT);
    snprintf(path, sizeof path, "%s/a.png", folder);
    const CtsPicture *two[] = {p, p};
    assert_int_equal(cts_export(two, 2, path, &plain, NULL, NULL, &err), CTS_ERR_USAGE);
    assert_int_equal(count_files(folder), 0);
    /* An existing file stays as it is unless forced. */
    put_file(path, "old", 3);
    assert_int_equal(cts_export_check(path, &plain, &err), CTS_ERR_OUTPUT);
    assert_int_equal(cts_export(two, 1, path, &plain, NULL, NULL, &err), CTS_ERR_OUTPUT);
    size_t n;
    uint8_t *bytes = slurp(path, &n);
    assert_true(n == 3 && memcmp(bytes, "old", 3) == 0);
    free(bytes);
    const CtsExportSettings force = {.force = true};
    assert_int_equal(cts_export_check(path, &force, &err), CTS_OK);
    assert_int_equal(cts_export(two, 1, path, &force, NULL, NULL, &err), CTS_OK);
    assert_int_equal(count_files(folder), 1);
    cts_picture_free(&p);
    remove_folder(folder);
}

/* The disk fills up after any number of bytes: an error, and nothing is left behind. */
static void fail_when_full(const char *ending)
{
    char folder[64], path[100];
    CtsError err;
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.%s", folder, ending);
    CtsPicture *p = make_picture(120, 90, 4, true);
    uint64_t whole = 0;
    assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, path, &plain, &whole, NULL, &err), CTS_OK);
    unlink(path);
    struct rlimit before, limit;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, SIG_IGN);
    for (uint64_t room = 0; room < whole; room += whole / 23 + 1) {
        limit = before;
        limit.rlim_cur = room;
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
        const CtsStatus st = cts_export(&(const CtsPicture *){p}, 1, path, &plain, NULL, NULL, &err);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
        assert_int_equal(st, CTS_ERR_OUTPUT);
        assert_non_null(strstr(err.text, path));
        assert_int_equal(count_files(folder), 0);
    }
    cts_picture_free(&p);
    remove_folder(folder);
}

static void test_png_full(void **state)
{
    fail_when_full("png");
}

static void test_exr_full(void **state)
{
    fail_when_full("exr");
}

static void test_no_picture(void **state)
{
    char folder[64], path[100];
    CtsPicture *p;
    CtsError err;
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.png", folder);
    assert_int_equal(cts_picture_read(path, &p, &err), CTS_ERR_READ);
    put_file(path, "", 0);
    assert_int_equal(cts_picture_read(path, &p, &err), CTS_ERR_READ);
    put_file(path, "hello, world", 12);
    assert_int_equal(cts_picture_read(path, &p, &err), CTS_ERR_READ);
    assert_int_equal(cts_picture_read(folder, &p, &err), CTS_ERR_READ);
    remove_folder(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_png_round_trip),
        cmocka_unit_test(test_bands),
        cmocka_unit_test(test_png_bytes),
        cmocka_unit_test(test_png_metadata),
        cmocka_unit_test(test_png_foreign),
        cmocka_unit_test(test_png_cut),
        cmocka_unit_test(test_png_promises_too_much),
        cmocka_unit_test(test_check),
        cmocka_unit_test(test_png_full),
        cmocka_unit_test(test_exr_round_trip),
        cmocka_unit_test(test_exr_camera),
        cmocka_unit_test(test_exrheader),
        cmocka_unit_test(test_exr_cut),
        cmocka_unit_test(test_exr_full),
        cmocka_unit_test(test_no_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
