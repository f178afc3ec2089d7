/* Numbers and texts by DICOM's grammar. */
#include "dicom/header/utf8.h"
#include "dicom/reader/reader.h"
#include "unit.h"
#include <stdlib.h>
#include <string.h>

static void test_decimal_strings(void **state)
{
    static const struct {
        const char *text;
        int n;
        double v[3];
    } good[] = {
        {"1", 1, {1}},
        {"-0.5", 1, {-0.5}},
        {"+116.44", 1, {116.44}},
        {" 2.5 ", 1, {2.5}},
        {"1e3", 1, {1000}},
        {"-1.5E-2", 1, {-0.015}},
        {".5", 1, {0.5}},
        {"5.", 1, {5}},
        {"0.4511718750000000000000", 1, {0.451171875}},
        {"1\\2\\3", 3, {1, 2, 3}},
        {"+1 \\ -2\\3 ", 3, {1, -2, 3}},
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        double v[3] = {0};
        if (!cts_parse_ds(good[i].text, strlen(good[i].text), v, good[i].n))
            fail_msg("%s is refused", good[i].text);
        for (int k = 0; k < good[i].n; k++)
            assert_true(v[k] == good[i].v[k]);
    }
    static const struct {
        const char *text;
        int n;
    } bad[] = {
        {"", 1},           {" ", 1},
        {"0,75", 1},       {"nan", 1},
        {"inf", 1},        {"-inf", 1},
        {"1e400", 1},      {"0x10", 1},
        {"1 mm", 1},       {"1 2", 1},
        {"--1", 1},        {"1.2.3", 1},
        {"1e", 1},         {"e5", 1},
        {".", 1},          {"1\\2", 1},
        {"1", 2},          {"1\\\\3", 3},
        {"1\\2\\", 3},     {"1\\2\\3\\4", 3},
        {"0,75\\0,75", 2}, {"+-1", 1},
        {"1_000", 1},      {"\t1", 1},
        {"infinity", 1},   {"0.00000000000000000000000000000000000000000000000000000000000000001", 1},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        double v[4];
        if (cts_parse_ds(bad[i].text, strlen(bad[i].text), v, bad[i].n))
            fail_msg("%s is taken for %d numbers", bad[i].text, bad[i].n);
    }
}

static void test_integer_strings(void **state)
{
    int v = 0;
    assert_true(cts_parse_is("12", 2, &v) && v == 12);
    assert_true(cts_parse_is("-12 ", 4, &v) && v == -12);
    assert_true(cts_parse_is(" +7", 3, &v) && v == 7);
    static const char *const bad[] = {"", "14.5", "abc", "1e3", "99999999999", "1\\2", "+", "-", "+-1", "0x1"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_false(cts_parse_is(bad[i], strlen(bad[i]), &v));
}

static void expect_text(const char *text, const char *charset, const char *wanted)
{
    char *got = cts_dcm_utf8(text, charset);
    assert_non_null(got);
    assert_string_equal(got, wanted);
    free(got);
}

static void test_texts(void **state)
{
    expect_text("Kopf nativ", "", "Kopf nativ");
    expect_text("Sch\xe4"
                "del",
                "ISO_IR 100",
                "Sch\xc3\xa4"
                "del");
    expect_text("Sch\xc3\xa4"
                "del",
                "ISO_IR 192",
                "Sch\xc3\xa4"
                "del");
    expect_text("Sch\xe4"
                "del",
                "", "Sch?del");
    expect_text("\xbf\xe0\xd8\xd2\xd5\xe2", "ISO_IR 144", "\xd0\x9f\xd1\x80\xd0\xb8\xd0\xb2\xd0\xb5\xd1\x82");
    expect_text("ab \x1b-L\xbf\xe0 \x1b-A\xe4", "ISO 2022 IR 100\\ISO 2022 IR 144", "ab \xd0\x9f\xd1\x80 \xc3\xa4");
    expect_text("\xd4\xcf\xc0\xde^", "ISO_IR 13", "\xef\xbe\x94\xef\xbe\x8f\xef\xbe\x80\xef\xbe\x9e^");
    expect_text("\xd4=\x1b$B;3ED\x1b(J^\x1b$B<\x1b(Jx", "ISO 2022 IR 13\\ISO 2022 IR 87", "?=?$B;3ED?(J^?$B<?(Jx");
    expect_text("\xd4=\x1b$B;3ED\x1b(J^x", "ISO 2022 IR 13\\ISO 2022 IR 87", "\xef\xbe\x94=\xe5\xb1\xb1\xe7\x94\xb0^x");
    expect_text("Hong^\x1b$)C\xb1\xe6", "\\ISO 2022 IR 149", "Hong^\xea\xb8\xb8");
    expect_text("\xcd\xf5", "GB18030", "\xe7\x8e\x8b");
    expect_text("Sch\xe4", "ISO_IR 6", "Sch?");
    expect_text("a\x1b[31mb\nc\x7f", "", "a?[31mb?c?");
    expect_text("a\xe2\x80\xae"
                "b\xe2\x80\xa8"
                "c",
                "ISO_IR 192", "a?b?c");
    expect_text("\xc0\xaf\xed\xa0\x80", "ISO_IR 192", "?????");
    char *got = cts_dcm_utf8("%n%s", "NO SUCH SET");
    assert_string_equal(got, "%n%s");
    free(got);
    char longer[200];
    memset(longer, 'x', sizeof longer);
    longer[199] = 0;
    got = cts_dcm_utf8(longer, "");
    assert_int_equal(strlen(got), 64);
    free(got);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_decimal_strings),
        cmocka_unit_test(test_integer_strings),
        cmocka_unit_test(test_texts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
