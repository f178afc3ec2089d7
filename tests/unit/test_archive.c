/* Zip files as input: the same volume as the folder, and nothing that a bad one can do. */
#include "ctsplat/series.h"
#include "dicom_files.h"
#include <zip.h>

enum { N_SLICES = 6 };

static void add(zip_t *zip, const char *name, const void *bytes, size_t n, int method)
{
    void *copy = malloc(n + 1);
    assert_non_null(copy);
    memcpy(copy, bytes, n);
    zip_source_t *source = zip_source_buffer(zip, copy, n, 1);
    const zip_int64_t at = zip_file_add(zip, name, source, ZIP_FL_OVERWRITE);
    assert_true(at >= 0);
    assert_int_equal(zip_set_file_compression(zip, (zip_uint64_t)at, method, 0), 0);
}

/* A stack of slices, each under the name that format gives it. */
static void add_stack(zip_t *zip, const char *format, int method)
{
    for (int k = 0; k < N_SLICES; k++) {
        StackTexts t;
        char name[200];
        const Slice s = stack_slice(&t, k, -1, -2, 2 * k);
        Bytes b = slice_bytes(&s);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
        snprintf(name, sizeof name, format, k);
#pragma GCC diagnostic pop
        add(zip, name, b.data, b.n, method);
        free(b.data);
    }
}

static zip_t *new_zip(const char *folder, char path[80])
{
    snprintf(path, 80, "%s/in.zip", folder);
    zip_t *zip = zip_open(path, ZIP_CREATE | ZIP_TRUNCATE, NULL);
    assert_non_null(zip);
    return zip;
}

static CtsSeriesList *find(const char *path)
{
    CtsSeriesList *list = NULL;
    CtsError err = {0};
    if (cts_series_find(&path, 1, 2, &list, NULL, &err))
        fail_msg("%s", err.text);
    return list;
}

static void expect_stack(const CtsSeries *series)
{
    CtsVolume *v = NULL;
    CtsError err = {0};
    if (cts_series_load(series, 2, NULL, &v, NULL, &err))
        fail_msg("%s", err.text);
    assert_int_equal(v->dims[2], N_SLICES);
    for (int k = 0; k < N_SLICES; k++)
        assert_int_equal(v->grey[k * SLICE_ROWS * SLICE_COLUMNS], 1000 + 100 * k);
    cts_volume_free(&v);
}

static void test_sound(void **state)
{
    static const char *const formats[] = {"IM%d", "study/series/IM%d.dcm", "../../../../tmp/IM%d", "/etc/IM%d",
                                          "C:\\IM%d"};
    static const int methods[] = {ZIP_CM_STORE, ZIP_CM_DEFLATE};
    for (int f = 0; f < 5; f++)
        for (int m = 0; m < 2; m++) {
            char folder[64], path[80];
            make_folder(folder);
            zip_t *zip = new_zip(folder, path);
            add_stack(zip, formats[f], methods[m]);
            add(zip, "readme.txt", "Not a slice.\n", 13, methods[m]);
            assert_true(zip_dir_add(zip, "empty", 0) >= 0);
            assert_int_equal(zip_close(zip), 0);
            CtsSeriesList *list = find(path);
            assert_int_equal(list->n, 1);
            assert_int_equal(list->n_files, N_SLICES + 1);
            assert_int_equal(list->n_not_ct, 1);
            assert_int_equal(count_files(folder), 1); /* nothing is unpacked beside it */
            expect_stack(&list->items[0]);
            cts_series_list_free(&list);
            remove_folder(folder);
        }
}

static void expect_refused(const char *path, CtsStatus status, const char *part)
{
    CtsSeriesList *list = NULL;
    CtsError err = {0};
    const CtsStatus st = cts_series_find(&path, 1, 2, &list, NULL, &err);
    if (st != status || !strstr(err.text, part) || !strstr(err.text, "in.zip"))
        fail_msg("%d %s, wanted %d %s", st, err.text, status, part);
}

/* Zeros pack a thousand to one; a hundred and 64 MiB are let in. */
static void test_bomb(void **state)
{
    enum { ZEROS = 90 << 20 };
    char folder[64], path[80];
    uint8_t *zeros = calloc(1, ZEROS);
    assert_non_null(zeros);
    memcpy(zeros + 128, "DICM", 4);
    make_folder(folder);
    zip_t *zip = new_zip(folder, path);
    add(zip, "bomb", zeros, ZEROS, ZIP_CM_DEFLATE);
    assert_int_equal(zip_close(zip), 0);
    expect_refused(path, CTS_ERR_READ, "holds more than");
    remove_folder(folder);
    free(zeros);
}

/* A byte changed or the end truncated anywhere: the right volume, a reported member, or a refusal. */
static void test_damage(void **state)
{
    char folder[64], path[80];
    size_t n;
    make_folder(folder);
    zip_t *zip = new_zip(folder, path);
    add_stack(zip, "IM%d", ZIP_CM_DEFLATE);
    assert_int_equal(zip_close(zip), 0);
    uint8_t *good = slurp(path, &n), *bytes = malloc(n);
    assert_non_null(bytes);
    for (size_t i = 0; i < n; i += n / 60) {
        for (int cut = 0; cut < 2; cut++) {
            CtsSeriesList *list = NULL;
            CtsError err = {0};
            memcpy(bytes, good, n);
            bytes[i] ^= 0x41;
            write_bytes(folder, "in.zip", bytes, cut ? i : n);
            const char *named = path;
            if (cts_series_find(&named, 1, 1, &list, NULL, &err))
                assert_true(err.text[0]);
            else if (list->items[0].n_slices == N_SLICES && list->n_unreadable == 0)
                expect_stack(&list->items[0]);
            cts_series_list_free(&list);
        }
    }
    free(good);
    free(bytes);
    remove_folder(folder);
}

static void test_no_zip(void **state)
{
    char folder[64], path[80];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/in.zip", folder);
    static const char start[] = "PK\3\4 and no more than that";
    write_bytes(folder, "in.zip", start, sizeof start);
    expect_refused(path, CTS_ERR_READ, "no sound zip file");
    write_bytes(folder, "in.zip", "PK\5\6\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 22);
    expect_refused(path, CTS_ERR_NO_SERIES, "no CT, MR or PET slice");
    remove_folder(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sound),
        cmocka_unit_test(test_bomb),
        cmocka_unit_test(test_damage),
        cmocka_unit_test(test_no_zip),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
