/* Outputs appear whole or not at all. */
#include "base/file.h"
#include "folder.h"
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

static char folder[64], path[128];

static int enter(void **state)
{
    make_folder(folder);
    snprintf(path, sizeof path, "%s/out.bin", folder);
    return 0;
}

static int leave(void **state)
{
    remove_folder(folder);
    return 0;
}

static void assert_content(const char *expected)
{
    size_t n;
    uint8_t *bytes = slurp(path, &n);
    assert_int_equal(n, strlen(expected));
    assert_memory_equal(bytes, expected, n);
    free(bytes);
}

static CtsStatus write_file(const char *text, bool force, uint64_t *bytes, CtsError *err)
{
    CtsTempFile *t = NULL;
    CtsStatus st;
    if ((st = cts_temp_open(&t, path, err)) || (st = cts_temp_write(t, text, strlen(text), err)))
        goto end;
    st = cts_temp_commit(&t, force, bytes, err);
end:
    cts_temp_discard(&t);
    return st;
}

static void test_commit(void **state)
{
    CtsError err;
    CtsTempFile *t = NULL;
    uint64_t bytes = 0;
    struct stat info;
    const mode_t old = umask(027);
    assert_int_equal(cts_temp_open(&t, path, &err), CTS_OK);
    assert_int_equal(cts_temp_write(t, "abc", 3, &err), CTS_OK);
    assert_int_equal(fstat(cts_temp_fd(t), &info), 0);
    assert_int_equal(info.st_mode & 0777, 0600);
    assert_int_equal(strncmp(cts_temp_path(t), folder, strlen(folder)), 0);
    assert_int_equal(access(path, F_OK), -1);
    assert_int_equal(cts_temp_commit(&t, false, &bytes, &err), CTS_OK);
    umask(old);
    assert_null(t);
    assert_int_equal(bytes, 3);
    assert_content("abc");
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(info.st_mode & 0777, 0640);
    assert_int_equal(count_files(folder), 1);
    cts_temp_discard(&t);
}

static void test_discard(void **state)
{
    CtsError err;
    CtsTempFile *t = NULL;
    assert_int_equal(cts_temp_open(&t, path, &err), CTS_OK);
    assert_int_equal(cts_temp_write(t, "abc", 3, &err), CTS_OK);
    assert_int_equal(count_files(folder), 1);
    cts_temp_discard(&t);
    assert_null(t);
    assert_int_equal(count_files(folder), 0);
}

static void test_no_overwrite(void **state)
{
    CtsError err;
    assert_int_equal(write_file("first", false, NULL, &err), CTS_OK);
    assert_int_equal(cts_file_check_writable(path, false, &err), CTS_ERR_OUTPUT);
    assert_int_equal(write_file("second", false, NULL, &err), CTS_ERR_OUTPUT);
    assert_non_null(strstr(err.text, path));
    assert_non_null(strstr(err.text, "`force`"));
    assert_content("first");
    assert_int_equal(count_files(folder), 1);
    assert_int_equal(cts_file_check_writable(path, true, &err), CTS_OK);
    assert_int_equal(write_file("third", true, NULL, &err), CTS_OK);
    assert_content("third");
    assert_int_equal(count_files(folder), 1);
}

/* A full disk, played by a limit on file size: an error, and nothing stays behind. */
static void test_write_fails(void **state)
{
    CtsError err;
    CtsTempFile *t = NULL;
    struct rlimit old, small;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    small = old;
    small.rlim_cur = 1000;
    void (*const handler)(int) = signal(SIGXFSZ, SIG_IGN);
    static const char data[4000];
    assert_int_equal(cts_temp_open(&t, path, &err), CTS_OK);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    const CtsStatus st = cts_temp_write(t, data, sizeof data, &err);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, handler);
    assert_int_equal(st, CTS_ERR_OUTPUT);
    assert_non_null(strstr(err.text, path));
    cts_temp_discard(&t);
    assert_int_equal(count_files(folder), 0);
}

static void test_no_folder(void **state)
{
    CtsError err;
    CtsTempFile *t = NULL;
    char far[200];
    snprintf(far, sizeof far, "%s/none/out.bin", folder);
    assert_int_equal(cts_file_check_writable(far, false, &err), CTS_ERR_OUTPUT);
    assert_non_null(strstr(err.text, far));
    assert_int_equal(cts_temp_open(&t, far, &err), CTS_ERR_OUTPUT);
    assert_null(t);
    assert_int_equal(cts_file_check_writable(folder, true, &err), CTS_ERR_OUTPUT); /* a folder is no file */
    assert_int_equal(cts_file_check_writable("/dev/null", true, &err), CTS_ERR_OUTPUT);
    assert_int_equal(cts_file_check_writable(path, false, &err), CTS_OK);
    assert_int_equal(cts_file_check_writable("out.bin", false, &err), CTS_OK);
}

/* A link that points nowhere is somebody's file all the same. */
static void test_dangling_link(void **state)
{
    CtsError err;
    assert_int_equal(symlink("nowhere", path), 0);
    assert_int_equal(cts_file_check_writable(path, false, &err), CTS_ERR_OUTPUT);
    assert_int_equal(write_file("x", false, NULL, &err), CTS_ERR_OUTPUT);
    assert_int_equal(count_files(folder), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_commit, enter, leave),
        cmocka_unit_test_setup_teardown(test_discard, enter, leave),
        cmocka_unit_test_setup_teardown(test_no_overwrite, enter, leave),
        cmocka_unit_test_setup_teardown(test_write_fails, enter, leave),
        cmocka_unit_test_setup_teardown(test_no_folder, enter, leave),
        cmocka_unit_test_setup_teardown(test_dangling_link, enter, leave),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
