/* Limits of input: at each of them, and one beyond. */
#include "base/file_bytes.h"
#include "base/mem.h"
#include "dicom/header/header_reader.h"
#include "dicom/header/pixel_places.h"
#include "dicom/header/utf8.h"
#include "dicom/pixels/pixel_tasks.h"
#include "dicom/reader/tag_scan.h"
#include "dicom_files.h"
#include "folder.h"
#include "input/files/scan.h"
#include "input/series/series_check.h"
#include <zlib.h>

/* A stack of synthetic slices. */
static CtsSliceSet stack_of(int n, int side)
{
    static const uint8_t no_pixels;
    CtsSliceSet set = {malloc((size_t)n * sizeof *set.items), n};
    for (int k = 0; k < n; k++) {
        CtsSlice *s = set.items[k] = malloc(sizeof *s);
        assert_non_null(s);
        *s = cts_slice_unknown();
        s->path = "IM";
        s->kind = CTS_OBJECT_SLICE;
        s->syntax = cts_syntax_native(true, false);
        s->rows = s->columns = side;
        s->bits_allocated = s->bits_stored = 16;
        s->high_bit = 15;
        s->slope = 1;
        s->row_spacing_mm = s->column_spacing_mm = 0.5;
        s->row_lps[0] = s->column_lps[1] = s->normal_lps[2] = 1;
        s->position_lps[2] = k;
        s->memory = &no_pixels;
        s->pixel_bytes = 2 * (uint64_t)side * (uint64_t)side;
    }
    return set;
}

static CtsSeriesList *list_of(int n, int side)
{
    CtsSliceSet set = stack_of(n, side);
    CtsSeriesList *list = calloc(1, sizeof *list);
    CtsError err = {0};
    assert_non_null(list);
    assert_int_equal(cts_series_check(&set, &(CtsSeriesRules){0}, &(CtsStudyNumbers){0}, list, &err), CTS_OK);
    return list;
}

static void test_slices(void **state)
{
    for (int n = 20000; n <= 20001; n++) {
        CtsSeriesList *list = list_of(n, 4);
        assert_int_equal(list->n, 1);
        assert_int_equal(list->items[0].refusal, n <= 20000 ? CTS_OK : CTS_ERR_GEOMETRY);
        assert_true(n <= 20000 || strstr(list->items[0].reason, "has 20001 slices, more than 20000"));
        cts_series_list_free(&list);
    }
}

static void test_share(void **state)
{
    const uint64_t free_bytes = 1000 * (uint64_t)(1 << 30);
    const double limit = 600.0 * (1 << 30);
    assert_true(cts_memory_allows(limit, free_bytes));
    assert_false(cts_memory_allows(limit + 1, free_bytes));
    assert_true(cts_memory_allows(1e18, 0)); /* a system where it is unknown */
}

/* More than the available memory: refused by the headers, before a pixel is read (there are none). */
static void test_volume(void **state)
{
    CtsError err = {0};
    CtsVolume *volume = NULL;
    if ((double)cts_memory_available() > 1e12)
        skip();
    CtsSeriesList *list = list_of(20000, 4096);
    assert_true(list->items[0].renderable);
    assert_int_equal(cts_series_load(&list->items[0], 1, NULL, &volume, NULL, &err), CTS_ERR_MEMORY);
    assert_non_null(strstr(err.text, "needs 640000 MiB of memory"));
    assert_null(volume);
    cts_series_list_free(&list);
}

/* 64 MiB before the pixels, and two bytes more: lengths are even. */
static void test_header(void **state)
{
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
        const CtsScanResult result =
            cts_scan_data(bytes, n_all, n_all, 0, cts_syntax_native(true, false), CTS_MAX_HEADER_BYTES, &found);
        assert_int_equal(result, more ? CTS_SCAN_BAD : CTS_SCAN_DONE);
        if (more)
            assert_non_null(strstr(found.why, "64 MiB"));
        else
            assert_true(found.pixels.found && found.header_end == LIMIT);
    }
    free(bytes);
}

/* A deflated file of 16 MiB, and one byte more; data after the stream are ignored. */
static void test_deflated(void **state)
{
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
        CtsHeaderReader reader = {0};
        CtsObject object = {0};
        CtsError err = {0};
        const CtsStatus st = cts_slice_read_header(&source, &reader, &object, &err);
        assert_int_equal(st, n <= LIMIT ? CTS_OK : CTS_ERR_READ);
        if (n <= LIMIT)
            assert_true(object.n_slices == 1 && !object.slices[0]->fault);
        else
            assert_non_null(strstr(err.text, "more than 16 MiB"));
        cts_object_free(&object);
        cts_header_reader_free(&reader);
    }
    free(file);
    free(plain.data);
}

/* The header of one slice; why: of its fault, or "". */
static CtsStatus read_header(Bytes bytes, char why[200])
{
    static char name[] = "IM";
    const CtsFile source = {.path = name, .memory = bytes.data, .n_memory = bytes.n};
    CtsHeaderReader reader = {0};
    CtsObject object = {0};
    CtsError err = {0};
    assert_int_equal(cts_slice_read_header(&source, &reader, &object, &err), CTS_OK);
    assert_true(object.n_slices >= 1);
    const CtsStatus st = object.slices[0]->fault;
    snprintf(why, 200, "%.199s", object.slices[0]->fault_text);
    cts_object_free(&object);
    cts_header_reader_free(&reader);
    free(bytes.data);
    return st;
}

/* Numbers of the header: within their bounds, at them, and one beyond. */
static void test_numbers(void **state)
{
    static const struct {
        int rows, columns, allocated, stored, high, samples;
        const char *frames, *reason;
    } cases[] = {
        {1, 1, 16, 16, 15, 1, "1", NULL},
        {0, 1, 16, 16, 15, 1, NULL, "Rows (0028,0010) is 0"},
        {1, 0, 16, 16, 15, 1, NULL, "Columns (0028,0011) is 0"},
        {4096, 1, 16, 16, 15, 1, NULL, NULL},
        {4097, 1, 16, 16, 15, 1, NULL, "Rows (0028,0010) is 4097"},
        {1, 4096, 16, 16, 15, 1, NULL, NULL},
        {1, 4097, 16, 16, 15, 1, NULL, "Columns (0028,0011) is 4097"},
        {1, 1, 17, 16, 15, 1, NULL, "BitsAllocated (0028,0100) is 17"},
        {1, 1, 8, 8, 7, 1, NULL, NULL},
        {1, 1, 7, 7, 6, 1, NULL, "BitsAllocated (0028,0100) is 7"},
        {1, 1, 8, 9, 8, 1, NULL, "fit no pixel"},
        {1, 1, 16, 1, 0, 1, NULL, NULL},
        {1, 1, 16, 0, 0, 1, NULL, "BitsStored (0028,0101) is 0"},
        {1, 1, 16, 17, 15, 1, NULL, "BitsStored (0028,0101) is 17"},
        {1, 1, 16, 12, 10, 1, NULL, "fit no pixel"},
        {1, 1, 16, 12, 15, 1, NULL, NULL},
        {1, 1, 16, 12, 16, 1, NULL, "HighBit (0028,0102) is 16"},
        {1, 1, 16, 16, 15, 2, NULL, "SamplesPerPixel (0028,0002) is not 1"},
        {1, 1, 16, 16, 15, 1, "2", "NumberOfFrames (0028,0008) is not 1"},
        {1, 1, 16, 16, 15, 1, "0", "NumberOfFrames (0028,0008) is not 1"},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        char why[200];
        Slice s = sound_slice();
        s.rows = cases[c].rows;
        s.columns = cases[c].columns;
        s.allocated = cases[c].allocated;
        s.stored = cases[c].stored;
        s.high = cases[c].high;
        s.samples = cases[c].samples;
        s.frames = cases[c].frames;
        const CtsStatus st = read_header(slice_bytes(&s), why);
        if (st != (cases[c].reason ? CTS_ERR_PIXELS : CTS_OK) || (st && !strstr(why, cases[c].reason)))
            fail_msg("case %zu: %d %s", c, st, why);
    }
}

/* An Enhanced CT object of 20000 frames, empty groups for each, and one more; its frames lack all else. */
static void test_frames(void **state)
{
    for (int n = 20000; n <= 20001; n++) {
        Bytes b = {0}, items = {0};
        char count[16], why[200];
        Slice s = sound_slice();
        s.sop_class = "1.2.840.10008.5.1.4.1.1.2.1";
        snprintf(count, sizeof count, "%d", n);
        s.frames = count;
        put_meta(&b, &s);
        put_header(&b, &s);
        for (int k = 0; k < n; k++) {
            put_tag(&items, 0xFFFEE000);
            put32(&items, 0);
        }
        put_element(&b, 0x52009230, "SQ", items.data, (uint32_t)items.n);
        put_pixels(&b, &s);
        free(items.data);
        read_header(b, why);
        assert_non_null(strstr(why, n <= 20000 ? "ImageOrientationPatient" : "not within 1 to 20000"));
    }
}

/* The offset table and 2^20 fragments, and one more. */
static void test_fragments(void **state)
{
    enum { LIMIT = 1 << 20, ITEM = 8 };
    static const uint8_t item[ITEM] = {0xFE, 0xFF, 0, 0xE0}, end[ITEM] = {0xFE, 0xFF, 0xDD, 0xE0};
    uint8_t *bytes = malloc((size_t)ITEM * (LIMIT + 3));
    assert_non_null(bytes);
    for (size_t n = LIMIT; n <= LIMIT + 1; n++) {
        CtsSlice slice = {.pixel_offset = 0};
        CtsSlice *frames[1] = {&slice};
        CtsError err = {0};
        for (size_t i = 0; i <= n; i++)
            memcpy(bytes + ITEM * i, item, ITEM);
        memcpy(bytes + ITEM * (n + 1), end, ITEM);
        const CtsFileBytes file = cts_file_bytes_in_memory(bytes, ITEM * (n + 2));
        assert_int_equal(cts_place_fragments(&file, frames, 1, &err), CTS_OK);
        assert_int_equal(slice.fault, n <= LIMIT ? CTS_OK : CTS_ERR_PIXELS);
        assert_true(n > LIMIT ? strstr(slice.fault_text, "a million fragments") != NULL
                              : slice.pixel_bytes == ITEM * n);
    }
    free(bytes);
}

/* RLE: 64 bytes of header, rising offsets inside the stream. JPEG: size, components, precision; no FF 01. */
static void test_streams(void **state)
{
    enum { RLE_BYTES = 64 + 8, COLUMNS = 4, ROWS = 1 };
    static const struct {
        uint32_t n_segments, first, second;
        bool sound;
    } rle[] = {{2, 64, 68, true},         {1, 64, 68, false},        {3, 64, 68, false}, {2, 63, 68, false},
               {2, 64, 64, false},        {2, 64, 65, true},         {2, 68, 64, false}, {2, 64, RLE_BYTES - 1, true},
               {2, 64, RLE_BYTES, false}, {2, 64, UINT32_MAX, false}};
    CtsError err;
    for (size_t c = 0; c < sizeof rle / sizeof *rle; c++) {
        uint8_t stream[RLE_BYTES] = {0};
        const uint32_t numbers[3] = {rle[c].n_segments, rle[c].first, rle[c].second};
        for (size_t i = 0; i < sizeof numbers; i++)
            stream[i] = (uint8_t)(numbers[i / 4] >> 8 * (i % 4));
        CtsCodecFrame f = {COLUMNS, ROWS, 16, 1, 0};
        if (cts_codec_check_rle(&f, stream, sizeof stream, &err) != (rle[c].sound ? CTS_OK : CTS_ERR_PIXELS))
            fail_msg("RLE %zu", c);
    }
    CtsCodecFrame f = {COLUMNS, ROWS, 16, 1, 0};
    const uint8_t none[64] = {2, 0, 0, 0, 64};
    assert_int_equal(cts_codec_check_rle(&f, none, sizeof none - 1, &err), CTS_ERR_PIXELS);

    static const struct {
        int precision, rows, columns, components, marker, allocated;
        bool sound;
    } jpeg[] = {
        {16, 1, 4, 1, 0xFE, 16, true},  {17, 1, 4, 1, 0xFE, 16, false}, {9, 1, 4, 1, 0xFE, 16, true},
        {8, 1, 4, 1, 0xFE, 16, false},  {8, 1, 4, 1, 0xFE, 8, true},    {9, 1, 4, 1, 0xFE, 8, false},
        {2, 1, 4, 1, 0xFE, 8, true},    {1, 1, 4, 1, 0xFE, 8, false},   {16, 0, 4, 1, 0xFE, 16, false},
        {16, 2, 4, 1, 0xFE, 16, false}, {16, 1, 3, 1, 0xFE, 16, false}, {16, 1, 5, 1, 0xFE, 16, false},
        {16, 1, 4, 2, 0xFE, 16, false}, {16, 1, 4, 0, 0xFE, 16, false}, {16, 1, 4, 1, 0x01, 16, false},
        {16, 1, 4, 1, 0x02, 16, true},
    };
    for (size_t c = 0; c < sizeof jpeg / sizeof *jpeg; c++) {
        /* Start, a segment of the marker, a lossless frame header. */
        const uint8_t stream[] = {0xFF,
                                  0xD8,
                                  0xFF,
                                  (uint8_t)jpeg[c].marker,
                                  0,
                                  2,
                                  0xFF,
                                  0xC3,
                                  0,
                                  11,
                                  (uint8_t)jpeg[c].precision,
                                  0,
                                  (uint8_t)jpeg[c].rows,
                                  0,
                                  (uint8_t)jpeg[c].columns,
                                  (uint8_t)jpeg[c].components,
                                  1,
                                  0x11,
                                  0};
        CtsCodecFrame frame = {COLUMNS, ROWS, jpeg[c].allocated, 1, 0};
        if (cts_codec_check_jpeg(&frame, stream, sizeof stream, &err) != (jpeg[c].sound ? CTS_OK : CTS_ERR_PIXELS))
            fail_msg("JPEG %zu: %s", c, err.text);
        assert_true(!jpeg[c].sound || frame.precision == jpeg[c].precision);
    }
}

/* Texts for display: 64 characters, however many bytes each has. */
static void test_texts(void **state)
{
    for (size_t n = 63; n <= 65; n++)
        for (size_t wide = 1; wide <= 2; wide++) {
            char text[200] = "";
            for (size_t i = 0; i < n; i++)
                strcat(text, wide == 1 ? "x" : "\xc3\xa4");
            char *got = cts_dcm_utf8(text, "ISO_IR 192");
            assert_int_equal(strlen(got), wide * (n < 64 ? n : 64));
            assert_int_equal(strncmp(got, text, strlen(got)), 0);
            free(got);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slices),   cmocka_unit_test(test_volume),    cmocka_unit_test(test_header),
        cmocka_unit_test(test_deflated), cmocka_unit_test(test_share),     cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_frames),   cmocka_unit_test(test_fragments), cmocka_unit_test(test_streams),
        cmocka_unit_test(test_texts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
