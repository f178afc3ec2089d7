/* The contact sheet's sections: planes of the patient, scale, grey levels, colours of outlines. */
#include "app/contact/contact_sheet.h"
#include "unit.h"
#include <math.h>
#include <string.h>

enum { NX = 16, NY = 12, NZ = 5, SIDE = CTS_SECTION_SIDE };
static uint16_t grey[NX * NY * NZ];

/* Voxels of 2 x 2 x 4 mm; slice 1 has 0 HU, the others air. sagittal: scanned as sagittal slices, in which columns run
 * to the back, rows to the feet, and slices to the left. */
static CtsPicture *draw(CtsLabel *labels, size_t n, bool sagittal)
{
    CtsVolume even = {.dims = {NX, NY, NZ},
                      .grey = grey,
                      .hu_offset = -1024,
                      .hu_step = 1,
                      .step_lps = {{2, 0, 0}, {0, 2, 0}, {0, 0, 4}}};
    if (sagittal)
        memcpy(even.step_lps, (double[3][3]){{0, 2, 0}, {0, 0, -2}, {4, 0, 0}}, sizeof even.step_lps);
    const CtsScanned scanned = {.n_slices = NZ, .even = &even};
    const CtsLabels all = {.items = labels, .n = n, .counted = true};
    CtsPicture *picture = NULL;
    memset(grey, 0, sizeof grey);
    for (int i = 0; i < NX * NY; i++)
        grey[NX * NY + i] = 1024;
    assert_int_equal(cts_card_sections(&scanned, n ? &all : NULL, &picture, NULL), CTS_OK);
    assert_int_equal(picture->width, 3 * SIDE);
    assert_int_equal(picture->height, SIDE);
    return picture;
}

static const float *pixel(const CtsPicture *p, int square, int x, int y)
{
    return p->pixels + 4 * ((size_t)y * 3 * SIDE + (size_t)(square * SIDE + x));
}

static bool has_colour(const float *rgb)
{
    return rgb[0] != rgb[1] || rgb[1] != rgb[2];
}

/* An outline within a pixel of x, and none two pixels before. */
static bool begins_at(const CtsPicture *p, int square, int x, int y)
{
    return (has_colour(pixel(p, square, x, y)) || has_colour(pixel(p, square, x + 1, y))) &&
           !has_colour(pixel(p, square, x - 2, y));
}

/* A box of voxels 4 <= i < 8, 3 <= j < 6 in slice 1. */
static size_t box(CtsLabelRun *runs)
{
    for (uint32_t j = 3; j < 6; j++)
        runs[j - 3] = (CtsLabelRun){NY + j, 4, 8};
    return 3;
}

/* Pixels of a square, 30 mm between the outermost of 16 columns being SIDE - 2 of them, at voxel coordinates of an axis
 * with n voxels of so many mm. */
static int at(double voxel, int n, double mm)
{
    return (int)floor(SIDE / 2.0 + (voxel - (n - 1) / 2.0) * mm * (SIDE - 2) / 30);
}

static void through_the_label(void **state)
{
    CtsLabelRun runs[3];
    CtsLabel label = {.fact.voxels = 12, .runs = runs, .n_runs = box(runs)};
    CtsPicture *p = draw(&label, 1, false);
    const int y = at(4, NY, 2), slice = SIDE - 1 - at(1, NZ, 4);
    assert_true(begins_at(p, 0, at(3.5, NX, 2), y));
    assert_false(has_colour(pixel(p, 0, at(6, NX, 2), y)));                /* inside */
    assert_true(fabsf(*pixel(p, 0, at(6, NX, 2), y) - 0.4f) < .01F);       /* 0 HU from -160 to 240 */
    assert_true(*pixel(p, 0, 90, 2) == 0);                                 /* above the scan */
    assert_true(begins_at(p, 1, at(3.5, NX, 2), slice));                   /* coronal: the feet at the bottom */
    assert_true(begins_at(p, 2, at(2.5, NY, 2), slice));                   /* sagittal: the front at the left */
    assert_true(*pixel(p, 1, at(6, NX, 2), SIDE - 1 - at(3, NZ, 4)) == 0); /* air of slice 3 */
    cts_picture_free(&p);
}

/* Slices of another orientation make the same planes of the patient. */
static void other_orientation(void **state)
{
    CtsPicture *p = draw(NULL, 0, true);
    /* Slice 1, of 0 HU, is a plane of the patient's left: a column of the axial and of the coronal section, and all of
     * the sagittal one, which runs through it. */
    const int x = at(1, NZ, 4);
    for (int square = 0; square < 2; square++) {
        assert_true(fabsf(*pixel(p, square, x, SIDE / 2) - 0.4f) < .02F);
        assert_true(*pixel(p, square, at(3, NZ, 4), SIDE / 2) == 0);
    }
    for (int i = -5; i <= 5; i += 5)
        assert_true(fabsf(*pixel(p, 2, SIDE / 2 + 10 * i, SIDE / 2 + 5 * i) - 0.4f) < .01F);
    cts_picture_free(&p);
}

/* A small label is drawn over a large one, in any order. */
static void small_over_large(void **state)
{
    CtsLabelRun large[NY], small[3];
    for (uint32_t j = 0; j < NY; j++)
        large[j] = (CtsLabelRun){NY + j, 0, NX};
    CtsLabel one[] = {{.fact.voxels = 12, .runs = small, .n_runs = box(small)},
                      {.fact.voxels = NX * NY, .runs = large, .n_runs = NY}};
    CtsPicture *p = draw(one, 2, false);
    const float *const edge = pixel(p, 0, at(3.5, NX, 2) + 1, at(4, NY, 2));
    assert_true(edge[0] > edge[2]); /* label 0 is red */
    cts_picture_free(&p);
}

static void nothing_labelled(void **state)
{
    CtsLabel label = {0};
    CtsPicture *p = draw(&label, 1, false);
    for (int i = 0; i < 3 * SIDE * SIDE; i++)
        assert_false(has_colour(p->pixels + 4 * i));
    cts_picture_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(through_the_label), cmocka_unit_test(other_orientation),
                                       cmocka_unit_test(small_over_large), cmocka_unit_test(nothing_labelled)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
