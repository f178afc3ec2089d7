/* Presets at any HU: straight lines between the points, the end values beyond them. */
#include "ctsplat/preset.h"

#include "base/enum_table.h"
#include "base/mutation.h"
#include <math.h>
#include <string.h>

CTS_ENUM_TABLE(char *const, cts_mode_names, CTS_N_MODES, [CTS_MODE_COMPOSITE] = "composite", [CTS_MODE_MIP] = "mip",
               [CTS_MODE_MINIP] = "minip", [CTS_MODE_AVERAGE] = "average");

/* Position of hu among the points: between lower and upper at fraction 0..1 (lower == upper outside them). The HU are
 * the first member of each point, stride bytes apart. Of two points at one HU the later one applies. */
typedef struct PointPlace {
    int lower, upper;
    double fraction;
} PointPlace;

static double point_hu(const void *points, size_t stride, int i)
{
    double hu;
    memcpy(&hu, (const char *)points + (size_t)i * stride, sizeof hu);
    return hu;
}

static PointPlace find_place(const void *points, size_t stride, int n, double hu)
{
    int low = 0, high = n; /* the number of points at or below hu lies in low..high */
    while (low < high) {
        const int middle = (low + high) / 2;
        const double at = point_hu(points, stride, middle);
        if (CTS_MUTATED(STEP_SIDE) ? at < hu : at <= hu)
            low = middle + 1;
        else
            high = middle;
    }
    if (low == 0)
        return (PointPlace){0, 0, 0};
    if (low == n)
        return (PointPlace){n - 1, n - 1, 0};
    const double a = point_hu(points, stride, low - 1), b = point_hu(points, stride, low);
    return (PointPlace){low - 1, low, (hu - a) / (b - a)};
}

static double interpolated(double a, double b, double fraction)
{
    return a + (b - a) * fraction;
}

double cts_preset_opacity(const CtsPreset *preset, double hu)
{
    if (preset->n_opacity < 1)
        return 0;
    const PointPlace p = find_place(preset->opacity, sizeof *preset->opacity, preset->n_opacity, hu);
    return interpolated(preset->opacity[p.lower].opacity, preset->opacity[p.upper].opacity, p.fraction);
}

double cts_preset_extinction_per_mm(const CtsPreset *preset, double hu)
{
    const double opacity =
        CTS_MUTATED(CAP) ? fmin(cts_preset_opacity(preset, hu), 0.999) : cts_preset_opacity(preset, hu);
    if (CTS_MUTATED(UNIT_DISTANCE))
        return -log1p(-fmin(opacity, 0.999999));
    if (opacity >= 1)
        return CTS_MAX_EXTINCTION_PER_MM;
    return fmin(-log1p(-opacity) / preset->unit_distance_mm, CTS_MAX_EXTINCTION_PER_MM);
}

void cts_preset_colour(const CtsPreset *preset, double hu, double rgb[3])
{
    if (preset->n_colour < 1) {
        rgb[0] = rgb[1] = rgb[2] = 1;
        return;
    }
    const PointPlace p = find_place(preset->colour, sizeof *preset->colour, preset->n_colour, hu);
    for (int c = 0; c < 3; c++)
        rgb[c] = interpolated(preset->colour[p.lower].rgb[c], preset->colour[p.upper].rgb[c], p.fraction);
}

static bool is_grey(const double rgb[3])
{
    return rgb[0] == rgb[1] && rgb[1] == rgb[2];
}

bool cts_preset_is_grey(const CtsPreset *preset, CtsMode mode)
{
    bool grey = preset->background_none || is_grey(preset->background);
    for (int i = 0; grey && i < preset->n_colour && mode == CTS_MODE_COMPOSITE; i++)
        grey = is_grey(preset->colour[i].rgb);
    return grey;
}
