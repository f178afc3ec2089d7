#define _GNU_SOURCE
/* Limits on what is read: at each of them, and one beyond. */
#include "base/mem.h"
#include "dicom/scan.h"
#include "dicom/series_judge.h"
#include "dicom/tag_scan.h"
#include "dicom_files.h"
#include "folder.h"
#include <zlib.h>

/* A stack of invented slices; NULL members are what no judge looks at. */
static CtsSliceSet stack_of(int n, int side)
{
    static const uint8_t no_pixels;
    CtsSliceSet set = {malloc((size_t)n * sizeof *set.items), n};
    for (int k = 0; k < n; k++) {
        CtsSlice *s = set.items[k] = calloc(1, sizeof *s);
        assert_non_null(s);
        s->path = "IM";
        s->syntax_uid = s->sop_uid = s->series_uid = s->frame_uid = s->modality = s->stack_id = "";
        s->kind = CTS_OBJECT_CT;
        s->syntax = cts_syntax_native(true, false);
        s->rows = s->columns = side;
        s->bits_allocated = s->bits_stored = 16;
        s->high_bit = 15;
        s->padding_word = -1;
        s->slope = 1;
        s->row_spacing_mm = s->column_spacing_mm = 0.5;
        s->row_lps[0] = s->column_lps[1] = s->normal_lps[2] = 1;
        s->position_lps[2] = k;
        s->memory = &no_pixels;
        s->pixel_bytes = 2 * (uint64_t)side * (uint64_t)side;
    }
    return set;
}

static void clear(CtsSeries *series)
{
    for (int k = 0; k < series->n_slices; k++) {
        cts_slice_clear(series->slices[k]);
        free(series->slices[k]);
    }
    free(series->slices);
    free(series->description);
    cts_findings_free(&series->findings);
}

static void test_slices(void **state)
{
    (void)state;
    for (int n = 20000; n <= 20001; n++) {
        CtsSeries series[CTS_MAX_PARTS] = {0};
        CtsError err = {0};
        int n_series = 0;
        CtsSliceSet set = stack_of(n, 4);
        assert_int_equal(cts_series_judge(&set, series, &n_series, &err), CTS_OK);
        assert_int_equal(n_series, 1);
        assert_int_equal(series[0].refusal, n <= 20000 ? CTS_OK : CTS_ERR_GEOMETRY);
        assert_true(n <= 20000 || strstr(series[0].reason, "has 20001 slices, more than 20000"));
        clear(&series[0]);
    }
}

/* More than there is: said by the headers, before a pixel is read (there are none). */
static void test_volume(void **state)
{
    (void)state;
    CtsSeries series[CTS_MAX_PARTS] = {0};
    CtsError err = {0};
    CtsVolume *volume = NULL;
    int n_series = 0;
    CtsSliceSet set = stack_of(20000, 4096);
    if ((double)cts_memory_available() > 1e12)
        skip();
    assert_int_equal(cts_series_judge(&set, series, &n_series, &err), CTS_OK);
    assert_true(series[0].renderable);
    assert_int_equal(cts_series_load(&series[0], 1, &volume, NULL, &err), CTS_ERR_MEMORY);
    assert_non_null(strstr(err.text, "needs 640000 MiB of memory"));
    assert_null(volume);
    clear(&series[0]);
}

/* 64 MiB before the pixels, and two bytes more: lengths are even. */
static void test_header(void **state)
{
    (void)state;
    enum { LIMIT = 64 << 20, HEAD = 12 };
    uint8_t *bytes = calloc(1, LIMIT + 64);
    assert_non_null(bytes);
    for (int more = 0; more <= 2; more += 2) {
        static const uint8_t pixels[] = {0xE0, 0x7F, 0x10, 0, 'O', 'W', 0, 0, 2, 0, 0, 0, 1, 2};
        const uint32_t n = (uint32_t)(LIMIT - HEAD + more);
        const uint8_t head[HEAD] = {
            0x09, 0, 0x10, 0, 'O', 'B', 0, 0, (uint8_t)n, (uint8_t)(n >> 8), (uint8_t)(n >> 16), (uint8_t)(n >> 24)};
        CtsDataScan found;
        memcpy(bytes, head, HEAD);
        memcpy(bytes + HEAD + n, pixels, sizeof pixels);
        const size_t n_all = HEAD + n + sizeof pixels;
        const CtsScanResult result = cts_scan_data(bytes, n_all, n_all, 0, cts_syntax_native(true, false), &found);
        assert_int_equal(result, more ? CTS_SCAN_BAD : CTS_SCAN_DONE);
        if (more)
            assert_non_null(strstr(found.why, "64 MiB"));
        else
            assert_true(found.has_pixels && found.header_end == LIMIT);
    }
    free(bytes);
}

/* A deflated file of 16 MiB, and one byte more; what follows the stream is not looked at. */
static void test_deflated(void **state)
{
    (void)state;
    enum { LIMIT = 16 << 20 };
    Slice s = sound_slice();
    s.syntax = "1.2.840.10008.1.2.1.99";
    const Bytes plain = slice_bytes(&s);
    CtsMetaScan meta;
    assert_int_equal(cts_scan_meta(plain.data, plain.n, plain.n, &meta), CTS_SCAN_DONE);
    uint8_t *file = calloc(1, LIMIT + 1);
    assert_non_null(file);
    memcpy(file, plain.data, meta.data_offset);
    z_stream z = {.next_in = plain.data + meta.data_offset,
                  .avail_in = (uInt)(plain.n - meta.data_offset),
                  .next_out = file + meta.data_offset,
                  .avail_out = 1 << 20};
    assert_int_equal(deflateInit2(&z, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY), Z_OK);
    assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
    deflateEnd(&z);
    for (size_t n = LIMIT; n <= LIMIT + 1; n++) {
        static char name[] = "deflated";
        const CtsFile source = {.path = name, .memory = file, .n_memory = n};
        CtsScratch scratch = {0};
        CtsObject object = {0};
        CtsError err = {0};
        uint64_t bytes_read = 0;
        const CtsFileKind kind = cts_slice_read_header(&source, &scratch, &object, &bytes_read, &err);
        assert_int_equal(kind, n <= LIMIT ? CTS_FILE_DICOM : CTS_FILE_UNREADABLE);
        if (n <= LIMIT)
            assert_true(object.n_slices == 1 && !object.slices[0]->fault);
        else
            assert_non_null(strstr(err.text, "more than 16 MiB"));
        cts_object_free(&object);
        cts_scratch_free(&scratch);
    }
    free(file);
    free(plain.data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slices),
        cmocka_unit_test(test_volume),
        cmocka_unit_test(test_header),
        cmocka_unit_test(test_deflated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
