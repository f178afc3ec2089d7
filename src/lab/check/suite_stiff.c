/* Extinction times layer distance from 1e-8 to 1e6, transfer functions with steps, peaks and doubled points, and very
 * many layers. */
#include "lab/check/suite.h"

/* Extinctions of opacity 1 - exp(-x): -expm1(-x) for the x named. */
static const CtsCheckPoint tau_1e_8[] = {{0, 9.99999995e-9, {1, 0.5, 0.25}}};
static const CtsCheckPoint tau_1e_6[] = {{0, 9.999995e-7, {1, 0.5, 0.25}}};
static const CtsCheckPoint tau_1e_4[] = {{0, 9.9995000166662500e-5, {1, 0.5, 0.25}}};
static const CtsCheckPoint tau_1[] = {{0, 0.63212055882855767, {1, 0.5, 0.25}}};
static const CtsCheckPoint opaque[] = {{0, 1, {1, 0.5, 0.25}}};
static const CtsCheckPoint ramp_to_1[] = {{100, 0, {1, 0, 0}}, {600, 1, {0, 1, 0.5}}, {900, 1, {0, 0, 1}}};
static const CtsCheckPoint step[] = {
    {0, 0.05, {1, 0.2, 0.1}}, {431.7, 0.05, {1, 0.2, 0.1}}, {431.7, 0.4, {0.1, 0.6, 1}}};
static const CtsCheckPoint steep[] = {
    {0, 0.05, {1, 0.2, 0.1}}, {431.7, 0.05, {1, 0.2, 0.1}}, {431.700001, 0.4, {0.1, 0.6, 1}}};
static const CtsCheckPoint tripled[] = {{0, 0.05, {1, 0.2, 0.1}},
                                        {431.7, 0.05, {1, 0.2, 0.1}},
                                        {431.7, 1, {1, 1, 1}},
                                        {431.7, 0, {0, 0, 0}},
                                        {431.7, 0.4, {0.1, 0.6, 1}}};
static const CtsCheckPoint at_500[] = {{0, 0.4, {1, 0, 0}}, {500, 0.4, {1, 0, 0}}, {500, 0.03, {0, 1, 1}}};
static const CtsCheckPoint narrow[] = {{495, 0, {1, 0.5, 0}}, {505, 0.2, {0.5, 1, 0}}};
static const CtsCheckPoint two_colours[] = {{0, 0.2, {1, 0, 0}}, {431.7, 0.2, {1, 0, 0}}, {431.7, 0.2, {0, 1, 0}}};
static const CtsCheckPoint peak[] = {{499, 0, {1, 0.7, 0.3}}, {500, 0.6, {1, 0.7, 0.3}}, {501, 0, {1, 0.7, 0.3}}};
static const CtsCheckPoint between[] = {
    {499.02, 0, {1, 0.7, 0.3}}, {499.1, 0.8, {1, 0.7, 0.3}}, {499.24, 0, {1, 0.7, 0.3}}};
static const CtsCheckPoint opaque_peak[] = {{499, 0, {1, 0.7, 0.3}}, {500, 1, {1, 0.7, 0.3}}, {501, 0, {1, 0.7, 0.3}}};
static const CtsCheckPoint low_opacity[] = {{100, 0, {0.9, 0.5, 0.2}}, {900, 0.002, {0.3, 0.8, 1}}};
static const CtsCheckPoint even_low_opacity[] = {{0, 1e-4, {0.25, 0.5, 1}}};
static const CtsCheckPoint grey_range[] = {{-1024, 0, {0, 0, 1}}, {64511, 0.02, {1, 1, 0}}};

#define PLATE .dims = {9, 13, 9}, .hu = {500}
#define RAMP .dims = {9, 21, 9}, .hu = {80, 1, 40, 2}
#define FINE_RAMP .dims = {9, 41, 9}, .hu = {494, 0.25, 0.25, 0.25}, .hu_step = 0.25
#define FROM_AROUND .azimuth_deg = -33, .elevation_deg = 24, .mm_per_pixel = 0.43
/* At other scales: pixels so many voxels apart. */
#define ASKEW(AZ, EL, S, SCALE)                                                                                        \
    .spacing_mm = {S, S, S}, .azimuth_deg = AZ, .elevation_deg = EL, .mm_per_pixel = (SCALE) * (S)
#define SPACING(S) .spacing_mm = {S, S, S}, .mm_per_pixel = 0.1 * S, .width = 7, .height = 7
#define PROMISED .bound = {CHECK_NONE, CHECK_PROMISED, 1e-6}
#define NEARLY .bound = {CHECK_NONE, 4e-3, 1e-6}

static const CtsCheckCase cases[] = {
    /* The paper's engines store transmittance in float32, which changes by steps of 6e-8. */
    LINEAR("stiff: tau h = 1e-8", PLATE, POINTS(tau_1e_8), SPACING(1), .bound = {CHECK_NONE, 1e-11, 1e-13}),
    LINEAR("stiff: tau h = 1e-8, oblique", PLATE, POINTS(tau_1e_8), FROM_AROUND, .bound = {CHECK_NONE, 1e-11, 1e-13}),
    LINEAR("stiff: tau h = 1e-6", PLATE, POINTS(tau_1e_6), SPACING(1), .bound = {1e-6, 1e-9, 1e-11}),
    LINEAR("stiff: tau h = 1e-4", PLATE, POINTS(tau_1e_4), SPACING(1), .bound = {1e-6, 1e-7, 1e-9}),
    LINEAR("stiff: tau h = 1e-4, oblique", PLATE, POINTS(tau_1e_4), FROM_AROUND, .bound = {CHECK_NONE, 1e-8, 1e-9}),
    LINEAR("stiff: tau h = 1", PLATE, POINTS(tau_1), SPACING(1), .bound = {1e-6, CHECK_PROMISED, 1e-7}),
    LINEAR("stiff: tau h = 1, oblique", PLATE, POINTS(tau_1), FROM_AROUND, .bound = {CHECK_NONE, CHECK_PROMISED, 1e-7}),
    LINEAR("stiff: tau h = 50", PLATE, POINTS(opaque), SPACING(1), .bound = {1e-6, 1e-6, 1e-7}),
    LINEAR("stiff: tau h = 1e4", PLATE, POINTS(opaque), SPACING(200), .bound = {1e-6, 1e-6, 1e-7}),
    LINEAR("stiff: tau h = 1e6", PLATE, POINTS(opaque), SPACING(20000), .bound = {1e-6, 1e-6, 1e-7}),
    LINEAR("stiff: ramp to opacity 1, 0.01 mm", RAMP, POINTS(ramp_to_1), SPACING(0.01), .bound = {3e-2, 3e-3, 1e-6}),
    LINEAR("stiff: ramp to opacity 1, 1 mm", RAMP, POINTS(ramp_to_1), SPACING(1), PROMISED),
    LINEAR("stiff: ramp to opacity 1, 20 m", RAMP, POINTS(ramp_to_1), SPACING(20000), PROMISED),
    LINEAR("steep: step", RAMP, POINTS(step), SPACING(1), PROMISED),
    LINEAR("steep: step, oblique", RAMP, POINTS(step), FROM_AROUND, NEARLY),
    LINEAR("steep: 1e-6 HU wide", RAMP, POINTS(steep), SPACING(1), PROMISED),
    LINEAR("steep: four points at one HU", RAMP, POINTS(tripled), SPACING(1), PROMISED),
    LINEAR("steep: exactly on a step the later point holds", PLATE, POINTS(at_500), SPACING(1),
           .bound = {1e-6, 1e-6, 1e-7}),
    LINEAR("levels: rounded to the nearest", .dims = {9, 21, 9}, .hu = {488, 1, 1, 1}, POINTS(narrow),
           .mm_per_pixel = 0.23, PIXELS(16, 16), .bound = {1.1e-2, CHECK_PROMISED, 1e-6}),
    LINEAR("steep: what shows behind 83 % of the light", RAMP, POINTS(two_colours), SPACING(1), PROMISED),
    LINEAR("peak: one HU wide, slow field", FINE_RAMP, POINTS(peak), SPACING(1), .bound = {2e-2, 5e-4, 1e-6}),
    LINEAR("peak: one HU wide, fast field", RAMP, POINTS(peak), SPACING(1), .bound = {CHECK_NONE, 5e-4, 1e-6}),
    LINEAR("peak: one HU wide, fast field, oblique", RAMP, POINTS(peak), FROM_AROUND, PROMISED),
    LINEAR("peak: between two levels", FINE_RAMP, POINTS(between), SPACING(1), NEARLY),
    LINEAR("peak: between two levels, oblique", FINE_RAMP, POINTS(between), FROM_AROUND,
           .bound = {CHECK_NONE, 1.5e-2, 1e-6}),
    LINEAR("peak: opaque, one HU wide", RAMP, POINTS(opaque_peak), SPACING(1),
           .bound = {CHECK_NONE, 2 * CHECK_PROMISED, 1e-6}),
    LINEAR("stiff: ramp to opacity 1, 0.01 mm, askew", RAMP, POINTS(ramp_to_1), ASKEW(50, -30, 0.01, 0.3), NEARLY),
    LINEAR("stiff: ramp to opacity 1, 1 mm, askew", RAMP, POINTS(ramp_to_1), ASKEW(-70, 65, 1, 1.1),
           .bound = {CHECK_NONE, 1.5e-2, 1e-6}),
    LINEAR("stiff: ramp to opacity 1, 20 m, askew", RAMP, POINTS(ramp_to_1), ASKEW(160, 12, 20000, 0.07),
           .bound = {CHECK_NONE, CHECK_NONE, 1e-6}),
    LINEAR("steep: step, reduced", RAMP, POINTS(step), ASKEW(25, -8, 1, 2.3), NEARLY),
    LINEAR("steep: step, magnified", RAMP, POINTS(step), ASKEW(110, 40, 1, 0.07), NEARLY),
    LINEAR("steep: four points at one HU, askew", RAMP, POINTS(tripled), ASKEW(-10, 80, 1, 0.6), NEARLY),
    LINEAR("steep: what shows behind 83 % of the light, askew", RAMP, POINTS(two_colours), ASKEW(45, 35.26, 1, 0.5),
           NEARLY),
    LINEAR("peak: one HU wide, slow field, askew", FINE_RAMP, POINTS(peak), ASKEW(17, 4, 1, 0.9), NEARLY),
    LINEAR("peak: opaque, one HU wide, askew", RAMP, POINTS(opaque_peak), ASKEW(-120, -33, 1, 0.2), NEARLY),
    LINEAR("range: all 16 bits in one ramp, askew", .dims = {9, 16, 9}, .hu = {-1024, 0, 4369, 0}, POINTS(grey_range),
           ASKEW(20, 50, 1, 0.4), .bound = {CHECK_NONE, 5e-4, 1e-6}),
    LINEAR("range: all 16 bits in one ramp", .dims = {9, 16, 9}, .hu = {-1024, 0, 4369, 0}, POINTS(grey_range),
           SPACING(1), .bound = {1e-3, 1e-4, 1e-6}),
    LINEAR("layers: 20,000 of one grey", .dims = {2, 20000, 2}, .hu = {500}, POINTS(even_low_opacity), PIXELS(3, 3),
           .mm_per_pixel = 0.2, .bound = {1e-5, 1e-5, 2e-7}),
    LINEAR("layers: 20,000 in a ramp", .dims = {2, 20000, 2}, .hu = {0, 0, 0.0625, 0}, .hu_step = 0.0625,
           POINTS(low_opacity), PIXELS(3, 3), .mm_per_pixel = 0.2, .bound = {2e-4, CHECK_PROMISED, 2e-7}),
};

const CtsCheckTable cts_check_stiff = {cases, sizeof cases / sizeof *cases};
