/* Presentation states: the standard's attributes for a picture. The attributes are in dicom/objects. */
#include "ctsplat/state.h"

#include "base/clamp.h"
#include "base/enum_table.h"
#include "base/file.h"
#include "base/hash.h"
#include "base/mem.h"
#include "base/text.h"
#include "dicom/objects/objects.h"
#include "output/export/format.h"
#include "output/export/sc_texts.h"
#include "output/image/describe.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The standard has no value for a mean along the ray. */
static CTS_ENUM_TABLE(char *const, methods,
                      CTS_N_MODES, [CTS_MODE_COMPOSITE] = "VOLUME_RENDERED", [CTS_MODE_MIP] = "MAXIMUM_IP",
                      [CTS_MODE_MINIP] = "MINIMUM_IP", [CTS_MODE_AVERAGE] = "VOLUME_RENDERED");

/* Shininess is relative to an implementation's maximum: here this power of the highlight. */
static const double max_power = 128;

static void fill_geometry(const CtsStateScene *scene, CtsDcmState *s)
{
    const CtsPictureInfo *info = scene->info;
    const double half_width_mm = info->mm_per_pixel * scene->width / 2,
                 half_height_mm = info->mm_per_pixel * scene->height / 2;
    const double field_mm[6] = {-half_width_mm, half_width_mm, half_height_mm, -half_height_mm, 0, 2 * info->camera_mm};
    for (int i = 0; i < 3; i++) {
        s->look_at_lps[i] = info->centre_lps[i];
        s->viewpoint_lps[i] = info->centre_lps[i] - info->forward_lps[i] * info->camera_mm;
        s->up_lps[i] = info->up_lps[i];
        s->forward_lps[i] = info->forward_lps[i];
        s->crop_lps[i] = scene->crop_low_lps[i];
        s->crop_lps[3 + i] = scene->crop_high_lps[i];
    }
    memcpy(s->field_mm, field_mm, sizeof field_mm);
    s->cropped = scene->cropped;
}

/* The preset sampled from its first to its last point: opacity is that of its unit distance. The window is in values
 * after rescale, which the referenced slices give any program, never in SUV. */
static void fill_transfer(const CtsStateScene *scene, CtsDcmState *s)
{
    const CtsPreset *p = scene->preset;
    double low_hu = fmin(p->opacity[0].hu, p->colour[0].hu);
    double high_hu = fmax(p->opacity[p->n_opacity - 1].hu, p->colour[p->n_colour - 1].hu);
    const bool projection = scene->info->mode != CTS_MODE_COMPOSITE;
    const double black_hu = scene->info->window_low_hu, white_hu = scene->info->window_high_hu;
    const double factor = scene->source->value_factor > 0 ? scene->source->value_factor : 1;
    if (projection) {
        low_hu = fmin(black_hu, white_hu);
        high_hu = fmax(black_hu, white_hu);
    }
    if (!(high_hu > low_hu))
        high_hu = low_hu + 1;
    s->window_centre_hu = (low_hu + high_hu) / 2 / factor;
    s->window_width_hu = (high_hu - low_hu) / factor;
    for (int i = 0; i < CTS_STATE_ENTRIES; i++) {
        const double share = i / (CTS_STATE_ENTRIES - 1.0), hu = low_hu + share * (high_hu - low_hu);
        const double grey = black_hu > white_hu ? 1 - share : share;
        double rgb[3] = {grey, grey, grey}, opacity = 1;
        if (!projection) {
            cts_preset_colour(p, hu, rgb);
            opacity = cts_preset_opacity(p, hu);
        }
        for (int c = 0; c < 3; c++)
            s->tables[c][i] = (uint16_t)(cts_clamp01(rgb[c]) * 65535 + 0.5);
        s->tables[3][i] = (uint16_t)(cts_clamp01(opacity) * 65535 + 0.5);
    }
}

static CtsStatus uid_of(const char *purpose, const CtsStateScene *scene, const char *text, char uid[65], CtsError *err)
{
    CtsHash *hash = cts_sc_hash_start(NULL, purpose, scene->source);
    cts_hash_text(hash, text);
    cts_hash_text(hash, CTS_VERSION);
    return cts_sc_hash_finish(&hash, uid, err);
}

/* One option a line, as on the command line. */
static CtsStatus write_options(const CtsStateScene *scene, char **text, CtsError *err)
{
    size_t size;
    FILE *const out = open_memstream(text, &size);
    CtsStatus st = CTS_OK;
    for (int i = 0; out && i < scene->n_options; i++) {
        const CtsJobOption *const o = &scene->options[i];
        if (!st && strchr(o->value, '\n'))
            st = cts_fail(err, CTS_ERR_USAGE, "--%s: a line break cannot stand in a presentation state", o->name);
        fprintf(out, "%s=%s\n", o->name, o->value);
    }
    return cts_text_end(out, text) ? st : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

static CtsStatus choose_names(const CtsStateScene *scene, CtsDcmState *s, CtsError *err)
{
    CtsHash *hash = cts_hash_start(NULL);
    char all[2 * CTS_DIGEST_BYTES + 1];
    const char *const *const identity = scene->source->slices[0]->identity;
    CtsStatus st;
    cts_hash_text(hash, s->preset);
    cts_hash_text(hash, s->options);
    cts_hash_text(hash, cts_describe_view(scene->info).text);
    cts_hash_text(hash, s->capture_uid);
    for (size_t i = 0; scene->labels && i < scene->labels->n_objects; i++)
        cts_hash_text(hash, scene->labels->objects[i].sop_uid);
    if ((st = cts_hash_hex(&hash, all, err)))
        return st;
    snprintf(s->study_uid, sizeof s->study_uid, "%s", identity[CTS_STUDY_UID]);
    snprintf(s->frame_uid, sizeof s->frame_uid, "%s", identity[CTS_FRAME_UID]);
    if ((!s->study_uid[0] && (st = uid_of("study", scene, "", s->study_uid, err))) ||
        (!s->frame_uid[0] && (st = uid_of("frame of reference", scene, "", s->frame_uid, err))) ||
        (st = uid_of("states", scene, "", s->series_uid, err)) || (st = uid_of("input", scene, all, s->input_uid, err)))
        return st;
    return uid_of("state", scene, all, s->sop_uid, err);
}

/* Hidden labels, as whole segments; warns about those that cannot be expressed. */
static CtsStatus fill_labels(const CtsStateScene *scene, CtsDcmState *s, CtsLabelCrop **crop, CtsError *err)
{
    const char *unsaid = NULL;
    if (!scene->labels)
        return CTS_OK;
    CtsStatus st = cts_alloc_zeroed(crop, scene->labels->n + 1, err);
    if (st || (st = cts_labels_crop(scene->labels, scene->choice, s->study_uid, *crop, &unsaid, err)))
        return st;
    s->labels = scene->labels;
    s->label_crop = *crop;
    if (unsaid)
        cts_report_diagnostic(
            scene->report, CTS_DIAGNOSTIC_STATE_LEFT_OUT,
            "the presentation state has no information for other programs on which labels are hidden: %s", unsaid);
    if (scene->choice->n_appearances || scene->choice->own_colours)
        cts_report_diagnostic(
            scene->report, CTS_DIAGNOSTIC_STATE_LEFT_OUT,
            "the presentation state has no information for other programs on the appearance of labels: "
            "the standard has no place for it");
    return CTS_OK;
}

/* Everything but the names and the private texts. */
static CtsStatus fill_state(const CtsStateScene *scene, CtsScTexts *texts, CtsDcmState *s, CtsError *err)
{
    const CtsPreset *p = scene->preset;
    const CtsExportJob job = {.head = {.n_frames = 1, .info = *scene->info}};
    cts_sc_texts(&job, texts);
    s->source = scene->source;
    s->description = texts->description;
    s->view = texts->view;
    s->method = methods[scene->info->mode];
    s->shaded = scene->shaded;
    if (scene->shaded && p->occlusion > 0)
        cts_report_diagnostic(
            scene->report, CTS_DIAGNOSTIC_STATE_LEFT_OUT,
            "the presentation state has no information for other programs on `ambient-occlusion` %g: the standard "
            "has no place for it",
            p->occlusion);
    s->ambient = cts_clamp01(p->ambient);
    s->diffuse = cts_clamp01(p->diffuse);
    s->specular = cts_clamp01(p->specular);
    s->shininess = cts_clamp01(p->power / max_power);
    fill_geometry(scene, s);
    fill_transfer(scene, s);
    if (scene->capture) {
        CtsDcmIds ids;
        const CtsStatus found = cts_dcm_ids(scene->capture, &ids, err);
        if (found)
            return found;
        memcpy(s->capture_class_uid, ids.class_uid, sizeof ids.class_uid);
        memcpy(s->capture_uid, ids.sop_uid, sizeof ids.sop_uid);
    }
    return CTS_OK;
}

CtsStatus cts_state_write(const char *path, const CtsStateScene *scene, bool force, CtsError *err)
{
    CtsScTexts texts;
    char *options = NULL, *preset = cts_preset_to_json(scene->preset);
    CtsLabelCrop *crop = NULL;
    CtsTempFile *temp = NULL;
    CtsDcmState *s = calloc(1, sizeof *s);
    CtsStatus st = s && preset ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    if (st || (st = fill_state(scene, &texts, s, err)) || (st = write_options(scene, &options, err)))
        goto end;
    s->preset = preset;
    s->options = options;
    if ((st = choose_names(scene, s, err)))
        goto end;
    cts_date_texts(s->date, s->time);
    s->series_number = cts_sc_series_number(scene->source, 999);
    if ((st = fill_labels(scene, s, &crop, err)) || (st = cts_temp_open(&temp, path, err)) ||
        (st = cts_dcm_state_write(s, temp, err)))
        goto end;
    cts_temp_keep_private(temp);
    st = cts_temp_commit(&temp, force, NULL, err);
end:
    cts_temp_discard(&temp);
    cts_free(&crop);
    free(options);
    free(preset);
    free(s);
    return st;
}

/* name=value lines in place. */
static CtsStatus split_options(CtsState *state, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (char *line = state->text, *end; !st && (end = strchr(line, '\n')); line = end + 1) {
        char *const value = memchr(line, '=', (size_t)(end - line));
        *end = 0;
        if (!*line)
            continue; /* padding */
        if (!value)
            return cts_fail(err, CTS_ERR_READ, "damaged: an option without a value");
        *value = 0;
        if (!(st = cts_grow(&state->options, state->n_options, err)))
            state->options[state->n_options++] = (CtsJobOption){.name = line, .value = value + 1};
    }
    return st;
}

CtsStatus cts_state_read(const char *path, CtsState **state, CtsError *err)
{
    CtsDcmStateRead read;
    CtsState *s = *state = calloc(1, sizeof *s);
    if (!s)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    CtsStatus st = cts_dcm_state_read(path, &read, err);
    s->text = read.options;
    s->slice_frame = read.slice_frame;
    memcpy(s->source_uid, read.series_uid, sizeof s->source_uid);
    memcpy(s->slice_uid, read.slice_uid, sizeof s->slice_uid);
    if (!st && (st = split_options(s, err)))
        cts_context(err, "%s", path);
    if (!st)
        st = cts_preset_parse(read.preset, strlen(read.preset), path, NULL, &s->preset, err);
    free(read.preset);
    if (st)
        cts_state_free(state);
    return st;
}

bool cts_state_is_of(const CtsState *state, const CtsSeries *series)
{
    return !state->slice_uid[0] || cts_series_count(series, state->slice_uid, state->slice_frame);
}

CtsStatus cts_state_uid(const char *path, char sop_uid[65], CtsError *err)
{
    CtsDcmIds ids;
    const CtsStatus st = cts_dcm_ids(path, &ids, err);
    if (st)
        return st;
    memcpy(sop_uid, ids.sop_uid, sizeof ids.sop_uid);
    return strcmp(ids.class_uid, CTS_STATE_CLASS)
               ? cts_fail(err, CTS_ERR_READ, "%s: is no Volume Rendering Volumetric Presentation State", path)
               : CTS_OK;
}

void cts_state_free(CtsState **state)
{
    if (!*state)
        return;
    free((*state)->text);
    free((*state)->options);
    free(*state);
    *state = NULL;
}
