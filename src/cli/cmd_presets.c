/* ctsplat presets: the list of them, or one in full. */
#include "cli/commands.h"
#include "cli/terminal.h"
#include "output/report/text_table.h"
#include <stdio.h>
#include <stdlib.h>

static CtsStatus append_preset(json_t *list, const CtsPreset *preset, CtsError *err)
{
    char *text = cts_preset_to_json(preset);
    json_t *object = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    if (!object || json_array_append_new(list, object))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return CTS_OK;
}

/* Into a table or a JSON list, whichever is there. */
static CtsStatus add_preset(CtsTable *table, json_t *list, const CtsPreset *p, bool own, CtsError *err)
{
    if (list)
        return append_preset(list, p, err);
    cts_table_row(table, "%s\t%s\t%s\t%s\t%g\t%g\t%s\t%s\t%s", p->name, cts_mode_names[p->mode],
                  p->modality == CTS_ANY_MODALITY ? "" : cts_modality_names[p->modality], cts_scale_names[p->scale],
                  p->window_low_hu, p->window_high_hu, p->shade ? "lit" : "unlit", p->remove_table ? "removed" : "kept",
                  own ? "yours" : "built in");
    return CTS_OK;
}

/* All presets. One of the user's that is broken, or that a built-in one hides, is a warning: the others can be used. */
static CtsStatus list_all(json_t *list, CtsError *err)
{
    CtsTable *table = list ? NULL : cts_table_new("preset\tmode\tfor\tscale\t>black\t>white\tlight\ttable\t");
    CtsStatus st = CTS_OK;
    const CtsPreset *preset;
    for (size_t i = 0; (preset = cts_preset_builtin(i)) && !st; i++)
        st = add_preset(table, list, preset, false, err);
    char **names = cts_preset_user_names();
    for (size_t i = 0; names && names[i] && !st; i++) {
        CtsPreset own;
        CtsError why;
        if (cts_preset_number(names[i])) {
            cli_warning("your preset %s.json: a built-in preset has its name and comes first (give the file another "
                        "name, or its path)",
                        names[i]);
            continue;
        }
        if (cts_preset_load(names[i], &own, &why)) {
            cli_warning("%s", why.text);
            continue;
        }
        snprintf(own.name, sizeof own.name, "%s", names[i]);
        st = add_preset(table, list, &own, true, err);
    }
    free(names);
    cts_table_print(table, stdout);
    cts_table_free(&table);
    return st;
}

static void print_one(const CtsPreset *p)
{
    printf("%s: %s, window %g to %g, opacity per %g mm", p->name, cts_mode_names[p->mode], p->window_low_hu,
           p->window_high_hu, p->unit_distance_mm);
    if (p->shade)
        printf(", lit (ambient %g, diffuse %g, specular %g, power %g, occlusion %g)", p->ambient, p->diffuse,
               p->specular, p->power, p->occlusion);
    else
        printf(", unlit");
    printf(", table %s, scale %s", p->remove_table ? "removed" : "kept", cts_scale_names[p->scale]);
    if (p->modality != CTS_ANY_MODALITY)
        printf(", for %s", cts_modality_names[p->modality]);
    printf("\n\n");
    char line[400], headings[64];
    const char *const advice = cts_preset_advice(p->name);
    if (advice)
        printf("%s\n\n", cli_with_options(advice, line, sizeof line));
    snprintf(headings, sizeof headings, ">%s\t>opacity", cts_scale_names[p->scale]);
    CtsTable *opacity = cts_table_new(headings);
    for (int i = 0; i < p->n_opacity; i++)
        cts_table_row(opacity, "%.10g\t%.6g", p->opacity[i].hu, p->opacity[i].opacity);
    cts_table_print(opacity, stdout);
    cts_table_free(&opacity);
    putchar('\n');
    snprintf(headings, sizeof headings, ">%s\t>red\t>green\t>blue", cts_scale_names[p->scale]);
    CtsTable *colour = cts_table_new(headings);
    for (int i = 0; i < p->n_colour; i++)
        cts_table_row(colour, "%.10g\t%.6g\t%.6g\t%.6g", p->colour[i].hu, p->colour[i].rgb[0], p->colour[i].rgb[1],
                      p->colour[i].rgb[2]);
    cts_table_print(colour, stdout);
    cts_table_free(&colour);
}

static CtsStatus show_one(const char *name, json_t *list, CtsError *err)
{
    CtsPreset preset;
    const CtsStatus st = cts_preset_load(name, &preset, err);
    if (st)
        return st;
    if (preset.note[0])
        cli_warning("preset %s: left out: %s", preset.name, preset.note);
    if (list)
        return append_preset(list, &preset, err);
    print_one(&preset);
    return CTS_OK;
}

CtsStatus cli_presets(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    json_t *const list = options->json ? json_array() : NULL;
    CtsStatus st = options->paths.n ? show_one(options->paths.items[0], list, err) : list_all(list, err);
    if (options->json && !st)
        st = cli_print_json(json_pack("{s:O}", "presets", list), err);
    json_decref(list);
    return st;
}
