/* A header read from the tag scan alone says what DCMTK says of it. */
#define _GNU_SOURCE
#include "unit.h"

#include "input/header/dcm_read.h"
#include <ftw.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct File {
    uint8_t bytes[64 << 10]; /* the first of them */
    size_t n;
} File;

static int n_read, n_scanned;

static void load(File *file, const char *path)
{
    FILE *f = fopen(path, "rbe");
    assert_non_null(f);
    file->n = fread(file->bytes, 1, sizeof file->bytes, f);
    fclose(f);
}

static void expect_text(const char *a, const char *b)
{
    assert_string_equal(a ? a : "(none)", b ? b : "(none)");
}

static void expect_same(CtsSlice *a, CtsSlice *b)
{
    expect_text(a->sop_uid, b->sop_uid);
    expect_text(a->fault_text, b->fault_text);
    free(a->fault_text);
    free(b->fault_text);
    a->sop_uid = b->sop_uid = NULL; /* other texts are shared */
    a->fault_text = b->fault_text = NULL;
    assert_memory_equal(a, b, sizeof *a);
}

/* Both ways on one data set; returns whether the scan alone was enough. */
static bool compare(const uint8_t *bytes, CtsDataScan *scan, const CtsSyntax *syntax)
{
    CtsTexts texts = {0};
    CtsSlice by_scan, by_dcmtk, blind;
    char class_by_scan[65] = "", class_by_dcmtk[65] = "", no_class[65] = "";
    memset(&by_scan, 0, sizeof by_scan);
    memset(&by_dcmtk, 0, sizeof by_dcmtk);
    memset(&blind, 0, sizeof blind);
    const CtsStatus st =
        cts_dcm_read_header(bytes, scan->header_end, scan, syntax, &texts, class_by_scan, &by_scan, NULL);
    /* Without the data set's length DCMTK would find nothing. */
    cts_dcm_read_header(bytes, 0, scan, syntax, &texts, no_class, &blind, NULL);
    scan->repeats = true;
    assert_int_equal(
        st, cts_dcm_read_header(bytes, scan->header_end, scan, syntax, &texts, class_by_dcmtk, &by_dcmtk, NULL));
    assert_string_equal(class_by_scan, class_by_dcmtk);
    const bool scanned = blind.sop_uid && blind.sop_uid[0];
    cts_slice_clear(&blind);
    expect_same(&by_scan, &by_dcmtk);
    cts_texts_free(&texts);
    return scanned;
}

static bool scan_file(const File *file, CtsMetaScan *meta, CtsDataScan *scan, const CtsSyntax **syntax)
{
    if (cts_scan_meta(file->bytes, file->n, file->n, meta) != CTS_SCAN_DONE)
        return false;
    const CtsSyntax *named = cts_syntax_find(meta->syntax_uid);
    if (!named || named->deflated)
        return false;
    *syntax = cts_syntax_native(named->explicit_vr, named->big_endian);
    return cts_scan_data(file->bytes, file->n, UINT64_MAX, meta->data_offset, *syntax, scan) == CTS_SCAN_DONE;
}

static int visit(const char *path, const struct stat *info, int type, struct FTW *ftw)
{
    static File file;
    (void)info;
    (void)ftw;
    CtsMetaScan meta;
    CtsDataScan scan;
    const CtsSyntax *syntax;
    if (type != FTW_F)
        return 0;
    load(&file, path);
    if (!scan_file(&file, &meta, &scan, &syntax))
        return 0;
    scan.header_end -= meta.data_offset;
    n_read++;
    n_scanned += compare(file.bytes + meta.data_offset, &scan, syntax);
    return 0;
}

static void test_same(void **state)
{
    (void)state;
    assert_int_equal(nftw(getenv("CTS_TESTDATA"), visit, 16, FTW_PHYS), 0);
    assert_true(n_read > 50 && n_scanned > n_read / 2);
}

/* Values that DCMTK reads in a way of its own are left to it. */
static void test_odd(void **state)
{
    (void)state;
    static File file, odd;
    char path[512];
    CtsMetaScan meta;
    CtsDataScan scan;
    const CtsSyntax *syntax;
    uint32_t seed = 1;
    snprintf(path, sizeof path, "%s/phantom/IM0001.dcm", getenv("CTS_TESTDATA"));
    load(&file, path);
    assert_true(scan_file(&file, &meta, &scan, &syntax));
    const char with[] = {' ', '\0', '\\', '9', '.', 'U', '\x80', '\1'};
    for (int n = 0; n < 3000; n++) {
        odd = file;
        for (int change = 0; change < 1 + n % 2; change++) {
            seed = seed * 1664525u + 1013904223u;
            const CtsTagValue *value = &scan.values[(seed >> 8) % (uint32_t)scan.n_values];
            const size_t before = value->n_bytes && seed >> 31 ? 0 : 4, span = value->n_bytes + before;
            uint8_t *at = odd.bytes + meta.data_offset + value->offset - before + (seed >> 12) % span;
            *at = (uint8_t)with[(seed >> 20) % sizeof with];
        }
        CtsDataScan found;
        CtsMetaScan odd_meta;
        const CtsSyntax *odd_syntax;
        if (!scan_file(&odd, &odd_meta, &found, &odd_syntax))
            continue;
        found.header_end -= odd_meta.data_offset;
        compare(odd.bytes + odd_meta.data_offset, &found, odd_syntax);
    }
}

int main(void)
{
    if (!getenv("CTS_TESTDATA")) {
        puts("CTS_TESTDATA does not name the test data: skipped");
        return 77;
    }
    assert_int_equal(cts_dcm_start(NULL), CTS_OK);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same),
        cmocka_unit_test(test_odd),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
