/* Parts of a preset, as the readers of all formats set them. */
#include "core/transfer/preset_read.h"

#include "base/text.h"
#include <math.h>
#include <string.h>

void cts_preset_init(CtsPreset *preset)
{
    *preset = (CtsPreset){.modality = CTS_ANY_MODALITY,
                          .unit_distance_mm = 1,
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
    /* Points at a single value have no range; a half on each side makes the step they mean. */
    if (!(high > low)) {
        low -= 0.5;
        high += 0.5;
    }
    preset->window_low_hu = low;
    preset->window_high_hu = high;
}

void cts_preset_hint_window(CtsPreset *preset, double low_hu, double high_hu)
{
    const double most = cts_preset_max_value(preset);
    if (!(low_hu < high_hu && fabs(low_hu) <= most && fabs(high_hu) <= most))
        return;
    preset->window_low_hu = low_hu;
    preset->window_high_hu = high_hu;
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
    cts_text_append(preset->note, sizeof preset->note, ", ", "%s", text);
}

/* The HU of a point, not below the previous one's, and the member for its value. */
static CtsStatus read_point(const CtsJsonAt *point, const char *key, const char *value_key, double previous_hu,
                            double most, double *hu, CtsJsonAt *value, CtsError *err)
{
    CtsJsonAt at;
    CtsStatus st = cts_json_need(point, key, &at, err);
    if (!st)
        st = cts_json_number(&at, -most, most, hu, err);
    if (!st && *hu < previous_hu)
        st = cts_json_fail(&at, err, "%s falls from %.10g to %.10g (points go upwards)", key, previous_hu, *hu);
    return st ? st : cts_json_need(point, value_key, value, err);
}

CtsStatus cts_preset_read_opacity(const CtsJsonAt *point, const char *hu, const char *opacity, CtsPreset *preset,
                                  CtsError *err)
{
    CtsJsonAt at;
    CtsOpacityPoint *p = &preset->opacity[preset->n_opacity];
    CtsStatus st = read_point(point, hu, opacity, preset->n_opacity ? p[-1].hu : -INFINITY,
                              cts_preset_max_value(preset), &p->hu, &at, err);
    if (!st && !(st = cts_json_number(&at, 0, 1, &p->opacity, err)))
        preset->n_opacity++;
    return st;
}

CtsStatus cts_preset_read_colour(const CtsJsonAt *point, const char *hu, const char *rgb, CtsPreset *preset,
                                 CtsError *err)
{
    CtsJsonAt at;
    CtsColourPoint *p = &preset->colour[preset->n_colour];
    CtsStatus st = read_point(point, hu, rgb, preset->n_colour ? p[-1].hu : -INFINITY, cts_preset_max_value(preset),
                              &p->hu, &at, err);
    if (!st && !(st = cts_json_numbers(&at, 3, 0, 1, p->rgb, err)))
        preset->n_colour++;
    return st;
}

CtsStatus cts_preset_read_light(const CtsJsonAt *at, const char *power, CtsPreset *preset, CtsError *err)
{
    const char *const keys[] = {"ambient", "diffuse", "specular", power};
    double *const values[] = {&preset->ambient, &preset->diffuse, &preset->specular, &preset->power};
    CtsStatus st = CTS_OK;
    CtsJsonAt member;
    for (int i = 0; i < 4 && !st; i++)
        if (cts_json_member(at, keys[i], &member))
            st = cts_json_number(&member, 0, i < 3 ? CTS_PRESET_MAX_LIGHT : CTS_PRESET_MAX_POWER, values[i], err);
    return st;
}
