/* Stored words to grey levels: the fast version against the plain one, both against the formula. */
#include "base/cpu.h"
#include "core/volume/grey.h"
#include "ctsplat/series.h"
#include "unit.h"
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { N_WORDS = 65536, EDGE = 8 };

/* PS3.5 8.1.1 and PS3.3 C.11.1 literally, in 64 bits. */
static uint16_t formula(uint16_t word, const CtsStored *s, int64_t slope, int64_t offset, int64_t *value)
{
    *value = (word >> s->shift) % (1 << s->bits);
    if (s->is_signed && *value >= 1 << (s->bits - 1))
        *value -= 1 << s->bits;
    if ((*value >= s->padding_low && *value <= s->padding_high) || word == s->padding_word)
        return 0;
    const int64_t grey = slope * *value + offset;
    return (uint16_t)(grey < 0 ? 0 : grey > 65535 ? 65535 : grey);
}

static void check_one(const CtsStored *s, int32_t slope, int32_t offset, size_t n)
{
    uint16_t *plain = malloc((N_WORDS + 2 * EDGE) * 2), *fast = malloc((N_WORDS + 2 * EDGE) * 2);
    assert_true(plain && fast);
    const unsigned masks[] = {0, cts_cpu_flags()};
    for (size_t m = 0; m < 2; m++) {
        for (size_t i = 0; i < N_WORDS + 2 * EDGE; i++)
            plain[i] = fast[i] = (uint16_t)((i - EDGE) * 40503u);
        int64_t low = INT32_MAX, high = INT32_MIN;
        uint16_t *wanted = malloc(n * 2 + 2);
        for (size_t i = 0; i < n; i++) {
            int64_t value;
            const uint16_t word = plain[EDGE + i];
            wanted[i] = formula(word, s, slope, offset, &value);
            if ((value >= s->padding_low && value <= s->padding_high) || word == s->padding_word)
                continue;
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        cts_cpu_set_mask(masks[m]);
        const CtsStoredRange alone = cts_stored_range(plain + EDGE, n, s);
        assert_true(alone.low == low && alone.high == high);
        const CtsStoredRange a = cts_grey_whole_plain(plain + EDGE, plain + EDGE, n, s, slope, offset);
        const CtsStoredRange b = cts_grey_whole(fast + EDGE, fast + EDGE, n, s, slope, offset);
        assert_memory_equal(plain, fast, (N_WORDS + 2 * EDGE) * 2);
        uint16_t *words = malloc(n * 2 + 2); /* the same from elsewhere */
        assert_non_null(words);
        for (size_t i = 0; i < n; i++)
            words[i] = (uint16_t)(i * 40503u);
        memset(fast + EDGE, 0xA5, n * 2);
        const CtsStoredRange c = cts_grey_whole(fast + EDGE, words, n, s, slope, offset);
        assert_true(c.low == b.low && c.high == b.high);
        free(words);
        assert_memory_equal(plain + EDGE, wanted, n * 2);
        assert_memory_equal(plain, fast, (N_WORDS + 2 * EDGE) * 2); /* nothing around it is touched either */
        assert_true(a.low == low && a.high == high && b.low == low && b.high == high);
        free(wanted);
    }
    cts_cpu_set_mask(~0u);
    free(plain);
    free(fast);
}

static void test_whole(void **state)
{
    static const CtsStored kinds[] = {
        {0, 16, false, 1, 0, -1},        {0, 16, true, 1, 0, -1},     {0, 16, true, -2000, -2000, -1},
        {0, 16, true, -3000, -1500, -1}, {0, 12, false, 1, 0, 63536}, {0, 12, true, -2048, -2048, -1},
        {4, 12, false, 0, 0, -1},        {4, 12, true, 1, 0, -1},     {0, 8, false, 255, 255, -1},
        {3, 10, true, 1, 0, -1},         {0, 1, false, 1, 0, -1},     {0, 1, true, 1, 0, -1},
        {0, 16, false, 0, 65535, -1},
    };
    static const int32_t rescale[][2] = {{1, 0},     {1, 1024},    {1, -70000},  {1, 32767},  {1, 65535},
                                         {1, 98303}, {1, 98304},   {1, -65535},  {1, -65536}, {2, -3000},
                                         {-1, 1024}, {150, -9999}, {1, 9999999}, {-152, -9}};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        for (size_t r = 0; r < sizeof rescale / sizeof *rescale; r++) {
            check_one(&kinds[k], rescale[r][0], rescale[r][1], N_WORDS);
            check_one(&kinds[k], rescale[r][0], rescale[r][1], r * 5);
        }
}

static void test_table(void **state)
{
    uint16_t *table = malloc(N_WORDS * 2), words[4] = {0, 100, 0x8000, 0xFFFF};
    const CtsStored s = {0, 16, true, -5, -5, -1};
    cts_grey_table(table, &s, 0.5, -1000.25, -1024, 0.25);
    for (int word = 0; word < N_WORDS; word++) {
        const int value = word < 32768 ? word : word - 65536;
        const double grey = floor((0.5 * value - 1000.25 + 1024) / 0.25 + 0.5);
        assert_int_equal(table[word], value == -5 ? 0 : (int)fmin(fmax(grey, 0), 65535));
    }
    /* Half a step is exact in this table, so HU come back to the last bit. */
    assert_true(-1024 + 0.25 * table[100] == 0.5 * 100 - 1000.25);
    const CtsStoredRange r = cts_stored_range(words, 4, &s);
    assert_true(r.low == -32768 && r.high == 100);
    cts_grey_look_up(words, 4, table);
    assert_true(words[0] == table[0] && words[1] == table[100] && words[2] == table[0x8000] &&
                words[3] == table[0xFFFF]);
    free(table);
}

static void test_all_padding(void **state)
{
    uint16_t words[3] = {7, 7, 7};
    const CtsStored s = {0, 16, false, 7, 7, -1};
    CtsStoredRange r = cts_stored_range(words, 3, &s);
    assert_true(r.low > r.high);
    r = cts_grey_whole_plain(words, words, 3, &s, 1, 1024);
    assert_true(r.low > r.high && words[0] == 0 && words[2] == 0);
}

/* Numbers in memory by the formula, on each path, packed and strewn: ends of ranges, and what is no number. */
static void check_given(CtsNumber number, size_t size, const double *hu, double step, size_t gap)
{
    enum { NX = 37, NY = 3, NZ = 5 };
    static uint8_t bytes[NX * NY * NZ * 2 * sizeof(double)];
    for (size_t i = 0; i < NX * NY * NZ; i++) {
        const int32_t whole = isfinite(hu[i]) ? (int32_t)hu[i] : 0;
        const float narrow = (float)hu[i];
        memcpy(bytes + i * gap * size,
               number == CTS_INT32     ? (const void *)&whole
               : number == CTS_FLOAT32 ? (const void *)&narrow
                                       : (const void *)&hu[i],
               size);
    }
    const ptrdiff_t stride = (ptrdiff_t)(gap * size);
    const CtsHuArray given = {.bytes = bytes,
                              .number = number,
                              .dims = {NX, NY, NZ},
                              .stride_bytes = {stride, NX * stride, NX * NY * stride},
                              .step_lps = {{1, 0, 0}, {0, 1, 0}, {0, 0, 2}}};
    for (unsigned mask = 0; mask < 2; mask++) {
        CtsScanned *scanned = NULL;
        CtsError err = {0};
        double low = INFINITY, high = -INFINITY;
        cts_cpu_set_mask(mask ? ~0u : 0);
        if (cts_scanned_of_hu(&given, 2, &scanned, NULL, &err))
            fail_msg("%s", err.text);
        for (size_t i = 0; i < NX * NY * NZ; i++) {
            const double x = number == CTS_INT32 && !isfinite(hu[i]) ? 0 : number == CTS_FLOAT32 ? (float)hu[i] : hu[i];
            const double grey = fmin(fmax(floor((x + 1024) / step + 0.5), 0), 65535);
            assert_int_equal(scanned->even->grey[i], isfinite(x) ? (uint16_t)grey : 0);
            low = isfinite(x) ? fmin(low, x) : low;
            high = isfinite(x) ? fmax(high, x) : high;
        }
        assert_true(scanned->even->hu_min == low && scanned->even->hu_max == high && scanned->even->hu_step == step);
        cts_scanned_free(&scanned);
    }
    cts_cpu_set_mask(~0u);
}

static void test_given(void **state)
{
    static const double ugly[] = {-1024, -1024.5, -0.0, 3071, -32768, NAN, INFINITY, -INFINITY};
    double hu[37 * 3 * 5];
    for (int ugliness = 0; ugliness < 3; ugliness++)
        for (size_t gap = 1; gap <= 2; gap++) {
            for (size_t i = 0; i < sizeof hu / sizeof *hu; i++)
                hu[i] = ugliness == 2 && i % 5 == 0 ? ugly[i / 5 % 8] : (double)(i * 7919 % 4000) - 1000;
            check_given(CTS_INT32, 4, hu, 1, gap);
            for (size_t i = 0; ugliness && i < sizeof hu / sizeof *hu; i++)
                hu[i] += i % 5 ? 0.03125 * (double)(i % 32) : 0;
            check_given(CTS_FLOAT32, 4, hu, ugliness ? 0.0625 : 1, gap);
            check_given(CTS_FLOAT64, 8, hu, ugliness ? 0.0625 : 1, gap);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_whole),
        cmocka_unit_test(test_table),
        cmocka_unit_test(test_all_padding),
        cmocka_unit_test(test_given),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
