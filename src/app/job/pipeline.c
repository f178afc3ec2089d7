#include "app/job/pipeline.h"

#include "base/clock.h"
#include "base/stage_timer.h"
#include "ctsplat/table.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct SeriesName {
    char text[80];
} SeriesName;

/* The name that option `series` accepts. */
static SeriesName name_of_series(const CtsSeries *s)
{
    SeriesName name;
    snprintf(name.text, sizeof name.text, s->part > 1 ? "%s#%d" : "%s", s->uid[0] ? s->uid : "(without UID)", s->part);
    return name;
}

/* Reports the chosen series where there are several, and the reason why each other one was not. */
static void report_choice(const CtsLoaded *loaded, CtsReport *report)
{
    const CtsSeriesList *list = loaded->list;
    const CtsSeries *taken = loaded->series;
    if (list->n < 2)
        return;
    if (taken->renderable)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SEVERAL_SERIES,
                              "%zu series found; taking %s (%s), the first by modality (CT, PT, MR) and number of "
                              "slices%s; `series` takes another, by UID or number (ctsplat info; there "
                              "`show-patient` adds date and description)",
                              list->n, name_of_series(taken).text, taken->traits,
                              taken == list->items ? "" : " of those that can be rendered");
    else
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SEVERAL_SERIES, "%zu series found, and none can be rendered",
                              list->n);
    for (size_t i = 0; i < list->n; i++) {
        const CtsSeries *s = &list->items[i];
        const char *const why = !s->renderable                         ? s->reason
                                : s->modality_id != taken->modality_id ? "another modality"
                                : s->n_slices < taken->n_slices        ? "fewer slices"
                                                                       : "another volume of the same series";
        if (s != taken)
            cts_report_diagnostic(report, CTS_DIAGNOSTIC_SERIES_NOT_TAKEN, "not taken: %zu, %s (%s): %s", i + 1,
                                  name_of_series(s).text, s->traits, why);
    }
}

/* Without a name the series whose slices the presentation state lists. */
static CtsStatus choose_series(const CtsSource *source, const CtsSeriesList *list, const CtsSeries **series,
                               CtsError *err)
{
    if (source->series_uid || !source->state || !source->state->slice_uid[0])
        return cts_series_choose(list, source->series_uid, series, err);
    for (size_t i = 0; i < list->n; i++)
        if (cts_state_is_of(source->state, *series = &list->items[i]))
            return CTS_OK;
    return cts_fail(
        err, CTS_ERR_GEOMETRY,
        "`state`: the volume that the presentation state lists is not among the %zu found (`series` renders "
        "another one)",
        list->n);
}

static CtsStatus find_series_of_source(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const char *const *paths = source->from ? (const char *const *)&loaded->fetched.folder : source->paths;
    const int n_paths = source->from ? 1 : source->n_paths;
    if (source->from && (st = cts_net_fetch(source->from, source->net, source->fetched, &loaded->fetched, report, err)))
        return cts_context(err, "`from`");
    const CtsSeriesSearch search = {
        .paths = paths, .n_paths = n_paths, .n_threads = source->n_threads, .rules = source->rules};
    if ((st = cts_series_search(&search, &loaded->list, report, err)))
        return st;
    if ((st = choose_series(source, loaded->list, &loaded->series, err)))
        return n_paths == 1 ? cts_context(err, "%s", paths[0]) : st;
    if (report)
        memcpy(report->series_uid, loaded->series->uid, sizeof report->series_uid);
    const CtsDiagnostics *found = &loaded->list->diagnostics;
    for (size_t i = 0; i < found->n; i++)
        cts_report_diagnostic(report, found->items[i].id, "%s", found->items[i].text);
    if (!source->series_uid && !source->state)
        report_choice(loaded, report);
    return CTS_OK;
}

static void report_interpolation(const CtsVolume *v, const CtsInterpolationCounts *made, CtsReport *report)
{
    const bool is_hu = v->quantity == CTS_QUANTITY_HU;
    const double difference = made->sum_of_differences_hu / (double)made->n_moved;
    if (made->no_memory)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_SLICES_NOT_SHAPED,
            "not enough memory for shape-based interpolation between slices, so terraces may be visible "
            "(free some memory, or crop)");
    else if (made->n_moved > 0)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_SLICES_MOVED,
            "shape-based interpolation displaced %.1f %% of the voxels between slices; they differ from "
            "linear interpolation by %.3g%s%s on average",
            100 * (double)made->n_moved / (double)made->n_voxels, is_hu ? round(difference) : difference,
            *cts_quantity_units[v->quantity] ? " " : "", cts_quantity_units[v->quantity]);
}

/* Crop of the air that table removal left around the patient. Beside crops_air (cts_render_ignores_air()), it stays
 * where labels may give it an opacity, and where minip and average lack the body mask that would exclude it. */
static void crop_air(const CtsSource *source, bool shows_air, CtsModel *model, CtsReport *report)
{
    const CtsVolume *const v = model->volume;
    const int before[3] = {cts_volume_extent(v, 0), cts_volume_extent(v, 1), cts_volume_extent(v, 2)};
    if (v->quantity != CTS_QUANTITY_HU || !source->remove_table || !source->crops_air || shows_air ||
        !(model->body || source->without_body))
        return;
    cts_model_crop_air(model);
    if (memcmp(before, v->dims, sizeof before) != 0)
        cts_report_skip(report, "air around the patient", "of %d x %d x %d voxels %d x %d x %d contain the patient",
                        before[0], before[1], before[2], v->dims[0], v->dims[1], v->dims[2]);
}

/* The field between voxels: less noise, and no terraces between thick slices. */
static CtsStatus interpolate_slices(const CtsSource *source, bool shows_air, CtsModel *model,
                                    CtsInterpolationCounts *made, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const CtsVolume *const v = model->volume;
    if (source->smooth_mm > 0 && (st = cts_model_smooth(model, source->smooth_mm, source->n_threads, err)))
        return st;
    if (source->smooth_mm > 0)
        cts_report_plan(report, "smoothing: a Gaussian of %g mm standard deviation", source->smooth_mm);
    crop_air(source, shows_air, model, report);
    const double start_ms = cts_wall_ms(), slice_mm = cts_volume_spacing_mm(v, 2);
    const int n_parts = cts_volume_layers_per_slice(v), n_slices = v->dims[2];
    if (source->interpolation == CTS_INTERPOLATION_LINEAR || n_parts == 1) {
        cts_report_skip(report, "layers between slices",
                        n_parts == 1 ? "slices lie no further apart than 1.5 pixels"
                                     : "linear interpolation between slices was requested");
        cts_volume_fit_memory(model->volume);
        report_interpolation(v, made, report);
        return CTS_OK;
    }
    CtsError why = {0};
    st = cts_model_interpolate(model, n_parts, source->interpolation, source->n_threads, made, &why);
    if (st == CTS_ERR_MEMORY) {
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SLICES_LINEAR,
                              "slices %.3g mm apart are interpolated linearly, so terraces may be visible: %s",
                              slice_mm, why.text);
        return CTS_OK;
    }
    if (st) {
        *err = why;
        return st;
    }
    cts_report_plan(report, "slices %.3g mm apart: %d layers between two by cubic interpolation%s, %d layers in total",
                    slice_mm, n_parts - 1, source->interpolation == CTS_INTERPOLATION_SHAPE ? " along shapes" : "",
                    v->dims[2]);
    cts_report_diagnostic(report, CTS_DIAGNOSTIC_SLICES_CUBIC, "%d slices became %d layers by interpolation in %.0f ms",
                          n_slices, v->dims[2], cts_wall_ms() - start_ms);
    report_interpolation(v, made, report);
    return CTS_OK;
}

/* After table removal, which needs the whole volume to distinguish table and patient. */
static CtsStatus process_model(const CtsSource *source, bool shows_air, CtsModel *model, CtsInterpolationCounts *made,
                               CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (source->crop.given)
        st = cts_model_crop(model, source->crop.low_lps, source->crop.high_lps, err);
    if (st || (st = interpolate_slices(source, shows_air, model, made, report, err)))
        return st;
    const CtsStageTimer meter = cts_stage_timer_start(report);
    st = cts_model_prepare(model, source->n_threads, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_GREY);
    return st;
}

static CtsStatus need_labels(const CtsLabelChoice *c, CtsError *err)
{
    const char *const asked = c->show            ? "show"
                              : c->hide          ? "hide"
                              : c->n_appearances ? "label"
                              : c->own_colours   ? "label-colours"
                              : c->order         ? "label-order"
                                                 : NULL;
    return asked ? cts_fail(err, CTS_ERR_USAGE,
                            "`%s`: there are no labels (give `labels` PATH, or auto; a presentation state holds none)",
                            asked)
                 : CTS_OK;
}

/* After all changes of the volume, which would drop the labels. */
static CtsStatus take_labels(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    if (!loaded->labels || !loaded->labels->counted)
        return need_labels(&source->choice, err);
    const CtsStageTimer meter = cts_stage_timer_start(report);
    const CtsStatus st =
        cts_model_take_labels(&loaded->model, loaded->labels, &source->choice, source->n_threads, report, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_LABELS);
    return st;
}

CtsStatus cts_source_labels(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    const CtsLabelRequest request = {.paths = source->labels,
                                     .n_paths = source->n_labels,
                                     .names = source->label_names,
                                     .unnamed = source->labels_unnamed,
                                     .listed = source->labels_listed,
                                     .archives = source->archives,
                                     .series_paths = source->from ? NULL : source->paths,
                                     .n_series_paths = source->from ? 0 : source->n_paths};
    cts_labels_free(&loaded->labels);
    if (!source->n_labels)
        return need_labels(&source->choice, err);
    if (!loaded->series->renderable)
        return CTS_OK;
    const CtsStageTimer meter = cts_stage_timer_start(report);
    const CtsStatus st = cts_labels_read(&request, loaded->series, &loaded->labels, report, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_LABELS);
    return st;
}

CtsStatus cts_source_read(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    CtsLabels *const labels = loaded->labels && !loaded->labels->counted ? loaded->labels : NULL;
    const CtsWordWatch watch = {labels ? cts_labels_take_words : NULL, labels, source->stop};
    cts_model_free(&loaded->model);
    cts_scanned_free(&loaded->scanned);
    CtsStatus st = labels ? cts_labels_begin(labels, err) : CTS_OK;
    if (!st)
        st = cts_series_scan(loaded->series, &watch, source->n_threads, &loaded->scanned, report, err);
    if (st || !labels)
        return st;
    const CtsStageTimer meter = cts_stage_timer_start(report);
    st = cts_labels_count(labels, loaded->scanned->number, loaded->scanned->n_slices, report, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_LABELS);
    return st;
}

void cts_source_report_fill(const CtsSource *source, const CtsScanned *scanned, CtsReport *report)
{
    double hu;
    /* If the rescale intercept is lost, air has the value of a filling. */
    const bool is_shifted = report && cts_diagnostics_find(&report->diagnostics, CTS_DIAGNOSTIC_HU_IMPLAUSIBLE);
    if (!source->fill.given && !is_shifted && cts_scanned_find_fill(scanned, &hu))
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_CONSTANT_FILL,
            "voxels at the border of the volume have exactly %g HU, a usual filling value outside the "
            "scan, and count as tissue (`fill` %g turns them into air)",
            hu, hu);
}

/* The filling becomes air before layers are put between slices. */
static CtsStatus clear_fill(const CtsSource *source, CtsScanned *scanned, CtsReport *report, CtsError *err)
{
    uint64_t n;
    const CtsStageTimer meter = cts_stage_timer_start(report);
    const CtsStatus st = cts_scanned_clear_fill(scanned, source->fill.hu, source->n_threads, &n, err);
    cts_stage_timer_stop(meter, report, CTS_STAGE_GREY);
    if (!st)
        cts_report_diagnostic(
            report, n ? CTS_DIAGNOSTIC_FILL_CLEARED : CTS_DIAGNOSTIC_FILL_MISSING,
            "filling: %llu voxels of exactly %g HU that are connected to the border were turned into air",
            (unsigned long long)n, source->fill.hu);
    return st;
}

/* Without memory for both, the slices become the volume in any case. */
static CtsStatus make_volume(const CtsSource *source, CtsScanned *scanned, bool last, CtsVolume **volume,
                             CtsInterpolationCounts *made, CtsError *err)
{
    CtsStatus st = CTS_ERR_MEMORY;
    if (!last)
        st = cts_scanned_volume(scanned, source->interpolation, false, source->n_threads, volume, made, NULL);
    if (st == CTS_ERR_MEMORY)
        st = cts_scanned_volume(scanned, source->interpolation, true, source->n_threads, volume, made, err);
    return st;
}

/* Layers that are made only where crop_air() keeps them. */
static CtsStatus make_layers(const CtsSource *source, CtsScanned *scanned, const CtsTableSearch *found, bool last,
                             bool crops, CtsVolume **volume, CtsInterpolationCounts *made, CtsError *err)
{
    int low[3], high[3];
    CtsStatus st = CTS_ERR_MEMORY;
    if (crops) {
        cts_table_kept_box(found, scanned->even, low, high);
        st = cts_scanned_box(scanned, source->interpolation, low, high, last, source->n_threads, volume, made, NULL);
    }
    return st == CTS_ERR_MEMORY ? make_volume(source, scanned, last, volume, made, err) : st;
}

/* Unevenly spaced slices become layers after the search for the table: shape-based interpolation would displace a plate
 * that is cut obliquely like a surface; linear interpolation does not. */
static CtsStatus make_volume_without_table(const CtsSource *source, CtsScanned *scanned, bool last, bool crops,
                                           CtsModel *model, CtsInterpolationCounts *made, CtsReport *report,
                                           CtsError *err)
{
    CtsTableSearch *found;
    const bool uneven = scanned->layer && scanned->even->grey && source->interpolation != CTS_INTERPOLATION_LINEAR;
    const CtsLinearLayers layers = cts_scanned_linear_layers(scanned);
    CtsStatus st = uneven ? CTS_OK : make_volume(source, scanned, last, &model->volume, made, err);
    if (st || (st = cts_table_search(uneven ? scanned->even : model->volume, uneven ? &layers : NULL,
                                     !source->without_body, source->n_threads, &found, report, err)))
        return st;
    if (uneven)
        st = make_layers(source, scanned, found, last, crops, &model->volume, made, err);
    if (!st && crops && !uneven)
        cts_table_crop(found, model);
    else if (!st)
        cts_table_clear(found, model, report);
    cts_table_search_free(&found);
    return st;
}

static CtsStatus view(const CtsSource *source, CtsScanned *scanned, bool last, CtsLoaded *loaded, CtsReport *report,
                      CtsError *err)
{
    CtsStatus st;
    double low[3], high[3];
    CtsInterpolationCounts made = {0};
    CtsModel *const model = &loaded->model;
    const bool shows_air = loaded->labels && cts_labels_show_air(&source->choice);
    /* One step with table removal, after which crop_air() sees the volume as it is. Smoothing and another crop
     * first see the whole volume. */
    const bool crops = source->crops_air && !shows_air && !source->crop.given && !(source->smooth_mm > 0) &&
                       scanned->even->quantity == CTS_QUANTITY_HU;
    cts_volume_box_lps(scanned->even, low, high);
    cts_report_plan(report, "volume: %.1f,%.1f,%.1f,%.1f,%.1f,%.1f mm, as a crop takes it", low[0], high[0], low[1],
                    high[1], low[2], high[2]);
    if (!source->remove_table) {
        cts_report_skip(report, "table removal", "off by %s", source->table_kept_by);
        st = make_volume(source, scanned, last, &model->volume, &made, err);
    } else
        st = make_volume_without_table(source, scanned, last, crops, model, &made, report, err);
    if (!st)
        st = process_model(source, shows_air, model, &made, report, err);
    return st ? st : take_labels(source, loaded, report, err);
}

CtsStatus cts_source_view(const CtsSource *asked, bool last, CtsLoaded *loaded, CtsReport *report, CtsError *err)
{
    CtsScanned *cleared = NULL;
    CtsSource source = *asked;
    cts_model_free(&loaded->model);
    loaded->noise_hu = cts_scanned_noise_hu(loaded->scanned);
    if (source.smooth_mm == CTS_SMOOTH_AUTO) {
        source.smooth_mm = loaded->noise_hu > CTS_NOISY_HU ? CTS_SMOOTH_NOISE_MM : 0;
        cts_report_plan(report, "noise of soft tissue: %.0f HU (smoothed above %d HU)", loaded->noise_hu, CTS_NOISY_HU);
    }
    cts_source_report_fill(&source, loaded->scanned, report);
    if (!source.fill.given)
        return view(&source, loaded->scanned, last, loaded, report, err);
    /* Other volumes need the slices as scanned; without memory for both they are read again. */
    CtsStatus st = last ? CTS_ERR_MEMORY : cts_scanned_copy(loaded->scanned, &cleared, NULL);
    if (!st || st == CTS_ERR_MEMORY) {
        CtsScanned *const scanned = cleared ? cleared : loaded->scanned;
        st = clear_fill(&source, scanned, report, err);
        if (!st)
            st = view(&source, scanned, true, loaded, report, err);
    }
    cts_scanned_free(&cleared);
    return st;
}

CtsStatus cts_source_find(const CtsSource *source, const CtsWatch *watch, int n_steps, CtsLoaded *loaded,
                          CtsReport *report, CtsError *err)
{
    const CtsStageTimer meter = cts_stage_timer_start(report);
    cts_watch_step(watch, 0, n_steps, source->from ? "fetching" : "searching");
    const CtsStatus st = find_series_of_source(source, loaded, report, err);
    cts_watch_diagnostics(watch, report);
    cts_stage_timer_stop(meter, report, CTS_STAGE_SCAN);
    if (loaded->list && watch->found)
        watch->found(watch->context, loaded->list);
    return st;
}

CtsStatus cts_source_scan(const CtsSource *source, const CtsWatch *watch, int n_steps, CtsLoaded *loaded,
                          CtsReport *report, CtsError *err)
{
    CtsStatus st = loaded->series ? CTS_OK : cts_source_find(source, watch, n_steps, loaded, report, err);
    if (st)
        return st;
    const CtsStageTimer meter = cts_stage_timer_start(report);
    cts_watch_step(watch, 1, n_steps, "reading");
    if (!(st = cts_source_labels(source, loaded, report, err)))
        st = cts_source_read(source, loaded, report, err);
    cts_watch_diagnostics(watch, report);
    cts_stage_timer_stop(meter, report, CTS_STAGE_DECODE);
    return st;
}

void cts_loaded_free(CtsLoaded *loaded)
{
    cts_model_free(&loaded->model);
    cts_scanned_free(&loaded->scanned);
    cts_labels_free(&loaded->labels);
    cts_series_list_free(&loaded->list);
    cts_net_fetched_remove(&loaded->fetched);
    loaded->series = NULL;
}
