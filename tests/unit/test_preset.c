/* Presets at any HU: formulas, published numbers, and the sanity of every built-in one. */
#include "ctsplat/preset.h"
#include "unit.h"

#include <math.h>
#include <string.h>

static const CtsPreset *named(const char *name)
{
    for (size_t i = 0; cts_preset_builtin(i); i++)
        if (!strcmp(cts_preset_builtin(i)->name, name))
            return cts_preset_builtin(i);
    fail_msg("no built-in preset %s", name);
    return NULL;
}

static void near(double found, double expected, double bound)
{
    if (!(fabs(found - expected) <= bound))
        fail_msg("found %.17g, expected %.17g within %g", found, expected, bound);
}

static void lines_and_steps(void **state)
{
    CtsPreset p = {.unit_distance_mm = 1, .n_opacity = 5, .n_colour = 2};
    const CtsOpacityPoint points[] = {{0, 0.25}, {100, 0.5}, {200, 0.1}, {200, 0.9}, {300, 0.2}};
    memcpy(p.opacity, points, sizeof points);
    p.colour[0] = (CtsColourPoint){-10, {0, 1, 0.5}};
    p.colour[1] = (CtsColourPoint){30, {1, 0, 0.5}};
    near(cts_preset_opacity(&p, -1e6), 0.25, 0);
    near(cts_preset_opacity(&p, 0), 0.25, 0);
    near(cts_preset_opacity(&p, 50), 0.375, 1e-15);
    near(cts_preset_opacity(&p, 150), 0.3, 1e-15);
    near(cts_preset_opacity(&p, nextafter(200, 0)), 0.1, 1e-12);
    near(cts_preset_opacity(&p, 200), 0.9, 0);
    near(cts_preset_opacity(&p, 250), 0.55, 1e-15);
    near(cts_preset_opacity(&p, 300), 0.2, 0);
    near(cts_preset_opacity(&p, 1e9), 0.2, 0);
    double rgb[3];
    cts_preset_colour(&p, 0, rgb);
    near(rgb[0], 0.25, 1e-15);
    near(rgb[1], 0.75, 1e-15);
    near(rgb[2], 0.5, 1e-15);
}

static void extinction(void **state)
{
    CtsPreset p = {.unit_distance_mm = 1, .n_opacity = 1};
    const double opacities[] = {0, 1e-9, 0.5, 0.999, 1};
    const double units[] = {0.25, 1, 3};
    for (int u = 0; u < 3; u++)
        for (int a = 0; a < 5; a++) {
            p.unit_distance_mm = units[u];
            p.opacity[0] = (CtsOpacityPoint){0, opacities[a]};
            const double formula = opacities[a] >= 1 ? 50 : fmin(-log(1 - opacities[a]) / units[u], 50);
            near(cts_preset_extinction_per_mm(&p, 7), formula, 1e-6 * formula);
        }
    /* One unit of material takes away the share that opacity names; small opacities lose no digits. */
    p = (CtsPreset){.unit_distance_mm = 2, .n_opacity = 1, .opacity = {{0, 0.37}}};
    near(1 - exp(-cts_preset_extinction_per_mm(&p, 0) * 2), 0.37, 1e-15);
    p.opacity[0].opacity = 1e-12;
    near(cts_preset_extinction_per_mm(&p, 0), 0.5e-12, 1e-24);
    p = (CtsPreset){.unit_distance_mm = 0.01, .n_opacity = 1, .opacity = {{0, 0.9}}};
    near(cts_preset_extinction_per_mm(&p, 0), 50, 0);
}

/* 3D Slicer's control points as VTK interprets them. */
static void slicer_numbers(void **state)
{
    const struct {
        const char *preset;
        double hu, opacity;
    } golden[] = {
        {"ct-bone", 0, .0179},   {"ct-bone", 50, .0723},   {"ct-bone", 300, .3443},
        {"ct-bone", 700, .7154}, {"ct-bone", 1500, .7122}, {"ct-muscle", 50, .3725},
        {"ct-aaa", 300, .7533},  {"ct-mip", 50, .5141},    {"ct-coronary-arteries-3", 300, .8583},
    };
    for (size_t i = 0; i < sizeof golden / sizeof *golden; i++)
        near(cts_preset_opacity(named(golden[i].preset), golden[i].hu), golden[i].opacity, 5.1e-5);

    const CtsPreset *bone = named("ct-bone");
    const double colours[2][4] = {{300, .814, .525, .423}, {700, .908, .820, .564}};
    for (int i = 0; i < 2; i++) {
        double rgb[3];
        cts_preset_colour(bone, colours[i][0], rgb);
        for (int c = 0; c < 3; c++)
            near(rgb[c], colours[i][1 + c], 5.1e-4);
    }
    const double steps_mm[] = {.25, .5, .7, 1, 2};
    const double at_300[] = {.1001, .1902, .2558, .3443, .5700}, at_700[] = {.2696, .4666, .5851, .7154, .9190};
    for (int i = 0; i < 5; i++) {
        near(1 - exp(-cts_preset_extinction_per_mm(bone, 300) * steps_mm[i]), at_300[i], 5.1e-5);
        near(1 - exp(-cts_preset_extinction_per_mm(bone, 700) * steps_mm[i]), at_700[i], 5.1e-5);
    }
}

/* Each of the 26 between its points, from the published points rounded to four digits: opacity at three HU, colour at
 * the second, class of lighting. */
static void slicer_presets(void **state)
{
    const struct {
        const char *name;
        char light; /* A: glossy, B: matt, C: none, D: of its own */
        double hu[3], opacity[3], rgb[3];
    } golden[] = {
        {"ct-bone", 'A', {312, 1856, 1956}, {0.3573, 0.7108, 0.7104}, {0.9529, 0.9078, 0.7764}},
        {"ct-bones", 'B', {216, 615, 715}, {0.0959, 0.1952, 0.1967}, {1.0000, 0.7068, 0.0290}},
        {"ct-cropped-volume-bone", 'C', {-450.5, 300, 2356}, {0.5000, 1.0000, 1.0000}, {0.5278, 0.5278, 0.5278}},
        {"ct-muscle", 'A', {31, 319, 1745}, {0.3380, 0.7551, 0.8186}, {0.9414, 0.7710, 0.6234}},
        {"ct-soft-tissue", 'C', {-163.5, 40, 1950}, {0.5007, 1.0000, 1.0000}, {0.5278, 0.5278, 0.5278}},
        {"ct-fat", 'C', {-99.5, -80, -59.5}, {0.0750, 0.1500, 0.0750}, {0.0000, 0.8615, 0.1385}},
        {"ct-lung", 'B', {-599.5, -500, -399.5}, {0.0750, 0.1500, 0.0750}, {0.4752, 0.8753, 0.0884}},
        {"ct-air", 'A', {-1962, -700, -600}, {0.7108, 0.3579, 0.1789}, {0.2500, 0.6500, 1.0000}},
        {"ct-mip", 'A', {31, 1886, 1986}, {0.4999, 1.0000, 1.0000}, {1.0000, 1.0000, 1.0000}},
        {"ct-x-ray", 'C', {650, 2286, 2386}, {0.0250, 0.0500, 0.0500}, {1.0000, 1.0000, 1.0000}},
        {"mr-angio", 'B', {154.8, 195.5, 2000}, {0.2177, 0.6564, 0.7368}, {0.9686, 0.9020, 0.8354}},
        {"mr-default", 'B', {30, 80, 622}, {0.0750, 0.2250, 0.4375}, {0.5922, 0.3765, 0.2294}},
        {"mr-mip-slicer", 'C', {200, 257.5, 2000}, {0.3193, 0.5, 1}, {1, 1, 1}},
        {"mr-t2-brain", 'D', {127, 315, 526}, {0.0855, 0.5842, 1}, {0.2971, 0.6689, 0.6167}},
        {"ct-aaa", 'A', {155, 317, 1745}, {0.3465, 0.7647, 0.8186}, {1.0000, 0.9685, 0.9773}},
        {"ct-aaa2", 'A', {137.39, 283, 2325}, {0.0833, 0.7202, 0.8125}, {0.9961, 0.8785, 0.5258}},
        {"ct-cardiac", 'A', {9, 220, 1666}, {0.1435, 0.7018, 0.8616}, {0.8066, 0.4656, 0.4743}},
        {"ct-cardiac2", 'A', {103, 932, 2329}, {0.2136, 0.7659, 0.7549}, {1.0000, 0.9392, 0.8117}},
        {"ct-cardiac3", 'A', {-21, 244, 2148}, {0.0845, 0.5982, 0.6116}, {1.0000, 0.9475, 0.5727}},
        {"ct-chest-contrast-enhanced", 'A', {159, 345, 1755}, {0.2231, 0.5355, 0.6206}, {0.9411, 0.7701, 0.6217}},
        {"ct-chest-vessels", 'B', {-628, 231, 1755}, {0.2142, 0.5268, 0.6206}, {0.9412, 0.7704, 0.6223}},
        {"ct-coronary-arteries", 'C', {148, 399, 2070}, {0.1312, 0.6747, 0.8884}, {0.8830, 0.8830, 0.8830}},
        {"ct-coronary-arteries-2", 'B', {143.85, 205, 2023}, {0.0582, 0.6722, 0.8304}, {0.9419, 0.6355, 0.3131}},
        {"ct-coronary-arteries-3", 'A', {129.31, 215, 2123}, {0.0489, 0.7639, 0.9331}, {0.8980, 0.6719, 0.4457}},
        {"ct-liver-vasculature", 'C', {153.5, 364, 2429}, {0.2411, 0.7447, 0.8437}, {0.7744, 0.7222, 0.5959}},
        {"ct-pulmonary-arteries", 'B', {-466, -113, 2020}, {0.0358, 0.5047, 0.8348}, {0.7277, 0.1840, 0.1138}},
    };
    assert_int_equal(sizeof golden / sizeof *golden, 26);
    for (size_t i = 0; i < sizeof golden / sizeof *golden; i++) {
        const CtsPreset *p = named(golden[i].name);
        double rgb[3];
        for (int k = 0; k < 3; k++)
            near(cts_preset_opacity(p, golden[i].hu[k]), golden[i].opacity[k], 2e-4);
        cts_preset_colour(p, golden[i].hu[1], rgb);
        for (int c = 0; c < 3; c++)
            near(rgb[c], golden[i].rgb[c], 2e-4);
        static const double lights[4][4] = {{0.1, 0.9, 0.2, 10}, {0.2, 1, 0, 1}, {0.2, 1, 0, 1}, {0.3, 0.6, 0.5, 40}};
        const double *const light = lights[golden[i].light - 'A'];
        assert_true(p->shade == (golden[i].light != 'C'));
        assert_true(p->ambient == light[0] && p->diffuse == light[1] && p->specular == light[2] &&
                    p->power == light[3]);
        assert_int_equal(p->mode, CTS_MODE_COMPOSITE);
    }
}

static void slicer_lighting(void **state)
{
    const CtsPreset *glossy = named("ct-bone"), *matt = named("ct-bones"), *unlit = named("ct-soft-tissue");
    assert_true(glossy->shade && matt->shade && !unlit->shade);
    near(glossy->ambient, 0.1, 0);
    near(glossy->diffuse, 0.9, 0);
    near(glossy->specular, 0.2, 0);
    near(glossy->power, 10, 0);
    near(matt->ambient, 0.2, 0);
    near(matt->diffuse, 1, 0);
    near(matt->specular, 0, 0);
    near(matt->power, 1, 0);
    int n = 0;
    for (size_t i = 0; cts_preset_builtin(i); i++)
        if (!strncmp(cts_preset_builtin(i)->name, "ct-", 3)) {
            assert_true(cts_preset_builtin(i)->remove_table);
            n++;
        }
    assert_int_equal(n, 22);
}

static void builtin_are_valid(void **state)
{
    size_t n = 0;
    for (const CtsPreset *p; (p = cts_preset_builtin(n)); n++) {
        for (size_t other = 0; other < n; other++)
            assert_string_not_equal(p->name, cts_preset_builtin(other)->name);
        assert_true(p->n_opacity >= 1 && p->n_colour >= 1);
        assert_true(p->n_opacity <= CTS_MAX_POINTS && p->n_colour <= CTS_MAX_POINTS);
        assert_true(p->window_high_hu != p->window_low_hu && p->unit_distance_mm == 1);
        assert_true(cts_preset_suits(p, (CtsModality)p->modality,
                                     p->scale == CTS_SCALE_RELATIVE ? CTS_QUANTITY_BQML : (CtsQuantity)p->scale));
        for (int i = 0; i < p->n_opacity; i++) {
            assert_true(p->opacity[i].opacity >= 0 && p->opacity[i].opacity <= 1);
            assert_true(i == 0 || p->opacity[i].hu >= p->opacity[i - 1].hu);
        }
        for (int i = 0; i < p->n_colour; i++) {
            for (int c = 0; c < 3; c++)
                assert_true(p->colour[i].rgb[c] >= 0 && p->colour[i].rgb[c] <= 1);
            assert_true(i == 0 || p->colour[i].hu >= p->colour[i - 1].hu);
        }
        /* Air is invisible, except in presets for air. */
        if (p->mode == CTS_MODE_COMPOSITE && strcmp(p->name, "ct-air") && strcmp(p->name, "ct-chest-vessels"))
            near(cts_preset_opacity(p, -1024), 0, 0);
    }
    assert_null(cts_preset_builtin(n));
    assert_null(cts_preset_builtin(SIZE_MAX));
    assert_null(cts_preset_builtin(n + 1));
}

/* Nothing below bone in bone; skin opaque from its surface on. */
static void own_looks(void **state)
{
    near(cts_preset_opacity(named("bone"), 149), 0, 0);
    assert_true(cts_preset_opacity(named("bone"), 700) > 0.8);
    near(cts_preset_opacity(named("skin"), -500), 0, 0);
    assert_true(cts_preset_opacity(named("skin"), -200) >= 0.9);
    assert_true(named("skin")->remove_table && named("bone")->remove_table);
    /* The lung's own density is invisible, and so are its surroundings; metal shows no bone. */
    near(cts_preset_opacity(named("lung"), -800), 0, 0);
    near(cts_preset_opacity(named("lung"), -250), 0, 0);
    assert_true(cts_preset_opacity(named("lung"), -450) > 0.1);
    near(cts_preset_opacity(named("metal"), 1800), 0, 0);
    assert_int_equal(named("soft")->mode, CTS_MODE_AVERAGE);
    assert_int_equal(named("lung-window")->mode, CTS_MODE_MINIP);
    assert_int_equal(named("bone-window")->mode, CTS_MODE_MIP);
}

/* Which series a preset fits and suits, and the default of each. */
static void scales(void **state)
{
    const struct {
        CtsModality modality;
        CtsQuantity quantity;
        const char *usual, *composite, *fits, *not_fits, *listed;
    } cases[] = {
        {CTS_MODALITY_CT, CTS_QUANTITY_HU, "bone", "bone", "ct-bone", "mr-mip", " bone skin "},
        {CTS_MODALITY_MR, CTS_QUANTITY_STORED, "mr-mip", "mr", "mr-t2-brain", "bone", ": mr mr-angio mr-default"},
        {CTS_MODALITY_PT, CTS_QUANTITY_SUVBW, "pet-mip", "pet-mip", "pet-mip-relative", "mr-default",
         ": pet-mip pet-mip-relative)"},
        {CTS_MODALITY_PT, CTS_QUANTITY_BQML, "pet-mip-relative", "pet-mip-relative", "mr", "pet-mip",
         ": pet-mip-relative)"},
        {CTS_MODALITY_CT, CTS_QUANTITY_STORED, "mr-mip", "mr", "mr-mip", "bone", ": mr mr-angio"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const CtsModality m = cases[i].modality;
        const CtsQuantity q = cases[i].quantity;
        CtsError err = {0};
        assert_string_equal(cts_preset_default(m, q, false), cases[i].usual);
        assert_string_equal(cts_preset_default(m, q, true), cases[i].composite);
        assert_true(cts_preset_suits(named(cases[i].usual), m, q));
        assert_int_equal(cts_preset_check(named(cases[i].fits), m, q, NULL), CTS_OK);
        assert_int_equal(cts_preset_check(named(cases[i].not_fits), m, q, &err), CTS_ERR_PRESET);
        if (!strstr(err.text, cases[i].listed))
            fail_msg("\"%s\" does not list \"%s\"", err.text, cases[i].listed);
    }
    assert_false(cts_preset_suits(named("mr"), CTS_MODALITY_PT, CTS_QUANTITY_BQML)); /* it only fits */
}

/* A relative preset's 0 and 1 are the volume's air and bright voxels; a window in the volume's values stays. */
static void relative_values(void **state)
{
    CtsVolume v = {.modality = CTS_MODALITY_MR, .quantity = CTS_QUANTITY_STORED, .air_value = 20, .bright_value = 220};
    CtsPreset p = *named("mr-mip");
    assert_int_equal(cts_preset_resolve(&p, &v, NULL), CTS_OK);
    assert_int_equal(p.scale, CTS_SCALE_STORED);
    near(p.window_low_hu, 40, 1e-12);
    near(p.window_high_hu, 340, 1e-12);
    near(p.opacity[0].hu, 40, 1e-12);
    near(p.colour[p.n_colour - 1].hu, 340, 1e-12);
    CtsPreset absolute = *named("mr-mip");
    absolute.window_absolute = true;
    absolute.window_low_hu = 7;
    assert_int_equal(cts_preset_resolve(&absolute, &v, NULL), CTS_OK);
    near(absolute.window_low_hu, 7, 0);
    v.bright_value = 20;
    p = *named("mr-mip");
    assert_int_equal(cts_preset_resolve(&p, &v, NULL), CTS_ERR_PIXELS);
    v.quantity = CTS_QUANTITY_HU;
    assert_int_equal(cts_preset_resolve(&p, &v, NULL), CTS_ERR_PRESET);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_and_steps), cmocka_unit_test(extinction),      cmocka_unit_test(slicer_numbers),
        cmocka_unit_test(slicer_presets),  cmocka_unit_test(slicer_lighting), cmocka_unit_test(builtin_are_valid),
        cmocka_unit_test(own_looks),       cmocka_unit_test(scales),          cmocka_unit_test(relative_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
