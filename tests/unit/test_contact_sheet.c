/* The contact sheet's data: valid records of several journals, gathered fields, and hostile contents. */
#include "app/contact/contact_sheet.h"
#include "folder.h"
#include <jansson.h>
#include <sys/stat.h>

static char folder[64];
static const CtsContactWanted wanted = {0};

static int enter(void **state)
{
    make_folder(folder);
    return 0;
}

static int leave(void **state)
{
    remove_folder(folder);
    return 0;
}

static void put(const char *name, const char *text)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

/* Writes the page and reads its data back as a browser does: up to the first end tag. */
static json_t *page_data(void)
{
    static const char start[] = "<script type=\"application/json\" id=\"data\">";
    char path[128];
    size_t n;
    CtsError err = {0};
    if (cts_contact_sheet_write(folder, &wanted, &err))
        fail_msg("%s", err.text);
    snprintf(path, sizeof path, "%s/index.html", folder);
    char *page = (char *)slurp(path, &n);
    page[n] = 0;
    char *from = strstr(page, start);
    assert_non_null(from);
    from += strlen(start);
    char *to = strstr(from, "</script>");
    assert_non_null(to);
    json_error_t where;
    json_t *data = json_loadb(from, (size_t)(to - from), 0, &where);
    if (!data)
        fail_msg("%s at %d", where.text, where.position);
    assert_non_null(strstr(to, "</html>"));
    free(page);
    return data;
}

static const json_t *series_at(const json_t *data, size_t i)
{
    return json_array_get(json_object_get(data, "series"), i);
}

static const char *text_of(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

static void test_last_line_counts(void **state)
{
    put("batch.jsonl", "{\"series_uid\":\"1.2\",\"status\":\"failed\",\"ended\":\"2026-11-22T06:00:09Z\"}\n"
                       "not JSON\n"
                       "{\"series_uid\":\"1.3\",\"status\":\"done\"}\n"
                       "[1]\n"
                       "{\"series_uid\":\"1.2\",\"status\":\"done\",\"ended\":\"2026-11-22T06:00:01Z\"}\n"
                       "{\"series_uid\":\"1.4\",\"status\":\"do");
    json_t *data = page_data();
    assert_int_equal(json_array_size(json_object_get(data, "series")), 2);
    assert_string_equal(text_of(series_at(data, 0), "status"), "done");
    assert_string_equal(text_of(series_at(data, 1), "series_uid"), "1.3");
    assert_int_equal(json_integer_value(json_object_get(data, "unreadable")), 2);
    json_decref(data);
}

static void test_shards(void **state)
{
    put("batch-0-of-2.jsonl", "{\"series_uid\":\"1.2\",\"reason\":\"later\",\"ended\":\"2026-11-22T06:00:09Z\"}\n");
    put("batch-1-of-2.jsonl", "{\"series_uid\":\"1.2\",\"reason\":\"earlier\",\"ended\":\"2026-11-22T06:00:01Z\"}\n"
                              "{\"series_uid\":\"1.5\"}\n");
    put("batch-1-of-2.jsonl.tmp", "{\"series_uid\":\"1.9\"}\n");
    put("batch-x-of-2.jsonl", "{\"series_uid\":\"1.9\"}\n");
    json_t *data = page_data();
    assert_int_equal(json_array_size(json_object_get(data, "series")), 2);
    assert_string_equal(text_of(series_at(data, 0), "reason"), "later");
    json_decref(data);
}

/* Batches in folders of their own: one page, paths from its own folder. */
static void test_folders(void **state)
{
    char path[128], file[160];
    snprintf(path, sizeof path, "%s/ST_1", folder);
    assert_int_equal(mkdir(path, 0700), 0);
    put("batch.jsonl", "{\"series_uid\":\"1.2\"}\n");
    put("ST_1/batch.jsonl", "{\"series_uid\":\"1.3\",\"outputs\":[{\"path\":\"1.3/a.png\",\"format\":\"png\"}]}\n");
    json_t *data = page_data();
    assert_int_equal(json_array_size(json_object_get(data, "series")), 2);
    const json_t *picture = json_array_get(json_object_get(series_at(data, 1), "pictures"), 0);
    assert_string_equal(text_of(json_object_get(json_object_get(picture, "files"), "png"), "first"), "ST_1/1.3/a.png");
    json_decref(data);
    snprintf(file, sizeof file, "%s/batch.jsonl", path);
    assert_int_equal(unlink(file), 0);
    assert_int_equal(rmdir(path), 0);
}

/* A reason that looks like markup ends no script element, and paths stay below the folder. */
static void test_hostile(void **state)
{
    static const char evil[] = "</script><script>alert(1)</script><!--<script>";
    json_t *line =
        json_pack("{s:s, s:s, s:[{s:s,s:s,s:s,s:s},{s:s,s:s},{s:s,s:s},{s:s,s:s},{s:s,s:s},{s:s,s:s}]}", "series_uid",
                  evil, "reason", evil, "outputs", "path", "1.2/a#b.png", "preset", evil, "view", "left", "format",
                  "png", "path", "/etc/passwd", "format", "png", "path", "../../x.png", "format", "png", "path",
                  "a/../x.png", "format", "png", "path", "a//x.png", "format", "png", "path", "", "format", "png");
    char *text = json_dumps(line, 0), *row;
    assert_true(asprintf(&row, "%s\n", text) > 0);
    put("batch.jsonl", row);
    json_t *data = page_data();
    const json_t *series = series_at(data, 0), *pictures = json_object_get(series, "pictures");
    assert_string_equal(text_of(series, "series_uid"), evil);
    assert_string_equal(text_of(series, "reason"), evil);
    assert_int_equal(json_array_size(pictures), 1);
    assert_string_equal(text_of(json_array_get(pictures, 0), "preset"), evil);
    free(text);
    free(row);
    json_decref(line);
    json_decref(data);
}

static void test_pictures(void **state)
{
    put("batch.jsonl",
        "{\"series_uid\":\"1.2\",\"input_sha256\":\"00\",\"outputs\":["
        "{\"path\":\"1.2/bone-left-000.png\",\"preset\":\"bone\",\"view\":\"left\",\"frame\":0,\"format\":\"png\"},"
        "{\"path\":\"1.2/bone-left.dcm\",\"preset\":\"bone\",\"view\":\"left\",\"format\":\"dcm\"},"
        "{\"path\":\"1.2/bone-left-001.png\",\"preset\":\"bone\",\"view\":\"left\",\"frame\":1,\"format\":\"png\"},"
        "{\"path\":\"1.2/skin-left-000.png\",\"preset\":\"skin\",\"view\":\"left\",\"frame\":0,\"format\":\"png\"}],"
        "\"thumbnails\":["
        "{\"path\":\"1.2/thumbs/bone-left.webp\",\"preset\":\"bone\",\"view\":\"left\",\"frames\":1},"
        "{\"path\":\"1.2/thumbs/bone-left-turn.webp\",\"preset\":\"bone\",\"view\":\"left\",\"frames\":2,"
        "\"width\":240,\"height\":120},"
        "{\"path\":\"1.2/thumbs/sections.webp\",\"sections\":true}],\"labels\":[{\"name\":\"liver\"}]}\n");
    json_t *data = page_data();
    const json_t *series = series_at(data, 0), *pictures = json_object_get(series, "pictures");
    assert_null(json_object_get(series, "input_sha256"));
    assert_string_equal(text_of(series, "sections"), "1.2/thumbs/sections.webp");
    assert_int_equal(json_array_size(json_object_get(series, "labels")), 1);
    json_t *expected = json_loads(
        "[{\"preset\":\"bone\",\"view\":\"left\",\"files\":{\"png\":{\"first\":\"1.2/bone-left-000.png\",\"frames\":2},"
        "\"dcm\":{\"first\":\"1.2/bone-left.dcm\",\"frames\":1}},\"thumb\":\"1.2/thumbs/bone-left.webp\","
        "\"turn\":{\"path\":\"1.2/thumbs/bone-left-turn.webp\",\"frames\":2,\"width\":240,\"height\":120}},"
        "{\"preset\":\"skin\",\"view\":\"left\",\"files\":{\"png\":{\"first\":\"1.2/"
        "skin-left-000.png\",\"frames\":1}}}]",
        0, NULL);
    assert_non_null(expected);
    assert_true(json_equal(pictures, expected));
    json_decref(expected);
    json_decref(data);
}

static void test_nothing_to_show(void **state)
{
    CtsError err = {0};
    assert_int_equal(cts_contact_sheet_write(folder, &wanted, &err), CTS_ERR_READ);
    assert_non_null(strstr(err.text, "holds no journal"));
    assert_int_equal(cts_contact_sheet_write("no-such-folder", &wanted, &err), CTS_ERR_READ);
    assert_int_equal(count_files(folder), 0);
    put("batch.jsonl", "");
    json_t *data = page_data();
    assert_int_equal(json_array_size(json_object_get(data, "series")), 0);
    json_decref(data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_last_line_counts, enter, leave),
        cmocka_unit_test_setup_teardown(test_shards, enter, leave),
        cmocka_unit_test_setup_teardown(test_folders, enter, leave),
        cmocka_unit_test_setup_teardown(test_hostile, enter, leave),
        cmocka_unit_test_setup_teardown(test_pictures, enter, leave),
        cmocka_unit_test_setup_teardown(test_nothing_to_show, enter, leave),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
