/* Pictures in memory: rounding, curves, blending, samples. */
#include "output/image/describe.h"
#include "output/image/samples.h"
#include "pictures.h"
#include <locale.h>

static void test_rounding(void **state)
{
    const struct {
        double v;
        int v16, v8;
    } cases[] = {
        {0, 0, 0},
        {1, 65535, 255},
        {0.5, 32768, 128},
        {-0.25, 0, 0},
        {1.75, 65535, 255},
        {NAN, 0, 0},
        {INFINITY, 65535, 255},
        {-INFINITY, 0, 0},
        {0.4999 / 65535, 0, 0},
        {0.5001 / 65535, 1, 0},
        {0.5001 / 255, 129, 1},
        {1 - 0.4999 / 65535, 65535, 255},
        {1 - 0.5001 / 65535, 65534, 255},
        {0.25, 16384, 64},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(cts_round16(cases[i].v), cases[i].v16);
        assert_int_equal(cts_round8(cases[i].v), cases[i].v8);
    }
    for (int k = 0; k <= 65535; k++)
        assert_int_equal(cts_round16(k / 65535.0), k);
}

/* Values of the curve worked out by hand from IEC 61966-2-1. */
static void test_curves(void **state)
{
    const double pairs[][2] = {{0, 0},
                               {1, 1},
                               {0.04045, 0.0031308},
                               {0.5, 0.21404114},
                               {0.2, 0.03310477},
                               {0.02, 0.02 / 12.92},
                               {0.7353569830524495, 0.5}};
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        assert_true(fabs(cts_srgb_to_linear(pairs[i][0]) - pairs[i][1]) < 1e-7);
        assert_true(fabs(cts_linear_to_srgb(pairs[i][1]) - pairs[i][0]) < 1e-6);
    }
    for (double v = 0; v < 2; v += 1.0 / 512)
        assert_true(fabs(cts_linear_to_srgb(cts_srgb_to_linear(v)) - v) < 1e-6);
    assert_true(cts_srgb_to_linear(-0.5) == 0 && cts_linear_to_srgb(-0.5) == 0);
    assert_true(cts_srgb_to_linear(NAN) == 0 && cts_linear_to_srgb(NAN) == 0);
}

static void test_new(void **state)
{
    CtsPicture *p = NULL;
    CtsError err;
    const int bad[][3] = {{0, 5, 4}, {5, 0, 4}, {-1, 5, 4}, {32769, 1, 4}, {1, 32769, 1}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(cts_picture_new(&p, bad[i][0], bad[i][1], bad[i][2], &err), CTS_ERR_USAGE);
        assert_null(p);
    }
    assert_int_equal(cts_picture_new(&p, 5, 5, 3, &err), CTS_ERR_INTERNAL);
    assert_int_equal(cts_picture_new(&p, 32768, 1, 4, &err), CTS_OK);
    assert_true(p->has_alpha);
    for (int i = 0; i < 4 * 32768; i++)
        assert_true(p->pixels[i] == 0);
    cts_picture_free(&p);
    assert_null(p);
    cts_picture_free(&p);
}

static void test_over(void **state)
{
    CtsPicture *p = NULL;
    CtsError err;
    assert_int_equal(cts_picture_new(&p, 3, 1, 4, &err), CTS_OK);
    const float pixels[] = {0, 0, 0, 0, 0.25f, 0.125f, 0, 0.5f, 1.5f, 0.5f, 0.25f, 1};
    memcpy(p->pixels, pixels, sizeof pixels);
    cts_picture_over(p, (const double[]){1, 0.5, 0.25}, 2);
    const float expected[] = {1, 0.5f, 0.25f, 1, 0.75f, 0.375f, 0.125f, 1, 1.5f, 0.5f, 0.25f, 1};
    assert_memory_equal(p->pixels, expected, sizeof expected);
    assert_false(p->has_alpha);
    cts_picture_free(&p);
}

static void test_grey(void **state)
{
    CtsPicture *colour = make_picture(8, 6, 4, false), *grey = make_picture(8, 6, 1, false);
    assert_false(cts_picture_is_grey(colour));
    assert_true(cts_picture_is_grey(grey));
    for (int i = 0; i < 48; i++)
        colour->pixels[4 * i + 1] = colour->pixels[4 * i + 2] = colour->pixels[4 * i];
    assert_true(cts_picture_is_grey(colour));
    colour->pixels[4 * 47 + 2] += 1e-3f;
    assert_false(cts_picture_is_grey(colour));
    cts_picture_free(&colour);
    cts_picture_free(&grey);
}

static void test_samples(void **state)
{
    CtsPicture *p = NULL;
    CtsError err;
    assert_int_equal(cts_picture_new(&p, 3, 1, 4, &err), CTS_OK);
    const float pixels[] = {0.25f, 0.125f, 0, 0.5f, 1e-6f, 1e-6f, 1e-6f, 1e-6f, 2, 0.5f, 0.25f, 1};
    memcpy(p->pixels, pixels, sizeof pixels);
    uint16_t row[12];
    cts_samples_row16(p, 0, 4, row);
    const uint16_t straight[] = {32768, 16384, 0, 32768, 0, 0, 0, 0, 65535, 32768, 16384, 65535};
    assert_memory_equal(row, straight, sizeof straight);
    cts_samples_row16(p, 0, 3, row);
    const uint16_t plain[] = {16384, 8192, 0, 0, 0, 0, 65535, 32768, 16384};
    assert_memory_equal(row, plain, sizeof plain);
    uint8_t row8[9];
    cts_samples_row8(p, 0, 3, row8);
    const uint8_t plain8[] = {64, 32, 0, 0, 0, 0, 255, 128, 64};
    assert_memory_equal(row8, plain8, sizeof plain8);
    cts_picture_free(&p);
}

static void test_describe(void **state)
{
    const struct {
        double azimuth_deg, elevation_deg;
        const char *text;
    } cases[] = {{0, 0, "anterior"}, {360, 0, "anterior"}, {180, 0, "posterior"},  {-180, 0, "posterior"},
                 {90, 0, "left"},    {-90, 0, "right"},    {270, 0, "right"},      {0, 90, "head"},
                 {0, -90, "feet"},   {-30, 20, "-30,20"},  {12.5, -0.0, "12.5,0"}, {90, 90, "90,90"}};
    /* A locale with a decimal comma must not reach the files; where it is not installed the test is the weaker. */
    setlocale(LC_ALL, "de_DE.UTF-8");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const CtsPictureInfo info = {.azimuth_deg = cases[i].azimuth_deg, .elevation_deg = cases[i].elevation_deg};
        assert_string_equal(cts_describe_view(&info).text, cases[i].text);
    }
    CtsPictureInfo info = {.mode = CTS_MODE_MIP, .window_low_hu = -100.5, .window_high_hu = 2100};
    assert_string_equal(cts_describe_window(&info).text, "-100.5,2100");
    info.mode = CTS_MODE_COMPOSITE;
    assert_string_equal(cts_describe_window(&info).text, "");
    setlocale(LC_ALL, "C");
}

static CtsPicture *constant(int width, int height, float v)
{
    CtsPicture *p = NULL;
    CtsError err;
    assert_int_equal(cts_picture_new(&p, width, height, 1, &err), CTS_OK);
    for (int i = 0; i < width * height; i++)
        p->pixels[i] = v;
    return p;
}

static CtsDifference compared(const CtsPicture *a, const CtsPicture *b)
{
    CtsDifference d;
    CtsError err;
    assert_int_equal(cts_picture_compare(a, b, &d, &err), CTS_OK);
    return d;
}

static void test_compare_equal(void **state)
{
    CtsPicture *a = make_picture(61, 47, 4, true), *b = make_picture(61, 47, 4, true);
    CtsDifference d = compared(a, b);
    assert_true(d.equal && d.rmse == 0 && isinf(d.psnr_db) && d.psnr_db > 0 && d.max == 0 && d.p999 == 0);
    assert_true(d.share == 0 && fabs(d.ssim - 1) < 1e-12);
    /* A change that clamping or three channels hide still is one. */
    b->pixels[4 * 1000 + 3] = nextafterf(b->pixels[4 * 1000 + 3], 2);
    d = compared(a, b);
    assert_true(!d.equal && d.rmse == 0);
    b->pixels[4 * 1000 + 3] = a->pixels[4 * 1000 + 3];
    a->pixels[0] = 1.5f;
    b->pixels[0] = 1.25f;
    d = compared(a, b);
    assert_true(!d.equal && d.rmse == 0);
    b->pixels[0] = NAN;
    d = compared(a, b);
    assert_true(!d.equal && d.max == 1);
    a->pixels[0] = NAN;
    assert_true(compared(a, b).equal);
    cts_picture_free(&a);
    cts_picture_free(&b);
}

/* Grey against the same grey as colour with and without alpha is equal. */
static void test_compare_kinds(void **state)
{
    CtsPicture *grey = make_picture(20, 30, 1, false), *colour = make_picture(20, 30, 4, true);
    for (int i = 0; i < 600; i++)
        for (int c = 0; c < 4; c++)
            colour->pixels[4 * i + c] = c < 3 ? grey->pixels[i] : 1;
    assert_true(compared(grey, colour).equal);
    colour->has_alpha = false;
    assert_true(compared(grey, colour).equal && compared(colour, grey).equal);
    CtsPicture *other = make_picture(20, 31, 1, false);
    CtsDifference d;
    CtsError err;
    assert_int_equal(cts_picture_compare(grey, other, &d, &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, "20x31"));
    cts_picture_free(&grey);
    cts_picture_free(&colour);
    cts_picture_free(&other);
}

/* Differences chosen, figures worked out: of 4000 pixels 3 differ by 0.5, 5 by 0.25, 40 by 1/256. */
static void test_compare_figures(void **state)
{
    CtsPicture *a = constant(80, 50, 0.25f), *b = constant(80, 50, 0.25f);
    for (int i = 0; i < 48; i++)
        b->pixels[(i * 1237) % 4000] += i < 3 ? 0.5f : i < 8 ? 0.25f : 1.0f / 256;
    CtsDifference d = compared(a, b);
    const double expected = sqrt((3 * 0.25 + 5 * 0.0625 + 40 / 65536.0) / 4000);
    assert_true(fabs(d.rmse - expected) < 1e-12);
    assert_true(fabs(d.psnr_db + 20 * log10(expected)) < 1e-9);
    assert_true(d.max == 0.5 && d.p999 == 0.25 && d.share == 8.0 / 4000);
    /* 4 of 4000 above the rest are 0.1 %: the percentile falls on the value below them. */
    for (int i = 3; i < 7; i++)
        b->pixels[(i * 1237) % 4000] = 0.25f;
    d = compared(a, b);
    assert_true(d.p999 == 1.0 / 256);
    cts_picture_free(&a);
    cts_picture_free(&b);
}

/* Two constant pictures leave only SSIM's luminance term; a sign flip about the mean turns the structure round. */
static void test_compare_ssim(void **state)
{
    const int sizes[][2] = {{40, 30}, {11, 11}, {3, 7}, {1, 1}, {50, 4}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        CtsPicture *a = constant(sizes[i][0], sizes[i][1], 0.5f), *b = constant(sizes[i][0], sizes[i][1], 0.75f);
        const double c1 = 1e-4, expected = (2 * 0.5 * 0.75 + c1) / (0.25 + 0.5625 + c1);
        assert_true(fabs(compared(a, b).ssim - expected) < 1e-9);
        cts_picture_free(&a);
        cts_picture_free(&b);
    }
    CtsPicture *a = constant(40, 40, 0), *b = constant(40, 40, 0);
    for (int y = 0; y < 40; y++)
        for (int x = 0; x < 40; x++) {
            const float v = (x + y) % 2 ? 0.75f : 0.25f;
            a->pixels[40 * y + x] = v;
            b->pixels[40 * y + x] = 1 - v;
        }
    /* The chessboard's windows have mean 0.5 and variance 0.0625 up to e = (sum of the weights'
     * signs)^2. */
    double sum = 0, signs = 0;
    for (int k = -5; k <= 5; k++) {
        const double weight = exp(-0.5 * k * k / 2.25);
        sum += weight;
        signs += k % 2 ? -weight : weight;
    }
    const double e = 0.25 * pow(signs / sum, 2), c1 = 1e-4, c2 = 9e-4, var = 0.0625 - e * e;
    const double expected = (2 * (0.5 + e) * (0.5 - e) + c1) * (-2 * var + c2) /
                            (((0.5 + e) * (0.5 + e) + (0.5 - e) * (0.5 - e) + c1) * (2 * var + c2));
    assert_true(fabs(compared(a, b).ssim - expected) < 1e-9);
    cts_picture_free(&a);
    cts_picture_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rounding),      cmocka_unit_test(test_curves),
        cmocka_unit_test(test_new),           cmocka_unit_test(test_over),
        cmocka_unit_test(test_grey),          cmocka_unit_test(test_samples),
        cmocka_unit_test(test_describe),      cmocka_unit_test(test_compare_equal),
        cmocka_unit_test(test_compare_kinds), cmocka_unit_test(test_compare_figures),
        cmocka_unit_test(test_compare_ssim),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
