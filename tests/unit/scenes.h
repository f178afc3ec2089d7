/* Volumes for the tests of whole pictures: a phantom head by formula, noise over the full range, a real head. */
#pragma once

#include "ctsplat/ctsplat.h"
#include "unit.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static inline uint32_t scene_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 32);
}

/* Air, skin, skull with a gap, brain, a bright pin; noise of so many HU either way. */
static inline CtsVolume *phantom_head(int nx, int ny, int nz, int noise_hu)
{
    CtsVolume *v = NULL;
    CtsError err;
    uint64_t state = 5;
    assert_int_equal(cts_volume_new(&v, nx, ny, nz, &err), CTS_OK);
    v->step_lps[2][2] = 1.5;
    size_t at = 0;
    for (int k = 0; k < nz; k++)
        for (int j = 0; j < ny; j++)
            for (int i = 0; i < nx; i++, at++) {
                const double x = 2.2 * i / (nx - 1) - 1.1, y = 2.2 * j / (ny - 1) - 1.1, z = 2.2 * k / (nz - 1) - 1.1;
                const double r = sqrt(1.2 * x * x + y * y + 0.9 * z * z);
                double hu = r > 1 ? -1024 : r > 0.9 ? 40 : r > 0.78 ? 900 : 35;
                if (r < 0.9 && hypot(x - 0.3, z) < 0.15 && y < 0)
                    hu = 20;
                if (hypot(x + 0.4, y) < 0.05)
                    hu = 2500;
                if (hu > -1024 && noise_hu > 0)
                    hu += (int)(scene_random(&state) % (uint32_t)(2 * noise_hu + 1)) - noise_hu;
                v->grey[at] = (uint16_t)(hu + 1024);
            }
    return v;
}

static inline CtsVolume *random_volume(int nx, int ny, int nz, uint64_t seed)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, nx, ny, nz, &err), CTS_OK);
    const size_t n = cts_volume_n_voxels(v);
    for (size_t i = 0; i < n; i++) {
        const uint32_t r = scene_random(&seed);
        /* Both ends of the range often, and runs of air. */
        v->grey[i] = (uint16_t)(r % 8 == 0 ? 0 : r % 8 == 1 ? 65535 : r % 8 < 4 ? r >> 16 & 3 : r >> 16);
    }
    return v;
}

/* The demo's head, 256 x 256 x 108, from the Debian package invesalius-examples; NULL where that is not installed. */
static inline CtsVolume *real_head(void)
{
    static const char command[] = "tar -xzOf /usr/share/doc/invesalius-examples/examples/Cranium.inv3 "
                                  "--wildcards '*matrix.dat' 2>/dev/null";
    enum { NX = 256, NY = 256, NZ = 108 };
    CtsVolume *v = NULL;
    CtsError err;
    FILE *pipe = popen(command, "r");
    int16_t *hu = malloc(sizeof *hu * NX * NY * NZ);
    assert_non_null(hu);
    const size_t n = pipe ? fread(hu, sizeof *hu, (size_t)NX * NY * NZ, pipe) : 0;
    if (pipe)
        pclose(pipe);
    if (n == (size_t)NX * NY * NZ) {
        assert_int_equal(cts_volume_new(&v, NX, NY, NZ, &err), CTS_OK);
        v->step_lps[0][0] = v->step_lps[1][1] = 0.957;
        v->step_lps[2][2] = 1.5;
        /* Its rows run from the back to the front. */
        for (int k = 0; k < NZ; k++)
            for (int j = 0; j < NY; j++)
                for (int i = 0; i < NX; i++) {
                    const int value = hu[((size_t)k * NY + (size_t)(NY - 1 - j)) * NX + (size_t)i];
                    v->grey[((size_t)k * NY + (size_t)j) * NX + (size_t)i] =
                        (uint16_t)(value < -1024 ? 0 : value + 1024);
                }
    }
    free(hu);
    return v;
}

static inline CtsPreset preset_named(const char *name)
{
    const CtsPreset *preset;
    for (size_t i = 0; (preset = cts_preset_builtin(i)); i++)
        if (strcmp(preset->name, name) == 0)
            return *preset;
    fail_msg("no built-in preset %s", name);
    abort();
}

/* A model of a volume alone. */
#define MODEL_OF(v) (&(CtsModel){.volume = (CtsVolume *)(v)})

static inline CtsPicture *render_model(const CtsModel *model, const CtsPreset *preset,
                                       const CtsRenderSettings *settings, CtsReport *report)
{
    CtsPicture *picture = NULL;
    CtsError err = {0};
    if (cts_render(model, preset, settings, &picture, report, &err))
        fail_msg("%s", err.text);
    return picture;
}

static inline CtsPicture *render(const CtsVolume *volume, const CtsPreset *preset, const CtsRenderSettings *settings,
                                 CtsReport *report)
{
    return render_model(MODEL_OF(volume), preset, settings, report);
}

/* Compares n values of a plane of pixels, each of so many channels; fails at the first that differs. */
static inline void assert_same_plane(const float *expected, const float *actual, int width, size_t n, int n_channels,
                                     const char *plane, const char *what)
{
    size_t n_differ = 0, first = 0;
    for (size_t i = n; i-- > 0;)
        if (memcmp(&expected[i], &actual[i], sizeof *actual)) {
            n_differ++;
            first = i;
        }
    const size_t pixel = first / (size_t)n_channels;
    if (n_differ)
        fail_msg("%s: pixel %zu,%zu %s, channel %zu: expected %.9g (%a), actual %.9g (%a); %zu of %zu values differ",
                 what, pixel % (size_t)width, pixel / (size_t)width, plane, first % (size_t)n_channels,
                 (double)expected[first], (double)expected[first], (double)actual[first], (double)actual[first],
                 n_differ, n);
}

/* Same bytes: pixels, error bounds and depth. A failure names the case by this text, the pixel and both values. */
static inline __attribute__((format(printf, 3, 4))) void
assert_same_picture(const CtsPicture *expected, const CtsPicture *actual, const char *format, ...)
{
    char what[300];
    va_list args;
    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    const size_t n = (size_t)expected->width * (size_t)expected->height;
    if (expected->width != actual->width || expected->height != actual->height ||
        expected->n_channels != actual->n_channels)
        fail_msg("%s: expected %d x %d pixels of %d channels, actual %d x %d of %d", what, expected->width,
                 expected->height, expected->n_channels, actual->width, actual->height, actual->n_channels);
    if (!expected->bound != !actual->bound || !expected->depth_mm != !actual->depth_mm)
        fail_msg("%s: expected %s bound and %s depth, actual %s and %s", what, expected->bound ? "a" : "no",
                 expected->depth_mm ? "a" : "no", actual->bound ? "a" : "no", actual->depth_mm ? "a" : "no");
    assert_same_plane(expected->pixels, actual->pixels, expected->width, n * (size_t)expected->n_channels,
                      expected->n_channels, "colour", what);
    if (expected->bound)
        assert_same_plane(expected->bound, actual->bound, expected->width, n, 1, "bound", what);
    if (expected->depth_mm)
        assert_same_plane(expected->depth_mm, actual->depth_mm, expected->width, n, 1, "depth", what);
}

static inline CtsRenderSettings settings_for(CtsEngineId engine, int size, double azimuth_deg, double elevation_deg)
{
    CtsRenderSettings s;
    cts_render_defaults(&s);
    s.engine = engine;
    s.width = s.height = size;
    s.azimuth_deg = azimuth_deg;
    s.elevation_deg = elevation_deg;
    s.n_threads = 1;
    return s;
}

/* Makes the picture so large that errors are controlled in two strips, of 512 rows and the rest; it shows the same. */
static inline void enlarge_to_two_strips(CtsRenderSettings *s)
{
    enum { HEIGHT = 600 };
    s->mm_per_pixel *= (double)s->height / HEIGHT;
    s->width = 2048;
    s->height = HEIGHT;
}
