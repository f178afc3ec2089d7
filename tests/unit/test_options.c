/* Options become a job: the promises of each row of the option table, and the single call that returns the picture
 * which it writes. */
#include "app/options/options.h"
#include "core/scene/settings.h"
#include "ctsplat/ctsplat.h"
#include "folder.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static CtsStatus take(CtsOptions *options, CtsCommand command, const char *name, const char *value, CtsError *err)
{
    return cts_options_take(options, command, &(CtsJobOption){.name = name, .value = value}, err);
}

/* The text of one option, or of none. */
static char *text_of(const char *name, const char *value, bool of_objects)
{
    CtsOptions options;
    CtsError err;
    cts_options_begin(&options);
    if (name && take(&options, CTS_FOR_BATCH, name, value, &err))
        fail_msg("%s", err.text);
    char *text = cts_options_text(&options, of_objects);
    assert_non_null(text);
    cts_options_free(&options);
    return text;
}

/* Some value that is not the default. */
static const char *sample_of(const CtsOption *o)
{
    static const struct {
        const char *name, *value;
    } samples[] = {{"size", "64x48"},     {"kernel", "cone:2"}, {"crop", "0,1,0,1,0,1"},
                   {"annotate", "scale"}, {"centre", "1,2,3"},  {"swivel", "40,20"},
                   {"fill", "-600"},      {"slab", "9@2"},      {"smooth", "auto"}};
    for (size_t i = 0; i < sizeof samples / sizeof *samples; i++)
        if (!strcmp(samples[i].name, o->name))
            return samples[i].value;
    switch (o->kind) {
    case CTS_FLAG:
        return "";
    case CTS_CHOICE:
        return o->choices[!strcmp(o->choices[0], o->fallback)];
    case CTS_INT:
    case CTS_NUMBER:
        return "9";
    default:
        return "given.txt";
    }
}

/* A batch with another value renders again the outputs that the option changes. */
static void test_batch_gets_all_options(void **state)
{
    for (const CtsOption *o = cts_options; o->name; o++) {
        const bool of_objects = o->remakes == CTS_REMAKES_OBJECT;
        if (!cts_option_is_of(o, CTS_FOR_BATCH) || !(of_objects || cts_option_is_of_pictures(o)))
            continue;
        char *without = text_of(NULL, NULL, of_objects), *with = text_of(o->name, sample_of(o), of_objects);
        if (!strcmp(without, with))
            fail_msg("--%s %s is not seen", o->name, sample_of(o));
        free(without);
        free(with);
    }
}

/* The text that identifies the volume of a job with this option. */
static char *choice_of(const char *name, const char *value)
{
    CtsOptions options;
    CtsError err;
    cts_options_begin(&options);
    if (name && take(&options, CTS_FOR_BATCH, name, value, &err))
        fail_msg("%s", err.text);
    const CtsSource source = cts_options_source(&options);
    char *text = cts_source_choice(&source);
    assert_non_null(text);
    cts_options_free(&options);
    return text;
}

/* The tables of options, of settings and of a source's fields agree on the first stage that is remade. */
static void test_stages(void **state)
{
    char *const none = choice_of(NULL, NULL);
    int n_volume = 0, n_render = 0;
    for (const CtsOption *o = cts_options; o->name; o++) {
        if (!cts_option_is_of(o, CTS_FOR_BATCH) || !cts_option_is_of_pictures(o))
            continue;
        char *const given = choice_of(o->name, sample_of(o));
        if ((strcmp(given, none) != 0) != (o->remakes == CTS_REMAKES_VOLUME))
            fail_msg("--%s %s: expected stage %d, but the volume is %s", o->name, sample_of(o), (int)o->remakes,
                     strcmp(given, none) ? "remade" : "kept");
        free(given);
        n_volume += o->remakes == CTS_REMAKES_VOLUME;
        for (const CtsSettingRow *row = cts_setting_rows; row < cts_setting_rows + CTS_N_SETTING_ROWS; row++)
            if (o->size > 0 && o->field == offsetof(CtsOptions, render) + row->at) {
                if (o->remakes != row->remakes)
                    fail_msg("--%s: stage %d, of its setting %d", o->name, (int)o->remakes, (int)row->remakes);
                n_render++;
            }
    }
    assert_true(n_volume >= 9 && n_render >= 8);
    free(none);
}

/* A default that is written as an argument is the default. */
static void test_defaults(void **state)
{
    int n = 0;
    for (const CtsOption *o = cts_options; o->name; o++) {
        CtsOptions none, given;
        CtsError err;
        if (!o->fallback || !cts_option_is_of(o, CTS_FOR_BATCH) || o->remakes == CTS_REMAKES_NOTHING)
            continue;
        cts_options_begin(&none);
        cts_options_begin(&given);
        if (!take(&given, CTS_FOR_BATCH, o->name, o->fallback, &err) && o->kind != CTS_TEXT && o->kind != CTS_TEXTS) {
            CtsOptions bare = given;
            bare.given = NULL;
            bare.n_given = 0;
            if (memcmp(&bare, &none, sizeof none))
                fail_msg("--%s %s is not the default", o->name, o->fallback);
            n++;
        }
        cts_options_free(&none);
        cts_options_free(&given);
    }
    assert_true(n > 8);
}

/* One name and one letter each, a help text, and bounds for every number. */
static void test_rows(void **state)
{
    assert_string_equal(cts_options[0].name, ""); /* each option has a heading above */
    for (const CtsOption *o = cts_options; o->name; o++) {
        if (!o->name[0]) {
            assert_true(o->help && *o->help && !o->commands);
            continue;
        }
        for (const CtsOption *p = cts_options; p < o; p++)
            assert_true(strcmp(o->name, p->name) && (!o->letter || o->letter != p->letter));
        assert_true(o->help && *o->help && o->commands);
        assert_true((o->kind == CTS_FLAG) == !o->argument);
        assert_true((o->kind != CTS_INT && o->kind != CTS_NUMBER) || cts_option_bounds(o));
        assert_ptr_equal(cts_option(o->name, strlen(o->name)), o);
    }
}

static void refused(const char *name, const char *value, const char *pattern)
{
    CtsOptions options;
    CtsError err = {0};
    cts_options_begin(&options);
    CtsStatus st = take(&options, CTS_FOR_JOB, name, value, &err);
    if (!st)
        st = cts_options_end(&options, CTS_FOR_JOB, &err);
    if (st != CTS_ERR_USAGE || !strstr(err.text, pattern))
        fail_msg("%s=%s: \"%s\", not \"%s\"", name, value, err.text, pattern);
    cts_options_free(&options);
}

static void test_near(void **state)
{
    refused("preest", "bone", "did you mean preset?");
    refused("engine", "tile", "did you mean tiled?");
    refused("engine", "clasisc", "did you mean classic?");
    refused("kernel", "gausian:2", "did you mean gaussian?");
    refused("view", "Anterior", "did you mean anterior?");
    refused("view", "ant", "did you mean anterior?");
    refused("mode", "MIP", "did you mean mip?");
    refused("mode", "x-ray", "not one of");
    CtsOptions options;
    CtsError err = {0};
    cts_options_begin(&options);
    assert_int_equal(take(&options, CTS_FOR_JOB, "engine", "something", &err), CTS_ERR_USAGE);
    assert_null(strstr(err.text, "did you mean"));
    assert_int_equal(take(&options, CTS_FOR_JOB, "view", "left", &err), CTS_OK);
    assert_int_equal(take(&options, CTS_FOR_JOB, "view", "right", &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, "batch"));
    cts_options_free(&options);
}

static void test_sizes(void **state)
{
    static const struct {
        const char *text;
        double bytes; /* 0: refused */
    } sizes[] = {{"6G", 0x1.8p32},
                 {"2GiB", 0x1p31},
                 {"2gib", 0x1p31},
                 {"2GB", 0x1p31},
                 {"512M", 0x1p29},
                 {"1.5GiB", 1.5 * 0x1p30},
                 {"1048576", 0x1p20},
                 {"1T", 0x1p40},
                 {"2GiBs", 0},
                 {"2Gi", 0x1p31},
                 {"GiB", 0},
                 {"2 GiB", 0},
                 {"1k", 0},
                 {"-2G", 0},
                 {"", 0},
                 {"2B", 0}};
    for (size_t n = 0; n < sizeof sizes / sizeof *sizes; n++) {
        CtsOptions options;
        CtsError err = {0};
        cts_options_begin(&options);
        const CtsStatus st = take(&options, CTS_FOR_SERVE, "memory", sizes[n].text, &err);
        if (st != (sizes[n].bytes > 0 ? CTS_OK : CTS_ERR_USAGE) || (double)options.memory_bytes != sizes[n].bytes)
            fail_msg("memory %s: expected %g bytes, found %g and status %d", sizes[n].text, sizes[n].bytes,
                     (double)options.memory_bytes, st);
        cts_options_free(&options);
    }
}

static void test_memory(void **state)
{
    char folder[] = "/tmp/given-XXXXXX", source[500], a[64], b[64];
    const char *root = getenv("CTS_TESTDATA");
    if (!root)
        skip();
    assert_non_null(mkdtemp(folder));
    snprintf(source, sizeof source, "%s/phantom", root);
    snprintf(a, sizeof a, "%s/a.png", folder);
    snprintf(b, sizeof b, "%s/b.png", folder);
    CtsJobOption given[] = {{.name = "path", .value = source},      {.name = "output", .value = a},
                            {.name = "size", .value = "96x80"},     {.name = "preset", .value = "skin"},
                            {.name = "annotate", .value = "scale"}, {.name = "rotation", .value = "3"}};
    CtsError err = {0};
    CtsPicture *picture = NULL;
    CtsReport report = {0};
    CtsExport *export;
    if (cts_options_run(given, 5, NULL, &picture, &report, &err))
        fail_msg("%s", err.text);
    assert_int_equal(cts_export_begin(&export, b, picture, 1, &(CtsExportSettings){0}, NULL, &err), CTS_OK);
    assert_int_equal(cts_export_rows(export, picture, &err), CTS_OK);
    cts_export_error(export, &report.bound);
    assert_int_equal(cts_export_end(&export, NULL, &err), CTS_OK);
    cts_report_free(&report);
    assert_same_bytes(a, b);
    cts_picture_free(&picture);

    /* Options without a place, and options that are not a job's. */
    assert_int_equal(cts_options_run(given, 6, NULL, &picture, NULL, &err), CTS_ERR_USAGE);
    assert_null(picture);
    assert_int_equal(cts_options_run(given, 1, NULL, NULL, NULL, &err), CTS_ERR_USAGE);
    given[1] = (CtsJobOption){.name = "json", .value = ""};
    assert_int_equal(cts_options_run(given, 2, NULL, &picture, NULL, &err), CTS_ERR_USAGE);
    unlink(a);
    unlink(b);
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rows),   cmocka_unit_test(test_batch_gets_all_options),
        cmocka_unit_test(test_stages), cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_near),   cmocka_unit_test(test_memory),
        cmocka_unit_test(test_sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
