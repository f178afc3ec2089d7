/* JSON documents for clients. */
#include "app/serve/server.h"

#include "base/json.h"
#include "dicom/header/slice.h"
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static char *dumped(json_t *json, size_t flags)
{
    char *const text = json ? json_dumps(json, flags) : NULL;
    json_decref(json);
    return text;
}

static json_t *labels_json(const CtsLabels *labels)
{
    json_t *const list = json_array();
    for (const CtsLabel *l = labels ? labels->items : NULL; l && l < labels->items + labels->n; l++)
        json_array_append_new(
            list, json_pack("{s:i, s:i, s:o, s:f, s:f, s:o*}", "file", l->fact.file, "number", l->fact.number, "name",
                            cts_json_new_text(l->fact.name), "ml", l->fact.ml, "voxels", (double)l->fact.voxels, "rgb",
                            l->coloured ? json_pack("[fff]", l->rgb[0], l->rgb[1], l->rgb[2]) : NULL));
    return list;
}

/* Labels are available once a volume is loaded. */
char *cts_list_labels(CtsServer *server, const char *id)
{
    pthread_mutex_lock(&server->lock);
    const CtsCachedSeries *const s = cts_series_cache_by_id(&server->cache, id);
    json_t *const list = labels_json(s && s->processed_volumes ? s->loaded.labels : NULL);
    pthread_mutex_unlock(&server->lock);
    return dumped(list, JSON_COMPACT);
}

/* State of the series' requests; "" without one. */
static const char *state_of(const CtsCachedSeries *cached)
{
    if (!cached->n_requested)
        return "";
    return cached->busy ? (cached->bytes ? "preparing" : "reading") : cached->n_running ? "rendering" : "waiting";
}

/* Adds date, description and the folder of the slices, which may identify the patient, where they were asked for. */
static void add_identifying(const CtsOptions *options, const CtsSeries *s, json_t *json)
{
    const size_t n = s->n_slices ? (size_t)(cts_slice_name(s->slices[0]) - s->slices[0]->path) : 0;
    if (options->show_patient)
        json_object_update_new(json, json_pack("{s:s, s:o}", "study_date", s->study_date, "description",
                                               cts_json_new_text(s->description ? s->description : "")));
    char *const folder = options->show_paths ? strndup(n ? s->slices[0]->path : ".", n ? n : 1) : NULL;
    if (folder)
        json_object_set_new(json, "path", cts_json_new_text(folder));
    free(folder);
}

/* Contains nothing that identifies the patient unless asked for. */
static json_t *series_json(const CtsServer *server, const CtsCachedSeries *cached)
{
    const CtsSeries *const s = cached->series;
    char *const reason = s->renderable ? NULL : cts_server_masked(server, cached, s->reason);
    json_t *const json = json_pack(
        "{s:s, s:s, s:o, s:s, s:b, s:b, s:[iii], s:[fff], s:s, s:b}", "id", cached->id, "state", state_of(cached),
        "traits", cts_json_new_text(s->traits), "modality", s->modality, "renderable", s->renderable, "passed",
        s->passed, "dims", s->columns, s->rows, s->n_slices, "spacing_mm", s->spacing_mm[0], s->spacing_mm[1],
        s->spacing_mm[2], "orientation", s->orientation, "loaded", cached->processed_volumes != NULL);
    if (json)
        add_identifying(server->options, s, json);
    if (json && reason)
        json_object_set_new(json, "reason", cts_json_new_text(reason));
    free(reason);
    return json;
}

char *cts_list_series(CtsServer *server)
{
    json_t *const list = json_array();
    pthread_mutex_lock(&server->lock);
    for (const CtsCachedSeries *s = server->cache.first; s; s = s->next)
        if (s->series)
            json_array_append_new(list, series_json(server, s));
    pthread_mutex_unlock(&server->lock);
    return dumped(list, JSON_COMPACT);
}

/* series NULL: of no series. */
static void list_preset(json_t *list, const CtsPreset *p, bool own, const CtsSeries *series)
{
    if (series && !cts_preset_suits(p, series->modality_id, series->quantity))
        return;
    const char *const usual = series ? cts_preset_default(series->modality_id, series->quantity, false) : "";
    json_array_append_new(list, json_pack("{s:s, s:s, s:s, s:s*, s:[ff], s:o, s:b, s:b}", "name", p->name, "mode",
                                          cts_mode_names[p->mode], "scale", cts_scale_names[p->scale], "modality",
                                          p->modality == CTS_ANY_MODALITY ? NULL : cts_modality_names[p->modality],
                                          "window_hu", p->window_low_hu, p->window_high_hu, "shade",
                                          p->shade ? json_pack("{s:f}", "occlusion", p->occlusion) : json_null(), "own",
                                          own, "default", !strcmp(p->name, usual)));
}

char *cts_list_presets(CtsServer *server, const char *id)
{
    json_t *const list = json_array();
    char **const own = cts_preset_user_names();
    const CtsPreset *p;
    CtsPreset mine;
    pthread_mutex_lock(&server->lock);
    const CtsCachedSeries *const cached = id ? cts_series_cache_by_id(&server->cache, id) : NULL;
    const CtsSeries *const series = cached ? cached->series : NULL;
    for (size_t i = 0; (p = cts_preset_builtin(i)); i++)
        list_preset(list, p, false, series);
    for (size_t i = 0; own && own[i]; i++)
        if (!cts_preset_load(own[i], &mine, NULL))
            list_preset(list, &mine, true, series);
    pthread_mutex_unlock(&server->lock);
    free(own);
    return dumped(list, JSON_COMPACT);
}

static void put_attribute(json_t *module, const char *tag, const char *vr, json_t *values)
{
    json_object_set_new(module, tag, json_pack("{s:s, s:o}", "vr", vr, "Value", values));
}

static json_t *vector(const double v[3])
{
    return json_pack("[ooo]", cts_json_new_number(v[0]), cts_json_new_number(v[1]), cts_json_new_number(v[2]));
}

char *cts_list_module(const CtsRenderRequest *r)
{
    static const char *const methods[CTS_N_MODES] = {[CTS_MODE_COMPOSITE] = "VOLUME_RENDERED",
                                                     [CTS_MODE_MIP] = "MAXIMUM_IP",
                                                     [CTS_MODE_MINIP] = "MINIMUM_IP",
                                                     [CTS_MODE_AVERAGE] = "AVERAGE_IP"};
    const CtsPictureInfo *const info = &r->info;
    json_t *const m = json_object();
    double position_lps[3];
    for (int i = 0; i < 3; i++)
        position_lps[i] = info->centre_lps[i] - info->forward_lps[i] * info->camera_mm;
    put_attribute(m, "00720510", "CS", json_pack("[s]", "3D_RENDERING"));
    put_attribute(m, "0070120D", "CS", json_pack("[s]", methods[info->mode]));
    put_attribute(m, "00701603", "FD", vector(position_lps));
    put_attribute(m, "00701604", "FD", vector(info->centre_lps));
    put_attribute(m, "00701605", "FD", vector(info->up_lps));
    if (info->mode != CTS_MODE_COMPOSITE) {
        const double low = info->window_low_hu, high = info->window_high_hu;
        put_attribute(m, "00281056", "CS", json_pack("[s]", "LINEAR_EXACT"));
        put_attribute(m, "00281051", "DS", json_pack("[o]", cts_json_new_number(fabs(high - low))));
        if (low > high)
            put_attribute(m, "20500020", "CS", json_pack("[s]", "INVERSE")); /* Presentation LUT Shape */
        put_attribute(m, "00281050", "DS", json_pack("[o]", cts_json_new_number((low + high) / 2)));
    }
    if (r->render_query.swivel_range_deg > 0) {
        put_attribute(m, "00701A06", "FD", json_pack("[o]", cts_json_new_number(r->render_query.swivel_range_deg)));
        put_attribute(m, "00701A05", "FD", json_pack("[o]", cts_json_new_number(r->render_query.swivel_step_deg)));
        put_attribute(m, "00701A03", "FD", json_pack("[o]", cts_json_new_number(r->render_query.rate)));
    }
    return dumped(m, JSON_COMPACT | JSON_PRESERVE_ORDER);
}

char *cts_list_scene(const CtsServer *server, const CtsRenderRequest *r)
{
    const CtsPictureInfo *const info = &r->info;
    json_t *const scene = json_pack("{s:f, s:[fff], s:[ff], s:s, s:[ff], s:s, s:s}", "mm_per_pixel", info->mm_per_pixel,
                                    "centre", info->centre_lps[0], info->centre_lps[1], info->centre_lps[2], "view",
                                    info->azimuth_deg, info->elevation_deg, "mode", cts_mode_names[info->mode],
                                    "window_hu", info->window_low_hu, info->window_high_hu, "unit",
                                    cts_quantity_units[r->cached->series->quantity], "preset", info->preset);
    json_t *const warnings = json_array();
    if (r->report.bound.known)
        json_object_set_new(scene, "bound_255", json_real(255 * r->report.bound.rmse));
    for (size_t i = 0; i < r->report.diagnostics.n && json_array_size(warnings) < 2; i++) {
        char *const text = r->report.diagnostics.items[i].severity == CTS_WARNING
                               ? cts_server_masked(server, r->cached, r->report.diagnostics.items[i].text)
                               : NULL;
        if (text)
            json_array_append_new(warnings, cts_json_new_text(text));
        free(text);
    }
    json_object_set_new(scene, "warnings", warnings);
    return dumped(scene, JSON_COMPACT | JSON_ENSURE_ASCII);
}
