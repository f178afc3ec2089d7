/* From files to a volume: finding, sorting, refusals, warnings and loading. */
#include "dicom/header/slice.h"
#include "found.h"
#include <sys/stat.h>

static CtsVolume *load(const CtsSeries *series, int threads)
{
    CtsVolume *v = NULL;
    CtsError err = {0};
    if (cts_series_load(series, threads, NULL, &v, NULL, &err))
        fail_msg("%s", err.text);
    return v;
}

/* Voxel (i, j) of the slice that write_stack() gave the number k. */
static int stack_grey(int k, int i, int j)
{
    return 1000 + 100 * k + i + 10 * j;
}

static void expect_slice(const CtsVolume *v, int layer, int k)
{
    for (int j = 0; j < SLICE_ROWS; j++)
        for (int i = 0; i < SLICE_COLUMNS; i++)
            assert_int_equal(v->grey[(layer * SLICE_ROWS + j) * SLICE_COLUMNS + i], stack_grey(k, i, j));
}

static const double five[] = {0, 2, 4, 6, 8};

static void test_sorted(void **state)
{
    Found f;
    make_folder(f.folder);
    write_stack(f.folder, five, 5);
    write_bytes(f.folder, "notes.txt", "text", 4);
    write_bytes(f.folder, "empty", "", 0);
    find(&f);
    assert_int_equal(f.status, CTS_OK);
    assert_true(f.list->n == 1 && f.list->n_files == 7 && f.list->n_not_ct == 2 && f.list->n_unreadable == 0);
    const CtsSeries *s = &f.list->items[0];
    assert_true(s->renderable && s->n_slices == 5 && s->columns == SLICE_COLUMNS && s->rows == SLICE_ROWS);
    assert_true(s->spacing_mm[0] == 0.5 && s->spacing_mm[1] == 0.75 && s->spacing_mm[2] == 2 && s->tilt_deg == 0);
    assert_string_equal(s->uid, "1.2.3");
    assert_string_equal(s->modality, "CT");
    assert_string_equal(s->orientation, "axial");
    assert_string_equal(s->transfer_syntax, "1.2.840.10008.1.2.1");
    assert_int_equal(s->diagnostics.n, 0);
    CtsVolume *v = load(s, 2);
    assert_true(v->dims[0] == SLICE_COLUMNS && v->dims[1] == SLICE_ROWS && v->dims[2] == 5);
    for (int k = 0; k < 5; k++)
        expect_slice(v, k, k);
    assert_true(v->origin_lps[0] == -1 && v->origin_lps[1] == -2 && v->origin_lps[2] == 0);
    assert_true(v->step_lps[0][0] == 0.5 && v->step_lps[1][1] == 0.75 && v->step_lps[2][2] == 2);
    assert_true(v->hu_offset == -1024 && v->hu_step == 1);
    assert_true(v->hu_min == 1000 - 1024 && v->hu_max == stack_grey(4, SLICE_COLUMNS - 1, SLICE_ROWS - 1) - 1024);
    cts_volume_free(&v);
    done(&f);
}

/* Slices head first and feet first: the same voxels at the same places. */
static void test_normal_down(void **state)
{
    Found f;
    make_folder(f.folder);
    for (int k = 0; k < 4; k++) {
        StackTexts t;
        Slice s = stack_slice(&t, k, 0, 0, 3 * k);
        s.orientation = "1\\0\\0\\0\\-1\\0";
        write_numbered(f.folder, k, &s);
    }
    find(&f);
    assert_int_equal(f.status, CTS_OK);
    CtsVolume *v = load(&f.list->items[0], 1);
    assert_true(v->origin_lps[2] == 9 && v->step_lps[2][2] == -3 && v->step_lps[1][1] == -0.75);
    for (int k = 0; k < 4; k++)
        expect_slice(v, k, 3 - k);
    cts_volume_free(&v);
    done(&f);
}

static void test_resampled(void **state)
{
    Found f;
    const double z[] = {0, 1, 2, 2.5, 3, 4, 5.5};
    find_stack(&f, z, 7);
    const CtsSeries *s = &f.list->items[0];
    assert_true(s->renderable && s->n_slices == 7 && s->spacing_mm[2] == 1);
    assert_int_equal(cts_diagnostics_find(&s->diagnostics, CTS_DIAGNOSTIC_UNEQUAL_SPACING)->severity, CTS_WARNING);
    CtsReport report = {0};
    CtsVolume *v = NULL;
    assert_int_equal(cts_series_load(s, 2, NULL, &v, &report, &f.err), CTS_OK);
    assert_non_null(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_UNEQUAL_SPACING));
    assert_true(report.stages[CTS_STAGE_DECODE].ran && report.stages[CTS_STAGE_GREY].ran);
    assert_int_equal(report.stages[CTS_STAGE_DECODE].items, 7);
    assert_true(v->dims[2] == 12 && v->step_lps[2][2] == 0.5);
    static const int slice_at[12] = {0, -1, 1, -1, 2, 3, 4, -1, 5, -1, -1, 6};
    for (int layer = 0; layer < 12; layer++)
        if (slice_at[layer] >= 0)
            expect_slice(v, layer, slice_at[layer]);
    assert_int_equal(v->grey[1 * SLICE_ROWS * SLICE_COLUMNS], stack_grey(0, 0, 0) + 50);
    assert_int_equal(v->grey[9 * SLICE_ROWS * SLICE_COLUMNS], stack_grey(5, 0, 0) + 33);
    cts_volume_free(&v);
    cts_report_free(&report);
    done(&f);
}

/* The scanned slices are unchanged by the volumes made from them. */
static void test_scanned(void **state)
{
    Found f;
    const double z[] = {0, 1, 2, 2.5, 3, 4, 5.5};
    find_stack(&f, z, 7);
    const CtsSeries *s = &f.list->items[0];
    CtsVolume *alone = load(s, 2), *first = NULL, *last = NULL;
    CtsScanned *scanned = NULL;
    CtsInterpolationCounts made = {0};
    assert_int_equal(cts_series_scan(s, NULL, 2, &scanned, NULL, &f.err), CTS_OK);
    assert_int_equal(scanned->n_slices, 7);
    for (int k = 0; k < 7; k++)
        assert_true(scanned->position_lps[k][2] == z[k] && scanned->layer[k] == 2 * z[k]);
    assert_int_equal(cts_scanned_volume(scanned, CTS_INTERPOLATION_LINEAR, false, 1, &first, &made, &f.err), CTS_OK);
    memset(first->grey, 0, cts_volume_n_voxels(first) * sizeof *first->grey);
    for (int k = 0; k < 7; k++)
        assert_int_equal(scanned->even->grey[k * SLICE_ROWS * SLICE_COLUMNS], stack_grey(k, 0, 0));
    assert_int_equal(cts_scanned_volume(scanned, CTS_INTERPOLATION_LINEAR, true, 2, &last, &made, &f.err), CTS_OK);
    assert_memory_equal(last->grey, alone->grey, cts_volume_n_voxels(alone) * sizeof *alone->grey);
    assert_null(scanned->even->grey);
    cts_volume_free(&first);
    assert_int_equal(cts_scanned_volume(scanned, CTS_INTERPOLATION_LINEAR, true, 2, &first, &made, &f.err),
                     CTS_ERR_INTERNAL);
    cts_volume_free(&alone);
    cts_volume_free(&last);
    cts_scanned_free(&scanned);
    done(&f);
}

/* A data set in implicit VR under a UID that is unknown: the UID is named, and nothing is called damaged. */
static void test_private_syntax(void **state)
{
    Found f;
    make_folder(f.folder);
    for (int k = 0; k < 4; k++) {
        StackTexts t;
        char name[16];
        Slice s = stack_slice(&t, k, 0, 0, 2 * k);
        Bytes b = {0}, explicit_vr = {0};
        s.syntax = k % 2 ? "1.2.840.113619.5.2" : "1.2.840.10008.1.20";
        put_meta(&b, &s);
        put_header(&explicit_vr, &s);
        for (size_t at = 0; at < explicit_vr.n;) { /* short forms all */
            const size_t n = explicit_vr.data[at + 6] | (size_t)explicit_vr.data[at + 7] << 8;
            put(&b, explicit_vr.data + at, 4);
            put32(&b, (uint32_t)n);
            put(&b, explicit_vr.data + at + 8, n);
            at += 8 + n;
        }
        put_tag(&b, 0x7FE00010);
        put32(&b, SLICE_COLUMNS * SLICE_ROWS * 2);
        for (int i = 0; i < SLICE_COLUMNS * SLICE_ROWS; i++)
            put16(&b, 1000);
        snprintf(name, sizeof name, "%d", k);
        write_bytes(f.folder, name, b.data, b.n);
        free(b.data);
        free(explicit_vr.data);
    }
    find(&f);
    assert_int_equal(f.status, CTS_OK);
    assert_int_equal(f.list->n_unreadable, 0);
    assert_int_equal(f.list->items[0].refusal, CTS_ERR_SYNTAX);
    assert_non_null(strstr(f.list->items[0].reason, "transfer syntax 1.2.840.10008.1.20 is unknown"));
    done(&f);
}

/* Pixels below 0 that the header calls unsigned: air would be the brightest of all. */
static void test_wrong_sign(void **state)
{
    for (int is_signed = 0; is_signed < 2; is_signed++) {
        Found f;
        make_folder(f.folder);
        for (int k = 0; k < 4; k++) {
            StackTexts t;
            Slice s = stack_slice(&t, k, 0, 0, 2 * k);
            s.base = 65500;
            s.intercept = "0";
            s.is_signed = is_signed;
            write_numbered(f.folder, k, &s);
        }
        find(&f);
        CtsVolume *v = NULL;
        CtsError err = {0};
        assert_int_equal(cts_series_load(&f.list->items[0], 1, NULL, &v, NULL, &err),
                         is_signed ? CTS_OK : CTS_ERR_PIXELS);
        assert_true(is_signed || strstr(err.text, "(0028,0103)"));
        cts_volume_free(&v);
        done(&f);
    }
}

/* Instance numbers by slice that do not begin at 1 cause a note, rising or falling; other numbers have no meaning. */
static void test_first_number(void **state)
{
    static const struct {
        int first, step, odd; /* odd: added to slice 2 */
        const char *diagnostic_expected;
    } numberings[] = {{1, 1, 0, NULL},
                      {5, -1, 0, NULL},
                      {2, 1, 0, "begin at 2: up to 1 slices"},
                      {9, -1, 0, "begin at 5: up to 4 slices"},
                      {7, 2, 0, NULL},
                      {7, 1, 1, NULL},
                      {7, 0, 0, NULL},
                      {0, 1, 0, NULL}};
    for (size_t c = 0; c < sizeof numberings / sizeof *numberings; c++) {
        Found f;
        make_folder(f.folder);
        for (int k = 0; k < 5; k++) {
            StackTexts t;
            char instance[16];
            Slice s = stack_slice(&t, k, 0, 0, 2 * k);
            snprintf(instance, sizeof instance, "%d",
                     numberings[c].first + k * numberings[c].step + (k == 2 ? numberings[c].odd : 0));
            s.instance = instance;
            write_numbered(f.folder, k, &s);
        }
        find(&f);
        const CtsDiagnostic *diagnostic_expected =
            cts_diagnostics_find(&f.list->items[0].diagnostics, CTS_DIAGNOSTIC_LATE_FIRST_NUMBER);
        if (!diagnostic_expected != !numberings[c].diagnostic_expected ||
            (diagnostic_expected && !strstr(diagnostic_expected->text, numberings[c].diagnostic_expected)))
            fail_msg("case %zu: %s", c, diagnostic_expected ? diagnostic_expected->text : "nothing");
        assert_true(!diagnostic_expected || diagnostic_expected->severity == CTS_NOTE);
        done(&f);
    }
}

/* Slices of zeros between others are reported; at the ends they may be air. */
static void test_blank(void **state)
{
    static const struct {
        unsigned blank; /* a bit for each slice */
        const char *diagnostic_expected;
    } blanks[] = {{0, NULL},
                  {1, NULL},
                  {1 << 5 | 1 << 4, NULL},
                  {63, NULL},
                  {4, "IM2: one value"},
                  {4 | 8, "IM2: one value in all pixels, as in 1 more"},
                  {1 | 2 | 8, "IM3: one value"}};
    for (size_t c = 0; c < sizeof blanks / sizeof *blanks; c++) {
        Found f;
        make_folder(f.folder);
        for (int k = 0; k < 6; k++) {
            StackTexts t;
            char name[16];
            const Slice s = stack_slice(&t, k, 0, 0, 2 * k);
            Bytes b = slice_bytes(&s);
            const size_t n = 2 * SLICE_ROWS * SLICE_COLUMNS;
            if (blanks[c].blank >> k & 1)
                memset(b.data + b.n - n, 0, n);
            snprintf(name, sizeof name, "IM%d", k);
            write_bytes(f.folder, name, b.data, b.n);
            free(b.data);
        }
        find(&f);
        CtsReport report = {0};
        CtsVolume *v = NULL;
        assert_int_equal(cts_series_load(&f.list->items[0], 2, NULL, &v, &report, &f.err), CTS_OK);
        const CtsDiagnostic *diagnostic_expected =
            cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_BLANK_SLICES);
        if (!diagnostic_expected != !blanks[c].diagnostic_expected ||
            (diagnostic_expected && !strstr(diagnostic_expected->text, blanks[c].diagnostic_expected)))
            fail_msg("case %zu: %s", c, diagnostic_expected ? diagnostic_expected->text : "nothing");
        cts_volume_free(&v);
        v = load(&f.list->items[0], 1);
        cts_volume_free(&v);
        cts_report_free(&report);
        done(&f);
    }
}

/* Folders are searched to a depth of 32. */
static void test_deep_folders(void **state)
{
    for (int depth = 32; depth <= 33; depth++) {
        Found f;
        char path[400];
        make_folder(f.folder);
        snprintf(path, sizeof path, "%s", f.folder);
        for (int d = 0; d < depth; d++) {
            strcat(path, "/d");
            assert_int_equal(mkdir(path, 0700), 0);
        }
        write_stack(path, five, 5);
        find(&f);
        assert_int_equal(f.status, depth <= 32 ? CTS_OK : CTS_ERR_READ);
        assert_true(depth <= 32 || strstr(f.err.text, "32 folders deep"));
        cts_series_list_free(&f.list);
        for (int d = depth; d >= 0; d--) {
            remove_folder(path);
            if (d)
                *strrchr(path, '/') = 0;
        }
    }
}

static void expect_refused(Found *f, CtsStatus status, const char *part)
{
    find(f);
    if (f->status)
        fail_msg("%s", f->err.text);
    assert_int_equal(f->list->items[0].refusal, status);
    if (!strstr(f->list->items[0].reason, part))
        fail_msg("\"%s\" does not say \"%s\"", f->list->items[0].reason, part);
    done(f);
}

static void test_no_volume(void **state)
{
    Found f;
    const double same[] = {1, 1, 1, 1}, gap[] = {0, 1, 2, 4};
    make_folder(f.folder);
    write_stack(f.folder, five, 1);
    expect_refused(&f, CTS_ERR_GEOMETRY, "has 1 slice");
    make_folder(f.folder);
    write_stack(f.folder, same, 4);
    expect_refused(&f, CTS_ERR_GEOMETRY, "one position");
    make_folder(f.folder);
    write_stack(f.folder, gap, 4);
    expect_refused(&f, CTS_ERR_GEOMETRY, "1 of 5 slices missing");
    make_folder(f.folder);
    Slice s = sound_slice();
    s.sop_class = "1.2.840.10008.5.1.4.1.1.2.1";
    write_slice(f.folder, "enhanced", &s);
    expect_refused(&f, CTS_ERR_PIXELS, "NumberOfFrames (0028,0008)");
    make_folder(f.folder);
    find(&f);
    assert_int_equal(f.status, CTS_ERR_NO_SERIES);
    done(&f);
    make_folder(f.folder);
    s.sop_class = "1.2.840.10008.5.1.4.1.1.7"; /* a secondary capture that calls itself CT */
    write_slice(f.folder, "capture", &s);
    find(&f);
    assert_int_equal(f.status, CTS_ERR_NO_SERIES);
    done(&f);
    const char *nowhere = "no-such-folder";
    assert_int_equal(cts_series_find(&nowhere, 1, 1, &f.list, NULL, &f.err), CTS_ERR_READ);
    assert_non_null(strstr(f.err.text, nowhere));
    const char *device = "/dev/zero";
    assert_int_equal(cts_series_find(&device, 1, 1, &f.list, NULL, &f.err), CTS_ERR_READ);
}

static void test_copies(void **state)
{
    Found f;
    make_folder(f.folder);
    write_stack(f.folder, five, 5);
    StackTexts t;
    Slice s = stack_slice(&t, 2, -1, -2, 4);
    write_slice(f.folder, "copy", &s);
    find(&f);
    assert_true(f.list->items[0].renderable && f.list->items[0].n_slices == 5);
    assert_int_equal(cts_diagnostics_find(&f.list->items[0].diagnostics, CTS_DIAGNOSTIC_COPIES_DROPPED)->severity,
                     CTS_WARNING);
    CtsVolume *v = load(&f.list->items[0], 1);
    expect_slice(v, 2, 2);
    cts_volume_free(&v);
    s.base += 1; /* the same UID with another picture is no copy */
    write_slice(f.folder, "copy", &s);
    cts_series_list_free(&f.list);
    expect_refused(&f, CTS_ERR_GEOMETRY, "one position");
}

typedef void (*phase_fn)(Slice *s, char text[2][32], int k, int phase);

static void by_acquisition(Slice *s, char text[2][32], int k, int phase)
{
    snprintf(text[0], 32, "%d", 4 + phase);
    s->acquisition = text[0];
}

static void by_temporal(Slice *s, char text[2][32], int k, int phase)
{
    snprintf(text[0], 32, "%d", 1 + phase);
    s->temporal = text[0];
}

static void by_time(Slice *s, char text[2][32], int k, int phase)
{
    snprintf(text[0], 32, "1200%02d.5", 20 * phase + k);
    s->time = text[0];
}

static void interleaved_in_time(Slice *s, char text[2][32], int k, int phase)
{
    snprintf(text[0], 32, "1200%02d.5", 2 * k + phase);
    s->time = text[0];
}

/* Two phases at the same positions are separated or refused, never mixed. */
static void test_phases(void **state)
{
    static const struct {
        phase_fn mark;
        bool told_apart;
    } ways[] = {{by_acquisition, true}, {by_temporal, true}, {by_time, true}, {interleaved_in_time, false}};
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        Found f;
        make_folder(f.folder);
        for (int phase = 0; phase < 2; phase++)
            for (int k = 0; k < 6; k++) {
                StackTexts t;
                char name[16], text[2][32];
                Slice s = stack_slice(&t, k, 0, 0, 2 * k);
                s.base += 5000 * phase;
                ways[w].mark(&s, text, k, phase);
                snprintf(name, sizeof name, "%d", (k * 5 + phase * 3) % 12 * 10 + k + phase);
                write_slice(f.folder, name, &s);
            }
        find(&f);
        assert_int_equal(f.status, CTS_OK);
        if (!ways[w].told_apart) {
            assert_true(f.list->n == 1 && f.list->items[0].refusal == CTS_ERR_GEOMETRY);
            done(&f);
            continue;
        }
        assert_int_equal(f.list->n, 2);
        for (int phase = 0; phase < 2; phase++) {
            const CtsSeries *s = NULL;
            char name[16];
            snprintf(name, sizeof name, "1.2.3#%d", phase + 1);
            assert_int_equal(cts_series_choose(f.list, name, &s, &f.err), CTS_OK);
            assert_true(s->renderable && s->n_slices == 6 && s->part == phase + 1);
            assert_non_null(cts_diagnostics_find(&s->diagnostics, CTS_DIAGNOSTIC_SEVERAL_VOLUMES));
            CtsVolume *v = load(s, 2);
            for (int k = 0; k < 6; k++)
                assert_int_equal(v->grey[k * SLICE_ROWS * SLICE_COLUMNS], stack_grey(k, 0, 0) + 5000 * phase);
            cts_volume_free(&v);
        }
        done(&f);
    }
}

static void test_choose(void **state)
{
    Found f;
    make_folder(f.folder);
    const int counts[] = {3, 5, 5, 7};
    const char *const uids[] = {"1.2.1", "1.2.5", "1.2.4", "1.2.7"};
    for (int u = 0; u < 4; u++)
        for (int k = 0; k < counts[u]; k++) {
            StackTexts t;
            char name[16];
            Slice s = stack_slice(&t, k, 0, 0, k);
            s.series = uids[u];
            s.slope = u == 3 ? "0" : "1"; /* the longest cannot be rendered */
            snprintf(name, sizeof name, "%d-%d", u, k);
            write_slice(f.folder, name, &s);
        }
    find(&f);
    assert_int_equal(f.list->n, 4);
    static const char *const wanted[] = {"1.2.7", "1.2.4", "1.2.5", "1.2.1"};
    for (int u = 0; u < 4; u++)
        assert_string_equal(f.list->items[u].uid, wanted[u]);
    const CtsSeries *s = NULL;
    /* Two of equal right are listed, with their numbers, which choose one. */
    assert_int_equal(cts_series_choose(f.list, NULL, &s, &f.err), CTS_ERR_USAGE);
    assert_non_null(strstr(f.err.text, "2 series have 5 slices each"));
    assert_non_null(strstr(f.err.text, "UID 1.2.4); 3 ("));
    assert_int_equal(cts_series_choose(f.list, "3", &s, &f.err), CTS_OK);
    assert_string_equal(s->uid, "1.2.5");
    assert_int_equal(cts_series_choose(f.list, "5", &s, &f.err), CTS_ERR_USAGE);
    assert_int_equal(cts_series_choose(f.list, "1.2.1", &s, &f.err), CTS_OK);
    assert_int_equal(s->n_slices, 3);
    assert_int_equal(cts_series_choose(f.list, "1.2", &s, &f.err), CTS_ERR_USAGE);
    assert_null(s);
    assert_int_equal(cts_series_choose(f.list, "1.2.4#2", &s, &f.err), CTS_ERR_USAGE);
    done(&f);
}

/* Series without UID: a folder is a series. */
static void test_folders(void **state)
{
    Found f;
    make_folder(f.folder);
    char inner[2][128];
    for (int d = 0; d < 2; d++) {
        snprintf(inner[d], sizeof inner[d], "%s/%d", f.folder, d);
        assert_int_equal(mkdir(inner[d], 0700), 0);
        for (int k = 0; k < 3 + d; k++) {
            StackTexts t;
            char name[16];
            Slice s = stack_slice(&t, k, 0, 0, k);
            s.series = "";
            snprintf(name, sizeof name, "%d", k);
            write_slice(inner[d], name, &s);
        }
    }
    find(&f);
    assert_true(f.list->n == 2 && f.list->items[0].n_slices == 4 && f.list->items[1].n_slices == 3);
    assert_string_equal(f.list->items[0].uid, "");
    remove_folder(inner[0]);
    remove_folder(inner[1]);
    done(&f);
}

static void test_any_threads(void **state)
{
    Found f;
    const double z[] = {0, 1, 2, 2.5, 3, 4, 5.5, 6.5, 8};
    find_stack(&f, z, 9);
    CtsVolume *one = load(&f.list->items[0], 1);
    for (int threads = 2; threads <= 7; threads += 5) {
        CtsVolume *many = load(&f.list->items[0], threads);
        assert_int_equal(cts_volume_n_voxels(one), cts_volume_n_voxels(many));
        assert_memory_equal(one->grey, many->grey, cts_volume_n_voxels(one) * sizeof *one->grey);
        assert_memory_equal(one->dims, many->dims, sizeof one->dims);
        assert_memory_equal(one->step_lps, many->step_lps, sizeof one->step_lps);
        assert_true(one->hu_min == many->hu_min && one->hu_max == many->hu_max);
        cts_volume_free(&many);
    }
    cts_volume_free(&one);
    done(&f);
}

static void test_description(void **state)
{
    Found f;
    make_folder(f.folder);
    for (int k = 0; k < 2; k++) {
        StackTexts t;
        Slice s = stack_slice(&t, k, 0, 0, k);
        s.description = "Head \x1b[2J";
        write_numbered(f.folder, k, &s);
    }
    find(&f);
    assert_string_equal(f.list->items[0].description, "Head ?[2J");
    assert_non_null(cts_diagnostics_find(&f.list->items[0].diagnostics, CTS_DIAGNOSTIC_TWO_SLICES));
    done(&f);
}

/* A load that is cancelled ends, and leaves nothing. */
static void test_stopped(void **state)
{
    Found f;
    const volatile sig_atomic_t stop = 1;
    CtsVolume *v = NULL;
    find_stack(&f, five, 5);
    assert_int_equal(cts_series_load(&f.list->items[0], 2, &stop, &v, NULL, &f.err), CTS_ERR_INTERRUPTED);
    assert_null(v);
    done(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sorted),       cmocka_unit_test(test_normal_down),    cmocka_unit_test(test_resampled),
        cmocka_unit_test(test_scanned),      cmocka_unit_test(test_private_syntax), cmocka_unit_test(test_no_volume),
        cmocka_unit_test(test_wrong_sign),   cmocka_unit_test(test_deep_folders),   cmocka_unit_test(test_copies),
        cmocka_unit_test(test_phases),       cmocka_unit_test(test_choose),         cmocka_unit_test(test_folders),
        cmocka_unit_test(test_any_threads),  cmocka_unit_test(test_description),    cmocka_unit_test(test_blank),
        cmocka_unit_test(test_first_number), cmocka_unit_test(test_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
