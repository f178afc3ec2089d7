/* Truncated, modified and inconsistent files: test_damage TESTDATA. A loaded volume is correct or there is none; for
 * any bytes, the reader ends and stays within its memory (the sanitizer build checks it). */
#include "base/sanitized.h"
#include "ctsplat/series.h"
#include "dicom_files.h"
#include <sys/stat.h>
#include <zlib.h>

static const char *testdata;

typedef struct Series {
    char folder[64];
    CtsVolume *good;
    Bytes victim; /* one file of the series, whole */
} Series;

static const char victim_name[] = "IM0004.dcm";

/* *reported: the reader reported a missing slice. err->text: after a success, the slice left out and the reason. */
static CtsStatus load_reporting(const char *folder, CtsVolume **volume, bool *reported, CtsError *err)
{
    static char left_out[400];
    CtsReport report = {0};
    CtsSeriesList *list = NULL;
    const CtsSeries *series = NULL;
    *volume = NULL;
    *err = (CtsError){0};
    CtsStatus st = cts_series_find(&folder, 1, 1, &list, NULL, err);
    if (!st)
        st = cts_series_choose(list, NULL, &series, err);
    if (!st)
        st = cts_series_load(series, 1, NULL, volume, &report, err);
    *reported = cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_MISSING_SLICES);
    const CtsDiagnostic *const bad = cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_BAD_SLICES);
    snprintf(left_out, sizeof left_out, "%s", bad ? bad->text : "");
    if (!st)
        snprintf(err->text, sizeof err->text, "%s", left_out);
    cts_report_free(&report);
    cts_series_list_free(&list);
    assert_true((st == CTS_OK) == (*volume != NULL));
    assert_true(st == CTS_OK || err->text[0]);
    return st;
}

static CtsStatus load_folder(const char *folder, CtsVolume **volume, CtsError *err)
{
    bool reported;
    return load_reporting(folder, volume, &reported, err);
}

/* A copy of one of the test series in a folder of its own. */
static void copy_series(Series *s, const char *name)
{
    char from[400], path[800];
    CtsError err;
    make_folder(s->folder);
    snprintf(from, sizeof from, "%s/%s", testdata, name);
    DIR *dir = opendir(from);
    assert_non_null(dir);
    for (struct dirent *e; (e = readdir(dir));) {
        if (e->d_name[0] == '.')
            continue;
        size_t n;
        snprintf(path, sizeof path, "%s/%s", from, e->d_name);
        uint8_t *bytes = slurp(path, &n);
        write_bytes(s->folder, e->d_name, bytes, n);
        if (strcmp(e->d_name, victim_name) == 0)
            s->victim = (Bytes){.data = bytes, .n = n};
        else
            free(bytes);
    }
    closedir(dir);
    assert_non_null(s->victim.data);
    if (load_folder(s->folder, &s->good, &err))
        fail_msg("%s: %s", name, err.text);
}

static void done(Series *s)
{
    cts_volume_free(&s->good);
    free(s->victim.data);
    remove_folder(s->folder);
}

static bool equal(const CtsVolume *a, const CtsVolume *b)
{
    return memcmp(a->dims, b->dims, sizeof a->dims) == 0 &&
           memcmp(a->grey, b->grey, cts_volume_n_voxels(a) * sizeof *a->grey) == 0;
}

static const char *const encodings[] = {"syntax/implicit", "syntax/explicit", "syntax/big",
                                        "syntax/deflated", "syntax/rle",      "syntax/jpeg-lossless",
                                        "syntax/jpeg-ls",  "syntax/jpeg-2000"};
enum { N_ENCODINGS = sizeof encodings / sizeof *encodings };

/* A slice with truncated pixels is left out, interpolated, and reported: never used in part, never silently. */
static void test_cut_short(void **state)
{
    for (int e = 0; e < N_ENCODINGS; e++) {
        Series s = {0};
        copy_series(&s, encodings[e]);
        for (size_t n = 0; n < s.victim.n;
             n += n < 200 || n + 40 > s.victim.n ? 1 + 4 * CTS_SANITIZED : 11 + 60 * CTS_SANITIZED) {
            CtsVolume *v;
            CtsError err;
            bool reported;
            write_bytes(s.folder, victim_name, s.victim.data, n);
            if (load_reporting(s.folder, &v, &reported, &err))
                fail_msg("%s cut to %zu bytes: %s", encodings[e], n, err.text);
            if (reported == equal(v, s.good))
                fail_msg("%s cut to %zu bytes: another picture in silence", encodings[e], n);
            cts_volume_free(&v);
        }
        done(&s);
    }
}

static void test_wrong_bytes(void **state)
{
    uint32_t random = 1;
    for (int e = 0; e < N_ENCODINGS; e++) {
        Series s = {0};
        copy_series(&s, encodings[e]);
        for (int round = 0; round < (CTS_SANITIZED ? 80 : 400); round++) {
            CtsVolume *v;
            CtsError err;
            uint8_t *bytes = malloc(s.victim.n);
            memcpy(bytes, s.victim.data, s.victim.n);
            for (int change = 0; change <= round % 3; change++) {
                random = random * 1664525u + 1013904223u;
                bytes[132 + (random >> 8) % (s.victim.n - 132)] ^= (uint8_t)(1 + round % 255);
            }
            write_bytes(s.folder, victim_name, bytes, s.victim.n);
            load_folder(s.folder, &v, &err);
            cts_volume_free(&v);
            free(bytes);
        }
        done(&s);
    }
}

static uint8_t *find_bytes(Bytes *b, const char *bytes, size_t n)
{
    uint8_t *at = memmem(b->data, b->n, bytes, n);
    assert_non_null(at);
    return at;
}

/* The victim is left out for this reason, and the volume reports that it is interpolated there. */
static void expect_left_out(Series *s, const char *part)
{
    CtsVolume *v;
    CtsError err;
    bool reported;
    write_bytes(s->folder, victim_name, s->victim.data, s->victim.n);
    const CtsStatus st = load_reporting(s->folder, &v, &reported, &err);
    if (st || !reported || !strstr(err.text, part) || !strstr(err.text, victim_name))
        fail_msg("%d %s, wanted %s", st, err.text, part);
    assert_int_equal(v->dims[2], s->good->dims[2]);
    assert_false(equal(v, s->good));
    cts_volume_free(&v);
}

/* Streams that DCMTK 3.6.7 loops on, overruns or decodes to half a picture. */
static void test_jpeg_headers(void **state)
{
    static const struct {
        const char *folder;
        uint8_t frame; /* marker of the frame header */
    } kinds[] = {{"syntax/jpeg-lossless", 0xC3}, {"syntax/jpeg-ls", 0xF7}};
    for (int k = 0; k < 2; k++) {
        Series s = {0};
        copy_series(&s, kinds[k].folder);
        uint8_t *soi = find_bytes(&s.victim, "\xff\xd8\xff", 3);
        uint8_t *frame = find_bytes(&s.victim, (const char[]){(char)0xFF, (char)kinds[k].frame}, 2);
        const uint8_t kept[4] = {soi[3], frame[4], frame[6], frame[9]};
        soi[3] = 0x01;
        expect_left_out(&s, "marker FF 01");
        soi[3] = kept[0];
        frame[4] = 8;
        expect_left_out(&s, "8 bits");
        frame[4] = kept[1];
        frame[6] = (uint8_t)(kept[2] + 1);
        expect_left_out(&s, "28 x 25");
        frame[6] = kept[2];
        frame[9] = 3;
        expect_left_out(&s, "3 components");
        frame[9] = kept[3];
        soi[1] = 0xD9;
        expect_left_out(&s, "no JPEG stream");
        soi[1] = 0xD8;
        if (frame[4] == 12) { /* else its upper bits may be an overlay */
            uint8_t *stored = find_bytes(&s.victim, "\x28\0\x01\x01US\2\0", 8);
            uint8_t *high = find_bytes(&s.victim, "\x28\0\x02\x01US\2\0", 8);
            stored[8] = 10;
            high[8] = 9;
            expect_left_out(&s, "reads as another number");
        }
        done(&s);
    }
}

static void test_rle_headers(void **state)
{
    Series s = {0};
    copy_series(&s, "syntax/rle");
    /* two segments, the first behind the header of 64 bytes */
    uint8_t *header = find_bytes(&s.victim, "\2\0\0\0\x40\0\0\0", 8);
    uint8_t kept[12];
    memcpy(kept, header, sizeof kept);
    header[0] = 3;
    expect_left_out(&s, "2 segments");
    memcpy(header, kept, sizeof kept);
    header[4] = 8;
    expect_left_out(&s, "offsets");
    memcpy(header, kept, sizeof kept);
    header[11] = 0x7F;
    expect_left_out(&s, "offsets");
    memcpy(header, kept, sizeof kept);
    /* the first segment ends where its codes begin: the picture would be filled up */
    memset(header + 64, 0x80, 8);
    CtsVolume *v;
    CtsError err;
    write_bytes(s.folder, victim_name, s.victim.data, s.victim.n);
    if (load_folder(s.folder, &v, &err) == CTS_OK)
        assert_true(v->dims[2] == s.good->dims[2]); /* 0x80 is "no operation"; the remainder may still be complete */
    cts_volume_free(&v);
    done(&s);
}

/* The file changes between the reading of its header and of its pixels. */
static void test_changed_meanwhile(void **state)
{
    Series s = {0};
    CtsError err;
    CtsVolume *v = NULL;
    CtsSeriesList *list = NULL;
    copy_series(&s, "syntax/explicit");
    const char *folder = s.folder;
    char path[400];
    snprintf(path, sizeof path, "%s/%s", s.folder, victim_name);
    assert_int_equal(cts_series_find(&folder, 1, 1, &list, NULL, &err), CTS_OK);
    assert_int_equal(truncate(path, (off_t)s.victim.n - 100), 0);
    assert_int_equal(cts_series_load(&list->items[0], 2, NULL, &v, NULL, &err), CTS_ERR_READ);
    assert_non_null(strstr(err.text, "IM0004.dcm"));
    assert_non_null(strstr(err.text, "changed"));
    assert_null(v);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(cts_series_load(&list->items[0], 2, NULL, &v, NULL, &err), CTS_ERR_READ);
    write_bytes(s.folder, victim_name, s.victim.data, s.victim.n); /* so that the folder can be emptied */
    cts_series_list_free(&list);
    done(&s);
}

/* A small deflated file that would inflate to gigabytes is given up at the header limit. */
static void test_deflate_bomb(void **state)
{
    enum { ZEROS = 80 << 20 };
    Bytes plain = {0}, file = {0};
    Slice slice = sound_slice();
    slice.syntax = "1.2.840.10008.1.2.1.99";
    put_text(&plain, 0x00080016, "UI", slice.sop_class);
    put_tag(&plain, 0x00091010);
    put(&plain, "OB\0\0", 4);
    put32(&plain, ZEROS);
    const size_t n_start = plain.n;
    plain.data = realloc(plain.data, n_start + ZEROS);
    assert_non_null(plain.data);
    memset(plain.data + n_start, 0, ZEROS);
    uint8_t *deflated = malloc(1 << 20);
    z_stream z = {
        .next_in = plain.data, .avail_in = (uInt)(n_start + ZEROS), .next_out = deflated, .avail_out = 1 << 20};
    assert_int_equal(deflateInit2(&z, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY), Z_OK);
    assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
    deflateEnd(&z);
    put_meta(&file, &slice);
    put(&file, deflated, z.total_out);
    char folder[64];
    make_folder(folder);
    write_bytes(folder, "bomb", file.data, file.n);
    CtsVolume *v;
    CtsError err;
    assert_int_equal(load_folder(folder, &v, &err), CTS_ERR_READ);
    assert_non_null(strstr(err.text, "64 MiB"));
    remove_folder(folder);
    free(deflated);
    free(plain.data);
    free(file.data);
}

/* A DICOMDIR of files whose names changed in case and ending, one that climbs out, and one that is not there. */
static void test_directory(void **state)
{
    static const char *const ids[] = {"IM1", "IM2", "..\\IM3", "IM4", "SUB\\IM5", "IM6", "IM7.DCM", "1.2.8"};
    static const char *const names[] = {"IM1", "im2", "sub/Im5.dcm", "IM6.DCM;1", "IM7.ima", "1.2.8.dcm", "not-named"};
    enum { N_IDS = sizeof ids / sizeof *ids, N_NAMES = sizeof names / sizeof *names };
    Bytes file = {0}, items = {0};
    const Slice directory = {.sop_class = "1.2.840.10008.1.3.10", .syntax = "1.2.840.10008.1.2.1"};
    for (int i = 0; i < N_IDS; i++) {
        Bytes record = {0};
        put_text(&record, 0x00041430, "CS", "IMAGE");
        put_text(&record, 0x00041500, "CS", ids[i]);
        put_tag(&items, 0xFFFEE000);
        put32(&items, (uint32_t)record.n);
        put(&items, record.data, record.n);
        free(record.data);
    }
    put_meta(&file, &directory);
    put_element(&file, 0x00041220, "SQ", items.data, (uint32_t)items.n);
    char folder[64], subfolder[80], path[400];
    make_folder(folder);
    write_bytes(folder, "DICOMDIR", file.data, file.n);
    write_bytes(folder, "IM6.BMP", "BM", 2);
    snprintf(subfolder, sizeof subfolder, "%s/sub", folder);
    assert_int_equal(mkdir(subfolder, 0777), 0);
    for (int i = 0; i < N_NAMES; i++) {
        StackTexts t;
        const Slice s = stack_slice(&t, i, 0, 0, i);
        write_slice(folder, names[i], &s);
    }
    snprintf(path, sizeof path, "%s/DICOMDIR", folder);
    const char *paths[] = {path};
    CtsSeriesList *list = NULL;
    CtsError err;
    assert_int_equal(cts_series_find(paths, 1, 1, &list, NULL, &err), CTS_OK);
    assert_true(list->n == 1 && list->items[0].n_slices == N_NAMES - 1 && list->n_unreadable == 1 &&
                list->n_not_ct == 1);
    assert_non_null(cts_diagnostics_find(&list->diagnostics, CTS_DIAGNOSTIC_DIRECTORY_ESCAPES));
    assert_non_null(cts_diagnostics_find(&list->diagnostics, CTS_DIAGNOSTIC_UNREADABLE_FILE));
    cts_series_list_free(&list);
    /* found in a folder it is passed over, and the folder's own files count */
    paths[0] = folder;
    assert_int_equal(cts_series_find(paths, 1, 1, &list, NULL, &err), CTS_OK);
    assert_true(list->items[0].n_slices == N_NAMES && list->n_not_ct == 2 && list->n_unreadable == 0);
    cts_series_list_free(&list);
    remove_folder(subfolder);
    remove_folder(folder);
    free(items.data);
    free(file.data);
}

/* A pipe must not be opened, a link to the folder itself not be followed. */
static void test_special_files(void **state)
{
    Series s = {0};
    char path[400];
    CtsVolume *v;
    CtsError err;
    copy_series(&s, "syntax/explicit");
    snprintf(path, sizeof path, "%s/pipe", s.folder);
    assert_int_equal(mkfifo(path, 0600), 0);
    snprintf(path, sizeof path, "%s/loop", s.folder);
    assert_int_equal(symlink(".", path), 0);
    snprintf(path, sizeof path, "%s/dangling", s.folder);
    assert_int_equal(symlink("nowhere", path), 0);
    assert_int_equal(load_folder(s.folder, &v, &err), CTS_OK);
    assert_true(equal(v, s.good));
    cts_volume_free(&v);
    done(&s);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cut_short),         cmocka_unit_test(test_wrong_bytes),
        cmocka_unit_test(test_jpeg_headers),      cmocka_unit_test(test_rle_headers),
        cmocka_unit_test(test_deflate_bomb),      cmocka_unit_test(test_directory),
        cmocka_unit_test(test_changed_meanwhile), cmocka_unit_test(test_special_files),
    };
    if (argc != 2)
        return 2;
    testdata = argv[1];
    return cmocka_run_group_tests(tests, NULL, NULL);
}
