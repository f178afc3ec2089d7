/* Pooled texts stay unchanged when others are added. */
#include "base/string_pool.h"
#include "unit.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 20000 };

static void test_many(void **state)
{
    static const char *kept[N], *shared[N];
    CtsStringPool t = {0};
    char text[32];
    for (int round = 0; round < 2; round++)
        for (int i = 0; i < N; i++) {
            const size_t n = (size_t)snprintf(text, sizeof text, "1.2.%d", i);
            shared[i] = cts_string_pool_share(&t, text, n);
            assert_ptr_equal(cts_string_pool_share(&t, text, n), shared[i]);
            kept[i] = cts_string_pool_add(&t, text, n);
            assert_ptr_not_equal(kept[i], shared[i]);
        }
    for (int i = 0; i < N; i++) {
        snprintf(text, sizeof text, "1.2.%d", i);
        assert_string_equal(shared[i], text);
        assert_string_equal(kept[i], text);
    }
    cts_string_pool_free(&t);
    assert_true(!t.blocks && !t.shared[0]);
}

static void test_odd(void **state)
{
    CtsStringPool t = {0};
    const char *empty = cts_string_pool_share(&t, "", 0);
    assert_string_equal(empty, "");
    assert_ptr_equal(cts_string_pool_share(&t, "\0x", 2), empty);
    assert_string_equal(cts_string_pool_add(&t, "abc", 2), "ab");
    /* One is the start of another. */
    const char *longer = cts_string_pool_share(&t, "1.2.3", 5), *shorter = cts_string_pool_share(&t, "1.2.3", 4);
    assert_string_equal(longer, "1.2.3");
    assert_string_equal(shorter, "1.2.");
    assert_ptr_equal(cts_string_pool_share(&t, "1.2.", 5), shorter);
    /* Sizes about that of a block, and above. */
    for (size_t n = (64 << 10) - 3; n < (64 << 10) + 3; n++) {
        char *large = malloc(n);
        assert_non_null(large);
        memset(large, 'a', n);
        const char *copy = cts_string_pool_add(&t, large, n);
        assert_true(strlen(copy) == n && memcmp(copy, large, n) == 0);
        free(large);
    }
    assert_string_equal(longer, "1.2.3");
    cts_string_pool_free(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_many), cmocka_unit_test(test_odd)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
