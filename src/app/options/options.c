#include "app/options/options.h"

#include "base/did_you_mean.h"
#include "base/mem.h"
#include "base/text.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void cts_options_begin(CtsOptions *options)
{
    *options = (CtsOptions){.shard.n = 1, .series_timeout_s = 3600, .find.modality = "CT", .listen = "127.0.0.1:8484"};
    cts_render_defaults(&options->render);
    options->export.quality = CTS_QUALITY_DEFAULT;
    options->export.frame_rate = CTS_FRAME_RATE_DEFAULT;
    options->render.fit = CTS_FIT_VISIBLE;
}

void cts_options_free(CtsOptions *options)
{
    for (const CtsOption *o = cts_options; o->name; o++)
        if (o->kind == CTS_TEXTS)
            free(((CtsTextList *)(void *)((char *)options + o->field))->items);
    free(options->given);
    free(options->recipe);
    cts_state_free(&options->state);
    cts_appearance_file_free(&options->appearance_file);
    cts_montage_free(&options->montage);
    *options = (CtsOptions){0};
}

static CtsStatus add_text(CtsTextList *list, const char *text, CtsError *err)
{
    const CtsStatus st = cts_grow(&list->items, list->n, err);
    if (!st)
        list->items[list->n++] = text;
    return st;
}

static CtsStatus add_given(CtsOptions *options, const CtsJobOption *given, CtsError *err)
{
    const CtsStatus st = cts_grow(&options->given, options->n_given, err);
    if (!st)
        options->given[options->n_given++] = *given;
    return st;
}

static CtsStatus set_choice(const CtsOption *o, void *field, const char *text, CtsError *err)
{
    const int i = cts_name_find(o->name, text, strlen(text), o->choices, o->n_choices, "", err);
    if (i < 0)
        return CTS_ERR_USAGE;
    if (o->size == sizeof(bool))
        *(bool *)field = i;
    else
        *(int *)field = o->first + i;
    return CTS_OK;
}

static CtsStatus put_value(CtsOptions *options, const CtsOption *o, const char *text, CtsError *err)
{
    void *field = (char *)options + o->field;
    const CtsBounds *b = cts_option_bounds(o);
    int n;
    double x;
    if (!*text && o->kind != CTS_FLAG && o->kind != CTS_PEER && o->kind != CTS_PARSED)
        return cts_fail(err, CTS_ERR_USAGE, "`%s`: an empty argument (%s)", o->name, o->argument);
    switch (o->kind) {
    case CTS_FLAG:
        *(bool *)field = true;
        return *text ? cts_fail(err, CTS_ERR_USAGE, "`%s` %s: takes no argument", o->name, text) : CTS_OK;
    case CTS_TEXT:
        *(const char **)field = text;
        return CTS_OK;
    case CTS_TEXTS:
        return add_text(field, text, err);
    case CTS_INT:
        if (!cts_integer(text, &n) || n < b->low || n > b->high)
            return cts_fail(err, CTS_ERR_USAGE, "`%s` %s: not a whole number from %.0f to %.0f", o->name, text, b->low,
                            b->high);
        *(int *)field = n;
        return CTS_OK;
    case CTS_NUMBER:
        if (!cts_number(text, &x) || x < b->low || x > b->high)
            return cts_fail(err, CTS_ERR_USAGE, "`%s` %s: not a number from %g to %g", o->name, text, b->low, b->high);
        *(double *)field = x;
        return CTS_OK;
    case CTS_CHOICE:
        return set_choice(o, field, text, err);
    case CTS_PEER:
        ((struct CtsGivenPeer *)field)->given = true;
        return cts_peer_parse(text, &((struct CtsGivenPeer *)field)->peer, err) ? cts_context(err, "`%s`", o->name)
                                                                                : CTS_OK;
    case CTS_PARSED:
        return o->parse(options, text, err);
    }
    return CTS_OK;
}

const char *cts_option_near(CtsCommand command, const char *name, size_t length)
{
    CtsDidYouMean nearest_word = {.written = name, .length = length};
    for (const CtsOption *o = cts_options; o->name; o++)
        if (cts_option_is_of(o, command))
            cts_did_you_mean_try(&nearest_word, o->name);
    return nearest_word.word;
}

/* Fails with a suggestion among the names that command has. */
static CtsStatus fail_unknown_name(CtsCommand command, const char *name, CtsError *err)
{
    const char *const near = cts_option_near(command, name, strlen(name));
    return cts_fail(err, CTS_ERR_USAGE, "%s: no such option%s%s%s", name, near ? " (did you mean " : "",
                    near ? near : "", near ? "?)" : "");
}

CtsStatus cts_options_take(CtsOptions *options, CtsCommand command, const CtsJobOption *word, CtsError *err)
{
    const CtsOption *o = cts_option(word->name, strlen(word->name));
    CtsStatus st;
    if (!o || !cts_option_is_of(o, command))
        return fail_unknown_name(command, word->name, err);
    if (o->is_list_of_batch && command != CTS_FOR_BATCH && cts_options_given(options, o->name))
        return cts_fail(err, CTS_ERR_USAGE,
                        "`%s` %s: a picture has only one, and %s is given too (ctsplat batch `%s` "
                        "LIST makes a picture with each)",
                        o->name, word->value, cts_options_given(options, o->name), o->name);
    if ((st = put_value(options, o, word->value, err)))
        return word->from ? cts_context(err, "%s", word->from) : st;
    return add_given(options, &(CtsJobOption){o->name, word->value, word->from}, err);
}

/* The index of the valid (last) occurrence of an option, -1 for none. */
static int last_of(const CtsOptions *options, const char *name)
{
    int i = options->n_given - 1;
    while (i >= 0 && strcmp(options->given[i].name, name))
        i--;
    return i;
}

const char *cts_options_given(const CtsOptions *options, const char *name)
{
    const int i = last_of(options, name);
    return i < 0 ? NULL : options->given[i].value;
}

/* True for options that a presentation state contains: those of the picture and its source, without paths of label
 * files. */
static bool is_of_recipe(const CtsOption *o)
{
    if (!strcmp(o->name, "labels") || !strcmp(o->name, "label-names"))
        return false;
    return cts_option_is_of_pictures(o) || o->remakes == CTS_REMAKES_TRANSFER || !strcmp(o->name, "view");
}

/* Takes the options of the presentation state that are not given. */
static CtsStatus take_state(CtsOptions *options, CtsCommand command, CtsError *err)
{
    CtsStatus st = cts_state_read(options->state_path, &options->state, err);
    const int n_own = options->n_given;
    for (int i = 0; !st && i < options->state->n_options; i++) {
        CtsJobOption said = options->state->options[i];
        const CtsOption *o = cts_option(said.name, strlen(said.name));
        bool own = false;
        if (!o || !is_of_recipe(o) || !cts_option_is_of(o, command))
            return cts_fail(err, CTS_ERR_READ, "%s: holds an option that this build does not have: %.60s",
                            options->state_path, said.name);
        for (int k = 0; k < n_own; k++)
            own |= !strcmp(options->given[k].name, o->name);
        said.from = options->state_path;
        if (!own)
            st = cts_options_take(options, command, &said, err);
    }
    return st;
}

/* Takes the options of the appearance file before those given, so that the last appearance of a label applies. */
static CtsStatus take_appearance_file(CtsOptions *options, CtsCommand command, CtsError *err)
{
    const CtsOptions own = *options;
    const CtsTextList *const looks = &own.label_appearances;
    options->given = NULL;
    options->n_given = 0;
    options->label_appearances = (CtsTextList){0};
    CtsStatus st = cts_appearance_file_read(options->appearance_path, &options->appearance_file, err);
    for (int i = 0; !st && i < options->appearance_file.n; i++) {
        const CtsJobOption *const said = &options->appearance_file.options[i];
        if (!strcmp(said->name, "label") || !cts_options_given(&own, said->name))
            st = cts_options_take(options, command, said, err);
    }
    for (int i = 0; !st && i < own.n_given; i++)
        st = add_given(options, &own.given[i], err);
    for (int i = 0; !st && i < looks->n; i++)
        st = add_text(&options->label_appearances, looks->items[i], err);
    free(own.given);
    free(looks->items);
    return st;
}

/* In the table's order; of an option that holds one value the last. */
static CtsStatus write_recipe(CtsOptions *options, CtsError *err)
{
    if (!(options->recipe = calloc((size_t)options->n_given + 1, sizeof *options->recipe)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (const CtsOption *o = cts_options; o->name; o++)
        for (int i = 0; i < options->n_given && is_of_recipe(o); i++) {
            const CtsJobOption *given = &options->given[i];
            if (!strcmp(given->name, o->name) && (o->kind == CTS_TEXTS || i == last_of(options, o->name)))
                options->recipe[options->n_recipe++] = *given;
        }
    return CTS_OK;
}

/* Checks fetching and sending. A server gets the UIDs to fetch later. */
static CtsStatus check_peers(const CtsOptions *o, CtsCommand command, CtsError *err)
{
    if (command == CTS_FOR_SERVE)
        return cts_net_check(o->from.given ? &o->from.peer : NULL, &o->net, err);
    if (o->from.given && o->paths.n > 0)
        return cts_fail(err, CTS_ERR_USAGE, "`from`: %s is given too (a PATH or a peer, not both)", o->paths.items[0]);
    const CtsSeriesQuery *q = &o->find;
    const bool asks = q->study_uid || q->series_uid || q->accession || q->patient_id || q->study_date;
    if (!o->from.given && (asks || o->net.move_port))
        return cts_fail(err, CTS_ERR_USAGE,
                        "`study-uid`, `series-uid` and `move-port` say what to fetch, and `from` is not given");
    if (o->from.given && !q->study_uid && command != CTS_FOR_INFO && command != CTS_FOR_BATCH)
        return cts_fail(err, CTS_ERR_USAGE,
                        "`from`: no study to fetch is named (give `study-uid`, and `series-uid` for "
                        "one of its series)");
    const CtsStatus st = o->send.given ? cts_net_check(&o->send.peer, &o->net, err) : CTS_OK;
    return !st && o->from.given ? cts_net_check(&o->from.peer, &o->net, err) : st;
}

CtsStatus cts_options_end(CtsOptions *options, CtsCommand command, CtsError *err)
{
    CtsStatus st = options->appearance_path ? take_appearance_file(options, command, err) : CTS_OK;
    if (st || (options->state_path && (st = take_state(options, command, err))) || (st = write_recipe(options, err)))
        return st;
    if (options->preset && options->state)
        options->state->preset.name[0] = 0; /* another preset is given */
    else if (options->state)
        options->preset = options->state->preset.name;
    /* A batch has lists. */
    CtsRenderSettings *const r = &options->render;
    if (command != CTS_FOR_BATCH &&
        ((options->view && (st = cts_view_of(options->view, &r->azimuth_deg, &r->elevation_deg, err))) ||
         (options->formats && (st = cts_format_of(options->formats, &options->format, err)))))
        return st;
    if ((st = cts_options_montage(options, command, err)))
        return st;
    if (options->swivel_step_deg > 0 && cts_options_given(options, "rotation"))
        return cts_fail(err, CTS_ERR_USAGE, "`swivel`: `rotation` is given too (choose one)");
    return check_peers(options, command, err);
}

/* Numbers in a canonical notation. */
static void print_value(FILE *file, const CtsOption *o, const char *text)
{
    double x;
    if ((o->kind == CTS_INT || o->kind == CTS_NUMBER) && cts_number(text, &x))
        fprintf(file, "%s=%.17g\n", o->name, x);
    else
        fprintf(file, "%s=%s\n", o->name, text);
}

bool cts_option_is_of_pictures(const CtsOption *o)
{
    return o->remakes <= CTS_REMAKES_FILE && o->remakes != CTS_REMAKES_TRANSFER;
}

/* Options that are not given appear with their defaults, so that giving the default changes nothing. */
char *cts_options_text(const CtsOptions *options, bool of_objects)
{
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    for (const CtsOption *o = cts_options; file && o->name; o++) {
        const int last = last_of(options, o->name);
        if (!(of_objects ? o->remakes == CTS_REMAKES_OBJECT : cts_option_is_of_pictures(o)) ||
            !cts_option_is_of(o, CTS_FOR_BATCH))
            continue;
        if (last < 0)
            print_value(file, o, o->fallback ? o->fallback : "none");
        for (int i = o->kind == CTS_TEXTS ? 0 : last; i >= 0 && i <= last; i++)
            if (!strcmp(options->given[i].name, o->name))
                print_value(file, o, options->given[i].value);
    }
    return cts_text_end(file, &text);
}

void cts_options_command(const CtsOptions *options, char *text, size_t size)
{
    FILE *out = fmemopen(text, size, "w");
    text[0] = 0;
    for (int i = 0; out && i < options->n_given; i++) {
        const CtsJobOption *given = &options->given[i];
        const CtsOption *o = cts_option(given->name, strlen(given->name));
        const CtsFormatInfo *format = cts_export_format(given->value);
        if (!strcmp(given->name, "path"))
            continue;
        if (o->kind == CTS_TEXTS && o->letter)
            fprintf(out, " -%c", o->letter);
        else
            fprintf(out, " --%s", given->name);
        if (o->kind == CTS_TEXTS && (format || !strcmp(given->value, "-")))
            fprintf(out, " %s%s", format ? "." : "-", format ? format->name : "");
        else if (o->kind != CTS_FLAG && o->kind != CTS_TEXT && o->kind != CTS_TEXTS)
            fprintf(out, " %s", given->value);
    }
    if (out)
        fclose(out);
    text[size - 1] = 0;
}
