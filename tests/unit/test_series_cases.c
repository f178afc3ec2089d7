/* Series with one attribute changed: the refusal or the diagnostic that follows. */
#include "dicom/header/slice.h"
#include "found.h"

/* One attribute of one slice, or of all, and the expected result of the series. */
typedef struct Case {
    const char *name;
    void (*change)(Slice *s, int k);
    CtsStatus refusal;
    const char *diagnostic; /* when not refused; NULL: none */
    const char *reason;     /* a part of it, when refused */
    int n_slices;
} Case;

#define CHANGE(name, statement)                                                                                        \
    static void name(Slice *s, int k)                                                                                  \
    {                                                                                                                  \
        statement;                                                                                                     \
    }

CHANGE(nothing, (void)s)
CHANGE(no_slope, s->slope = NULL)
CHANGE(comma_slope, s->slope = "1,0")
CHANGE(zero_slope, s->slope = "0")
CHANGE(tiny_slope, s->slope = "1e-7")
CHANGE(falling, (s->slope = "-1", s->intercept = "3000"))
CHANGE(huge_intercept, s->intercept = "1e9")
CHANGE(not_hu, s->rescale_type = "OD")
CHANGE(unspecified, s->rescale_type = "US")
CHANGE(is_hu, s->rescale_type = "HU")
CHANGE(spelt_hu, s->rescale_type = ((const char *[]){"hu", "HOUNSFIELD", "Hounsfield Unit", "Hounsfield Units",
                                                     "Hounsfield Unit(s)", "Houndsfield Unit", " Hu ", "H U"})[k % 8])
CHANGE(spelt_unspecified, s->rescale_type = "UNSPECIFIED")
CHANGE(small_z_eff, s->rescale_type = "z_eff")
CHANGE(electron_density, s->rescale_type = "ED")
CHANGE(many_without_place,
       (s->frames = "40", s->position = s->orientation = s->spacing = NULL, s->type = "DERIVED\\PRIMARY"))
CHANGE(private_syntax, s->syntax = "1.2.840.113619.5.2")
CHANGE(no_spacing, s->spacing = NULL)
CHANGE(zero_spacing, s->spacing = "0\\0.5")
CHANGE(one_spacing, s->spacing = "0.5")
CHANGE(wide_spacing, s->spacing = "0.5\\10.5")
CHANGE(no_position, s->position = NULL)
CHANGE(far_position, s->position = "-1\\-100001\\3")
CHANGE(two_positions, s->position = "1\\2")
CHANGE(one_without_position, s->position = k == 5 ? NULL : s->position)
CHANGE(no_orientation, s->orientation = NULL)
CHANGE(zero_orientation, s->orientation = "0\\0\\0\\0\\0\\0")
CHANGE(skew, s->orientation = "1\\0\\0\\0.02\\1\\0")
CHANGE(rough, s->orientation = "1\\0\\0\\0.005\\1\\0")
CHANGE(colour, s->samples = 3)
CHANGE(palette, s->photometric = "PALETTE COLOR")
CHANGE(inverted, s->photometric = "MONOCHROME1")
CHANGE(frames, s->frames = "2")
CHANGE(one_frame, s->frames = "1")
CHANGE(odd_frames, s->frames = "abc")
CHANGE(no_rows, s->rows = 0)
CHANGE(wide, s->columns = 4097)
CHANGE(widest, s->columns = 4096)
CHANGE(bits_32, s->allocated = 32)
CHANGE(bits_17, s->stored = 17)
CHANGE(high_low, s->high = 10)
CHANGE(half_signed, s->is_signed = -1)
CHANGE(patients, s->patient = k == 3 ? "P2" : "P1")
CHANGE(frames_of_reference, s->frame = k == 3 ? "1.2.8" : "1.2.9")
CHANGE(some_frames_empty, s->frame = k == 3 ? "" : "1.2.9")
CHANGE(scouts, s->type = k < 2 ? "ORIGINAL\\PRIMARY\\LOCALIZER" : s->type)
CHANGE(all_scouts, s->type = "ORIGINAL\\PRIMARY\\LOCALIZER")
CHANGE(unmarked_scout, s->orientation = k == 0 ? "0\\1\\0\\0\\0\\-1" : s->orientation)
CHANGE(one_size, s->columns = k == 0 ? 8 : s->columns)
CHANGE(sizes, s->columns = k < 4 ? 8 : s->columns)
CHANGE(unknown_syntax, s->syntax = "1.2.3.4.5")
CHANGE(jpeg_xl, s->syntax = "1.2.840.10008.1.2.4.110")
CHANGE(jpeg_xl_lossy, s->syntax = "1.2.840.10008.1.2.4.112")
CHANGE(jpip, s->syntax = "1.2.840.10008.1.2.4.94")
CHANGE(not_native, s->syntax = "1.2.840.10008.1.2.4.70")
CHANGE(longer, s->n_more = 10)
CHANGE(much_longer, s->n_more = 50)
CHANGE(longer_than_file, (s->n_more = 10, s->n_cut = 2))
CHANGE(unpadded, (s->allocated = s->stored = 8, s->high = 7, s->rows = s->columns = 5, s->base = 0, s->n_cut = 1))
CHANGE(two_in_one, s->n_more = 60)
CHANGE(odd_bytes, (s->allocated = s->stored = 8, s->high = 7, s->rows = s->columns = 5, s->base = 0))
CHANGE(no_uid, s->series = NULL)
CHANGE(one_instance_uid, s->sop = "1.2.3.1")
CHANGE(times, s->instance = "14.5")

static const Case cases[] = {
    {"sound", nothing, CTS_OK, NULL, NULL, 20},
    {"slope missing", no_slope, CTS_ERR_PIXELS, NULL, "(0028,1053)", 20},
    {"slope with a comma", comma_slope, CTS_ERR_PIXELS, NULL, "(0028,1053)", 20},
    {"slope 0", zero_slope, CTS_ERR_PIXELS, NULL, "RescaleSlope 0", 20},
    {"slope 1e-7", tiny_slope, CTS_ERR_PIXELS, NULL, "RescaleSlope 1e-07", 20},
    {"intercept huge", huge_intercept, CTS_ERR_PIXELS, NULL, "no Hounsfield", 20},
    {"not HU", not_hu, CTS_ERR_PIXELS, NULL, "(0028,1054) is OD", 20},
    {"slope -1", falling, CTS_OK, "negative_slope", NULL, 20},
    {"unspecified", unspecified, CTS_OK, "rescale_unspecified", NULL, 20},
    {"HU", is_hu, CTS_OK, NULL, NULL, 20},
    {"HU in other spellings", spelt_hu, CTS_OK, NULL, NULL, 20},
    {"UNSPECIFIED", spelt_unspecified, CTS_OK, "rescale_unspecified", NULL, 20},
    {"no other word in small letters", small_z_eff, CTS_ERR_PIXELS, NULL, "is z_eff, not HU", 20},
    {"electron density", electron_density, CTS_ERR_PIXELS, NULL, "(0028,1054) is ED, not HU (`quantity`", 20},
    {"many frames without a place", many_without_place, CTS_ERR_PIXELS, NULL, "NumberOfFrames (0028,0008) is not 1",
     20},
    {"private syntax", private_syntax, CTS_ERR_SYNTAX, NULL, "1.2.840.113619.5.2", 20},
    {"no spacing", no_spacing, CTS_ERR_GEOMETRY, NULL, "(0028,0030)", 20},
    {"spacing 0", zero_spacing, CTS_ERR_GEOMETRY, NULL, "(0028,0030)", 20},
    {"one spacing", one_spacing, CTS_ERR_GEOMETRY, NULL, "(0028,0030)", 20},
    {"spacing 10.5", wide_spacing, CTS_ERR_GEOMETRY, NULL, "(0028,0030)", 20},
    {"no position", no_position, CTS_ERR_GEOMETRY, NULL, "(0020,0032)", 20},
    {"position far away", far_position, CTS_ERR_GEOMETRY, NULL, "100001 mm away", 20},
    {"two numbers of position", two_positions, CTS_ERR_GEOMETRY, NULL, "(0020,0032)", 20},
    {"one slice without position", one_without_position, CTS_OK, "bad_slices", NULL, 19},
    {"no orientation", no_orientation, CTS_ERR_GEOMETRY, NULL, "(0020,0037)", 20},
    {"zero orientation", zero_orientation, CTS_ERR_GEOMETRY, NULL, "(0020,0037)", 20},
    {"skew orientation", skew, CTS_ERR_GEOMETRY, NULL, "(0020,0037)", 20},
    {"rough orientation", rough, CTS_OK, "rough_orientation", NULL, 20},
    {"colour", colour, CTS_ERR_PIXELS, NULL, "(0028,0002)", 20},
    {"palette", palette, CTS_ERR_PIXELS, NULL, "(0028,0004)", 20},
    {"inverted", inverted, CTS_OK, "monochrome1", NULL, 20},
    {"two frames", frames, CTS_ERR_PIXELS, NULL, "(0028,0008)", 20},
    {"one frame", one_frame, CTS_OK, NULL, NULL, 20},
    {"frames of letters", odd_frames, CTS_ERR_PIXELS, NULL, "(0028,0008)", 20},
    {"no rows", no_rows, CTS_ERR_PIXELS, NULL, "Rows (0028,0010) is 0", 20},
    {"4096 columns", widest, CTS_OK, NULL, NULL, 20},
    {"4097 columns", wide, CTS_ERR_PIXELS, NULL, "Columns (0028,0011) is 4097", 20},
    {"32 bits", bits_32, CTS_ERR_PIXELS, NULL, "(0028,0100) is 32", 20},
    {"17 bits stored", bits_17, CTS_ERR_PIXELS, NULL, "(0028,0101) is 17", 20},
    {"high bit 10 of 16", high_low, CTS_ERR_PIXELS, NULL, "high bit 10", 20},
    {"no sign", half_signed, CTS_ERR_PIXELS, NULL, "(0028,0103)", 20},
    {"two patients", patients, CTS_ERR_GEOMETRY, NULL, "different patients", 20},
    {"two frames of reference", frames_of_reference, CTS_ERR_GEOMETRY, NULL, "(0020,0052)", 20},
    {"one frame of reference missing", some_frames_empty, CTS_OK, "identity_incomplete", NULL, 20},
    {"scouts", scouts, CTS_OK, "localizers_dropped", NULL, 18},
    {"scouts alone", all_scouts, CTS_ERR_GEOMETRY, NULL, "only localizer", 20},
    {"a scout unmarked", unmarked_scout, CTS_OK, "other_slices_dropped", NULL, 19},
    {"one of another size", one_size, CTS_OK, "other_slices_dropped", NULL, 19},
    {"four of another size", sizes, CTS_ERR_GEOMETRY, NULL, "largest group has 16", 20},
    {"syntax unknown", unknown_syntax, CTS_ERR_SYNTAX, NULL, "1.2.3.4.5", 20},
    {"JPEG XL", jpeg_xl, CTS_ERR_SYNTAX, NULL, "1.2.840.10008.1.2.4.110", 20},
    {"JPEG XL, lossy", jpeg_xl_lossy, CTS_ERR_SYNTAX, "lossy", "export it so", 20},
    {"JPIP", jpip, CTS_ERR_SYNTAX, "lossy", "(JPIP Referenced): its pixels are on a server", 20},
    {"compressed that is not", not_native, CTS_ERR_PIXELS, NULL, "not compressed", 20},
    {"pixels 10 bytes long", longer, CTS_OK, "long_pixels", NULL, 20},
    {"pixels 50 bytes long", much_longer, CTS_OK, "long_pixels", NULL, 20},
    {"pixels longer than the file", longer_than_file, CTS_ERR_PIXELS, NULL, "70 bytes long, and 68 are left", 20},
    {"the padding byte missing", unpadded, CTS_OK, NULL, NULL, 20},
    {"pixels twice as long", two_in_one, CTS_ERR_PIXELS, NULL, "holds 2 frames", 20},
    {"an odd number of bytes", odd_bytes, CTS_OK, NULL, NULL, 20},
    {"no series UID", no_uid, CTS_OK, NULL, NULL, 20},
    {"one SOP instance UID for all", one_instance_uid, CTS_OK, NULL, NULL, 20},
    {"instance number 14.5", times, CTS_OK, NULL, NULL, 20},
};

static void test_cases(void **state)
{
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        Found f;
        make_folder(f.folder);
        for (int k = 0; k < 20; k++) {
            StackTexts t;
            Slice s = stack_slice(&t, k, 0, 0, 2 * k);
            cases[c].change(&s, k);
            write_numbered(f.folder, k, &s);
        }
        find(&f);
        if (f.status)
            fail_msg("%s: %s", cases[c].name, f.err.text);
        assert_int_equal(f.list->n, 1);
        const CtsSeries *s = &f.list->items[0];
        if (s->refusal != cases[c].refusal || s->n_slices != cases[c].n_slices || s->renderable != !s->refusal)
            fail_msg("%s: status %d, %d slices: %s", cases[c].name, s->refusal, s->n_slices, s->reason);
        CtsVolume *v = NULL;
        CtsError err = {0};
        assert_int_equal(cts_series_load(s, 1, NULL, &v, NULL, &err), cases[c].refusal);
        if (s->refusal == CTS_ERR_SYNTAX)
            assert_true(s->spacing_mm[2] == 2 && s->rows == SLICE_ROWS);
        if (s->refusal) {
            if (!strstr(s->reason, cases[c].reason) || !strstr(err.text, cases[c].reason) || v)
                fail_msg("%s: %s", cases[c].name, err.text);
        } else {
            const size_t warned = cases[c].diagnostic && strcmp(cases[c].diagnostic, "bad_slices") == 0 ? 2 : 1;
            assert_int_equal(s->diagnostics.n, cases[c].diagnostic ? warned : 0); /* a bad slice leaves a gap, too */
            bool is_found = !cases[c].diagnostic;
            for (size_t i = 0; i < s->diagnostics.n; i++)
                is_found = is_found || !strcmp(s->diagnostics.items[i].code, cases[c].diagnostic);
            if (!is_found)
                fail_msg("%s: no %s", cases[c].name, cases[c].diagnostic);
        }
        cts_volume_free(&v);
        done(&f);
    }
}

/* One object of many frames is no single slice, which would only be passed. */
static void test_many_frames(void **state)
{
    Found f;
    make_folder(f.folder);
    Slice s = sound_slice();
    many_without_place(&s, 0);
    s.frame = NULL;
    write_slice(f.folder, "cone", &s);
    find(&f);
    assert_int_equal(f.list->n, 1);
    assert_int_equal(f.list->items[0].refusal, CTS_ERR_PIXELS);
    assert_true(!f.list->items[0].passed && strstr(f.list->items[0].reason, "NumberOfFrames (0028,0008) is not 1"));
    done(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cases),
        cmocka_unit_test(test_many_frames),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
