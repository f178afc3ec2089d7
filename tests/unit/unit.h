/* Included by every unit test: cmocka needs these headers before its own. */
#pragma once

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fnmatch.h>
#include <stdio.h>
#include <stdlib.h>

/* Every test is handed a state, and formulas all coordinates; few need them. */
#pragma GCC diagnostic ignored "-Wunused-parameter"

/* Number of cases that a pattern names ("*" and "?" match). */
static inline size_t unit_matches(const struct CMUnitTest *tests, size_t n_tests, const char *pattern)
{
    size_t n = 0;
    for (size_t i = 0; i < n_tests; i++)
        n += fnmatch(pattern, tests[i].name, 0) == 0;
    return n;
}

/* Runs the cases that the environment variable CTS_CASE names, with or without "test_" in front, or all where it is not
 * set. A name that no case has is a failure, which lists them. */
static inline int unit_run(const char *group, const struct CMUnitTest *tests, size_t n_tests, CMFixtureFunction setup,
                           CMFixtureFunction teardown)
{
    static char pattern[200];
    const char *const name = getenv("CTS_CASE");
    if (name) {
        snprintf(pattern, sizeof pattern, "%s", name);
        if (!unit_matches(tests, n_tests, pattern))
            snprintf(pattern, sizeof pattern, "test_%s", name);
        if (!unit_matches(tests, n_tests, pattern)) {
            fprintf(stderr, "FAIL: no case is named %s; the cases are:", name);
            for (size_t i = 0; i < n_tests; i++)
                fprintf(stderr, " %s", tests[i].name);
            fputc('\n', stderr);
            return 1;
        }
        cmocka_set_test_filter(pattern);
    }
    return _cmocka_run_group_tests(group, tests, n_tests, setup, teardown);
}

#undef cmocka_run_group_tests
#define cmocka_run_group_tests(tests, setup, teardown)                                                                 \
    unit_run(#tests, tests, sizeof(tests) / sizeof *(tests), setup, teardown)
