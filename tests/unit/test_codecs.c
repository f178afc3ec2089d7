/* Codecs: RLE lengths; JPEG 2000 streams as other programs write them, and damaged ones. */
#include "../tools/htj2k_stream.h"
#include "codec_frames.h"

/* Three runs for each of two segments; a row more than in the header is an error. */
static void test_rle_length(void **state)
{
    uint8_t stream[64 + 2 * 8] = {2, 0, 0, 0, 64, 0, 0, 0, 72};
    static const uint8_t segment[8] = {3, 1, 2, 3, 4, 0xFD, 7, 0}; /* 4 bytes, 4 times 7, padding */
    CtsError err;
    memcpy(stream + 64, segment, 8);
    memcpy(stream + 72, segment, 8);
    CtsCodecFrame right = {4, 2, 16, 1, 0}, less = {4, 1, 16, 1, 0}, wide = {7, 1, 16, 1, 0};
    assert_int_equal(cts_codec_check_rle(&right, stream, sizeof stream, &err), CTS_OK);
    assert_int_equal(cts_codec_check_rle(&wide, stream, sizeof stream, &err), CTS_OK); /* a byte of padding */
    assert_int_equal(cts_codec_check_rle(&less, stream, sizeof stream, &err), CTS_ERR_PIXELS);
    assert_non_null(strstr(err.text, "holds 8 pixels"));
}

enum { COLUMNS = 37, ROWS = 23, N = COLUMNS * ROWS };

static Jpeg2000Bytes stream_of(const Jpeg2000 *p, bool high_throughput, const int32_t *samples)
{
    Jpeg2000Bytes bytes = high_throughput ? htj2k_stream(p, false, samples) : jpeg2000_stream(p, samples);
    assert_true(bytes.n > 0);
    return bytes;
}

static CtsStatus decode_2000(const Jpeg2000 *stream, bool high_throughput, const int32_t *samples,
                             const CtsFrameFormat *format, uint16_t *pixels, CtsError *err)
{
    *err = (CtsError){0};
    Jpeg2000Bytes bytes = stream_of(stream, high_throughput, samples);
    const CtsStatus st = cts_jpeg2000_decode(format, bytes.data, bytes.n, pixels, err);
    free(bytes.data);
    return st;
}

/* Every combination of the stream's own bits and sign with the header's: the samples themselves, or a refusal. */
static void test_jpeg2000(void **state)
{
    static const struct {
        Jpeg2000 stream;
        int low, high; /* of the samples */
        int stored;
        bool is_signed;
        const char *reason;
    } cases[] = {
        {{COLUMNS, ROWS, 16, 1, true, false}, -1024, 3071, 16, true, NULL},
        {{COLUMNS, ROWS, 16, 1, false, false}, 0, 65535, 16, false, NULL},
        {{COLUMNS, ROWS, 12, 1, false, false}, 0, 4095, 12, false, NULL},
        {{COLUMNS, ROWS, 12, 1, true, false}, -2048, 2047, 12, true, NULL},
        {{COLUMNS, ROWS, 12, 1, true, true}, -2048, 2047, 16, true, NULL},
        {{COLUMNS, ROWS, 16, 1, false, false}, 0, 4095, 12, false, NULL},
        {{COLUMNS, ROWS, 16, 1, false, false}, 0, 4096, 12, false, "reads as another number"},
        {{COLUMNS, ROWS, 16, 1, false, false}, 0, 32767, 16, true, NULL},
        {{COLUMNS, ROWS, 16, 1, false, false}, 0, 64512, 16, true, "reads as another number"},
        {{COLUMNS, ROWS, 16, 1, true, false}, -1, 100, 16, false, "reads as another number"},
        {{COLUMNS, ROWS, 16, 3, false, false}, 0, 100, 16, false, "3 components"},
        {{COLUMNS, ROWS + 1, 16, 1, false, false}, 0, 100, 16, false, "37 x 24"},
    };
    static int32_t samples[COLUMNS * (ROWS + 1)];
    static uint16_t pixels[N];
    for (size_t n = 0; n < 2 * sizeof cases / sizeof *cases; n++) {
        CtsFrameFormat f = format_16(COLUMNS, ROWS);
        CtsError err;
        const size_t c = n / 2;
        const bool high_throughput = n % 2;
        f.bits_stored = cases[c].stored;
        f.high_bit = cases[c].stored - 1;
        f.is_signed = cases[c].is_signed;
        for (int i = 0; i < COLUMNS * (ROWS + 1); i++)
            samples[i] = i == 0   ? cases[c].low
                         : i == 1 ? cases[c].high
                                  : cases[c].low + i % (cases[c].high - cases[c].low);
        const CtsStatus st = decode_2000(&cases[c].stream, high_throughput, samples, &f, pixels, &err);
        if (st != (cases[c].reason ? CTS_ERR_PIXELS : CTS_OK) || (st && !strstr(err.text, cases[c].reason)))
            fail_msg("case %zu, high throughput %d: %d %s", c, high_throughput, st, err.text);
        for (int i = 0; !st && i < N; i++)
            assert_int_equal(pixels[i], (uint16_t)samples[i]);
    }
}

/* Through the walls, by any of the three syntaxes. */
static void expect_decoder_takes(const CtsFrameFormat *format, const Jpeg2000Bytes *bytes, const uint16_t *pixels)
{
    static const char *const uids[] = {"1.2.840.10008.1.2.4.201", "1.2.840.10008.1.2.4.202", "1.2.840.10008.1.2.4.203"};
    CtsSandbox d = cts_codec_make();
    for (int i = 0; i < 3; i++) {
        CtsFrameFormat f = *format;
        CtsError err = {0};
        const void *out;
        f.syntax = cts_syntax_find(uids[i]);
        if (run_frame(&d, &f, bytes->data, bytes->n, 1 + (size_t)i, &out, &err))
            fail_msg("%s", err.text);
        assert_memory_equal(out, pixels, cts_frame_bytes(&f));
    }
    cts_sandbox_stop(&d);
}

/* High-throughput streams as OpenJPH writes them: larger pictures, several blocks and levels, noise and edges. */
static void test_htj2k(void **state)
{
    enum { SIDE = 201 };
    static int32_t samples[SIDE * SIDE];
    static uint16_t pixels[SIDE * SIDE];
    uint32_t random = 1;
    for (int lossy = 0; lossy < 2; lossy++)
        for (int bits = 10; bits <= 16; bits += 3) {
            const Jpeg2000 shape = {SIDE, SIDE, bits, 1, false, false};
            CtsFrameFormat f = format_16(SIDE, SIDE);
            CtsError err = {0};
            f.is_signed = false;
            f.bits_stored = bits;
            f.high_bit = bits - 1;
            for (int i = 0; i < SIDE * SIDE; i++) {
                random = random * 1664525u + 1013904223u;
                const uint32_t noise = random >> (32 - bits);
                samples[i] = i % SIDE < 70 ? (int32_t)noise : i / SIDE > 100 ? (1 << bits) - 1 : 0;
            }
            Jpeg2000Bytes bytes = htj2k_stream(&shape, lossy, samples);
            assert_true(bytes.n > 0);
            assert_int_equal(cts_jpeg2000_decode(&f, bytes.data, bytes.n, pixels, &err), CTS_OK);
            expect_decoder_takes(&f, &bytes, pixels);
            for (int i = 0; i < SIDE * SIDE; i++)
                assert_true(abs(pixels[i] - samples[i]) <= (lossy ? 1 << bits >> 5 : 0));
            free(bytes.data);
        }
}

/* Truncated at any byte, or with one changed: the right samples or a reason, never a hang or a crash. */
static void damage_2000(bool high_throughput)
{
    static int32_t samples[N];
    static uint16_t pixels[N + 1];
    const Jpeg2000 shape = {COLUMNS, ROWS, 16, 1, false, false};
    const CtsFrameFormat f = format_16(COLUMNS, ROWS);
    CtsError err;
    for (int i = 0; i < N; i++)
        samples[i] = (i * 7919) & 0xFFF;
    Jpeg2000Bytes bytes = stream_of(&shape, high_throughput, samples);
    for (size_t n = 0; n + 3 < bytes.n; n += n < 150 ? 1 : 13)
        assert_int_equal(cts_jpeg2000_decode(&f, bytes.data, n, pixels, &err), CTS_ERR_PIXELS);
    CtsSandbox d = cts_codec_make();
    uint32_t random = 1;
    pixels[N] = 12345;
    for (int round = 0; round < 300; round++) {
        const void *out;
        random = random * 1664525u + 1013904223u;
        uint8_t *const changed = bytes.data + (random >> 8) % bytes.n, change = (uint8_t)(1 + round % 255);
        *changed ^= change;
        run_frame(&d, &f, bytes.data, bytes.n, 1, &out, &err);
        *changed ^= change;
    }
    cts_sandbox_stop(&d);
    free(bytes.data);
}

static void test_jpeg2000_damage(void **state)
{
    damage_2000(false);
    damage_2000(true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rle_length),
        cmocka_unit_test(test_jpeg2000),
        cmocka_unit_test(test_jpeg2000_damage),
        cmocka_unit_test(test_htj2k),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
