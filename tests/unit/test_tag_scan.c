/* The framing of files, sound and broken: where the pixels are, how deep it nests, and that nothing is believed. */
#include "dicom/header/header_answer.h"
#include "dicom/reader/tag_scan.h"
#include "dicom_files.h"

static const CtsSyntax *explicit_le(void)
{
    return cts_syntax_native(true, false);
}

static CtsScanResult scan(const Bytes *b, const CtsSyntax *syntax, CtsDataScan *found)
{
    return cts_scan_data(b->data, b->n, b->n, 0, syntax, CTS_MAX_HEADER_BYTES, found);
}

static void put_pixel_tag(Bytes *b)
{
    put_element(b, 0x7FE00010, "OW", "\1\2\3\4", 4);
}

static void test_whole_file(void **state)
{
    const Slice s = sound_slice();
    const Bytes b = slice_bytes(&s);
    const size_t pixel_bytes = SLICE_ROWS * SLICE_COLUMNS * 2;
    CtsMetaScan meta;
    CtsDataScan data;
    assert_int_equal(cts_scan_meta(b.data, b.n, b.n, &meta), CTS_SCAN_DONE);
    assert_true(meta.has_preamble);
    assert_string_equal(meta.syntax_uid, "1.2.840.10008.1.2.1");
    assert_string_equal(meta.sop_class_uid, "1.2.840.10008.5.1.4.1.1.2");
    assert_int_equal(cts_scan_data(b.data, b.n, b.n, meta.data_offset, explicit_le(), CTS_MAX_HEADER_BYTES, &data),
                     CTS_SCAN_DONE);
    assert_true(data.pixels.found && !data.pixels.encapsulated && data.pixels.are_words);
    assert_int_equal(data.pixels.n_bytes, pixel_bytes);
    assert_int_equal(data.pixels.offset, b.n - pixel_bytes);
    assert_int_equal(data.header_end, data.pixels.offset - 12);
    /* However few bytes are at hand, the answer is the same or a wish for more, and the wish can be met. */
    for (size_t n = meta.data_offset; n < b.n; n++) {
        CtsDataScan part;
        const CtsScanResult result =
            cts_scan_data(b.data, n, b.n, meta.data_offset, explicit_le(), CTS_MAX_HEADER_BYTES, &part);
        assert_true(result == CTS_SCAN_MORE ? part.need > n && part.need <= b.n + 12
                                            : part.pixels.offset == data.pixels.offset);
    }
    /* A truncated file is never accepted as complete. */
    for (size_t n = 0; n < data.pixels.offset; n++) {
        CtsDataScan part;
        CtsMetaScan first;
        uint8_t *copy = malloc(n ? n : 1);
        memcpy(copy, b.data, n);
        if (cts_scan_meta(copy, n, n, &first) == CTS_SCAN_DONE &&
            cts_scan_data(copy, n, n, first.data_offset, explicit_le(), CTS_MAX_HEADER_BYTES, &part) == CTS_SCAN_DONE)
            assert_false(part.pixels.found);
        free(copy);
    }
    free(b.data);
}

/* A data set without pixels ends with its last value, which has to be at hand as a whole. */
static void test_last_value(void **state)
{
    Bytes b = {0};
    uint8_t value[600] = {0};
    CtsDataScan found;
    put_text(&b, 0x00080016, "UI", "1.2.3");
    put_element(&b, 0x00091010, "OB", value, sizeof value);
    for (size_t n = 0; n < b.n; n++) {
        assert_int_equal(cts_scan_data(b.data, n, b.n, 0, explicit_le(), CTS_MAX_HEADER_BYTES, &found), CTS_SCAN_MORE);
        assert_true(found.need > n && found.need <= b.n + 12);
    }
    assert_int_equal(scan(&b, explicit_le(), &found), CTS_SCAN_DONE);
    assert_int_equal(found.header_end, b.n);
    free(b.data);
}

static void test_strangers(void **state)
{
    CtsMetaScan meta;
    static const char *const texts[] = {"",
                                        "x",
                                        "hello, this is no DICOM file at all",
                                        "<html><body>404</body></html>",
                                        "\x1f\x8b\x08\0\0\0\0\0\0\3",
                                        "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"};
    static const size_t sizes[] = {0, 1, 35, 29, 10, 16};
    for (size_t i = 0; i < 6; i++)
        assert_int_equal(cts_scan_meta((const uint8_t *)texts[i], sizes[i], sizes[i], &meta), CTS_SCAN_NOT_DICOM);
    uint8_t zeros[200] = {0};
    assert_int_equal(cts_scan_meta(zeros, sizeof zeros, sizeof zeros, &meta), CTS_SCAN_NOT_DICOM);
    memcpy(zeros + 128, "DICM", 4); /* a preamble and nothing behind it */
    assert_int_equal(cts_scan_meta(zeros, 132, 132, &meta), CTS_SCAN_DONE);
    assert_string_equal(meta.syntax_uid, "");
}

static void test_guess(void **state)
{
    assert_ptr_equal(cts_scan_guess((const uint8_t *)"\x08\0\x08\0CS\4\0", 8), cts_syntax_native(true, false));
    assert_ptr_equal(cts_scan_guess((const uint8_t *)"\x08\0\x08\0\4\0\0\0", 8), cts_syntax_native(false, false));
    assert_ptr_equal(cts_scan_guess((const uint8_t *)"\0\x08\0\x08"
                                                     "CS\0\4",
                                    8),
                     cts_syntax_native(true, true));
    assert_null(cts_scan_guess((const uint8_t *)"\x08\0\x08\0\xff\xff\xff\x7f", 8));
    assert_null(cts_scan_guess((const uint8_t *)"\x08\0\x08\0CS\4", 7));
    assert_null(cts_scan_guess((const uint8_t *)"\x10\0\x08\0\4\0\0\0", 8));
    assert_null(cts_scan_guess((const uint8_t *)"\x08\0\x08\0\3\0\0\0", 8));
}

/* `depth` sequences in each other, of undefined length or exactly as long as they are. */
static Bytes nested(int depth, bool defined)
{
    Bytes inside = {0};
    put_text(&inside, 0x00081150, "UI", "1.2");
    for (int d = 0; d < depth; d++) {
        Bytes outer = {0};
        put_tag(&outer, 0x00081140);
        put(&outer, "SQ\0\0", 4);
        put32(&outer, defined ? (uint32_t)inside.n + 8 : UINT32_MAX);
        put_tag(&outer, 0xFFFEE000);
        put32(&outer, defined ? (uint32_t)inside.n : UINT32_MAX);
        put(&outer, inside.data, inside.n);
        if (!defined) {
            put_tag(&outer, 0xFFFEE00D);
            put32(&outer, 0);
            put_tag(&outer, 0xFFFEE0DD);
            put32(&outer, 0);
        }
        free(inside.data);
        inside = outer;
    }
    put_pixel_tag(&inside);
    return inside;
}

static void test_nesting(void **state)
{
    for (int defined = 0; defined < 2; defined++) {
        for (int depth = 1; depth <= 66; depth++) {
            CtsDataScan found;
            const Bytes b = nested(depth, defined);
            assert_int_equal(scan(&b, explicit_le(), &found), depth <= CTS_MAX_NESTING ? CTS_SCAN_DONE : CTS_SCAN_BAD);
            if (depth <= CTS_MAX_NESTING)
                assert_true(found.pixels.found && found.pixels.offset == b.n - 4);
            else
                assert_non_null(strstr(found.why, "64 deep"));
            free(b.data);
        }
    }
}

/* Implicit VR does not mark sequences: a probable one is entered, and left when it is none. */
static void test_implicit(void **state)
{
    const CtsSyntax *implicit = cts_syntax_native(false, false);
    Bytes deep = {0};
    put_tag(&deep, 0x00081150);
    put32(&deep, 2);
    put(&deep, "1", 2);
    for (int d = 0; d < 70; d++) {
        Bytes outer = {0};
        put_tag(&outer, 0x00081140);
        put32(&outer, (uint32_t)deep.n + 8);
        put_tag(&outer, 0xFFFEE000);
        put32(&outer, (uint32_t)deep.n);
        put(&outer, deep.data, deep.n);
        free(deep.data);
        deep = outer;
    }
    CtsDataScan found;
    assert_int_equal(scan(&deep, implicit, &found), CTS_SCAN_BAD);
    free(deep.data);
    Bytes b = {0};
    put_tag(&b, 0x00091010);
    put32(&b, 16);
    put(&b, "\xfe\xff\x00\xe0\xff\xff\xff\x10junkjunk", 16); /* begins like an item of 285 million bytes */
    put_tag(&b, 0x7FE00010);
    put32(&b, 4);
    put(&b, "\1\2\3\4", 4);
    assert_int_equal(scan(&b, implicit, &found), CTS_SCAN_DONE);
    assert_true(found.pixels.found && found.pixels.offset == b.n - 4);
    free(b.data);
}

/* A private sequence written as UN of undefined length is implicit inside (PS3.5 6.2.2). */
static void test_unknown_vr(void **state)
{
    Bytes b = {0};
    put_tag(&b, 0x00091010);
    put(&b, "UN\0\0", 4);
    put32(&b, UINT32_MAX);
    put_tag(&b, 0xFFFEE000);
    put32(&b, UINT32_MAX);
    put_tag(&b, 0x00091011);
    put32(&b, 6);
    put(&b, "abcdef", 6);
    put_tag(&b, 0xFFFEE00D);
    put32(&b, 0);
    put_tag(&b, 0xFFFEE0DD);
    put32(&b, 0);
    put_us(&b, 0x00280010, 5);
    put_pixel_tag(&b);
    CtsDataScan found;
    assert_int_equal(scan(&b, explicit_le(), &found), CTS_SCAN_DONE);
    assert_true(found.pixels.found && found.pixels.offset == b.n - 4);
    free(b.data);
}

/* An icon's pixels precede the image's, in a sequence. */
static void test_icon(void **state)
{
    Bytes b = {0};
    put_tag(&b, 0x00880200);
    put(&b, "SQ\0\0", 4);
    put32(&b, UINT32_MAX);
    put_tag(&b, 0xFFFEE000);
    put32(&b, UINT32_MAX);
    put_us(&b, 0x00280010, 64);
    put_tag(&b, 0x7FE00010);
    put(&b, "OB\0\0", 4);
    put32(&b, UINT32_MAX);
    for (int i = 0; i < 2; i++) {
        put_tag(&b, 0xFFFEE000);
        put32(&b, i ? 12 : 0);
        put(&b, "\xfe\xff\xdd\xe0 no end!", i ? 12 : 0); /* raw bytes that look like a delimiter */
    }
    put_tag(&b, 0xFFFEE0DD);
    put32(&b, 0);
    put_tag(&b, 0xFFFEE00D);
    put32(&b, 0);
    put_tag(&b, 0xFFFEE0DD);
    put32(&b, 0);
    put_pixel_tag(&b);
    CtsDataScan found;
    assert_int_equal(scan(&b, explicit_le(), &found), CTS_SCAN_DONE);
    assert_true(found.pixels.found && !found.pixels.encapsulated && found.pixels.offset == b.n - 4);
    free(b.data);
}

static void expect_bad(Bytes *b, const CtsSyntax *syntax, const char *why)
{
    CtsDataScan found;
    assert_int_equal(scan(b, syntax, &found), CTS_SCAN_BAD);
    if (!strstr(found.why, why))
        fail_msg("\"%s\" does not say \"%s\"", found.why, why);
    free(b->data);
    *b = (Bytes){0};
}

static void test_lies(void **state)
{
    Bytes b = {0};
    put_tag(&b, 0x00091010);
    put(&b, "OB\0\0", 4);
    put32(&b, 0x7FFFFF00);
    expect_bad(&b, explicit_le(), "longer than the file");
    put_text(&b, 0x00080008, "CS", "AXIAL");
    put_tag(&b, 0x00091010);
    put(&b, "LO", 2);
    put16(&b, 0xFFF0);
    expect_bad(&b, explicit_le(), "longer than the file");
    put_text(&b, 0x00080008, "CS", "AXIAL");
    expect_bad(&b, cts_syntax_native(false, false), "implicit");
    put_tag(&b, 0x00080008);
    put32(&b, 4);
    put(&b, "ABCD", 4);
    expect_bad(&b, explicit_le(), "explicit");
    put_us(&b, 0x00280010, 512);
    put_us(&b, 0x00280010, 256);
    put_pixel_tag(&b);
    expect_bad(&b, explicit_le(), "(0028,0010) occurs twice");
    put_tag(&b, 0x00081140);
    put(&b, "SQ\0\0", 4);
    put32(&b, UINT32_MAX);
    put_us(&b, 0x00280010, 512);
    expect_bad(&b, explicit_le(), "other than items");
    /* the same value twice is odd, and harmless */
    CtsDataScan found;
    put_us(&b, 0x00280010, 512);
    put_us(&b, 0x00280010, 512);
    put_pixel_tag(&b);
    assert_int_equal(scan(&b, explicit_le(), &found), CTS_SCAN_DONE);
    free(b.data);
}

/* Any byte may be wrong; the scan ends, and gives an offset of the pixels only inside the file. */
static void test_wrong_bytes(void **state)
{
    Bytes b = nested(3, true);
    Bytes second = nested(2, false);
    put(&b, second.data, second.n);
    for (size_t i = 0; i < b.n; i++)
        for (int bit = 0; bit < 9; bit++) {
            CtsDataScan found;
            uint8_t *copy = malloc(b.n);
            memcpy(copy, b.data, b.n);
            copy[i] = (uint8_t)(bit < 8 ? copy[i] ^ 1 << bit : 0xFF);
            if (cts_scan_data(copy, b.n, b.n, 0, explicit_le(), CTS_MAX_HEADER_BYTES, &found) == CTS_SCAN_DONE &&
                found.pixels.found)
                assert_true(found.pixels.offset <= b.n && found.header_end < found.pixels.offset);
            cts_scan_data(copy, b.n, b.n, 0, cts_syntax_native(false, false), CTS_MAX_HEADER_BYTES, &found);
            cts_scan_data(copy, b.n, b.n, 0, cts_syntax_native(true, true), CTS_MAX_HEADER_BYTES, &found);
            free(copy);
        }
    free(b.data);
    free(second.data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_whole_file),  cmocka_unit_test(test_last_value), cmocka_unit_test(test_strangers),
        cmocka_unit_test(test_guess),       cmocka_unit_test(test_nesting),    cmocka_unit_test(test_implicit),
        cmocka_unit_test(test_unknown_vr),  cmocka_unit_test(test_icon),       cmocka_unit_test(test_lies),
        cmocka_unit_test(test_wrong_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
