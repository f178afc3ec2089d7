/* The contact sheet's sections: position, grey levels, colours of outlines. */
#include "app/contact/contact_sheet.h"
#include "unit.h"
#include <math.h>
#include <string.h>

enum { NX = 16, NY = 12, NZ = 5, SIDE = CTS_LABEL_SLICES_SIDE };
static uint16_t grey[NX * NY * NZ];
static double position_lps[NZ][3], at_mm[NZ], thickness_mm[NZ];

/* Voxels of 2 x 2 x 4 mm; slice 1 has 0 HU, the others air. */
static CtsPicture *draw(CtsLabel *labels, size_t n)
{
    CtsVolume even = {.dims = {NX, NY, NZ}, .grey = grey, .hu_offset = -1024, .hu_step = 1};
    const CtsScanned scanned = {.n_slices = NZ, .even = &even, .n_slots = NZ};
    CtsLabels all = {.grid = {.columns = NX,
                              .rows = NY,
                              .n_slices = NZ,
                              .step_lps = {{2, 0, 0}, {0, 2, 0}},
                              .position_lps = position_lps,
                              .at_mm = at_mm,
                              .thickness_mm = thickness_mm},
                     .items = labels,
                     .n = n,
                     .counted = true};
    CtsPicture *picture = NULL;
    memset(grey, 0, sizeof grey);
    for (int i = 0; i < NX * NY; i++)
        grey[NX * NY + i] = 1024;
    for (int k = 0; k < NZ; k++) {
        at_mm[k] = 4 * k;
        thickness_mm[k] = 4;
    }
    assert_int_equal(cts_label_slices(&scanned, &all, &picture, NULL), CTS_OK);
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

/* A box of voxels 4 <= i < 8, 3 <= j < 6 in slice 1. */
static size_t box(CtsLabelRun *runs)
{
    for (uint32_t j = 3; j < 6; j++)
        runs[j - 3] = (CtsLabelRun){NY + j, 4, 8};
    return 3;
}

/* 32 mm are 240 pixels, 7.5 a mm: a voxel is 15 pixels wide, and 24 mm of rows leave 30 pixels above. */
static void cut_through_the_label(void **state)
{
    CtsLabelRun runs[3];
    CtsLabel label = {.fact.voxels = 12, .runs = runs, .n_runs = box(runs)};
    CtsPicture *p = draw(&label, 1);
    assert_true(has_colour(pixel(p, 0, 60, 80)));            /* left edge of column 4 */
    assert_true(has_colour(pixel(p, 0, 119, 80)));           /* right edge of column 7 */
    assert_false(has_colour(pixel(p, 0, 59, 80)));           /* outside */
    assert_false(has_colour(pixel(p, 0, 90, 100)));          /* inside */
    assert_true(fabsf(*pixel(p, 0, 90, 100) - 0.4f) < .01F); /* 0 HU from -160 to 240 */
    assert_true(*pixel(p, 0, 90, 20) == 0);                  /* above the picture */
    /* Slices of 30 pixels, 75 to 225 - 60: the last one on top, so slice 1 from 135 to 165. */
    assert_true(has_colour(pixel(p, 1, 70, 135)) && has_colour(pixel(p, 1, 70, 164)));
    assert_false(has_colour(pixel(p, 1, 70, 134)));
    assert_true(has_colour(pixel(p, 2, 30 + 45, 150))); /* row 3 */
    assert_true(*pixel(p, 2, 100, 60) == 0);
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
    CtsPicture *p = draw(one, 2);
    const float *const edge = pixel(p, 0, 60, 80);
    assert_true(edge[0] > edge[2]); /* label 0 is red */
    cts_picture_free(&p);
}

static void nothing_held(void **state)
{
    CtsLabel label = {0};
    CtsPicture *p = draw(&label, 1);
    for (int i = 0; i < 3 * SIDE * SIDE; i++)
        assert_false(has_colour(p->pixels + 4 * i));
    cts_picture_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(cut_through_the_label), cmocka_unit_test(small_over_large),
                                       cmocka_unit_test(nothing_held)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
