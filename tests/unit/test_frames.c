/* Objects with many frames: functional groups, stacks, phases, frames of fragments. */
#include "../tools/jpeg2000_stream.h"
#include "ctsplat/series.h"
#include "dicom_files.h"
#include "found.h"
#include <math.h>

/* Attributes of one frame; NULL or 0 leaves them to the shared groups, or out. */
typedef struct Frame {
    const char *position, *orientation, *slope, *stack, *type, *when;
    uint32_t temporal;
    int base;
} Frame;

typedef struct Object {
    const char *sop_class, *syntax, *shared_orientation, *shared_slope, *shared_spacing, *count;
    Frame frames[24];
    int n, n_groups; /* n_groups: per-frame items written, when not n */
} Object;

static void put_item(Bytes *b, const Bytes *content)
{
    put_tag(b, 0xFFFEE000);
    put32(b, (uint32_t)content->n);
    put(b, content->data, content->n);
}

/* A sequence of one item with one or two text elements; nothing when both are missing. */
static void put_group(Bytes *b, uint32_t sequence, const Bytes *elements)
{
    Bytes item = {0};
    if (!elements->n)
        return;
    put_item(&item, elements);
    put_element(b, sequence, "SQ", item.data, (uint32_t)item.n);
    free(item.data);
}

static void put_text_group(Bytes *b, uint32_t sequence, uint32_t tag, const char *vr, const char *text)
{
    Bytes elements = {0};
    put_text(&elements, tag, vr, text);
    put_group(b, sequence, &elements);
    free(elements.data);
}

static void put_rescale_group(Bytes *b, const char *slope)
{
    Bytes elements = {0};
    if (slope) {
        put_text(&elements, 0x00281052, "DS", "-1024");
        put_text(&elements, 0x00281053, "DS", slope);
        put_text(&elements, 0x00281054, "LO", "HU");
    }
    put_group(b, 0x00289145, &elements);
    free(elements.data);
}

static Bytes frame_groups(const Frame *f)
{
    Bytes b = {0}, content = {0};
    put_text_group(&b, 0x00189329, 0x00089007, "CS", f->type);
    put_text(&content, 0x00189074, "DT", f->when);
    put_text(&content, 0x00209056, "SH", f->stack);
    if (f->temporal) {
        Bytes index = {0};
        put32(&index, f->temporal);
        put_element(&content, 0x00209128, "UL", index.data, 4);
        free(index.data);
    }
    put_group(&b, 0x00209111, &content);
    put_text_group(&b, 0x00209113, 0x00200032, "DS", f->position);
    put_text_group(&b, 0x00209116, 0x00200037, "DS", f->orientation);
    put_rescale_group(&b, f->slope);
    free(content.data);
    return b;
}

static void put_groups(Bytes *b, const Object *o)
{
    Bytes shared = {0}, item = {0}, frames = {0};
    put_text_group(&shared, 0x00209116, 0x00200037, "DS", o->shared_orientation);
    put_text_group(&shared, 0x00289110, 0x00280030, "DS", o->shared_spacing);
    put_rescale_group(&shared, o->shared_slope);
    put_item(&item, &shared);
    put_element(b, 0x52009229, "SQ", item.data, (uint32_t)item.n);
    for (int k = 0; k < (o->n_groups ? o->n_groups : o->n); k++) {
        Bytes groups = frame_groups(&o->frames[k]);
        put_item(&frames, &groups);
        free(groups.data);
    }
    put_element(b, 0x52009230, "SQ", frames.data, (uint32_t)frames.n);
    free(shared.data);
    free(item.data);
    free(frames.data);
}

/* Everything up to the pixels. */
static Bytes object_header(const Object *o)
{
    char count[16];
    Bytes b = {0};
    Slice s = sound_slice();
    s.sop_class = o->sop_class;
    s.syntax = o->syntax;
    snprintf(count, sizeof count, "%d", o->n);
    s.frames = o->count ? o->count : count;
    s.position = s.orientation = s.spacing = s.slope = s.intercept = NULL;
    put_meta(&b, &s);
    put_header(&b, &s);
    put_groups(&b, o);
    return b;
}

static int frame_word(const Frame *f, int i, int j)
{
    return f->base + i + 10 * j;
}

static Bytes object_bytes(const Object *o)
{
    Bytes b = object_header(o), pixels = {0};
    for (int k = 0; k < o->n; k++)
        for (int j = 0; j < SLICE_ROWS; j++)
            for (int i = 0; i < SLICE_COLUMNS; i++)
                put16(&pixels, (unsigned)frame_word(&o->frames[k], i, j));
    put_element(&b, 0x7FE00010, "OW", pixels.data, (uint32_t)pixels.n);
    free(pixels.data);
    return b;
}

/* n frames 2 mm apart, written in an order of their own. */
static char positions[24][32];

static Object sound_object(int n)
{
    Object o = {.sop_class = "1.2.840.10008.5.1.4.1.1.2.1",
                .syntax = "1.2.840.10008.1.2.1",
                .shared_orientation = "1\\0\\0\\0\\1\\0",
                .shared_slope = "1",
                .shared_spacing = "0.75\\0.5",
                .n = n};
    for (int k = 0; k < n; k++) {
        const int at = (k * 5 + 2) % n;
        snprintf(positions[k], sizeof positions[k], "-1\\-2\\%d", 2 * at);
        o.frames[k] = (Frame){.position = positions[k], .base = 1000 + 100 * at};
    }
    return o;
}

static void find_bytes(Found *f, Bytes b)
{
    *f = (Found){0};
    make_folder(f->folder);
    write_bytes(f->folder, "frames", b.data, b.n);
    free(b.data);
    find(f);
    if (f->status)
        fail_msg("%s", f->err.text);
}

/* Layer k holds 1000 + 100 * k + first + column + 10 * row, times slope. */
static void expect_volume(const CtsSeries *s, int n, int first, int slope)
{
    CtsVolume *v = NULL;
    CtsError err = {0};
    if (s->refusal || cts_series_load(s, 2, NULL, &v, NULL, &err))
        fail_msg("%s%s", s->reason, err.text);
    assert_int_equal(v->dims[2], n);
    assert_true(v->step_lps[0][0] == 0.5 && v->step_lps[1][1] == 0.75 && fabs(v->step_lps[2][2] - 2) < 1e-12);
    for (int k = 0; k < n; k++)
        for (int j = 0; j < SLICE_ROWS; j++)
            for (int i = 0; i < SLICE_COLUMNS; i++)
                assert_int_equal(v->grey[(k * SLICE_ROWS + j) * SLICE_COLUMNS + i],
                                 slope * (1000 + 100 * k + first + i + 10 * j));
    cts_volume_free(&v);
}

static void test_one_stack(void **state)
{
    static const char *const classes[] = {"1.2.840.10008.5.1.4.1.1.2.1", "1.2.840.10008.5.1.4.1.1.2.2"};
    for (int c = 0; c < 2; c++) {
        Found f;
        Object o = sound_object(8);
        o.sop_class = classes[c];
        find_bytes(&f, object_bytes(&o));
        assert_int_equal(f.list->n, 1);
        assert_int_equal(f.list->items[0].part, 0);
        expect_volume(&f.list->items[0], 8, 0, 1);
        done(&f);
    }
}

/* A frame's own groups win over the shared ones. */
static void test_own_groups(void **state)
{
    Found f;
    Object o = sound_object(6);
    o.shared_slope = "3";
    for (int k = 0; k < o.n; k++)
        o.frames[k].slope = "2";
    find_bytes(&f, object_bytes(&o));
    expect_volume(&f.list->items[0], 6, 0, 2);
    done(&f);
}

static void test_stacks(void **state)
{
    Found f;
    Object o = sound_object(7);
    for (int k = 0; k < 7; k++) {
        o.frames[k].stack = "1";
        o.frames[7 + k] = o.frames[k];
        o.frames[7 + k].stack = "2";
        o.frames[7 + k].base += 5000;
    }
    o.n = 13; /* the second has a slice less, at the end or in the middle: wherever the order puts it */
    o.frames[13] = (Frame){0};
    find_bytes(&f, object_bytes(&o));
    assert_int_equal(f.list->n, 2);
    assert_int_equal(f.list->items[0].n_slices, 7);
    assert_int_equal(f.list->items[0].part, 1);
    assert_int_equal(f.list->items[1].part, 2);
    assert_non_null(cts_diagnostics_find(&f.list->items[0].diagnostics, CTS_DIAGNOSTIC_SEVERAL_VOLUMES));
    expect_volume(&f.list->items[0], 7, 0, 1);
    const CtsSeries *second = NULL;
    assert_int_equal(cts_series_choose(f.list, "1.2.3#2", &second, &f.err), CTS_OK);
    assert_int_equal(second->n_slices, 6);
    static const char *const none[] = {"1.2.3#0", "1.2.3#3", "1.2.3#", "1.2.3#2x", "1.2.3#02", "1.2.3# 2"};
    for (size_t i = 0; i < sizeof none / sizeof *none; i++)
        assert_int_equal(cts_series_choose(f.list, none[i], &second, &f.err), CTS_ERR_USAGE);
    done(&f);
}

/* Phases at the same places: by temporal position, by time. */
static void test_phases(void **state)
{
    for (int by_time = 0; by_time < 2; by_time++) {
        Found f;
        Object o = sound_object(6);
        static char when[12][24];
        for (int k = 0; k < 12; k++) {
            snprintf(when[k], sizeof when[k], "202001021200%02d.5+0100", 10 + k);
            o.frames[k] = o.frames[k % 6];
            o.frames[k].stack = "1";
            o.frames[k].base += k < 6 ? 0 : 3000;
            o.frames[k].temporal = by_time ? 0 : k < 6 ? 1 : 2;
            o.frames[k].when = by_time ? when[k] : NULL;
        }
        o.n = 12;
        find_bytes(&f, object_bytes(&o));
        assert_int_equal(f.list->n, 2);
        expect_volume(&f.list->items[0], 6, 0, 1);
        expect_volume(&f.list->items[1], 6, 3000, 1);
        done(&f);
    }
}

static void test_scout_frame(void **state)
{
    Found f;
    Object o = sound_object(6);
    o.frames[6] = (Frame){.position = "0\\0\\0",
                          .orientation = "0\\1\\0\\0\\0\\-1",
                          .type = "ORIGINAL\\PRIMARY\\LOCALIZER\\NONE",
                          .base = 100};
    o.n = 7;
    find_bytes(&f, object_bytes(&o));
    assert_non_null(cts_diagnostics_find(&f.list->items[0].diagnostics, CTS_DIAGNOSTIC_LOCALIZERS_DROPPED));
    expect_volume(&f.list->items[0], 6, 0, 1);
    done(&f);
}

typedef void (*change_fn)(Object *o);
#define CHANGE(name, statement)                                                                                        \
    static void name(Object *o)                                                                                        \
    {                                                                                                                  \
        statement;                                                                                                     \
    }
CHANGE(no_orientation, o->shared_orientation = NULL)
CHANGE(no_slope, o->shared_slope = NULL)
CHANGE(no_spacing, o->shared_spacing = NULL)
CHANGE(few_groups, o->n_groups = o->n - 1)
CHANGE(many_frames, o->count = "20001")
CHANGE(no_count, o->count = "0")
CHANGE(more_frames, (o->count = "9", o->n_groups = 9))

static void test_refused(void **state)
{
    static const struct {
        change_fn change;
        CtsStatus status;
        const char *reason;
    } cases[] = {
        {no_orientation, CTS_ERR_GEOMETRY, "(0020,0037)"},
        {no_slope, CTS_ERR_PIXELS, "(0028,1053)"},
        {no_spacing, CTS_ERR_GEOMETRY, "(0028,0030)"},
        {few_groups, CTS_ERR_PIXELS, "(5200,9230)"},
        {many_frames, CTS_ERR_PIXELS, "(0028,0008)"},
        {no_count, CTS_ERR_PIXELS, "(0028,0008)"},
        {more_frames, CTS_ERR_GEOMETRY, "frame 9: ImagePositionPatient"},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        Found f;
        Object o = sound_object(8);
        cases[c].change(&o);
        find_bytes(&f, object_bytes(&o));
        const CtsSeries *s = &f.list->items[0];
        if (s->refusal != cases[c].status || !strstr(s->reason, cases[c].reason))
            fail_msg("case %zu: %d %s", c, s->refusal, s->reason);
        done(&f);
    }
}

/* Fewer pixels than frames: those that are there make the volume, when enough are. */
static void test_truncated(void **state)
{
    Found f;
    Object o = sound_object(21);
    Bytes b = object_bytes(&o);
    b.n -= 2 * SLICE_COLUMNS * SLICE_ROWS + 1;
    find_bytes(&f, b);
    const CtsSeries *s = &f.list->items[0];
    assert_int_equal(s->refusal, CTS_OK);
    assert_int_equal(s->n_slices, 19);
    assert_non_null(cts_diagnostics_find(&s->diagnostics, CTS_DIAGNOSTIC_BAD_SLICES));
    assert_non_null(strstr(cts_diagnostics_find(&s->diagnostics, CTS_DIAGNOSTIC_BAD_SLICES)->text, "truncated"));
    done(&f);
}

typedef enum Table { NO_TABLE, GOOD_TABLE, WRONG_TABLE } Table;

/* Each frame is cut into `pieces` fragments. */
static Bytes encapsulated(const Object *o, int pieces, Table table)
{
    const Jpeg2000 shape = {SLICE_COLUMNS, SLICE_ROWS, 16, 1, false, false};
    Bytes b = object_header(o), items = {0}, offsets = {0};
    for (int k = 0; k < o->n; k++) {
        int32_t samples[SLICE_COLUMNS * SLICE_ROWS];
        for (int p = 0; p < SLICE_COLUMNS * SLICE_ROWS; p++)
            samples[p] = frame_word(&o->frames[k], p % SLICE_COLUMNS, p / SLICE_COLUMNS);
        Jpeg2000Bytes stream = jpeg2000_stream(&shape, samples);
        const size_t even = (stream.n + 1) / 2 * 2, piece = even / (size_t)pieces / 2 * 2;
        stream.data = realloc(stream.data, even + 1);
        stream.data[stream.n] = 0;
        put32(&offsets, (uint32_t)items.n + (table == WRONG_TABLE && k == 2 ? 4 : 0));
        for (int i = 0; i < pieces; i++) {
            const Bytes part = {.data = stream.data + (size_t)i * piece,
                                .n = i + 1 < pieces ? piece : even - (size_t)i * piece};
            put_item(&items, &part);
        }
        free(stream.data);
    }
    put_tag(&b, 0x7FE00010);
    put(&b, "OB\0\0\xff\xff\xff\xff", 8);
    if (table == NO_TABLE)
        offsets.n = 0;
    put_item(&b, &offsets);
    put(&b, items.data, items.n);
    put(&b, "\xfe\xff\xdd\xe0\0\0\0\0", 8);
    free(items.data);
    free(offsets.data);
    return b;
}

static void test_fragments(void **state)
{
    for (int pieces = 1; pieces <= 3; pieces++)
        for (int table = NO_TABLE; table <= WRONG_TABLE; table++) {
            Found f;
            Object o = sound_object(7);
            o.syntax = "1.2.840.10008.1.2.4.90";
            find_bytes(&f, encapsulated(&o, pieces, (Table)table));
            expect_volume(&f.list->items[0], 7, 0, 1);
            done(&f);
        }
}

/* Streams without offsets, and no table. */
static void test_frames_not_told(void **state)
{
    Found f;
    Object o = sound_object(7);
    o.syntax = "1.2.840.10008.1.2.4.90";
    Bytes b = encapsulated(&o, 2, NO_TABLE);
    for (size_t i = 0; i + 4 < b.n; i++)
        if (memcmp(b.data + i, "\xff\x4f\xff\x51", 4) == 0) {
            b.data[i + 1] = 0;
            break;
        }
    find_bytes(&f, b);
    assert_int_equal(f.list->items[0].refusal, CTS_ERR_PIXELS);
    assert_non_null(strstr(f.list->items[0].reason, "cannot be separated"));
    done(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_stack), cmocka_unit_test(test_own_groups),  cmocka_unit_test(test_stacks),
        cmocka_unit_test(test_phases),    cmocka_unit_test(test_scout_frame), cmocka_unit_test(test_refused),
        cmocka_unit_test(test_truncated), cmocka_unit_test(test_fragments),   cmocka_unit_test(test_frames_not_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
