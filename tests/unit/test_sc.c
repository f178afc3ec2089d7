/* Secondary captures: contents, copied attributes, reproducibility, and the round trip. */
#include "ctsplat/export.h"
#include "output/export/sc_texts.h"
#include "output/image/samples.h"
#include "pictures.h"
#include <math.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

/* A series of two slices' files copied to a folder of its own, found by the reader; "Phantom^Test" renamed to a name
 * of the same length whose bytes are Latin-1. */
typedef struct Source {
    char work[64];   /* the current folder during the tests */
    char folder[64]; /* inside it */
    CtsSeriesList *list;
    const CtsSeries *series;
} Source;

static const char patient[] = "M\xfcller^Anna ";

static void copy_renamed(const char *from, const char *to)
{
    size_t n;
    uint8_t *bytes = slurp(from, &n);
    uint8_t *name = memmem(bytes, n, "Phantom^Test", 12);
    assert_non_null(name);
    memcpy(name, patient, 12);
    FILE *f = fopen(to, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
    free(bytes);
}

static int setup(void **state)
{
    static Source source;
    const char *root = getenv("CTS_TESTDATA");
    CtsError err = {0};
    if (!root)
        return -1;
    make_folder(source.work);
    assert_int_equal(chdir(source.work), 0);
    make_folder(source.folder);
    for (int k = 1; k <= 3; k++) {
        char from[500], to[100];
        snprintf(from, sizeof from, "%s/phantom/IM%04d.dcm", root, 20 + k);
        snprintf(to, sizeof to, "%s/IM%d.dcm", source.folder, k);
        copy_renamed(from, to);
    }
    const char *path = source.folder;
    if (cts_series_find(&path, 1, 1, &source.list, NULL, &err) ||
        cts_series_choose(source.list, NULL, &source.series, &err))
        fail_msg("%s", err.text);
    assert_int_equal(source.series->n_slices, 3);
    *state = &source;
    return 0;
}

static int teardown(void **state)
{
    Source *source = *state;
    cts_series_list_free(&source->list);
    remove_folder(source->folder);
    assert_int_equal(chdir(".."), 0);
    remove_folder(source->work);
    return 0;
}

static CtsPicture *view_of(int width, int height, int n_channels, double azimuth_deg)
{
    CtsPicture *p = make_picture(width, height, n_channels, false);
    const double a = azimuth_deg * M_PI / 180;
    p->info.azimuth_deg = azimuth_deg;
    p->info.elevation_deg = 0;
    memcpy(p->info.right_lps, (const double[3]){cos(a), sin(a), 0}, sizeof p->info.right_lps);
    return p;
}

static void write_sc(const CtsPicture *p, const char *path, const CtsExportSettings *settings)
{
    CtsError err = {0};
    uint64_t bytes = 0;
    struct stat info;
    if (cts_export(&p, 1, path, settings, &bytes, NULL, &err))
        fail_msg("%s", err.text);
    assert_int_equal(stat(path, &info), 0);
    assert_int_equal(bytes, info.st_size);
}

/* The value of an attribute of an Explicit VR Little Endian file, as text without padding; "" if missing. The last one
 * of its tag, since those inside sequences precede it. For short text VRs. */
static char *text_of(const uint8_t *bytes, size_t n, unsigned group, unsigned element, const char *vr, char text[300])
{
    const uint8_t head[6] = {(uint8_t)group,          (uint8_t)(group >> 8), (uint8_t)element,
                             (uint8_t)(element >> 8), (uint8_t)vr[0],        (uint8_t)vr[1]};
    const uint8_t *at = NULL;
    for (const uint8_t *p = bytes; (p = memmem(p, n - (size_t)(p - bytes), head, sizeof head)); p++)
        at = p;
    text[0] = 0;
    if (!at)
        return text;
    size_t length = at[6] | (size_t)at[7] << 8;
    assert_true(length < 300);
    memcpy(text, at + 8, length);
    while (length > 0 && (text[length - 1] == ' ' || text[length - 1] == 0))
        length--;
    text[length] = 0;
    return text;
}

typedef struct Attribute {
    unsigned group, element;
    const char *vr, *value;
} Attribute;

static void check_attributes(const char *path, const Attribute *wanted, size_t n_wanted)
{
    size_t n;
    uint8_t *bytes = slurp(path, &n);
    char text[300];
    for (size_t i = 0; i < n_wanted; i++) {
        const Attribute *a = &wanted[i];
        if (strcmp(text_of(bytes, n, a->group, a->element, a->vr, text), a->value) != 0)
            fail_msg("(%04x,%04x) is \"%s\", not \"%s\"", a->group, a->element, text, a->value);
    }
    free(bytes);
}

static int occurrences(const char *path, const char *what)
{
    size_t n;
    uint8_t *bytes = slurp(path, &n);
    int found = 0;
    for (const uint8_t *p = bytes; (p = memmem(p, n - (size_t)(p - bytes), what, strlen(what))); p++)
        found++;
    free(bytes);
    return found;
}

static const char class_single[] = "1.2.840.10008.5.1.4.1.1.7", class_word[] = "1.2.840.10008.5.1.4.1.1.7.3",
                  class_colour[] = "1.2.840.10008.5.1.4.1.1.7.4";

static void test_single(void **state)
{
    const Source *source = *state;
    const CtsExportSettings settings = {.source = source->series};
    CtsPicture *p = view_of(33, 21, 4, 0);
    p->info.shows_skin = true;
    p->info.occlusion = 0.45;
    write_sc(p, "single.dcm", &settings);
    const Attribute wanted[] = {
        {0x0008, 0x0008, "CS", "DERIVED\\SECONDARY\\VOLUME_RENDER"},
        {0x0008, 0x0016, "UI", class_single},
        {0x0008, 0x0020, "DA", "20000101"},
        {0x0008, 0x0060, "CS", "CT"},
        {0x0008, 0x0064, "CS", "WSD"},
        {0x0008, 0x0070, "LO", "ctsplat"},
        {0x0008, 0x103e, "LO", "VR bone"},
        {0x0010, 0x0010, "PN", "M\xfcller^Anna"},
        {0x0010, 0x0020, "LO", "PHANTOM"},
        {0x0018, 0x0015, "CS", "HEAD"},
        {0x0028, 0x0030, "DS", "0.5\\0.5"},
        {0x0028, 0x0a02, "CS", "GEOMETRY"},
        {0x0028, 0x2002, "CS", "SRGB"},
        {0x0020, 0x0013, "IS", "1"},
        {0x0020, 0x0020, "CS", "L\\F"},
        {0x0028, 0x0004, "CS", "RGB"},
        {0x0028, 0x0301, "CS", "NO"},
        {0x0028, 0x0302, "CS", "YES"},
        {0x0028, 0x2110, "CS", "00"},
        /* attributes without meaning for a projection */
        {0x0020, 0x0032, "DS", ""},
        {0x0020, 0x0052, "UI", ""},
        {0x0028, 0x1050, "DS", ""},
        {0x0018, 0x0060, "DS", ""},
    };
    check_attributes("single.dcm", wanted, sizeof wanted / sizeof *wanted);
    assert_int_equal(occurrences("single.dcm", "preset bone, occlusion 0.45, orthographic, view "), 1);
    for (int i = 0; i < 3; i++) {
        char from[100];
        size_t n;
        char uid[300];
        snprintf(from, sizeof from, "%s/IM%d.dcm", source->folder, i + 1);
        uint8_t *bytes = slurp(from, &n);
        text_of(bytes, n, 0x0008, 0x0018, "UI", uid);
        assert_int_equal(occurrences("single.dcm", uid), 2); /* source image, and referenced instance */
        free(bytes);
    }
    unlink("single.dcm");
    /* Oblique: letters of both components; elsewhere in the series. */
    CtsPicture *q = view_of(33, 21, 1, -30);
    memcpy(q->info.right_lps, (const double[3]){0.866, -0.5, 0}, sizeof q->info.right_lps);
    write_sc(q, "oblique.dcm", &settings);
    const Attribute grey[] = {
        {0x0008, 0x0008, "CS", "DERIVED\\SECONDARY\\MAX_IP"},
        {0x0020, 0x0020, "CS", "LA\\F"},
        {0x0028, 0x0004, "CS", "MONOCHROME2"},
        {0x0028, 0x1050, "DS", "32768"},
        {0x0028, 0x1051, "DS", "65536"},
        {0x0028, 0x0302, "CS", "NO"},
    };
    check_attributes("oblique.dcm", grey, sizeof grey / sizeof *grey);
    unlink("oblique.dcm");
    cts_picture_free(&p);
    cts_picture_free(&q);
}

static void test_frames(void **state)
{
    const Source *source = *state;
    const CtsExportSettings settings = {.source = source->series};
    for (int kind = 0; kind < 2; kind++) {
        CtsPicture *frames[5];
        CtsError err;
        for (int k = 0; k < 5; k++)
            frames[k] = view_of(15, 11, kind ? 1 : 4, 72 * k);
        assert_int_equal(cts_export((const CtsPicture *const *)frames, 5, "frames.dcm", &settings, NULL, NULL, &err),
                         CTS_OK);
        const Attribute wanted[] = {
            {0x0008, 0x0016, "UI", kind ? class_word : class_colour},
            {0x0028, 0x0008, "IS", "5"},
            {0x0028, 0x0009, "AT", "\x18"}, /* (0018,1063) FrameTime; its bytes are 18 00 63 10 */
            {0x0018, 0x1063, "DS", "100"},
            {0x0008, 0x2143, "IS", "5"},
            {0x0020, 0x0020, "CS", ""},
            {0x0028, 0x1050, "DS", ""},
            {0x0028, 0x1054, "LO", kind ? "US" : ""},
            {0x2050, 0x0020, "CS", kind ? "IDENTITY" : ""},
        };
        check_attributes("frames.dcm", wanted, sizeof wanted / sizeof *wanted);
        /* Band by band it is the same object, each band of a frame after the other. */
        setenv("SOURCE_DATE_EPOCH", "1000000000", 1);
        CtsPicture *tall[2] = {view_of(15, 200, kind ? 1 : 4, 0), view_of(15, 200, kind ? 1 : 4, 180)};
        assert_int_equal(cts_export((const CtsPicture *const *)tall, 2, "tall.dcm", &settings, NULL, NULL, &err),
                         CTS_OK);
        export_in_bands((const CtsPicture *const *)tall, 2, kind, CTS_BAND_ROWS, "bands.dcm", &settings);
        assert_same_bytes("tall.dcm", "bands.dcm");
        unsetenv("SOURCE_DATE_EPOCH");
        unlink("tall.dcm");
        unlink("bands.dcm");
        cts_picture_free(&tall[0]);
        cts_picture_free(&tall[1]);
        /* Another size is refused: nothing is written. */
        CtsPicture *odd = view_of(16, 11, kind ? 1 : 4, 0);
        const CtsPicture *mixed[2] = {frames[0], odd};
        assert_int_equal(cts_export(mixed, 2, "mixed.dcm", &settings, NULL, NULL, &err), CTS_ERR_USAGE);
        assert_int_not_equal(access("mixed.dcm", F_OK), 0);
        cts_picture_free(&odd);
        for (int k = 0; k < 5; k++)
            cts_picture_free(&frames[k]);
        unlink("frames.dcm");
    }
}

/* Colours to the last of 8 bits, grey to the last of 16, through every compression; alpha over black. */
static void test_round_trip(void **state)
{
    const Source *source = *state;
    const int sizes[][2] = {{33, 21}, {1, 1}, {64, 40}, {3, 300}};
    for (int compression = CTS_SC_NONE; compression < CTS_SC_N_COMPRESSIONS; compression++)
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
            for (int kind = 0; kind < 3; kind++) {
                const CtsExportSettings settings = {.source = source->series,
                                                    .compression = (CtsScCompression)compression};
                CtsPicture *p = make_picture(sizes[i][0], sizes[i][1], kind == 1 ? 1 : 4, kind == 2), *q;
                CtsError err;
                write_sc(p, "trip.dcm", &settings);
                if (cts_picture_read("trip.dcm", &q, &err))
                    fail_msg("%s", err.text);
                assert_true(q->width == p->width && q->height == p->height && !q->has_alpha);
                uint16_t a[3 * 64], b[3 * 64];
                uint8_t a8[3 * 64], b8[3 * 64];
                for (int y = 0; y < p->height; y++) {
                    if (kind == 1 || p->width * p->height == 1) {
                        cts_samples_row16(p, y, 1, a);
                        cts_samples_row16(q, y, 1, b);
                        if (q->n_channels == 1)
                            assert_memory_equal(a, b, (size_t)p->width * 2);
                    } else {
                        cts_samples_row8(p, y, 3, a8);
                        cts_samples_row8(q, y, 3, b8);
                        assert_memory_equal(a8, b8, (size_t)p->width * 3);
                    }
                }
                cts_picture_free(&p);
                cts_picture_free(&q);
                unlink("trip.dcm");
            }
}

static void uids_of(const char *path, char study[300], char series[300], char instance[300])
{
    size_t n;
    uint8_t *bytes = slurp(path, &n);
    text_of(bytes, n, 0x0020, 0x000d, "UI", study);
    text_of(bytes, n, 0x0020, 0x000e, "UI", series);
    text_of(bytes, n, 0x0008, 0x0018, "UI", instance);
    for (int i = 0; i < 3; i++) {
        const char *uid = i == 0 ? study : i == 1 ? series : instance;
        assert_int_equal(strncmp(uid, "2.25.", 5), 0);
        assert_true(strlen(uid) <= 44 && uid[5] != '0' && strspn(uid + 5, "0123456789") == strlen(uid + 5));
    }
    free(bytes);
}

static void test_uids(void **state)
{
    const Source *source = *state;
    CtsExportSettings settings = {.source = source->series, .force = true};
    CtsPicture *p = view_of(20, 10, 4, 0), *q = view_of(20, 10, 4, 90);
    char study[6][300], series[6][300], instance[6][300];
    setenv("SOURCE_DATE_EPOCH", "1000000000", 1);
    write_sc(p, "a.dcm", &settings);
    write_sc(p, "b.dcm", &settings);
    assert_same_bytes("a.dcm", "b.dcm");
    const Attribute dates[] = {{0x0008, 0x0012, "DA", "20010909"},
                               {0x0008, 0x0013, "TM", "014640"},
                               {0x0008, 0x0023, "DA", "20010909"},
                               {0x0018, 0x1012, "DA", "20010909"}};
    check_attributes("a.dcm", dates, sizeof dates / sizeof *dates);
    unsetenv("SOURCE_DATE_EPOCH");
    write_sc(p, "b.dcm", &settings);
    uids_of("a.dcm", study[0], series[0], instance[0]);
    uids_of("b.dcm", study[1], series[1], instance[1]);
    assert_string_equal(series[0], series[1]);
    assert_string_equal(instance[0], instance[1]);
    write_sc(q, "b.dcm", &settings); /* another view: another instance of the same series */
    uids_of("b.dcm", study[1], series[1], instance[1]);
    assert_string_equal(study[0], study[1]);
    assert_string_equal(series[0], series[1]);
    assert_string_not_equal(instance[0], instance[1]);
    /* Under a number and a name of the user's the views share a series. */
    CtsExportSettings named = settings;
    named.series_number = 77;
    named.series_description = "for the meeting";
    write_sc(p, "b.dcm", &named);
    uids_of("b.dcm", study[1], series[1], instance[1]);
    write_sc(q, "b.dcm", &named);
    uids_of("b.dcm", study[2], series[2], instance[2]);
    assert_string_equal(series[1], series[2]);
    assert_string_not_equal(instance[1], instance[2]);
    const Attribute names[] = {{0x0020, 0x0011, "IS", "77"}, {0x0008, 0x103e, "LO", "for the meeting"}};
    check_attributes("b.dcm", names, sizeof names / sizeof *names);
    p->pixels[0] += 0.1f; /* another picture */
    write_sc(p, "b.dcm", &settings);
    uids_of("b.dcm", study[2], series[2], instance[2]);
    assert_string_not_equal(instance[0], instance[2]);
    snprintf(p->info.preset, sizeof p->info.preset, "skin");
    write_sc(p, "b.dcm", &settings); /* another preset: another series */
    uids_of("b.dcm", study[3], series[3], instance[3]);
    assert_string_equal(study[0], study[3]);
    assert_string_not_equal(series[0], series[3]);
    settings.new_uids = true;
    write_sc(p, "a.dcm", &settings);
    write_sc(p, "b.dcm", &settings);
    uids_of("a.dcm", study[4], series[4], instance[4]);
    uids_of("b.dcm", study[5], series[5], instance[5]);
    assert_string_equal(study[0], study[4]);
    assert_string_not_equal(series[4], series[5]);
    assert_string_not_equal(instance[4], instance[5]);
    unlink("a.dcm");
    unlink("b.dcm");
    cts_picture_free(&p);
    cts_picture_free(&q);
}

static void test_deidentify(void **state)
{
    const Source *source = *state;
    const CtsExportSettings open = {.source = source->series, .force = true};
    const CtsExportSettings closed = {.source = source->series, .force = true, .deidentify = true};
    CtsPicture *p = view_of(20, 10, 4, 0), *q = view_of(20, 10, 4, 90);
    CtsReport report = {0};
    CtsError err;
    char study[3][300], series[3][300], instance[3][300], first_id[300], second_id[300];
    write_sc(p, "open.dcm", &open);
    write_sc(p, "a.dcm", &closed);
    q->info.shows_skin = true;
    assert_int_equal(cts_export(&(const CtsPicture *){q}, 1, "b.dcm", &closed, NULL, &report, &err), CTS_OK);
    assert_int_equal(report.diagnostics.n, 1);
    assert_string_equal(report.diagnostics.items[0].code, "recognizable_features");
    uids_of("open.dcm", study[0], series[0], instance[0]);
    uids_of("a.dcm", study[1], series[1], instance[1]);
    uids_of("b.dcm", study[2], series[2], instance[2]);
    assert_string_not_equal(study[0], study[1]);
    assert_string_equal(study[1], study[2]);
    assert_string_not_equal(series[0], series[1]);
    assert_string_not_equal(instance[0], instance[1]);
    size_t n;
    uint8_t *bytes = slurp("a.dcm", &n);
    text_of(bytes, n, 0x0010, 0x0020, "LO", first_id);
    free(bytes);
    bytes = slurp("b.dcm", &n);
    text_of(bytes, n, 0x0010, 0x0020, "LO", second_id);
    free(bytes);
    assert_int_equal(strncmp(first_id, "ANON-", 5), 0);
    assert_string_equal(first_id, second_id);
    const char *const gone[] = {"M\xfcller", "PHANTOM", "20000101", "made-up", study[0], source->series->uid};
    for (size_t i = 0; i < sizeof gone / sizeof *gone; i++) {
        assert_true(occurrences("open.dcm", gone[i]) > 0);
        assert_int_equal(occurrences("a.dcm", gone[i]), 0);
    }
    const Attribute wanted[] = {{0x0012, 0x0062, "CS", "YES"},
                                {0x0010, 0x0030, "DA", ""},
                                {0x0008, 0x0050, "SH", ""},
                                {0x0028, 0x0303, "CS", "REMOVED"}};
    check_attributes("a.dcm", wanted, sizeof wanted / sizeof *wanted);
    unlink("open.dcm");
    unlink("a.dcm");
    unlink("b.dcm");
    cts_report_free(&report);
    cts_picture_free(&p);
    cts_picture_free(&q);
}

/* No two of the built-in presets share a SeriesNumber, which is short and the same from version to version; all views
 * of one do, as instances of their own, and rotations have another. */
static void test_series_numbers(void **state)
{
    const Source *source = *state;
    CtsSeries third = *source->series;
    int numbers[500], n = 0, instances[2];
    char series[2][65];
    CtsError err;
    third.series_number = 3;
    for (size_t k = 0; cts_preset_builtin(k); k++)
        for (int view = 0; view < 4; view++) {
            CtsExportJob job = {.settings.source = &third, .head.n_frames = view < 2 ? 1 : 8};
            CtsScTexts words;
            CtsScNames names;
            const uint8_t pixels[CTS_DIGEST_BYTES] = {0};
            snprintf(job.head.info.preset, sizeof job.head.info.preset, "%s", cts_preset_builtin(k)->name);
            job.head.info.azimuth_deg = 90 * (view % 2);
            cts_sc_texts(&job, &words);
            assert_int_equal(cts_sc_names(&job, &words, pixels, &names, &err), CTS_OK);
            assert_int_equal(names.series_number / 1000, 3);
            assert_true(n < 500);
            instances[view % 2] = names.instance_number;
            snprintf(series[view % 2], sizeof series[0], "%s", names.series_uid);
            if (view % 2) {
                assert_int_equal(numbers[n - 1], names.series_number);
                assert_string_equal(series[0], series[1]);
                assert_int_not_equal(instances[0], instances[1]);
                continue;
            }
            for (int i = 0; i < n; i++)
                assert_int_not_equal(numbers[i], names.series_number);
            numbers[n++] = names.series_number;
        }
    assert_true(n > 20);
    assert_int_equal(cts_preset_number("bone"), 1); /* as viewers' hanging protocols have it */
    assert_int_equal(cts_preset_number("skin"), 2);
    assert_int_equal(cts_preset_number("brain"), 61);
    assert_int_equal(cts_preset_number("no such"), 0);
}

static uint32_t big32(const uint8_t *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

/* The profile is framed as ICC.1:2010 has it, and its white is D50: the primaries add up to it. */
static void test_icc(void **state)
{
    const uint8_t *const profile = cts_icc_srgb;
    const size_t n = CTS_ICC_BYTES;
    double white[3] = {0};
    assert_int_equal(big32(profile), n);
    assert_memory_equal(profile + 12, "scnrRGB XYZ ", 12);
    assert_memory_equal(profile + 36, "acsp", 4);
    for (uint32_t i = 0; i < big32(profile + 128); i++) {
        const uint8_t *tag = profile + 132 + 12 * i, *data = profile + big32(tag + 4);
        assert_true(big32(tag + 4) % 4 == 0 && big32(tag + 4) + big32(tag + 8) <= n);
        for (int c = 0; c < 3 && memcmp(tag + 1, "XYZ", 3) == 0; c++)
            white[c] += (int32_t)big32(data + 8 + 4 * c) / 65536.0;
        if (memcmp(tag + 1, "TRC", 3) == 0) { /* the curve's parts meet where the lower one ends */
            double v[5];
            for (int k = 0; k < 5; k++)
                v[k] = (int32_t)big32(data + 12 + 4 * k) / 65536.0;
            assert_true(fabs(pow(v[1] * v[4] + v[2], v[0]) - v[3] * v[4]) < 1e-4);
            assert_true(fabs(pow(v[1] + v[2], v[0]) - 1) < 1e-4);
        }
    }
    for (int c = 0; c < 3; c++)
        assert_true(fabs(white[c] - (int32_t)big32(profile + 68 + 4 * c) / 65536.0) < 5e-4);
}

/* dciodvfy, an independent validator of DICOM objects, reports nothing except the object's name. */
static void test_dciodvfy(void **state)
{
    if (system("command -v dciodvfy >/dev/null"))
        skip();
    char folder[500];
    const char *path = folder;
    CtsSeriesList *list;
    CtsError found;
    snprintf(folder, sizeof folder, "%s/phantom", getenv("CTS_TESTDATA"));
    assert_int_equal(cts_series_find(&path, 1, 1, &list, NULL, &found), CTS_OK);
    for (int kind = 0; kind < 4; kind++)
        for (int compression = CTS_SC_NONE; compression < CTS_SC_N_COMPRESSIONS; compression++) {
            const CtsExportSettings settings = {.source = &list->items[0],
                                                .compression = (CtsScCompression)compression};
            CtsPicture *frames[2] = {view_of(33, 21, kind % 2 ? 1 : 4, 0), view_of(33, 21, kind % 2 ? 1 : 4, 180)};
            CtsError err;
            assert_int_equal(cts_export((const CtsPicture *const *)frames, kind < 2 ? 1 : 2, "checked.dcm", &settings,
                                        NULL, NULL, &err),
                             CTS_OK);
            FILE *pipe = popen("dciodvfy checked.dcm 2>&1", "r");
            char out[2000];
            assert_non_null(pipe);
            const size_t n = fread(out, 1, sizeof out - 1, pipe);
            out[n] = 0;
            if (pclose(pipe) || strstr(out, "Error") || strstr(out, "Warning"))
                fail_msg("%s", out);
            assert_non_null(strstr(out, "SCImage"));
            unlink("checked.dcm");
            cts_picture_free(&frames[0]);
            cts_picture_free(&frames[1]);
        }
    cts_series_list_free(&list);
}

static void test_refusals(void **state)
{
    const Source *source = *state;
    CtsPicture *p = view_of(20, 10, 4, 0), *q;
    CtsError err;
    const CtsExportSettings none = {0};
    assert_int_equal(cts_export_check("a.dcm", &none, &err), CTS_OK); /* the source is not known yet */
    assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, "a.dcm", &none, NULL, NULL, &err), CTS_ERR_USAGE);
    /* A slice that changed since it was scanned may be another patient's by now. */
    const CtsExportSettings settings = {.source = source->series};
    char path[100], away[100];
    snprintf(path, sizeof path, "%s/IM1.dcm", source->folder);
    snprintf(away, sizeof away, "%s/away", source->folder);
    assert_int_equal(cts_export_check("a.dcm", &settings, &err), CTS_OK);
    for (int k = 1; k <= 3; k++) {
        snprintf(path, sizeof path, "%s/IM%d.dcm", source->folder, k);
        snprintf(away, sizeof away, "%s/away%d", source->folder, k);
        assert_int_equal(rename(path, away), 0);
    }
    assert_int_equal(cts_export_check("a.dcm", &settings, &err), CTS_ERR_READ);
    assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, "a.dcm", &settings, NULL, NULL, &err), CTS_ERR_READ);
    for (int k = 1; k <= 3; k++) {
        snprintf(path, sizeof path, "%s/IM%d.dcm", source->folder, k);
        snprintf(away, sizeof away, "%s/away%d", source->folder, k);
        assert_int_equal(truncate(away, 100), 0);
        assert_int_equal(rename(away, path), 0);
    }
    assert_int_equal(cts_export(&(const CtsPicture *){p}, 1, "a.dcm", &settings, NULL, NULL, &err), CTS_ERR_READ);
    assert_non_null(strstr(err.text, "changed"));
    assert_int_not_equal(access("a.dcm", F_OK), 0);
    /* A CT slice is no picture of ours to read: signed, and no display values. */
    snprintf(path, sizeof path, "%s/phantom/IM0001.dcm", getenv("CTS_TESTDATA"));
    assert_int_equal(cts_picture_read(path, &q, &err), CTS_ERR_READ);
    assert_null(q);
    cts_picture_free(&p);
}

static void test_full_and_cut(void **state)
{
    const Source *source = *state;
    const CtsExportSettings settings = {.source = source->series};
    CtsPicture *p = view_of(101, 67, 4, 0), *q;
    CtsError err;
    char folder[64], path[100];
    make_folder(folder);
    snprintf(path, sizeof path, "%s/a.dcm", folder);
    write_sc(p, path, &settings);
    size_t n;
    uint8_t *bytes = slurp(path, &n);
    for (size_t k = 0; k < n; k += k < 2500 ? 3 : 501) {
        FILE *f = fopen(path, "wb");
        assert_int_equal(fwrite(bytes, 1, k, f), k);
        fclose(f);
        assert_int_equal(cts_picture_read(path, &q, &err), CTS_ERR_READ);
        assert_null(q);
    }
    unlink(path);
    struct rlimit before, limit;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, SIG_IGN);
    for (size_t room = 0; room < n; room += n / 11) {
        limit = before;
        limit.rlim_cur = room;
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
        const CtsStatus st = cts_export(&(const CtsPicture *){p}, 1, path, &settings, NULL, NULL, &err);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
        assert_int_equal(st, CTS_ERR_OUTPUT);
        assert_int_equal(count_files(folder), 0);
    }
    free(bytes);
    remove_folder(folder);
    cts_picture_free(&p);
}

int main(void)
{
    if (!getenv("CTS_TESTDATA")) {
        puts("CTS_TESTDATA does not name the test data: skipped");
        return 77;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_single),         cmocka_unit_test(test_frames),     cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_uids),           cmocka_unit_test(test_deidentify), cmocka_unit_test(test_dciodvfy),
        cmocka_unit_test(test_full_and_cut),   cmocka_unit_test(test_refusals),   cmocka_unit_test(test_icc),
        cmocka_unit_test(test_series_numbers),
    };
    return cmocka_run_group_tests_name("sc", tests, setup, teardown);
}
