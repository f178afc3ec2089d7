/* Elements as the reader passes them on: values of each kind, and records with anything in them. */
#include "dicom/header/elements.h"
#include "dicom/reader/reader.h"
#include "dicom_files.h"

enum { ROOM = 1 << 14 };

/* The records of a data set, which stay in `answer`. */
static CtsElements read_elements(const Bytes *data, uint64_t *answer)
{
    const CtsReaderOrder order = {.task = CTS_READER_OBJECT, .n_files = 1, .max_header = CTS_MAX_HEADER_BYTES};
    const CtsHeaderItem item = {sizeof item, data->n, data->n};
    Bytes stream = {0};
    CtsError err = {0};
    put(&stream, &item, sizeof item);
    put(&stream, data->data, data->n);
    assert_int_equal(cts_reader_prepare(&err), CTS_OK);
    assert_int_equal(cts_reader_answer(&order, stream.data, stream.n, answer, ROOM, &err), CTS_OK);
    free(stream.data);
    const CtsHeaderAnswer *const a = (const CtsHeaderAnswer *)answer;
    if (a->result != CTS_HEADER_DONE)
        fail_msg("result %u: %s", a->result, a->why);
    const uint8_t *const at = (const uint8_t *)answer + a->at;
    return (CtsElements){at, at + a->n};
}

static Bytes sample(void)
{
    const Slice s = sound_slice();
    Bytes b = {0}, item = {0}, sequence = {0};
    put_meta(&b, &s);
    put_text(&b, 0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.66.4");
    put_text(&item, 0x00080100, "SH", " T-D0050 ");
    put_us(&item, 0x00620004, 7);
    put_tag(&sequence, 0xFFFEE000);
    put32(&sequence, (uint32_t)item.n);
    put(&sequence, item.data, item.n);
    put_element(&b, 0x00082218, "SQ", sequence.data, (uint32_t)sequence.n);
    put_text(&b, 0x00200032, "DS", "1.5\\-2\\3e1");
    put_text(&b, 0x00201002, "IS", "-12");
    put_text(&b, 0x00280008, "IS", "four");
    put_us(&b, 0x00280010, 512);
    put_element(&b, 0x00281201, "OW", "\1\2\3\4", 4);
    put_element(&b, 0x00730010, "UN", "ab", 2);
    free(item.data);
    free(sequence.data);
    return b;
}

static void test_kinds(void **state)
{
    uint64_t answer[ROOM / 8];
    const Bytes b = sample();
    const CtsElements e = read_elements(&b, answer);
    char text[65];
    double values[3];
    int value;
    assert_true(cts_elements_text(e, CTS_TAG_META_CLASS, text, sizeof text));
    assert_string_equal(text, "1.2.840.10008.5.1.4.1.1.2");
    assert_true(cts_elements_text(cts_elements_item(e, 0x00082218), 0x00080100, text, sizeof text));
    assert_string_equal(text, "T-D0050");
    assert_true(cts_elements_integer(cts_elements_item(e, 0x00082218), 0x00620004, &value) && value == 7);
    assert_true(cts_elements_decimals(e, 0x00200032, values, 3));
    assert_true(values[0] == 1.5 && values[1] == -2 && values[2] == 30);
    assert_false(cts_elements_decimals(e, 0x00200032, values, 2));
    assert_true(cts_elements_integer(e, 0x00201002, &value) && value == -12);
    assert_false(cts_elements_integer(e, 0x00280008, &value));
    assert_true(cts_elements_text(e, 0x00280008, text, sizeof text) && !strcmp(text, "four"));
    assert_true(cts_elements_shorts(e, 0x00280010, &value, 1) && value == 512);
    const CtsElements words = cts_elements_find(e, 0x00281201);
    assert_int_equal(words.end - words.at, 4);
    assert_memory_equal(words.at, "\1\2\3\4", 4);
    assert_true(cts_elements_text(e, 0x00730010, text, sizeof text) && !strcmp(text, "ab"));
    assert_false(cts_elements_text(e, 0x00100010, text, sizeof text));
    free(b.data);
}

/* Counts elements at any depth. */
static int count(CtsElements e)
{
    CtsElement one;
    CtsElements item;
    int n = 0;
    while (cts_elements_next(&e, &one)) {
        n++;
        while (one.kind == CTS_VALUE_ITEMS && cts_items_next(&one.value, &item))
            n += count(item);
    }
    return n;
}

/* A reader that was taken over may write any byte: nothing beyond the records is read (which sanitizers see). */
static void test_any_bytes(void **state)
{
    uint64_t answer[ROOM / 8];
    const Bytes b = sample();
    const CtsElements sound = read_elements(&b, answer);
    const size_t n = (size_t)(sound.end - sound.at);
    assert_int_equal(count(sound), 11);
    for (size_t i = 0; i < n; i++)
        for (int bit = 0; bit < 9; bit++) {
            uint8_t *const copy = malloc(n);
            char text[17];
            double values[3];
            memcpy(copy, sound.at, n);
            copy[i] = (uint8_t)(bit < 8 ? copy[i] ^ 1 << bit : 0xFF);
            const CtsElements e = {copy, copy + n};
            assert_in_range(count(e), 0, 11);
            cts_elements_text(e, 0x00080016, text, sizeof text);
            cts_elements_decimals(e, 0x00200032, values, 3);
            free(copy);
        }
    free(b.data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_kinds), cmocka_unit_test(test_any_bytes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
