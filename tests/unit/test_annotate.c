/* Letters and scale bar: positions, length of the bar, unchanged pixels. */
#include "ctsplat/annotate.h"
#include "output/image/describe.h"
#include "output/image/letters.h"
#include "output/image/samples.h"
#include "pictures.h"

static CtsPicture *flat(int width, int height, int n_channels, float v, double mm_per_pixel)
{
    CtsPicture *p = make_picture(width, height, n_channels, false);
    for (size_t i = 0; i < (size_t)width * height * n_channels; i++)
        p->pixels[i] = v;
    for (size_t i = 0; n_channels == 4 && i < (size_t)width * height; i++)
        p->pixels[4 * i + 3] = 1;
    p->info.mm_per_pixel = mm_per_pixel;
    p->info.light_behind = v > 0.5f;
    return p;
}

/* Pixels of a rectangle that differ from v by more than 0.3. */
static int marked(const CtsPicture *p, float v, int x0, int y0, int x1, int y1)
{
    int n = 0;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            n += fabsf(p->pixels[((size_t)y * p->width + x) * p->n_channels] - v) > 0.3f;
    return n;
}

static void test_directions(void **state)
{
    const struct {
        double v[3];
        const char *text;
    } cases[] = {{{1, 0, 0}, "L"},       {{-1, 0, 0}, "R"},          {{0, 1, 0}, "P"},        {{0, -1, 0}, "A"},
                 {{0, 0, 1}, "H"},       {{0, 0, -2}, "F"},          {{0.87, -0.5, 0}, "LA"}, {{-0.5, -0.87, 0}, "AR"},
                 {{0.98, 0.2, 0}, "L"},  {{0.6, 0.5, -0.62}, "FLP"}, {{0, 0, 0}, ""},         {{0, 0.26, 0.966}, "HP"},
                 {{0, 0.25, 0.968}, "H"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_string_equal(cts_describe_direction(cases[i].v).text, cases[i].text);
}

/* Each edge has its letters in the middle, nothing else changes, and they are visible on black and white. */
static void test_letters(void **state)
{
    for (int k = 0; k < 2; k++) {
        const float v = (float)k;
        CtsError err;
        CtsPicture *p = flat(600, 400, 4, v, 0.5);
        assert_int_equal(cts_annotate(p, true, false, NULL, &err), CTS_OK);
        const int left = marked(p, v, 0, 160, 60, 240), right = marked(p, v, 540, 160, 600, 240);
        const int top = marked(p, v, 260, 0, 340, 60), bottom = marked(p, v, 260, 340, 340, 400);
        assert_true(left > 10 && right > 10 && top > 10 && bottom > 10);
        assert_int_equal(marked(p, v, 0, 0, 600, 400), left + right + top + bottom);
        for (int i = 0; i < 600 * 400; i++)
            assert_true(p->pixels[4 * i + 3] == 1);
        assert_true(cts_picture_is_grey(p));
        cts_picture_free(&p);
    }
}

/* Marks on white are those on black, turned round: neither is the fainter. */
static void test_white(void **state)
{
    CtsError err;
    CtsPicture *black = flat(600, 400, 1, 0, 0.5), *white = flat(600, 400, 1, 1, 0.5);
    assert_int_equal(cts_annotate(black, true, true, NULL, &err), CTS_OK);
    assert_int_equal(cts_annotate(white, true, true, NULL, &err), CTS_OK);
    for (int i = 0; i < 600 * 400; i++)
        assert_true(fabsf(black->pixels[i] + white->pixels[i] - 1) < 1e-5f);
    cts_picture_free(&black);
    cts_picture_free(&white);
}

/* The bar's length agrees with its text, a round number near a fifth of the width. */
static void test_scale(void **state)
{
    const struct {
        int width;
        double mm_per_pixel, length_mm;
    } cases[] = {{400, 0.5, 50}, {400, 0.27, 20}, {1000, 0.1, 20}, {333, 0.013, 1}, {500, 3, 200}, {200, 0.025, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsError err;
        CtsPicture *p = flat(cases[i].width, 200, 1, 0, cases[i].mm_per_pixel);
        assert_int_equal(cts_annotate(p, false, true, NULL, &err), CTS_OK);
        double longest = 0;
        for (int y = 0; y < 200; y++) {
            double run = 0;
            for (int x = 0; x < cases[i].width; x++)
                run += p->pixels[y * cases[i].width + x] * 255 / 242;
            longest = fmax(longest, run);
        }
        /* The dark outline at both ends adds some 5 % of a pixel's light per pixel. */
        assert_true(fabs(longest - cases[i].length_mm / cases[i].mm_per_pixel) < 0.5);
        assert_int_equal(marked(p, 0, cases[i].width / 2, 0, cases[i].width, 200), 0);
        assert_int_equal(marked(p, 0, 0, 0, cases[i].width, 100), 0);
        cts_picture_free(&p);
    }
}

static void test_edges(void **state)
{
    CtsError err;
    const int sizes[][2] = {{1, 1}, {3, 90}, {90, 3}, {16, 16}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        CtsPicture *p = flat(sizes[i][0], sizes[i][1], 1, 0.5f, 0.5);
        assert_int_equal(cts_annotate(p, true, true, NULL, &err), CTS_OK);
        cts_picture_free(&p);
    }
    CtsPicture *p = flat(100, 100, 4, 0, 0);
    assert_int_equal(cts_annotate(p, false, true, NULL, &err), CTS_ERR_USAGE);
    assert_int_equal(cts_annotate(p, true, false, NULL, &err), CTS_OK);
    cts_picture_free(&p);
    /* On a transparent picture only the marks become opaque, with no colour beyond their alpha. */
    p = flat(100, 100, 4, 0, 0.5);
    p->has_alpha = true;
    memset(p->pixels, 0, 100 * 100 * 4 * sizeof(float));
    assert_int_equal(cts_annotate(p, true, true, NULL, &err), CTS_OK);
    int opaque = 0, clear = 0;
    for (int i = 0; i < 100 * 100; i++) {
        const float *v = p->pixels + 4 * i;
        opaque += v[3] == 1;
        clear += v[3] == 0;
        assert_true(v[0] <= v[3] && v[1] == v[0] && v[2] == v[0]);
    }
    assert_true(opaque > 50 && clear > 8000);
    cts_picture_free(&p);
}

/* Drawn band by band it is the same. */
static void test_bands(void **state)
{
    CtsError err;
    CtsPicture *whole = flat(300, 500, 4, 0.4f, 0.5), *cut = flat(300, 500, 4, 0.4f, 0.5);
    assert_int_equal(cts_annotate(whole, true, true, NULL, &err), CTS_OK);
    for (int y = 0; y < 500; y += CTS_BAND_ROWS) {
        CtsPicture band = *cut;
        band.first_row = y;
        band.height = 500 - y < CTS_BAND_ROWS ? 500 - y : CTS_BAND_ROWS;
        band.pixels += (size_t)y * 300 * 4;
        assert_int_equal(cts_annotate(&band, true, true, NULL, &err), CTS_OK);
    }
    assert_memory_equal(whole->pixels, cut->pixels, (size_t)300 * 500 * 4 * sizeof(float));
    cts_picture_free(&whole);
    cts_picture_free(&cut);
}

/* Marks without room are left out and counted: none is drawn over another mark or cut off. */
static void test_no_room(void **state)
{
    const struct {
        int width, height, n_left_out;
    } cases[] = {{200, 200, 0}, {100, 100, 0}, {64, 64, 1}, {16384, 1, 5}, {1, 1, 5}, {1, 3000, 5}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsError err;
        int n_left_out;
        CtsPicture *p = flat(cases[i].width, cases[i].height, 1, 0, 0.5);
        assert_int_equal(cts_annotate(p, true, true, &n_left_out, &err), CTS_OK);
        assert_int_equal(n_left_out, cases[i].n_left_out);
        if (n_left_out == 5)
            assert_int_equal(marked(p, 0, 0, 0, p->width, p->height), 0);
        cts_picture_free(&p);
    }
}

/* Names appear in their colours, by bands as in the whole picture; in a picture without room they are left out. */
static void legend(void **state)
{
    const CtsLegendEntry entries[] = {{"liver", 1, {1, 0, 0}}, {"a_b-c.1+2", 2, {0, 0, 1}}};
    CtsPicture *whole = NULL, *band = NULL;
    CtsError err;
    int n_left_out = -1, n_red = 0, n_blue = 0;
    assert_int_equal(cts_picture_new(&whole, 200, 160, 4, &err), CTS_OK);
    assert_int_equal(cts_annotate_legend(whole, entries, 2, NULL, &n_left_out, &err), CTS_OK);
    assert_int_equal(n_left_out, 0);
    assert_true(whole->info.annotated);
    for (int i = 0; i < 200 * 160; i++) {
        const float *p = whole->pixels + 4 * i;
        n_red += p[0] > 0.9F && p[1] < 0.1F && p[2] < 0.1F;
        n_blue += p[2] > 0.9F && p[0] < 0.1F && p[1] < 0.1F;
    }
    assert_true(n_red > 20 && n_blue > 20);
    assert_int_equal(cts_picture_new(&band, 200, 10, 4, &err), CTS_OK);
    band->first_row = 10;
    band->whole_height = 160;
    assert_int_equal(cts_annotate_legend(band, entries, 2, NULL, NULL, &err), CTS_OK);
    assert_memory_equal(band->pixels, whole->pixels + 4 * 10 * 200, 4 * 10 * 200 * sizeof *band->pixels);
    cts_picture_free(&band);
    cts_picture_free(&whole);
    assert_int_equal(cts_picture_new(&whole, 20, 20, 4, &err), CTS_OK);
    assert_int_equal(cts_annotate_legend(whole, entries, 2, NULL, &n_left_out, &err), CTS_OK);
    assert_int_equal(n_left_out, 2);
    cts_picture_free(&whole);
}

/* Drawn letters as a text for comparison: base letters with their accents. */
static void check_drawn(const char *text, const char *alike, bool lacks)
{
    CtsLetters a = {.n = 0}, b = {.n = 0};
    cts_letters_add(text, &a);
    cts_letters_add(alike, &b);
    if (a.lacks != lacks || b.lacks || a.n != b.n || memcmp(a.items, b.items, (size_t)a.n * sizeof *a.items) != 0)
        fail_msg("%s: %d letters, lacking %d; as %s: %d letters, lacking %d", text, a.n, a.lacks, alike, b.n, b.lacks);
}

/* Latin with accents and Greek are drawn in capitals, composed or decomposed; names in other scripts are counted. */
static void letters_of_names(void **state)
{
    static const struct {
        const char *text, *alike;
        bool lacks;
    } cases[] = {{"Gr\u00f6\u00dfe", "GRO\u0308SSE", false},
                 {"\u03ae\u03c0\u03b1\u03c1", "H\u0301\u03a0AP", false},
                 {"\u03c3\u03c2\u0390", "\u03a3\u03a3I\u0308\u0301", false},
                 {"\u0105\u0142\u017c", "A\u0328Z\u0307", true},
                 {"ti\u1ebfng", "TING", true},
                 {"a  b ", "A B", false},
                 {"Lung, left (x=1)", "LUNG, LEFT (X=1)", false},
                 {"\u809d\u81d3", "", true},
                 {"\u809d liver", "LIVER", true},
                 {"\u043f\u0435\u0447\u0435\u043d\u044c", "", true},
                 {"a\xff\xe4z", "AZ", true}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        check_drawn(cases[i].text, cases[i].alike, cases[i].lacks);
    /* Latin-1 and Latin Extended-A, small letters like capitals; those that are no letter with an accent are left out.
     */
    static const uint16_t others[] = {0xC6,  0xD0,  0xD7,  0xD8,  0xDE,  0x110, 0x126, 0x131, 0x132,
                                      0x138, 0x13F, 0x141, 0x149, 0x14A, 0x152, 0x166, 0x17F};
    for (unsigned code = 0xC0; code < 0x180; code++) {
        const char text[] = {(char)(0xC0 | code >> 6), (char)(0x80 | (code & 0x3F)), 0};
        CtsLetters letters = {.n = 0};
        cts_letters_add(text, &letters);
        bool is_other = false;
        for (size_t i = 0; i < sizeof others / sizeof *others; i++)
            is_other |= code == others[i] || code == others[i] + (code < 0x100 ? 32u : 1u);
        if (!is_other && (letters.lacks || !letters.n || !letters.items[0].glyph))
            fail_msg("U+%04X is not drawn", code);
    }
}

/* One name drawn in a picture of its own; how many are in part. */
static int draw_name(const char *name, CtsPicture **picture)
{
    enum { WIDTH = 200, HEIGHT = 160 };
    const CtsLegendEntry entry = {name, 42, {1, 0, 0}};
    int n_in_part = -1, n_left_out = -1;
    assert_int_equal(cts_picture_new(picture, WIDTH, HEIGHT, 4, NULL), CTS_OK);
    assert_int_equal(cts_annotate_legend(*picture, &entry, 1, &n_in_part, &n_left_out, NULL), CTS_OK);
    assert_int_equal(n_left_out, 0);
    return n_in_part;
}

static bool same_picture(const char *name, const CtsPicture *picture)
{
    CtsPicture *other = NULL;
    const int n_in_part = draw_name(name, &other);
    const size_t n = sizeof(float) * 4 * (size_t)other->width * (size_t)other->height;
    const bool same = !n_in_part && !memcmp(other->pixels, picture->pixels, n);
    cts_picture_free(&other);
    return same;
}

/* Names that cannot be written whole have their number in front, and are counted. */
static void names_in_part(void **state)
{
    static const struct {
        const char *name, *alike;
        int n_in_part;
    } cases[] = {{"\u809d\u81d3", "42", 1},
                 {"\u809d liver", "42 liver", 1},
                 {"", "42", 1},
                 {"\u03ae\u03c0\u03b1\u03c1", "\u0389\u03a0\u0391\u03a1", 0}};
    static const char wide[] = "a name that is far longer than this picture is wide";
    CtsPicture *picture = NULL;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const int n = draw_name(cases[i].name, &picture);
        if (n != cases[i].n_in_part || !same_picture(cases[i].alike, picture))
            fail_msg("%s is not drawn as %s: %d names in part", cases[i].name, cases[i].alike, n);
        cts_picture_free(&picture);
    }
    assert_int_equal(draw_name(wide, &picture), 1);
    bool found = false;
    for (int n = 8; n < (int)sizeof wide && !found; n++) {
        char part[64];
        snprintf(part, sizeof part, "42 %.*s", n, wide);
        found = same_picture(part, picture);
    }
    assert_true(found);
    cts_picture_free(&picture);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(letters_of_names), cmocka_unit_test(names_in_part), cmocka_unit_test(legend),
        cmocka_unit_test(test_directions),  cmocka_unit_test(test_letters),  cmocka_unit_test(test_white),
        cmocka_unit_test(test_scale),       cmocka_unit_test(test_edges),    cmocka_unit_test(test_bands),
        cmocka_unit_test(test_no_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
