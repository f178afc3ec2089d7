/* ctsplat's own preset file, read and written. */
#include "core/transfer/preset_read.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void cts_preset_init(CtsPreset *preset)
{
    *preset = (CtsPreset){.unit_distance_mm = 1,
                          .ambient = 0.2,
                          .diffuse = 0.8,
                          .specular = 0.3,
                          .power = 20,
                          .mode = CTS_MODE_COMPOSITE};
}

void cts_preset_default_window(CtsPreset *preset)
{
    double low = fmin(preset->opacity[0].hu, preset->colour[0].hu);
    double high = fmax(preset->opacity[preset->n_opacity - 1].hu, preset->colour[preset->n_colour - 1].hu);
    /* Points at a single HU have no range; half a HU on each side makes the step they mean. */
    if (!(high > low)) {
        low -= 0.5;
        high += 0.5;
    }
    preset->window_low_hu = low;
    preset->window_high_hu = high;
}

bool cts_preset_set_name(CtsPreset *preset, const char *text)
{
    const size_t n = strlen(text);
    if (n < 1 || n >= sizeof preset->name)
        return false;
    for (size_t i = 0; i < n; i++)
        if ((unsigned char)text[i] < 0x20 || text[i] == 0x7f || text[i] == '/')
            return false;
    memcpy(preset->name, text, n + 1);
    return true;
}

void cts_preset_note(CtsPreset *preset, const char *text)
{
    const size_t room = sizeof preset->note - strlen(preset->note);
    if (preset->note[0] && room > 3)
        strcat(preset->note, ", ");
    strncat(preset->note, text, sizeof preset->note - strlen(preset->note) - 1);
}

static CtsStatus read_hu(const CtsJsonAt *point, double previous_hu, double *hu, CtsError *err)
{
    CtsStatus st;
    CtsJsonAt at;
    if (!cts_json_member(point, "hu", &at))
        return cts_json_fail(point, err, "%s %zu has no hu", point->parent->key, point->index + 1);
    if ((st = cts_json_number(&at, -CTS_PRESET_MAX_HU, CTS_PRESET_MAX_HU, hu, err)))
        return st;
    if (*hu < previous_hu)
        return cts_json_fail(&at, err, "hu falls from %.10g to %.10g (points go upwards)", previous_hu, *hu);
    return CTS_OK;
}

static CtsStatus read_rgb(const CtsJsonAt *at, double rgb[3], CtsError *err)
{
    CtsStatus st = cts_json_check_array(at, 3, 3, err);
    for (size_t c = 0; c < 3 && !st; c++) {
        const CtsJsonAt element = cts_json_element(at, c);
        st = cts_json_number(&element, 0, 1, &rgb[c], err);
    }
    return st;
}

static CtsStatus read_colour(const CtsJsonAt *point, double hu, CtsPreset *preset, CtsError *err)
{
    CtsJsonAt at;
    if (!cts_json_member(point, "rgb", &at))
        return cts_json_fail(point, err, "%s %zu has no rgb", point->parent->key, point->index + 1);
    CtsColourPoint *colour = &preset->colour[preset->n_colour++];
    colour->hu = hu;
    return read_rgb(&at, colour->rgb, err);
}

static CtsStatus read_points(const CtsJsonAt *points, bool with_colour, CtsPreset *preset, CtsError *err)
{
    static const char *const keys[] = {"hu", "opacity", "rgb"};
    CtsStatus st = cts_json_check_array(points, 1, CTS_MAX_POINTS, err);
    for (size_t i = 0; !st && i < json_array_size(points->value); i++) {
        const CtsJsonAt point = cts_json_element(points, i);
        CtsJsonAt opacity;
        CtsOpacityPoint *p = &preset->opacity[i];
        if ((st = cts_json_check_keys(&point, keys, with_colour ? 3 : 2, err)) ||
            (st = read_hu(&point, i ? p[-1].hu : -INFINITY, &p->hu, err)))
            return st;
        if (!cts_json_member(&point, "opacity", &opacity))
            return cts_json_fail(&point, err, "points %zu has no opacity", i + 1);
        st = cts_json_number(&opacity, 0, 1, &p->opacity, err);
        if (!st && with_colour)
            st = read_colour(&point, p->hu, preset, err);
        preset->n_opacity++;
    }
    return st;
}

static CtsStatus read_colour_points(const CtsJsonAt *points, CtsPreset *preset, CtsError *err)
{
    static const char *const keys[] = {"hu", "rgb"};
    CtsStatus st = cts_json_check_array(points, 1, CTS_MAX_POINTS, err);
    for (size_t i = 0; !st && i < json_array_size(points->value); i++) {
        const CtsJsonAt point = cts_json_element(points, i);
        double hu;
        if (!(st = cts_json_check_keys(&point, keys, 2, err)) &&
            !(st = read_hu(&point, i ? preset->colour[i - 1].hu : -INFINITY, &hu, err)))
            st = read_colour(&point, hu, preset, err);
    }
    return st;
}

static CtsStatus read_window(const CtsJsonAt *at, CtsPreset *preset, CtsError *err)
{
    CtsStatus st;
    const CtsJsonAt low = cts_json_element(at, 0), high = cts_json_element(at, 1);
    if ((st = cts_json_check_array(at, 2, 2, err)) ||
        (st = cts_json_number(&low, -CTS_PRESET_MAX_HU, CTS_PRESET_MAX_HU, &preset->window_low_hu, err)) ||
        (st = cts_json_number(&high, -CTS_PRESET_MAX_HU, CTS_PRESET_MAX_HU, &preset->window_high_hu, err)))
        return st;
    if (!(preset->window_high_hu > preset->window_low_hu))
        return cts_json_fail(&high, err, "window goes from %.10g to %.10g (the larger value comes second)",
                             preset->window_low_hu, preset->window_high_hu);
    return CTS_OK;
}

static CtsStatus read_shade(const CtsJsonAt *at, CtsPreset *preset, CtsError *err)
{
    static const char *const keys[] = {"ambient", "diffuse", "specular", "power"};
    double *const values[] = {&preset->ambient, &preset->diffuse, &preset->specular, &preset->power};
    const double highest[] = {CTS_PRESET_MAX_LIGHT, CTS_PRESET_MAX_LIGHT, CTS_PRESET_MAX_LIGHT, CTS_PRESET_MAX_POWER};
    if (json_is_null(at->value))
        return CTS_OK;
    if (!json_is_object(at->value))
        return cts_json_fail(at, err, "shade is neither an object { } nor null");
    CtsStatus st = cts_json_check_keys(at, keys, 4, err);
    for (int i = 0; i < 4 && !st; i++) {
        CtsJsonAt member;
        if (cts_json_member(at, keys[i], &member))
            st = cts_json_number(&member, 0, highest[i], values[i], err);
    }
    preset->shade = true;
    return st;
}

static CtsStatus read_mode(const CtsJsonAt *at, CtsPreset *preset, CtsError *err)
{
    const char *name;
    const CtsStatus st = cts_json_string(at, &name, err);
    if (st)
        return st;
    for (int m = 0; m < CTS_N_MODES; m++)
        if (!strcmp(name, cts_mode_names[m])) {
            preset->mode = (CtsMode)m;
            return CTS_OK;
        }
    return cts_json_fail(at, err, "mode \"%.40s\" is not one of: composite mip minip average", name);
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
    if (strlen(text) != 7 || text[0] != '#' || text[1 + strspn(text + 1, "0123456789abcdefABCDEF")])
        return cts_json_fail(at, err, "background \"%.40s\" is neither \"#RRGGBB\" nor \"none\"", text);
    const unsigned long rgb = strtoul(text + 1, NULL, 16);
    for (int c = 0; c < 3; c++)
        preset->background[c] = (double)(rgb >> (16 - 8 * c) & 255) / 255;
    return CTS_OK;
}

static CtsStatus read_preset(const CtsJsonAt *root, CtsPreset *preset, CtsError *err)
{
    static const char *const keys[] = {
        "name", "window", "points", "colour_points", "mode", "unit_distance_mm", "shade", "background", "remove_table"};
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

    const bool own_colours = cts_json_member(root, "colour_points", &colour_points);
    if (!cts_json_member(root, "points", &at))
        return cts_json_fail(root, err, "points is missing");
    if ((st = read_points(&at, !own_colours, preset, err)) ||
        (own_colours && (st = read_colour_points(&colour_points, preset, err))))
        return st;
    cts_preset_default_window(preset);

    if ((cts_json_member(root, "window", &at) && (st = read_window(&at, preset, err))) ||
        (cts_json_member(root, "mode", &at) && (st = read_mode(&at, preset, err))) ||
        (cts_json_member(root, "unit_distance_mm", &at) &&
         (st = cts_json_number(&at, CTS_PRESET_MIN_UNIT_MM, CTS_PRESET_MAX_UNIT_MM, &preset->unit_distance_mm, err))) ||
        (cts_json_member(root, "shade", &at) && (st = read_shade(&at, preset, err))) ||
        (cts_json_member(root, "background", &at) && (st = read_background(&at, preset, err))) ||
        (cts_json_member(root, "remove_table", &at) && (st = cts_json_bool(&at, &preset->remove_table, err))))
        return st;
    return CTS_OK;
}

/* What `ctsplat presets --json` prints: a list under the one key "presets", from which `which` takes one. */
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
    json_t *list = json_array();
    for (int c = 0; c < 3; c++)
        json_array_append_new(list, cts_json_new_number(rgb[c]));
    return list;
}

static bool same_places(const CtsPreset *preset)
{
    bool same = preset->n_opacity == preset->n_colour;
    for (int i = 0; same && i < preset->n_opacity; i++)
        same = preset->opacity[i].hu == preset->colour[i].hu;
    return same;
}

char *cts_preset_to_json(const CtsPreset *preset)
{
    json_t *root = json_object(), *points = json_array();
    const bool together = same_places(preset);
    json_object_set_new(root, "name", json_string(preset->name));
    json_object_set_new(
        root, "window",
        json_pack("[o,o]", cts_json_new_number(preset->window_low_hu), cts_json_new_number(preset->window_high_hu)));
    json_object_set_new(root, "points", points);
    for (int i = 0; i < preset->n_opacity; i++) {
        json_t *point = json_object();
        json_object_set_new(point, "hu", cts_json_new_number(preset->opacity[i].hu));
        if (together)
            json_object_set_new(point, "rgb", rgb_to_json(preset->colour[i].rgb));
        json_object_set_new(point, "opacity", cts_json_new_number(preset->opacity[i].opacity));
        json_array_append_new(points, point);
    }
    if (!together) {
        json_t *colours = json_array();
        json_object_set_new(root, "colour_points", colours);
        for (int i = 0; i < preset->n_colour; i++)
            json_array_append_new(colours, json_pack("{s:o,s:o}", "hu", cts_json_new_number(preset->colour[i].hu),
                                                     "rgb", rgb_to_json(preset->colour[i].rgb)));
    }
    json_object_set_new(root, "mode", json_string(cts_mode_names[preset->mode]));
    json_object_set_new(root, "unit_distance_mm", cts_json_new_number(preset->unit_distance_mm));
    json_object_set_new(root, "shade",
                        !preset->shade ? json_null()
                                       : json_pack("{s:o,s:o,s:o,s:o}", "ambient", cts_json_new_number(preset->ambient),
                                                   "diffuse", cts_json_new_number(preset->diffuse), "specular",
                                                   cts_json_new_number(preset->specular), "power",
                                                   cts_json_new_number(preset->power)));
    json_object_set_new(root, "background",
                        preset->background_none
                            ? json_string("none")
                            : json_sprintf("#%02x%02x%02x", (unsigned)lround(preset->background[0] * 255),
                                           (unsigned)lround(preset->background[1] * 255),
                                           (unsigned)lround(preset->background[2] * 255)));
    json_object_set_new(root, "remove_table", json_boolean(preset->remove_table));
    /* 15 digits read well, and nearly always say it all. */
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
