/* Slicer's volume properties as text: the nine lines of a .vp file, which are also the attributes of a VolumeProperty
 * element in presets.xml or a scene. A function is a count and then so many numbers. */
#include "core/transfer/preset_read.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const cts_vtk_names[CTS_VTK_N] = {
    [CTS_VTK_INTERPOLATION] = "interpolation",
    [CTS_VTK_SHADE] = "shade",
    [CTS_VTK_DIFFUSE] = "diffuse",
    [CTS_VTK_AMBIENT] = "ambient",
    [CTS_VTK_SPECULAR] = "specular",
    [CTS_VTK_POWER] = "specularPower",
    [CTS_VTK_OPACITY] = "scalarOpacity",
    [CTS_VTK_GRADIENT] = "gradientOpacity",
    [CTS_VTK_COLOUR] = "colorTransfer",
    [CTS_VTK_RANGE] = "effectiveRange",
};

/* The next number of *text, between blanks; false at the end or at anything else. */
static bool next_number(const char **text, double *value)
{
    *text += strspn(*text, " \t\r");
    const size_t n = strcspn(*text, " \t\r");
    if (!n || strspn(*text, "0123456789+-.eE") < n)
        return false;
    char *end;
    *value = strtod(*text, &end);
    const bool whole = end == *text + n && isfinite(*value);
    *text = end;
    return whole;
}

static bool at_end(const char *text)
{
    return !text[strspn(text, " \t\r")];
}

/* A single number; an absent or empty one keeps the present value. */
static CtsStatus read_value(const char *name, const CtsVtkText values[], int which, double low, double high,
                            double *value, CtsError *err)
{
    const char *text = values[which].text;
    double x;
    if (!text || at_end(text))
        return CTS_OK;
    if (!next_number(&text, &x) || !at_end(text) || x < low || x > high)
        return cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s is not a number from %g to %g", name, values[which].line,
                        cts_vtk_names[which], low, high);
    *value = x;
    return CTS_OK;
}

/* The points of a function, n_values numbers each, the first of them the HU. *n is 0 when it is not given. */
static CtsStatus read_vtk_function(const char *name, const CtsVtkText values[], int which, int n_values,
                                   double (*points)[4], int *n, CtsError *err)
{
    const char *text = values[which].text, *what = cts_vtk_names[which];
    const int line = values[which].line;
    double count;
    *n = 0;
    if (!text || at_end(text))
        return CTS_OK;
    if (!next_number(&text, &count) || count < n_values || count > CTS_MAX_POINTS * n_values ||
        fmod(count, n_values) != 0)
        return cts_fail(
            err, CTS_ERR_PRESET,
            "%s: line %d: %s does not begin with the count of its numbers, %d for each of at most %d points", name,
            line, what, n_values, CTS_MAX_POINTS);
    for (int i = 0; i < (int)count; i++) {
        double *x = &points[i / n_values][i % n_values];
        const bool is_hu = i % n_values == 0;
        if (!next_number(&text, x))
            return cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s has %d numbers where it says %.0f", name, line, what,
                            i, count);
        if (is_hu ? fabs(*x) > CTS_PRESET_MAX_HU : *x < 0 || *x > 1)
            return cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s has the value %.10g (%s)", name, line, what, *x,
                            is_hu ? "at most a million" : "0 to 1");
        if (is_hu && i && *x < points[i / n_values - 1][0])
            return cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s falls from %.10g to %.10g (points go upwards)", name,
                            line, what, points[i / n_values - 1][0], *x);
    }
    if (!at_end(text))
        return cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s has more numbers than the %.0f it says", name, line, what,
                        count);
    *n = (int)count / n_values;
    return CTS_OK;
}

static CtsStatus read_functions(const char *name, const CtsVtkText values[], CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    double points[CTS_MAX_POINTS][4];
    int n;
    if ((st = read_vtk_function(name, values, CTS_VTK_GRADIENT, 2, points, &n, err)))
        return st;
    bool varies = false;
    for (int i = 0; i < n; i++)
        varies |= points[i][1] != 1;
    if (varies)
        cts_preset_note(preset, "gradient opacity");

    if ((st = read_vtk_function(name, values, CTS_VTK_OPACITY, 2, points, &preset->n_opacity, err)))
        return st;
    for (int i = 0; i < preset->n_opacity; i++)
        preset->opacity[i] = (CtsOpacityPoint){points[i][0], points[i][1]};

    if ((st = read_vtk_function(name, values, CTS_VTK_COLOUR, 4, points, &preset->n_colour, err)))
        return st;
    for (int i = 0; i < preset->n_colour; i++)
        preset->colour[i] = (CtsColourPoint){points[i][0], {points[i][1], points[i][2], points[i][3]}};

    const int missing = !preset->n_opacity ? CTS_VTK_OPACITY : CTS_VTK_COLOUR;
    if (!preset->n_opacity || !preset->n_colour)
        return cts_fail(err, CTS_ERR_PRESET, "%s: line %d: %s is missing or empty", name, values[missing].line,
                        cts_vtk_names[missing]);
    return CTS_OK;
}

CtsStatus cts_preset_from_vtk(const char *name, const CtsVtkText values[CTS_VTK_N], CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    double interpolation = 1, shade = 0;
    cts_preset_init(preset);
    if ((st = read_value(name, values, CTS_VTK_INTERPOLATION, 0, 2, &interpolation, err)) ||
        (st = read_value(name, values, CTS_VTK_SHADE, 0, 1, &shade, err)) ||
        (st = read_value(name, values, CTS_VTK_DIFFUSE, 0, CTS_PRESET_MAX_LIGHT, &preset->diffuse, err)) ||
        (st = read_value(name, values, CTS_VTK_AMBIENT, 0, CTS_PRESET_MAX_LIGHT, &preset->ambient, err)) ||
        (st = read_value(name, values, CTS_VTK_SPECULAR, 0, CTS_PRESET_MAX_LIGHT, &preset->specular, err)) ||
        (st = read_value(name, values, CTS_VTK_POWER, 0, CTS_PRESET_MAX_POWER, &preset->power, err)) ||
        (st = read_functions(name, values, preset, err)))
        return st;
    preset->shade = shade != 0;
    if (interpolation != 1)
        cts_preset_note(preset, "its interpolation");

    /* effectiveRange is Slicer's suggested window and malformed in some published presets. */
    cts_preset_default_window(preset);
    const char *range = values[CTS_VTK_RANGE].text;
    double low, high;
    if (range && next_number(&range, &low) && next_number(&range, &high) && at_end(range))
        cts_preset_hint_window(preset, low, high);
    return CTS_OK;
}

CtsStatus cts_preset_from_vp(const char *text, size_t size, const char *name, CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    CtsVtkText values[CTS_VTK_N] = {0};
    char *copy = memchr(text, 0, size) ? NULL : strndup(text, size), *line = copy;
    if (!copy)
        return cts_fail(err, CTS_ERR_PRESET, "%s: not a preset: a byte 0 in its text", name);
    int n = 0;
    for (; line && n < CTS_VTK_N_LINES; n++) {
        values[n].text = strsep(&line, "\n");
        values[n].line = n + 1;
    }
    for (int i = n; i < CTS_VTK_N_LINES; i++)
        values[i].line = n;
    if (line && line[strspn(line, " \t\r\n")])
        st = cts_fail(err, CTS_ERR_PRESET, "%s: line %d: text after the nine lines of a .vp file", name,
                      CTS_VTK_N_LINES + 1);
    else
        st = cts_preset_from_vtk(name, values, preset, err);
    free(copy);
    return st;
}
