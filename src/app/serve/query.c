#include "app/serve/server.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void cts_query_add(CtsQuery *q, const char *name, const char *value)
{
    q->too_many |= q->n == CTS_QUERY_PARTS;
    if (q->too_many)
        return;
    q->parts[q->n].name = name;
    q->parts[q->n++].value = value;
}

void cts_query_make(CtsQuery *query, const char *name, const char *format, ...)
{
    char *const text = query->made[query->n_made++];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof *query->made, format, arguments);
    va_end(arguments);
    cts_query_add(query, name, text);
}

const char *cts_query_value(const CtsQuery *query, const char *name)
{
    for (int i = 0; i < query->n; i++)
        if (!strcmp(query->parts[i].name, name))
            return query->parts[i].value;
    return NULL;
}

/* A client must not name files: it may use presets listed here, or give one in the request itself. */
static CtsStatus check_query_preset(const char *name, CtsError *err)
{
    bool known = name[0] == '{' || cts_preset_number(name);
    char **const own = known ? NULL : cts_preset_user_names();
    for (size_t i = 0; !known && own && own[i]; i++)
        known = !strcmp(own[i], name);
    free(own);
    return known ? CTS_OK : cts_fail(err, CTS_ERR_PRESET, "preset %.60s: no such preset here (see /presets)", name);
}

/* Checks NAME=LOOK, where LOOK is a colour or a preset. A name may contain =, so LOOK may begin after any of them, and
 * must name no file in any case: FILE#PRESET has a #. */
static CtsStatus check_appearance(const char *text, CtsError *err)
{
    const char *const first = strchr(text, '='), *const last = strrchr(text, '=');
    if (!first || last[1] == '#')
        return first && strcspn(first, "/#") < (size_t)(last - first) ? check_query_preset(first + 1, err) : CTS_OK;
    json_t *const own = first[1] == '{' ? json_loads(first + 1, 0, NULL) : NULL;
    const bool is_own = own;
    json_decref(own);
    if (is_own)
        return CTS_OK;
    return check_query_preset(first + strcspn(first, "/#") < last ? first + 1 : last + 1, err);
}

static CtsStatus take_query_options(CtsRenderQuery *render_query, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int i = 0; i < render_query->query.n && !st; i++) {
        const CtsJobOption word = {.name = render_query->query.parts[i].name,
                                   .value = render_query->query.parts[i].value};
        if (!strcmp(word.name, "preset") && (st = check_query_preset(word.value, err)))
            return st;
        if (!strcmp(word.name, "look") && word.value[0] != '{')
            return cts_fail(err, CTS_ERR_USAGE, "`look`: belongs in the request itself, as JSON");
        st = cts_options_take(&render_query->options, CTS_FOR_REQUEST, &word, err);
    }
    return st;
}

static CtsStatus name_file(CtsRenderQuery *render_query, const CtsFormatInfo *format, const char *folder,
                           unsigned long serial, CtsError *err)
{
    if (asprintf(&render_query->path, "%s/%lu.%s", folder, serial, format->name) < 0) {
        render_query->path = NULL;
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    return cts_options_take(&render_query->options, CTS_FOR_JOB,
                            &(CtsJobOption){.name = "output", .value = render_query->path}, err);
}

CtsStatus cts_render_query_options(CtsRenderQuery *render_query, const CtsFormatInfo *format, const char *folder,
                                   unsigned long serial, int n_threads, CtsReport *report, CtsError *err)
{
    CtsOptions *const o = &render_query->options;
    CtsStatus st;
    render_query->media_type = format->media_type;
    cts_options_begin(o);
    o->render.n_threads = n_threads;
    o->export.scratch = true;
    o->export.png_8_bits = true; /* as the standard requires; option png-bits overrides it */
    if (render_query->query.too_many)
        return cts_fail(err, CTS_ERR_USAGE, "more than %d parameters", CTS_QUERY_PARTS);
    if (render_query->state_path &&
        (st = cts_options_take(o, CTS_FOR_JOB, &(CtsJobOption){.name = "state", .value = render_query->state_path},
                               err)))
        return st;
    if ((st = take_query_options(render_query, err)) || (st = name_file(render_query, format, folder, serial, err)) ||
        (st = cts_options_end(o, CTS_FOR_REQUEST, err)))
        return st;
    for (int i = 0; i < o->label_appearances.n; i++)
        if ((st = check_appearance(o->label_appearances.items[i], err)))
            return st;
    if (o->rotation > 1 && !format->many_frames)
        return cts_fail(err, CTS_ERR_USAGE, "one .%s holds one picture, not the %d of a rotation (take webp or dcm)",
                        format->name, o->rotation);
    if ((st = cts_options_one_job(o, &render_query->preset, &render_query->job, report, err)))
        return st;
    return cts_job_check(&render_query->job, report, err);
}
