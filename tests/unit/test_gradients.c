/* The engines' gradients near the volume's borders, where each loads its voxels in a way of its own: to air beyond, or
 * one-sided and doubled; one voxel, two, and the distance of two scanned slices from the border. */
#include "scenes.h"

/* Even opacity and diffuse light alone: a pixel's colour over its opacity is the mean of |n.v| along its ray. */
static CtsPreset even_light(bool air_beyond)
{
    CtsPreset p = *cts_preset_builtin(0);
    p.n_opacity = p.n_colour = 2;
    p.opacity[0] = (CtsOpacityPoint){-1024, air_beyond ? 0 : 0.02};
    p.opacity[1] = (CtsOpacityPoint){-900, 0.02};
    p.colour[0] = (CtsColourPoint){-1024, {1, 1, 1}};
    p.colour[1] = (CtsColourPoint){3000, {1, 1, 1}};
    p.shade = true;
    p.ambient = p.specular = p.occlusion = 0;
    p.diffuse = 1;
    p.remove_table = false;
    return p;
}

/* Levels whose gradient is never small, and differs from voxel to voxel. */
static CtsVolume *slopes(const int dims[3], int slice_layers)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, dims[0], dims[1], dims[2], &err), CTS_OK);
    v->slice_layers = slice_layers;
    size_t at = 0;
    for (int k = 0; k < dims[2]; k++)
        for (int j = 0; j < dims[1]; j++)
            for (int i = 0; i < dims[0]; i++)
                v->grey[at++] = (uint16_t)(1200 + 40 * i + 3 * i * i + 60 * j + 2 * j * k + 50 * k + 4 * i * k);
    return v;
}

static void compare_engines(const CtsVolume *volume, const CtsPreset *preset, double azimuth_deg, double elevation_deg)
{
    static const CtsEngineId engines[] = {CTS_ENGINE_TILED, CTS_ENGINE_SHEETS, CTS_ENGINE_CLASSIC};
    static const double most[] = {0.001, 0.01, 0.01};
    /* Rays of an oblique view that pass near an edge are short for sheets and layers. A border that is taken for
     * another kind of border makes a difference of 0.5. */
    const bool oblique = azimuth_deg != 0 && elevation_deg != 0;
    const float least = oblique ? 0.08f : 0.01f;
    CtsRenderSettings s;
    cts_render_defaults(&s);
    s.width = s.height = 36;
    s.mm_per_pixel = 0.45;
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    s.engine = CTS_ENGINE_RAYCAST;
    CtsPicture *cast = render(volume, preset, &s, NULL);
    for (size_t e = 0; e < sizeof engines / sizeof *engines; e++) {
        s.engine = engines[e];
        s.level = s.engine == CTS_ENGINE_SHEETS ? CTS_LEVEL_HALF_SHEETS : CTS_LEVEL_AUTO;
        s.max_error = s.engine == CTS_ENGINE_TILED ? 0.002 : 0;
        s.samples = s.engine == CTS_ENGINE_CLASSIC ? 16 : 0;
        CtsPicture *found = render(volume, preset, &s, NULL);
        for (size_t at = 0; at < 36 * 36; at++) {
            const float *const a = found->pixels + 4 * at, *const b = cast->pixels + 4 * at;
            if (b[3] < least)
                continue;
            const double off = fabs((double)(a[0] / a[3]) - (double)(b[0] / b[3]));
            if (off > (oblique ? 4 : 1) * most[e])
                fail_msg("engine %s, view %g,%g, %d x %d x %d voxels, %d layers a slice, air beyond %d, pixel %zu,%zu: "
                         "mean of |n.v| %g, ray caster %g",
                         cts_engine_names[engines[e]], azimuth_deg, elevation_deg, volume->dims[0], volume->dims[1],
                         volume->dims[2], volume->slice_layers, preset->opacity[0].opacity == 0, at % 36, at / 36,
                         (double)(a[0] / a[3]), (double)(b[0] / b[3]));
        }
        cts_picture_free(&found);
    }
    cts_picture_free(&cast);
}

static void test_borders(void **state)
{
    static const int dims[][3] = {{12, 11, 13}, {12, 11, 13}, {12, 2, 13}, {2, 11, 13}, {12, 11, 2}};
    static const double views[][2] = {{0, 0}, {90, 0}, {0, 90}, {30, 20}};
    for (int n = 0; n < 5 * 3; n++) {
        CtsVolume *volume = slopes(dims[n / 3], n % 3 + 1);
        /* Between two layers with air beyond normals reverse, which sheets and layers pass over. */
        const CtsPreset preset = even_light(n < 3);
        for (int i = 0; i < 4; i++)
            compare_engines(volume, &preset, views[i][0], views[i][1]);
        cts_volume_free(&volume);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_borders)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
