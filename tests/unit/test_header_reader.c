/* Headers read by another process: many in few messages, and whatever that process does. */
#include "dicom/header/dicom_object.h"
#include "dicom/header/header_reader.h"
#include "dicom_files.h"

enum { N = 80 };

/* Reads N headers: that of file `bad` has the text `fault` as its description, the first n_long have 100 kB more. */
static void read_all(CtsHeaderReader *reader, const char *fault, int bad, int n_long, CtsHeaderRead read[N])
{
    static char name[] = "IM";
    static CtsFile files[N];
    static const uint8_t more[100000];
    Bytes bytes[N], extra = {0};
    put_element(&extra, 0x00091010, "OB", more, sizeof more);
    for (int i = 0; i < N; i++) {
        Slice s = sound_slice();
        CtsFileBytes file;
        size_t n;
        s.description = i == bad ? fault : "sound";
        s.extra = i < n_long ? &extra : NULL;
        bytes[i] = slice_bytes(&s);
        files[i] = (CtsFile){.path = name, .memory = bytes[i].data, .n_memory = bytes[i].n};
        read[i] = (CtsHeaderRead){0};
        assert_int_equal(cts_header_begin(reader, &files[i], &file, &n, NULL), CTS_OK);
        assert_true(cts_header_add(reader, &files[i], &file, n, &read[i]));
    }
    cts_header_finish(reader);
    for (int i = 0; i < N; i++)
        free(bytes[i].data);
    free(extra.data);
}

static void check_sound(CtsHeaderRead read[N], int bad)
{
    for (int i = 0; i < N; i++) {
        if (i != bad && (read[i].why.status || read[i].object.n_slices != 1 || read[i].object.slices[0]->fault ||
                         strcmp(read[i].object.slices[0]->description, "sound")))
            fail_msg("file %d: %s", i, read[i].why.text);
        cts_object_free(&read[i].object);
    }
}

static void test_long(void **state)
{
    CtsHeaderReader reader = {0};
    CtsHeaderRead read[N];
    for (int n_long = 0; n_long <= N; n_long += N / 4) {
        read_all(&reader, NULL, -1, n_long, read);
        check_sound(read, -1);
    }
    cts_header_reader_free(&reader);
}

/* A file that makes the reader crash, or give answers without sense, is refused by its name; no other one is. */
static void test_faults(void **state)
{
    static const struct {
        const char *fault, *why;
    } cases[] = {{"reader:c", "its reader "},   {"reader:m", "memory"},       {"reader:n", "without sense"},
                 {"reader:o", "without sense"}, {"reader:l", "more than 64"}, {"reader:t", "without sense"},
                 {"reader:s", "without sense"}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        CtsHeaderReader reader = {0};
        CtsHeaderRead read[N];
        const int bad = 37;
        read_all(&reader, cases[c].fault, bad, 0, read);
        if (!read[bad].why.status || !strstr(read[bad].why.text, cases[c].why))
            fail_msg("%s: status %d, %s", cases[c].fault, (int)read[bad].why.status, read[bad].why.text);
        check_sound(read, bad);
        cts_header_reader_free(&reader);
    }
}

/* An object is written or refused, whatever the writer does. */
static void test_writer(void **state)
{
    static const struct {
        CtsRecord record;
        char text[32];
    } uids[] = {{{0x00080016, CTS_VALUE_TEXT, 25}, "1.2.840.10008.5.1.4.1.1.7"},
                {{0x00080018, CTS_VALUE_TEXT, 25}, "1.2.3.4.5.6.7.8.9.10.11.1"}};
    static const struct {
        const char *fault;
        CtsStatus status;
        const char *why;
    } cases[] = {{"sound", CTS_OK, ""},
                 {"reader:c", CTS_ERR_OUTPUT, "its writer "},
                 {"reader:m", CTS_ERR_OUTPUT, "memory"},
                 {"reader:n", CTS_ERR_READ, "without sense"},
                 {"reader:o", CTS_ERR_READ, "without sense"},
                 {"reader:l", CTS_ERR_READ, "more than 64"}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        Slice s = sound_slice();
        s.description = cases[c].fault;
        Bytes bytes = slice_bytes(&s);
        const CtsSlice source = {.path = "IM", .memory = bytes.data, .file_bytes = bytes.n};
        const CtsReaderOrder order = {.n_records = sizeof uids, .syntax_number = 1, .body_side = true};
        CtsDicomObject object;
        CtsError err = {0};
        if (cts_dicom_object_make(&object, &source, order, (const uint8_t *)uids, &err) != cases[c].status ||
            !strstr(err.text, cases[c].why))
            fail_msg("%s: status %d, %s", cases[c].fault, (int)err.status, err.text);
        if (!cases[c].status) {
            assert_true(object.elements.end - object.elements.at > 132);
            assert_memory_equal(object.elements.at + 128, "DICM", 4);
        }
        cts_dicom_object_close(&object);
        free(bytes.data);
    }
}

static void test_missing_program(void **state)
{
    CtsHeaderReader reader = {0};
    CtsHeaderRead read[N];
    setenv("CTSPLAT_LIBEXEC", "/no/such/folder", 1);
    read_all(&reader, NULL, -1, 0, read);
    assert_int_equal(read[0].why.status, CTS_ERR_INTERNAL);
    assert_non_null(strstr(read[0].why.text, "ctsplat-dicom"));
    cts_header_reader_free(&reader);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_long), cmocka_unit_test(test_faults),
                                       cmocka_unit_test(test_writer), cmocka_unit_test(test_missing_program)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
