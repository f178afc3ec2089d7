/* A box of one tissue, filled to the border of the volume: beyond it is air, so that the faces where a scan cuts
 * through the body are shaded as surfaces, and nothing inside is. */
#include "lab/check/suite.h"

static const CtsCheckPoint of_3[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.03, {0.2, 0.5, 0.9}}};
static const CtsCheckPoint of_10[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.1, {0.2, 0.5, 0.9}}};
static const CtsCheckPoint of_90[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.9, {0.2, 0.5, 0.9}}};

#define BOX(NAME, AZ, EL, ...)                                                                                         \
    SCENE(NAME, CHECK_OF_ALL, cts_check_volume_scene, .hu = {500}, .lit = true, PIXELS(21, 21), VIEW(AZ, EL),          \
          __VA_ARGS__)
#define SIZE .dims = {17, 14, 11}
#define HAZE POINTS(of_3)
#define FOG POINTS(of_10)

/* A layer's gradient at the faces ends within a voxel: the paper's planes, one a layer, give it half of that. */
static const CtsCheckCase cases[] = {
    BOX("cut faces: anterior", 0, 0, SIZE, HAZE, .bound = {3e-2, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: left", 90, 0, SIZE, HAZE, .bound = {3e-2, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: head", 0, 90, SIZE, HAZE, .bound = {3e-2, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: feet, nearly opaque", 0, -90, SIZE, .samples = 16, POINTS(of_90),
        .bound = {8e-3, CHECK_PROMISED, 2e-6}),
    BOX("cut faces: oblique", 20, 15, SIZE, HAZE, .bound = {3e-2, 1.2e-2, 2e-6}),
    BOX("cut faces: oblique, more samples", 20, 15, SIZE, .samples = 16, HAZE, .bound = {3e-3, 1e-3, 2e-6}),
    BOX("cut faces: onto an edge", 45, 0, SIZE, .samples = 16, FOG, .bound = {6e-3, 1e-3, 2e-6}),
    BOX("cut faces: onto a corner", 45, 35.26, SIZE, .samples = 16, FOG, .bound = {6e-3, 4e-3, 2e-6}),
    BOX("cut faces: leaning slices, spacing 1:2:3", -15, 70, SIZE, .spacing_mm = {1, 2, 3}, .lean = 0.3, .samples = 16,
        HAZE, .bound = {6e-3, 6e-3, 2e-6}),
    BOX("cut faces: 3 layers to a slice", -35, 40, SIZE, .layers = 3, .samples = 16, HAZE, .bound = {6e-3, 4e-3, 2e-6}),
    BOX("cut faces: two layers", 10, 60, .dims = {17, 14, 2}, .samples = 16, FOG, .bound = {6e-3, 1e-3, 2e-6}),
};

const CtsCheckTable cts_check_faces = {cases, sizeof cases / sizeof *cases};
