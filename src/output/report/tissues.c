#include "output/report/tissues.h"

#include "output/report/text_table.h"
#include <jansson.h>
#include <math.h>
#include <stdlib.h>

/* A pure tissue, or what mixes it with the next, as one normal distribution: mean and standard deviation. */
typedef struct Row {
    char name[64];
    double weight, mean_hu, sd_hu;
    bool mixed;
    int tissue;
} Row;

static int rows_of(const CtsMixture *m, Row rows[2 * CTS_MAX_TISSUES])
{
    int n = 0;
    for (int i = 0; i < m->n; i++) {
        const CtsTissue *t = &m->tissue[i];
        Row *pure = &rows[n++];
        *pure = (Row){.weight = t->weight, .mean_hu = t->mean_hu, .sd_hu = t->sd_hu, .tissue = i};
        snprintf(pure->name, sizeof pure->name, "%s", t->name);
        if (!(t->mixed_weight > 0))
            continue;
        Row *mixed = &rows[n++];
        const double apart = t[1].mean_hu - t->mean_hu, noise = fmin(t->sd_hu, t[1].sd_hu);
        *mixed = (Row){.weight = t->mixed_weight,
                       .mean_hu = t->mean_hu + apart / 2,
                       .sd_hu = sqrt(apart * apart / 12 + noise * noise),
                       .mixed = true,
                       .tissue = i};
        snprintf(mixed->name, sizeof mixed->name, "%s/%s", t->name, t[1].name);
    }
    return n;
}

static double share(uint64_t part, uint64_t all)
{
    return all > 0 ? (double)part / (double)all : 0;
}

void cts_mixture_print(FILE *file, const CtsMixture *mixture, const CtsVoidKey *key, const char *preset_name)
{
    Row rows[2 * CTS_MAX_TISSUES];
    char text[CTS_KEY_TEXT];
    const int n = rows_of(mixture, rows);
    fprintf(file, "%llu voxels of %d grey levels, %d rounds%s\n\n", (unsigned long long)mixture->n_voxels,
            mixture->n_levels, mixture->n_rounds, mixture->converged ? "" : " (not converged)");
    CtsTable *table = cts_table_new((const char *const[]){"class", ">weight", ">mean HU", ">sd HU", "preset"}, 5);
    for (int i = 0; i < n; i++) {
        cts_table_cell(table, "%s", rows[i].name);
        cts_table_cell(table, "%.4f %%", 100 * rows[i].weight);
        cts_table_cell(table, "%.1f", rows[i].mean_hu);
        cts_table_cell(table, "%.1f", rows[i].sd_hu);
        cts_table_cell(table, "%s", rows[i].mixed ? "by its share" : key->is_void[rows[i].tissue] ? "void" : "shows");
    }
    cts_table_print(table, file);
    cts_table_free(&table);
    cts_void_key_text(key, text);
    if (key->useful)
        fprintf(file, "\nvoid key of preset %s: probability %.2f, that is %s\n", preset_name, key->probability, text);
    else
        fprintf(file, "\nvoid key of preset %s: none\n", preset_name);
    if (!key->useful)
        fprintf(file, "%s\n",
                mixture->n > 0 && key->is_void[0] ? "the preset shows none of these tissues"
                                                  : "the preset shows every one of these tissues");
    else
        fprintf(file,
                "it takes %.4g %% of the voxels that would show something for void, and with them %.4g %% of the "
                "opacity\n",
                100 * share(key->dropped, key->visible), 100 * key->opacity_dropped);
}

/* An open end has no number. */
static json_t *hu_or_null(double hu)
{
    return isfinite(hu) ? json_real(hu) : json_null();
}

static json_t *new_classes(const CtsMixture *mixture, const CtsVoidKey *key)
{
    Row rows[2 * CTS_MAX_TISSUES];
    json_t *list = json_array();
    const int n = rows_of(mixture, rows);
    for (int i = 0; i < n; i++)
        json_array_append_new(
            list, json_pack("{s:s,s:f,s:f,s:f,s:b,s:o}", "class", rows[i].name, "weight", rows[i].weight, "mean_hu",
                            rows[i].mean_hu, "sd_hu", rows[i].sd_hu, "mixed", rows[i].mixed, "void",
                            rows[i].mixed ? json_null() : json_boolean(key->is_void[rows[i].tissue])));
    return list;
}

static json_t *new_key(const CtsVoidKey *key)
{
    json_t *ranges = json_array();
    for (int i = 0; i < key->n_ranges; i++)
        json_array_append_new(
            ranges, json_pack("[o,o]", hu_or_null(key->range[i].from_hu), hu_or_null(key->range[i].below_hu)));
    return json_pack("{s:b,s:o,s:o,s:I,s:I,s:I,s:f}", "useful", key->useful, "probability",
                     key->useful ? json_real(key->probability) : json_null(), "void_hu", ranges, "voxels",
                     (json_int_t)key->total, "visible", (json_int_t)key->visible, "dropped", (json_int_t)key->dropped,
                     "opacity_dropped", key->opacity_dropped);
}

CtsStatus cts_mixture_print_json(FILE *file, const CtsMixture *mixture, const CtsVoidKey *key, const char *preset_name,
                                 CtsError *err)
{
    json_t *value =
        json_pack("{s:s,s:o,s:o}", "preset", preset_name, "mixture", new_classes(mixture, key), "key", new_key(key));
    char *text = value ? json_dumps(value, JSON_INDENT(2) | JSON_REAL_PRECISION(15)) : NULL;
    json_decref(value);
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    fprintf(file, "%s\n", text);
    free(text);
    return CTS_OK;
}
