#include "output/report/info.h"

#include "base/json.h"
#include "output/report/redact.h"
#include "output/report/text_table.h"
#include <stdlib.h>
#include <string.h>

/* printed: a text that is printed already; NULL: none. */
static void print_diagnostics(FILE *file, const CtsDiagnostics *diagnostics, const char *indent, const char *printed)
{
    for (size_t i = 0; i < diagnostics->n; i++) {
        if (printed && !strcmp(diagnostics->items[i].text, printed))
            continue;
        fprintf(file, "%s%s: %s\n", indent, cts_severity_names[diagnostics->items[i].severity],
                diagnostics->items[i].text);
    }
}

static void print_labels(FILE *file, const CtsPixelFacts *f)
{
    CtsTable *table = cts_table_new(">label\tname\tsource\t>voxels\t>ml\t>mean HU\t>sd HU\t>parts\t");
    for (size_t i = 0; i < f->n_labels; i++) {
        const CtsLabelFact *l = &f->labels[i];
        char hu[80] = "-\t-";
        if (l->n_hu)
            snprintf(hu, sizeof hu, "%.1f\t%.1f", l->hu_mean, l->hu_sd);
        cts_table_row(table, "%d\t%.255s\t%s\t%llu\t%.1f\t%s\t%llu\t%s%s%s%s", l->number, l->name,
                      cts_label_source_names[l->source], (unsigned long long)l->voxels, l->ml, hu,
                      (unsigned long long)l->parts, l->voxels ? "" : "empty ", l->touches_edge ? "edge " : "",
                      l->overlap ? "overlap " : "", l->in_air ? "in air" : "");
    }
    cts_table_print(table, file);
    cts_table_free(&table);
}

static void print_series(FILE *file, int number, const CtsSeries *s, const CtsPixelFacts *f, bool show_patient)
{
    const bool is_hu = s->quantity == CTS_QUANTITY_HU;
    const char *const unit = cts_quantity_units[s->quantity];
    fprintf(file, "series %s\n", s->uid[0] ? s->uid : "(without UID)");
    fprintf(file, "  number           %d (for --series)\n  modality         %s\n", number, s->modality);
    if (show_patient && s->study_date[0])
        fprintf(file, "  study date       %s\n", s->study_date);
    if (show_patient && s->series_number >= 0)
        fprintf(file, "  series number    %d\n", s->series_number);
    if (show_patient && s->description)
        fprintf(file, "  description      %s\n", s->description);
    fprintf(file, "  slices           %d of %d x %d pixels%s%s\n", s->n_slices, s->columns, s->rows,
            s->orientation[0] ? ", " : "", s->orientation);
    if (s->spacing_mm[0] > 0) {
        fprintf(file, "  spacing          %.4g x %.4g", s->spacing_mm[0], s->spacing_mm[1]);
        if (s->spacing_mm[2] > 0)
            fprintf(file, " x %.4g", s->spacing_mm[2]);
        fprintf(file, " mm\n");
        fprintf(file, "  distinguished by %s\n", s->traits);
        fprintf(file, "  tilt             %.2f degrees\n", s->tilt_deg);
    }
    if (f->known) {
        fprintf(file, "  range            %.6g to %.6g %s%s%s%s\n", f->hu_min, f->hu_max, unit,
                is_hu   ? ""
                : *unit ? " ("
                        : "(",
                is_hu ? "" : cts_quantity_names[s->quantity], is_hu ? "" : ")");
        fprintf(file, "  box              %.1f,%.1f,%.1f,%.1f,%.1f,%.1f mm (as a crop takes it)\n", f->box_low_lps[0],
                f->box_high_lps[0], f->box_low_lps[1], f->box_high_lps[1], f->box_low_lps[2], f->box_high_lps[2]);
    }
    fprintf(file, "  transfer syntax  %s\n", s->transfer_syntax);
    const char *printed = s->renderable && !f->refused ? NULL : s->renderable ? f->reason : s->reason;
    fprintf(file, "  renderable       %s%s\n", printed ? "no: " : "yes", printed ? printed : "");
    print_diagnostics(file, &s->diagnostics, "  ", printed);
    print_diagnostics(file, &f->diagnostics, "  ", printed);
    if (f->n_labels)
        print_labels(file, f);
    else if (f->has_labels)
        fprintf(file, "  labels           none\n");
}

void cts_info_print(FILE *file, const CtsSeriesList *list, const CtsPixelFacts *facts, bool show_patient)
{
    char others[1000];
    cts_series_list_others(list, others, sizeof others);
    fprintf(file, "%d file%s: %zu series, %d passed over%s%s%s, %d not readable\n", list->n_files,
            list->n_files == 1 ? "" : "s", list->n, list->n_not_ct, others[0] ? " (" : "", others, others[0] ? ")" : "",
            list->n_unreadable);
    print_diagnostics(file, &list->diagnostics, "", NULL);
    for (size_t i = 0; i < list->n; i++) {
        if (facts[i].left_out)
            continue;
        fputc('\n', file);
        print_series(file, (int)i + 1, &list->items[i], &facts[i], show_patient);
    }
}

void cts_pixel_facts(CtsPixelFacts *facts, const CtsVolume *volume)
{
    facts->known = true;
    facts->hu_min = volume->hu_min;
    facts->hu_max = volume->hu_max;
    cts_volume_box_lps(volume, facts->box_low_lps, facts->box_high_lps);
}

bool cts_diagnostics_have(const CtsDiagnostics *diagnostics, const CtsDiagnostic *diagnostic)
{
    for (size_t i = 0; i < diagnostics->n; i++)
        if (diagnostics->items[i].id == diagnostic->id && !strcmp(diagnostics->items[i].text, diagnostic->text))
            return true;
    return false;
}

json_t *cts_diagnostic_json(const CtsDiagnostic *diagnostic)
{
    return json_pack("{s:o,s:s,s:o}", "code", cts_json_new_text(diagnostic->code), "severity",
                     cts_severity_names[diagnostic->severity], "text", cts_json_new_text(diagnostic->text));
}

static json_t *number_if(bool known, double number)
{
    return known ? cts_json_new_number(number) : json_null();
}

static json_t *text_if(const char *text)
{
    return text && text[0] ? cts_json_new_text(text) : json_null();
}

json_t *cts_label_json(const CtsLabelFact *l)
{
    return json_pack("{s:i,s:o,s:s,s:I,s:o,s:o,s:o,s:b,s:I,s:I,s:b,s:b,s:i}", "number", l->number, "name",
                     cts_json_new_text(l->name), "source", cts_label_source_names[l->source], "voxels",
                     (json_int_t)l->voxels, "ml", cts_json_new_number(l->ml), "hu_mean", number_if(l->n_hu, l->hu_mean),
                     "hu_sd", number_if(l->n_hu, l->hu_sd), "touches_edge", l->touches_edge, "parts",
                     (json_int_t)l->parts, "overlap", (json_int_t)l->overlap, "empty", !l->voxels, "label_in_air",
                     l->in_air, "file", l->file);
}

json_t *cts_table_json(const CtsTableFact *t)
{
    return json_pack("{s:o,s:o,s:o}", "body_ml", cts_json_new_number(t->body_mm3 / 1000), "removed_ml",
                     cts_json_new_number(t->removed_mm3 / 1000), "lost_percent",
                     cts_json_new_number(100 * t->thick_mm3 / t->body_mm3));
}

static void append_diagnostics(json_t *list, const CtsDiagnostics *diagnostics)
{
    for (size_t i = 0; i < diagnostics->n; i++)
        json_array_append_new(list, cts_diagnostic_json(&diagnostics->items[i]));
}

json_t *cts_info_json(const CtsSeries *s, const CtsPixelFacts *f, bool show_patient)
{
    const bool is_hu = s->quantity == CTS_QUANTITY_HU;
    char *study = s->study_uid[0] ? cts_uid_hash(NULL, s->study_uid) : NULL;
    json_t *diagnostics = json_array(), *labels = f->has_labels ? json_array() : NULL;
    append_diagnostics(diagnostics, &s->diagnostics);
    append_diagnostics(diagnostics, &f->diagnostics);
    for (size_t i = 0; i < f->n_labels; i++)
        json_array_append_new(labels, cts_label_json(&f->labels[i]));
    json_t *object = json_pack(
        "{s:o,s:o,s:o,s:o,s:i,s:[i,i,i],s:[o,o,o],s:o,s:o*,s:o*,s:o,s:o,s:o,s:b,s:b,s:o,s:o*}", "series_uid",
        cts_json_new_text(s->uid), "traits", cts_json_new_text(s->traits), "modality", cts_json_new_text(s->modality),
        "study", text_if(study), "slices", s->n_slices, "dims", s->columns, s->rows, s->n_slices, "spacing_mm",
        number_if(s->spacing_mm[0] > 0, s->spacing_mm[0]), number_if(s->spacing_mm[1] > 0, s->spacing_mm[1]),
        number_if(s->spacing_mm[2] > 0, s->spacing_mm[2]), "tilt_deg", cts_json_new_number(s->tilt_deg), "hu_min",
        is_hu ? number_if(f->known, f->hu_min) : NULL, "hu_max", is_hu ? number_if(f->known, f->hu_max) : NULL,
        "box_mm",
        f->known ? json_pack("[f,f,f,f,f,f]", f->box_low_lps[0], f->box_high_lps[0], f->box_low_lps[1],
                             f->box_high_lps[1], f->box_low_lps[2], f->box_high_lps[2])
                 : json_null(),
        "transfer_syntax", cts_json_new_text(s->transfer_syntax), "orientation", text_if(s->orientation), "renderable",
        s->renderable && !f->refused, "passed", s->passed, "findings", diagnostics, "labels", labels);
    json_object_update_new(object,
                           json_pack("{s:s,s:s,s:o,s:o}", "quantity", cts_quantity_names[s->quantity], "unit",
                                     cts_quantity_units[s->quantity], "value_min", number_if(f->known, f->hu_min),
                                     "value_max", number_if(f->known, f->hu_max)));
    if (show_patient)
        json_object_update_new(object, json_pack("{s:o,s:o,s:o}", "study_date", text_if(s->study_date), "series_number",
                                                 s->series_number < 0 ? json_null() : json_integer(s->series_number),
                                                 "description",
                                                 s->description ? cts_json_new_text(s->description) : json_null()));
    free(study);
    return object;
}

json_t *cts_info_list_json(const CtsSeriesList *list, const CtsPixelFacts *facts, bool show_patient)
{
    json_t *series = json_array(), *diagnostics = json_array(), *others = json_object();
    for (size_t i = 0; i < list->n; i++)
        if (!facts[i].left_out)
            json_array_append_new(series, cts_info_json(&list->items[i], &facts[i], show_patient));
    append_diagnostics(diagnostics, &list->diagnostics);
    for (size_t i = 0; i < list->n_others; i++)
        json_object_set_new(others, list->others[i].what, json_integer(list->others[i].n));
    return json_pack("{s:o,s:{s:i,s:i,s:i,s:o},s:o}", "series", series, "files", "seen", list->n_files, "not_ct",
                     list->n_not_ct, "unreadable", list->n_unreadable, "others", others, "findings", diagnostics);
}
