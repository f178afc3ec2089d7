/* Slicer's volume property JSON (schema volume-property-schema-v1.0.0): one component of one property. Keys that do
 * not change a picture are passed over, as the schema allows any. */
#include "core/transfer/preset_read.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* VTK bends the segment between two points by the first one's midpoint and sharpness; ctsplat's segments are linear. */
static void note_bends(const CtsJsonAt *point, CtsPreset *preset)
{
    const json_t *midpoint = json_object_get(point->value, "midpoint"),
                 *sharpness = json_object_get(point->value, "sharpness");
    const bool bent =
        (midpoint && json_number_value(midpoint) != 0.5) || (sharpness && json_number_value(sharpness) != 0);
    if (bent && !strstr(preset->note, "midpoint"))
        cts_preset_note(preset, "midpoint and sharpness");
}

/* The points of a transfer function; *n is 0 when it is not there. */
static CtsStatus find_points(const CtsJsonAt *component, const char *key, CtsJsonAt *function, CtsJsonAt *points,
                             size_t *n, CtsError *err)
{
    *n = 0;
    if (!cts_json_member(component, key, function))
        return CTS_OK;
    CtsStatus st = cts_json_need(function, "points", points, err);
    if (!st)
        st = cts_json_check_array(points, 1, CTS_MAX_POINTS, err);
    *n = st ? 0 : json_array_size(points->value);
    return st;
}

/* One that has to be there, of opacity or of colour. */
static CtsStatus read_function(const CtsJsonAt *component, const char *key, bool colour, CtsPreset *preset,
                               CtsError *err)
{
    size_t n;
    CtsJsonAt function, points;
    CtsStatus st = find_points(component, key, &function, &points, &n, err);
    if (!st && !n)
        return cts_json_fail(component, err, "the component has no %s", key);
    for (size_t i = 0; i < n && !st; i++) {
        const CtsJsonAt point = cts_json_element(&points, i);
        st = colour ? cts_preset_read_colour(&point, "x", "color", preset, err)
                    : cts_preset_read_opacity(&point, "x", "y", preset, err);
        note_bends(&point, preset);
    }
    return st;
}

static CtsStatus read_lighting(const CtsJsonAt *component, CtsPreset *preset, CtsError *err)
{
    CtsStatus st = CTS_OK;
    CtsJsonAt at;
    /* The schema's defaults. */
    preset->ambient = 0.1;
    preset->diffuse = 0.7;
    preset->specular = 0.2;
    preset->power = 10;
    if (cts_json_member(component, "shade", &at))
        st = cts_json_bool(&at, &preset->shade, err);
    if (!st && cts_json_member(component, "lighting", &at))
        st = cts_preset_read_light(&at, "specularPower", preset, err);
    return st;
}

static CtsStatus read_component(const CtsJsonAt *component, CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    CtsJsonAt at, function;
    size_t n;
    if ((st = read_function(component, "scalarOpacity", false, preset, err)) ||
        (st = read_function(component, "rgbTransferFunction", true, preset, err)) ||
        (st = read_lighting(component, preset, err)))
        return st;
    if (cts_json_member(component, "scalarOpacityUnitDistance", &at) &&
        (st = cts_json_number(&at, CTS_PRESET_MIN_UNIT_MM, CTS_PRESET_MAX_UNIT_MM, &preset->unit_distance_mm, err)))
        return st;
    if (json_is_true(json_object_get(component->value, "disableGradientOpacity")))
        return CTS_OK;
    if ((st = find_points(component, "gradientOpacity", &function, &at, &n, err)))
        return st;
    for (size_t i = 0; i < n; i++)
        if (json_number_value(json_object_get(json_array_get(at.value, i), "y")) != 1) {
            cts_preset_note(preset, "gradient opacity");
            break;
        }
    return CTS_OK;
}

/* Slicer's file stem is the only name most properties have, so a number (from 1) chooses too. */
static bool is_chosen(const json_t *property, size_t index, size_t n, const char *which)
{
    if (!which)
        return n == 1;
    const char *name = json_string_value(json_object_get(property, "name"));
    char *end;
    const unsigned long number = strtoul(which, &end, 10);
    return (name && !strcasecmp(name, which)) || (*which && !*end && number == index + 1);
}

CtsStatus cts_preset_from_slicer_json(const CtsJson *json, const char *which, CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    const CtsJsonAt root = cts_json_root(json);
    CtsJsonAt properties, components, range;
    cts_json_member(&root, "volumeProperties", &properties);
    cts_preset_init(preset);
    if ((st = cts_json_check_array(&properties, 1, 1000, err)))
        return st;
    const size_t n = json_array_size(properties.value);
    size_t i = 0;
    while (i < n && !is_chosen(json_array_get(properties.value, i), i, n, which))
        i++;
    if (i == n && which)
        return cts_fail(err, CTS_ERR_PRESET, "%s: holds no preset %.60s (it has %zu: #1 to #%zu)", json->name, which, n,
                        n);
    if (i == n)
        return cts_fail(err, CTS_ERR_PRESET, "%s: holds %zu presets (take one by adding #1 to #%zu, or #NAME)",
                        json->name, n, n);

    const CtsJsonAt property = cts_json_element(&properties, i);
    if ((st = cts_json_need(&property, "components", &components, err)) ||
        (st = cts_json_check_array(&components, 1, 100, err)))
        return st;
    const CtsJsonAt component = cts_json_element(&components, 0);
    if ((st = read_component(&component, preset, err)))
        return st;
    if (json_array_size(components.value) > 1)
        cts_preset_note(preset, "components after the first");
    const char *interpolation = json_string_value(json_object_get(property.value, "interpolationType"));
    if (interpolation && strcmp(interpolation, "linear"))
        cts_preset_note(preset, "its interpolation");
    const char *name = json_string_value(json_object_get(property.value, "name"));
    if (name)
        cts_preset_set_name(preset, name);

    cts_preset_default_window(preset);
    if (cts_json_member(&property, "effectiveRange", &range))
        cts_preset_hint_window(preset, json_number_value(json_array_get(range.value, 0)),
                               json_number_value(json_array_get(range.value, 1)));
    return CTS_OK;
}
