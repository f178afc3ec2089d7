/* ctsplat's own preset file, read and written. */
#include "core/transfer/preset_read.h"

#include "base/text.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The key of a point's value. */
static const char *place_key(const CtsPreset *preset)
{
    return preset->scale == CTS_SCALE_HU ? "hu" : "at";
}

static CtsStatus read_points(const CtsJsonAt *points, bool opacity, bool colour, CtsPreset *preset, CtsError *err)
{
    const char *const place = place_key(preset);
    const char *const keys[] = {place, "opacity", "rgb"}, *const colour_keys[] = {place, "rgb"};
    CtsStatus st = cts_json_check_array(points, 1, CTS_MAX_POINTS, err);
    for (size_t i = 0; !st && i < json_array_size(points->value); i++) {
        const CtsJsonAt point = cts_json_element(points, i);
        st = cts_json_check_keys(&point, opacity ? keys : colour_keys, opacity && colour ? 3 : 2, err);
        if (!st && opacity)
            st = cts_preset_read_opacity(&point, place, "opacity", preset, err);
        if (!st && colour)
            st = cts_preset_read_colour(&point, place, "rgb", preset, err);
    }
    return st;
}

static CtsStatus read_window(const CtsJsonAt *at, CtsPreset *preset, CtsError *err)
{
    double ends[2];
    const double most = cts_preset_max_value(preset);
    const CtsStatus st = cts_json_numbers(at, 2, -most, most, ends, err);
    if (st)
        return st;
    preset->window_low_hu = ends[0];
    preset->window_high_hu = ends[1];
    const CtsJsonAt high = cts_json_element(at, 1);
    return ends[1] != ends[0] ? CTS_OK
                              : cts_json_fail(&high, err, "window goes from %.10g to %.10g (two values that differ)",
                                              ends[0], ends[1]);
}

static CtsStatus read_shade(const CtsJsonAt *at, CtsPreset *preset, CtsError *err)
{
    static const char *const keys[] = {"ambient", "diffuse", "specular", "power", "occlusion"};
    CtsJsonAt occlusion;
    if (json_is_null(at->value))
        return CTS_OK;
    if (!json_is_object(at->value))
        return cts_json_fail(at, err, "shade is neither an object { } nor null");
    preset->shade = true;
    CtsStatus st = cts_json_check_keys(at, keys, sizeof keys / sizeof *keys, err);
    if (!st && cts_json_member(at, "occlusion", &occlusion))
        st = cts_json_number(&occlusion, 0, 1, &preset->occlusion, err);
    return st ? st : cts_preset_read_light(at, "power", preset, err);
}

/* The member of this key, one of n names, as its index; *index is unchanged without the member. */
static CtsStatus read_name(const CtsJsonAt *root, const char *key, const char *const *names, int n, int *index,
                           CtsError *err)
{
    CtsJsonAt at;
    const char *name;
    char list[80] = "";
    if (!cts_json_member(root, key, &at))
        return CTS_OK;
    const CtsStatus st = cts_json_string(&at, &name, err);
    for (int i = 0; i < n && !st; i++) {
        if (!strcmp(name, names[i])) {
            *index = i;
            return CTS_OK;
        }
        strcat(strcat(list, " "), names[i]);
    }
    return st ? st : cts_json_fail(&at, err, "%s \"%.40s\" is not one of:%s", key, name, list);
}

static CtsStatus read_names(const CtsJsonAt *root, CtsPreset *preset, CtsError *err)
{
    int scale = CTS_SCALE_HU, mode = CTS_MODE_COMPOSITE;
    CtsStatus st = read_name(root, "scale", cts_scale_names, CTS_N_SCALES, &scale, err);
    if (!st && !(st = read_name(root, "modality", cts_modality_names, CTS_N_MODALITIES, &preset->modality, err)))
        st = read_name(root, "mode", cts_mode_names, CTS_N_MODES, &mode, err);
    preset->scale = (CtsScale)scale;
    preset->mode = (CtsMode)mode;
    return st;
}

static CtsStatus read_background(const CtsJsonAt *at, CtsPreset *preset, CtsError *err)
{
    const char *text;
    const CtsStatus st = cts_json_string(at, &text, err);
    if (st)
        return st;
    preset->background_none = !strcmp(text, "none");
    if (preset->background_none)
        return CTS_OK;
    return cts_text_rgb(text, preset->background) && !text[7]
               ? CTS_OK
               : cts_json_fail(at, err, "background \"%.40s\" is neither \"#RRGGBB\" nor \"none\"", text);
}

static CtsStatus read_preset(const CtsJsonAt *root, CtsPreset *preset, CtsError *err)
{
    static const char *const keys[] = {
        "name",  "window",     "points",       "colour_points", "mode",    "unit_distance_mm",
        "shade", "background", "remove_table", "scale",         "modality"};
    CtsStatus st;
    CtsJsonAt at, colour_points;
    const char *name;
    cts_preset_init(preset);
    if ((st = cts_json_check_keys(root, keys, sizeof keys / sizeof *keys, err)))
        return st;
    if (!cts_json_member(root, "name", &at))
        return cts_json_fail(root, err, "name is missing");
    if ((st = cts_json_string(&at, &name, err)))
        return st;
    if (!cts_preset_set_name(preset, name))
        return cts_json_fail(&at, err, "name is not 1 to 63 bytes without slashes and control characters");
    if ((st = read_names(root, preset, err)))
        return st;

    const bool own_colours = cts_json_member(root, "colour_points", &colour_points);
    if (!cts_json_member(root, "points", &at))
        return cts_json_fail(root, err, "points is missing");
    if ((st = read_points(&at, true, !own_colours, preset, err)) ||
        (own_colours && (st = read_points(&colour_points, false, true, preset, err))))
        return st;
    cts_preset_default_window(preset);

    if ((cts_json_member(root, "window", &at) && (st = read_window(&at, preset, err))) ||
        (cts_json_member(root, "unit_distance_mm", &at) &&
         (st = cts_json_number(&at, CTS_PRESET_MIN_UNIT_MM, CTS_PRESET_MAX_UNIT_MM, &preset->unit_distance_mm, err))) ||
        (cts_json_member(root, "shade", &at) && (st = read_shade(&at, preset, err))) ||
        (cts_json_member(root, "background", &at) && (st = read_background(&at, preset, err))) ||
        (cts_json_member(root, "remove_table", &at) && (st = cts_json_bool(&at, &preset->remove_table, err))))
        return st;
    return CTS_OK;
}

/* The output of `ctsplat presets --json`: a list under the only key "presets", from which `which` selects one. */
static CtsStatus choose_from_list(const CtsJsonAt *list, const char *which, CtsJsonAt *chosen, CtsError *err)
{
    const CtsStatus st = cts_json_check_array(list, 1, 1000, err);
    if (st)
        return st;
    const size_t n = json_array_size(list->value);
    for (size_t i = 0; i < n; i++) {
        *chosen = cts_json_element(list, i);
        const char *name = json_string_value(json_object_get(chosen->value, "name"));
        if (which ? name && !strcmp(name, which) : n == 1)
            return CTS_OK;
    }
    if (which)
        return cts_json_fail(list, err, "there is no preset %.60s", which);
    return cts_json_fail(list, err, "there are %zu presets (take one by adding #NAME)", n);
}

CtsStatus cts_preset_from_json(const CtsJson *json, const char *which, CtsPreset *preset, CtsError *err)
{
    const CtsJsonAt root = cts_json_root(json);
    CtsJsonAt list, chosen;
    if (cts_json_member(&root, "presets", &list) && json_object_size(root.value) == 1) {
        const CtsStatus st = choose_from_list(&list, which, &chosen, err);
        return st ? st : read_preset(&chosen, preset, err);
    }
    if (which)
        return cts_json_fail(&root, err, "one preset, not several to take %.60s from", which);
    return read_preset(&root, preset, err);
}

static json_t *rgb_to_json(const double rgb[3])
{
    return json_pack("[ooo]", cts_json_new_number(rgb[0]), cts_json_new_number(rgb[1]), cts_json_new_number(rgb[2]));
}

static bool same_places(const CtsPreset *preset)
{
    bool same = preset->n_opacity == preset->n_colour;
    for (int i = 0; same && i < preset->n_opacity; i++)
        same = preset->opacity[i].hu == preset->colour[i].hu;
    return same;
}

/* Points of opacity, of colour, or of both at the same places. */
static json_t *points_to_json(const CtsPreset *p, bool opacity, bool colour)
{
    json_t *points = json_array();
    for (int i = 0; i < (opacity ? p->n_opacity : p->n_colour); i++)
        json_array_append_new(points, json_pack("{s:o, s:o*, s:o*}", place_key(p),
                                                cts_json_new_number(opacity ? p->opacity[i].hu : p->colour[i].hu),
                                                "rgb", colour ? rgb_to_json(p->colour[i].rgb) : NULL, "opacity",
                                                opacity ? cts_json_new_number(p->opacity[i].opacity) : NULL));
    return points;
}

static json_t *light_to_json(const CtsPreset *p)
{
    return json_pack("{s:o,s:o,s:o,s:o,s:o*}", "ambient", cts_json_new_number(p->ambient), "diffuse",
                     cts_json_new_number(p->diffuse), "specular", cts_json_new_number(p->specular), "power",
                     cts_json_new_number(p->power), "occlusion",
                     p->occlusion > 0 ? cts_json_new_number(p->occlusion) : NULL);
}

char *cts_preset_to_json(const CtsPreset *p)
{
    const bool together = same_places(p);
    const double *const b = p->background;
    json_t *background = p->background_none ? json_string("none")
                                            : json_sprintf("#%02x%02x%02x", (unsigned)lround(b[0] * 255),
                                                           (unsigned)lround(b[1] * 255), (unsigned)lround(b[2] * 255));
    json_t *root = json_pack(
        "{s:s, s:s, s:s*, s:[oo], s:o, s:o*, s:s, s:o, s:o?, s:o, s:b}", "name", p->name, "scale",
        cts_scale_names[p->scale], "modality", p->modality == CTS_ANY_MODALITY ? NULL : cts_modality_names[p->modality],
        "window", cts_json_new_number(p->window_low_hu), cts_json_new_number(p->window_high_hu), "points",
        points_to_json(p, true, together), "colour_points", together ? NULL : points_to_json(p, false, true), "mode",
        cts_mode_names[p->mode], "unit_distance_mm", cts_json_new_number(p->unit_distance_mm), "shade",
        p->shade ? light_to_json(p) : NULL, "background", background, "remove_table", p->remove_table);
    if (p->window_absolute && p->scale == CTS_SCALE_RELATIVE)
        json_object_set_new(root, "window_absolute", json_true());
    /* 15 digits are readable and nearly always exact. */
    char *text = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(15));
    json_t *again = text ? json_loads(text, 0, NULL) : NULL;
    if (again && !json_equal(again, root)) {
        free(text);
        text = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
    }
    json_decref(again);
    json_decref(root);
    return text;
}
