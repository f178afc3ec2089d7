/* Presets at any HU: formulas, published numbers, and the sanity of every built-in one. */
#include "ctsplat/preset.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
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
    (void)state;
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
    (void)state;
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

/* What VTK makes of 3D Slicer's control points. */
static void slicer_numbers(void **state)
{
    (void)state;
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

static void slicer_lighting(void **state)
{
    (void)state;
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
        n += !strncmp(cts_preset_builtin(i)->name, "ct-", 3);
    assert_int_equal(n, 22);
}

static void builtin_are_valid(void **state)
{
    (void)state;
    size_t n = 0;
    for (const CtsPreset *p; (p = cts_preset_builtin(n)); n++) {
        for (size_t other = 0; other < n; other++)
            assert_string_not_equal(p->name, cts_preset_builtin(other)->name);
        assert_true(p->n_opacity >= 1 && p->n_colour >= 1);
        assert_true(p->n_opacity <= CTS_MAX_POINTS && p->n_colour <= CTS_MAX_POINTS);
        assert_true(p->window_high_hu > p->window_low_hu && p->unit_distance_mm == 1);
        for (int i = 0; i < p->n_opacity; i++) {
            assert_true(p->opacity[i].opacity >= 0 && p->opacity[i].opacity <= 1);
            assert_true(i == 0 || p->opacity[i].hu >= p->opacity[i - 1].hu);
        }
        for (int i = 0; i < p->n_colour; i++) {
            for (int c = 0; c < 3; c++)
                assert_true(p->colour[i].rgb[c] >= 0 && p->colour[i].rgb[c] <= 1);
            assert_true(i == 0 || p->colour[i].hu >= p->colour[i - 1].hu);
        }
        /* Air is never seen, except where air is the point. */
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
    (void)state;
    near(cts_preset_opacity(named("bone"), 149), 0, 0);
    assert_true(cts_preset_opacity(named("bone"), 700) > 0.8);
    near(cts_preset_opacity(named("skin"), -500), 0, 0);
    assert_true(cts_preset_opacity(named("skin"), -200) >= 0.9);
    assert_true(named("skin")->remove_table && named("bone")->remove_table);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_and_steps), cmocka_unit_test(extinction),        cmocka_unit_test(slicer_numbers),
        cmocka_unit_test(slicer_lighting), cmocka_unit_test(builtin_are_valid), cmocka_unit_test(own_looks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
