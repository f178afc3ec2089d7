#include "app/batch/batch.h"

#include "base/text.h"
#include "ctsplat/label_files.h"
#include "ctsplat/preset.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void cts_batch_lists_free(CtsBatchLists *l)
{
    free(l->view_texts);
    free(l->formats);
    free(l->presets);
    free(l->views);
    free(l->options);
    free(l->montage_options);
    free(l->dcm_options);
}

/* Splits text at commas; *items and their texts are one block. */
static CtsStatus split(const char *option, const char *text, const char ***items, int *n, CtsError *err)
{
    const size_t most = strlen(text) + 1;
    *n = 0;
    if (!(*items = malloc(most * sizeof **items + most)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (char *rest = strcpy((char *)(*items + most), text), *item; (item = strsep(&rest, ","));) {
        if (!*item)
            return cts_fail(err, CTS_ERR_USAGE, "`%s` %s: an empty name between commas", option, text);
        (*items)[(*n)++] = item;
    }
    return CTS_OK;
}

/* Kinds of series that have default presets of their own. */
static const struct {
    CtsModality modality;
    CtsQuantity quantity;
} kinds[] = {{CTS_MODALITY_CT, CTS_QUANTITY_HU},
             {CTS_MODALITY_MR, CTS_QUANTITY_STORED},
             {CTS_MODALITY_PT, CTS_QUANTITY_SUVBW},
             {CTS_MODALITY_PT, CTS_QUANTITY_BQML}};
enum { N_KINDS = sizeof kinds / sizeof *kinds };

static bool takes_preset(const CtsBatchLists *l, int preset, CtsModality modality, CtsQuantity quantity)
{
    bool any = false;
    for (int i = 0; i < l->n_named; i++)
        any |= cts_preset_suits(&l->presets[i], modality, quantity);
    if (any || preset < l->n_named)
        return preset < l->n_named && cts_preset_suits(&l->presets[preset], modality, quantity);
    const int kind = preset - l->n_named;
    return !strcmp(cts_preset_default(modality, quantity, false),
                   cts_preset_default(kinds[kind].modality, kinds[kind].quantity, false));
}

bool cts_batch_takes(const CtsBatchLists *l, int preset, int view, CtsModality modality, CtsQuantity quantity)
{
    bool takes = takes_preset(l, preset, modality, quantity);
    for (int p = 0; p < preset && l->views[view].is_montage; p++)
        takes &= !takes_preset(l, p, modality, quantity);
    for (int i = 0; i < l->montage->n && l->views[view].is_montage; i++)
        takes &= !l->montage->tiles[i].preset || cts_preset_suits(l->montage->tiles[i].preset, modality, quantity);
    return takes;
}

/* A window that was given is meant for the presets that were given. */
static CtsStatus take_default(const CtsOptions *options, int kind, CtsBatchLists *l, CtsReport *report, CtsError *err)
{
    CtsPreset *const preset = &l->presets[l->n_presets++], own;
    const char *const name =
        cts_preset_default(kinds[kind].modality, kinds[kind].quantity, options->render.mode == CTS_MODE_COMPOSITE);
    CtsStatus st = cts_options_preset(options, name, preset, l->n_named || kind ? NULL : report, err);
    if (!st && l->n_named && !(st = cts_preset_load(name, &own, err))) {
        preset->window_low_hu = own.window_low_hu;
        preset->window_high_hu = own.window_high_hu;
        preset->window_absolute = false;
    }
    return st;
}

static CtsStatus take_presets(const CtsOptions *options, CtsBatchLists *l, CtsReport *report, CtsError *err)
{
    const char **names = NULL;
    CtsStatus st = options->preset ? split("preset", options->preset, &names, &l->n_named, err) : CTS_OK;
    if (!st && !(l->presets = calloc((size_t)l->n_named + N_KINDS, sizeof *l->presets)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < l->n_named && !st; i++) {
        st = cts_options_preset(options, names[i], &l->presets[i], report, err);
        for (int k = 0; k < i && !st; k++)
            if (!strcmp(l->presets[k].name, l->presets[i].name))
                st = cts_fail(err, CTS_ERR_USAGE, "`preset`: two are called %s (give one of them another name)",
                              l->presets[i].name);
    }
    l->n_presets = l->n_named;
    for (int kind = 0; kind < N_KINDS && !st; kind++)
        st = take_default(options, kind, l, report, err);
    free(names);
    return st;
}

/* Rotations from views of equal elevation are the same circle: keeps the first. */
static void join_circles(const CtsOptions *options, CtsBatchLists *l, CtsReport *report)
{
    int n = 0;
    for (int i = 0; i < l->n_views; i++) {
        int k = 0;
        while (k < n && l->views[k].elevation_deg != l->views[i].elevation_deg)
            k++;
        if (options->rotation && k < n)
            cts_report_diagnostic(
                report, CTS_DIAGNOSTIC_SAME_CIRCLE,
                "`rotation` from %s covers the same circle as that from %s, and is left out (choose a "
                "view of another elevation)",
                l->views[i].name, l->views[k].name);
        else
            l->views[n++] = l->views[i];
    }
    l->n_views = n;
}

/* A view by numbers holds a comma itself. */
static CtsStatus take_views(const CtsOptions *options, CtsBatchLists *l, CtsError *err)
{
    CtsStatus st = split("view", options->view ? options->view : "anterior", &l->view_texts, &l->n_views, err);
    if (st)
        return st;
    if (!(l->views = calloc((size_t)l->n_views + 1, sizeof *l->views)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    int n = 0;
    for (int i = 0; i < l->n_views && !st; i++) {
        CtsBatchView *const v = &l->views[n++];
        double number;
        const char *name = l->view_texts[i];
        if (cts_number(name, &number) && i + 1 < l->n_views)
            *(char *)(uintptr_t)(l->view_texts[++i] - 1) = ',';
        v->name = name;
        st = cts_view_of(name, &v->azimuth_deg, &v->elevation_deg, err);
        for (int k = 0; k < n - 1 && !st; k++)
            if (!strcmp(l->views[k].name, name))
                st = cts_fail(err, CTS_ERR_USAGE, "`view`: %s twice", name);
    }
    if (options->montage.n)
        l->views[n++] = (CtsBatchView){.name = "montage", .is_montage = true};
    l->n_views = n;
    return st;
}

static CtsStatus take_formats(const CtsOptions *options, CtsBatchLists *l, bool *any_object, CtsError *err)
{
    const CtsFormatInfo *format;
    CtsStatus st = split("format", options->formats ? options->formats : "png", &l->formats, &l->n_formats, err);
    for (int i = 0; i < l->n_formats && !st; i++) {
        if ((st = cts_format_of(l->formats[i], &format, err)))
            return st;
        *any_object |= format->is_object;
        for (int k = 0; k < i; k++)
            if (!strcmp(l->formats[k], l->formats[i]))
                return cts_fail(err, CTS_ERR_USAGE, "`format`: %s twice", l->formats[i]);
    }
    return st;
}

static CtsStatus take_peer(const CtsOptions *options, CtsBatchLists *l, bool any_object, CtsError *err)
{
    const CtsPeer *p = &options->send.peer;
    if (!options->send.given)
        return CTS_OK;
    if (!any_object)
        return cts_fail(err, CTS_ERR_USAGE, "`send`: there is no DICOM output to send (give `format` dcm)");
    if (p->web)
        snprintf(l->send_to, sizeof l->send_to, "%s", p->url);
    else
        snprintf(l->send_to, sizeof l->send_to, "%s@%s:%d", p->aet, p->host, p->port);
    return CTS_OK;
}

/* Adds the contents of the files that label options name, since they can change while the options do not. */
static CtsStatus put_files(const CtsOptions *options, FILE *out, CtsError *err)
{
    CtsStatus st = CTS_OK;
    char *text = NULL;
    if (options->source.label_names && !(st = cts_labels_stamp(options->source.label_names, "", NULL, &text, err)))
        fputs(text, out);
    free(text);
    for (int i = 0; i < options->label_appearances.n && !st; i++) {
        const char *const text_of_it = options->label_appearances.items[i], *const first = strchr(text_of_it, '=');
        const char *look = strrchr(text_of_it, '=');
        CtsPreset preset;
        if (!look || !look[1] || look[1] == '#')
            continue;
        /* Names may hold =, and so may presets. */
        while (look > first && cts_preset_load(look + 1, &preset, NULL))
            look = memrchr(text_of_it, '=', (size_t)(look - text_of_it));
        if (look == first && (st = cts_preset_load(look + 1, &preset, err)))
            return cts_context(err, "`label` %.*s", (int)(look - text_of_it), text_of_it);
        text = cts_preset_to_json(&preset);
        fputs(text ? text : "", out);
        free(text);
    }
    return st;
}

/* The montage's options, with the contents of its presets. */
static char *montage_text(const CtsOptions *options)
{
    char *text = NULL;
    size_t size;
    FILE *const out = open_memstream(&text, &size);
    if (!out)
        return NULL;
    fprintf(out, "%s\n%d\n", options->montage_list ? options->montage_list : "", options->montage.columns);
    for (int i = 0; i < options->montage.n; i++) {
        char *const preset =
            options->montage.tiles[i].preset ? cts_preset_to_json(options->montage.tiles[i].preset) : NULL;
        fputs(preset ? preset : "", out);
        free(preset);
    }
    return cts_text_end(out, &text);
}

static CtsStatus put_options(const CtsOptions *options, CtsBatchLists *lists, CtsError *err)
{
    size_t size;
    char *const words = cts_options_text(options, false);
    FILE *const out = words ? open_memstream(&lists->options, &size) : NULL;
    CtsStatus st = CTS_OK;
    if (out) {
        fputs(words, out);
        st = put_files(options, out, err);
    }
    free(words);
    lists->dcm_options = cts_options_text(options, true);
    lists->montage_options = montage_text(options);
    const bool made = out && !fclose(out) && lists->dcm_options && lists->montage_options;
    return st || made ? st : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

CtsStatus cts_batch_lists(const CtsOptions *options, CtsBatchLists *lists, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    bool any_object = false;
    lists->montage = &options->montage;
    if ((st = take_presets(options, lists, report, err)) || (st = take_views(options, lists, err)) ||
        (st = take_formats(options, lists, &any_object, err)) || (st = take_peer(options, lists, any_object, err)))
        return st;
    join_circles(options, lists, report);
    /* option deidentify also affects folders and journal */
    cts_options_report_objects(options, any_object, "deidentify", report);
    return put_options(options, lists, err);
}
