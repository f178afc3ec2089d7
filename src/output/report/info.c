#include "output/report/info.h"

#include "base/json.h"
#include "output/report/masked.h"
#include "output/report/text_table.h"
#include <stdlib.h>
#include <string.h>

/* told: what stands above already; NULL: nothing. */
static void print_findings(FILE *file, const CtsFindings *findings, const char *indent, const char *told)
{
    for (size_t i = 0; i < findings->n; i++) {
        if (told && !strcmp(findings->items[i].text, told))
            continue;
        fprintf(file, "%s%s: %s\n", indent, cts_severity_names[findings->items[i].severity], findings->items[i].text);
    }
}

static void print_labels(FILE *file, const CtsPixelFacts *f)
{
    CtsTable *table = cts_table_new(
        (const char *const[]){">label", "name", "source", ">voxels", ">ml", ">mean HU", ">sd HU", ">parts", ""}, 9);
    for (size_t i = 0; i < f->n_labels; i++) {
        const CtsLabelFact *l = &f->labels[i];
        cts_table_cell(table, "%d", l->number);
        cts_table_cell(table, "%s", l->name);
        cts_table_cell(table, "%s", cts_label_source_names[l->source]);
        cts_table_cell(table, "%llu", (unsigned long long)l->voxels);
        cts_table_cell(table, "%.1f", l->ml);
        cts_table_cell(table, l->n_hu ? "%.1f" : "-", l->hu_mean);
        cts_table_cell(table, l->n_hu ? "%.1f" : "-", l->hu_sd);
        cts_table_cell(table, "%llu", (unsigned long long)l->parts);
        cts_table_cell(table, "%s%s%s%s", l->voxels ? "" : "empty ", l->touches_edge ? "edge " : "",
                       l->overlap ? "overlap " : "", l->in_air ? "in air" : "");
    }
    cts_table_print(table, file);
    cts_table_free(&table);
}

static void print_series(FILE *file, const CtsSeries *s, const CtsPixelFacts *f, bool show_patient)
{
    fprintf(file, "series %s\n", s->uid[0] ? s->uid : "(without UID)");
    fprintf(file, "  modality         %s\n", s->modality);
    if (show_patient && s->study_date[0])
        fprintf(file, "  study date       %s\n", s->study_date);
    if (show_patient && s->series_number >= 0)
        fprintf(file, "  series number    %d\n", s->series_number);
    if (show_patient && s->description)
        fprintf(file, "  description      %s\n", s->description);
    fprintf(file, "  slices           %d of %d x %d pixels, %s\n", s->n_slices, s->columns, s->rows, s->orientation);
    fprintf(file, "  spacing          %.4g x %.4g", s->spacing_mm[0], s->spacing_mm[1]);
    if (s->spacing_mm[2] > 0)
        fprintf(file, " x %.4g", s->spacing_mm[2]);
    fprintf(file, " mm\n");
    fprintf(file, "  tilt             %.2f degrees\n", s->tilt_deg);
    if (f->known) {
        fprintf(file, "  range            %.6g to %.6g HU\n", f->hu_min, f->hu_max);
        fprintf(file, "  box              %.1f,%.1f,%.1f,%.1f,%.1f,%.1f mm (as a crop takes it)\n", f->box_low_lps[0],
                f->box_high_lps[0], f->box_low_lps[1], f->box_high_lps[1], f->box_low_lps[2], f->box_high_lps[2]);
    }
    fprintf(file, "  transfer syntax  %s\n", s->transfer_syntax);
    const char *told = s->renderable && !f->refused ? NULL : s->renderable ? f->reason : s->reason;
    fprintf(file, "  renderable       %s%s\n", s->passed ? "no, passed: " : told ? "no: " : "yes", told ? told : "");
    print_findings(file, &s->findings, "  ", told);
    print_findings(file, &f->findings, "  ", told);
    if (f->n_labels)
        print_labels(file, f);
    else if (f->has_labels)
        fprintf(file, "  labels           none\n");
}

void cts_info_print(FILE *file, const CtsSeriesList *list, const CtsPixelFacts *facts, bool show_patient)
{
    char others[1000];
    cts_series_list_others(list, others, sizeof others);
    fprintf(file, "%d files: %zu CT series, %d files passed over%s%s%s, %d not readable\n", list->n_files, list->n,
            list->n_not_ct, others[0] ? " (" : "", others, others[0] ? ")" : "", list->n_unreadable);
    print_findings(file, &list->findings, "", NULL);
    for (size_t i = 0; i < list->n; i++) {
        fputc('\n', file);
        print_series(file, &list->items[i], &facts[i], show_patient);
    }
}

void cts_pixel_facts(CtsPixelFacts *facts, const CtsVolume *volume)
{
    facts->known = true;
    facts->hu_min = volume->hu_min;
    facts->hu_max = volume->hu_max;
    cts_volume_box_lps(volume, facts->box_low_lps, facts->box_high_lps);
}

json_t *cts_finding_json(const CtsFinding *finding)
{
    return json_pack("{s:o,s:s,s:o}", "code", cts_json_new_text(finding->code), "severity",
                     cts_severity_names[finding->severity], "text", cts_json_new_text(finding->text));
}

json_t *cts_label_json(const CtsLabelFact *l)
{
    json_t *object =
        json_pack("{s:i,s:o,s:s,s:I,s:o}", "number", l->number, "name", cts_json_new_text(l->name), "source",
                  cts_label_source_names[l->source], "voxels", (json_int_t)l->voxels, "ml", cts_json_new_number(l->ml));
    json_object_set_new(object, "hu_mean", l->n_hu ? cts_json_new_number(l->hu_mean) : json_null());
    json_object_set_new(object, "hu_sd", l->n_hu ? cts_json_new_number(l->hu_sd) : json_null());
    json_object_set_new(object, "touches_edge", json_boolean(l->touches_edge));
    json_object_set_new(object, "parts", json_integer((json_int_t)l->parts));
    json_object_set_new(object, "overlap", json_integer((json_int_t)l->overlap));
    json_object_set_new(object, "empty", json_boolean(!l->voxels));
    json_object_set_new(object, "label_in_air", json_boolean(l->in_air));
    json_object_set_new(object, "file", json_integer(l->file));
    return object;
}

json_t *cts_table_json(const CtsTableFact *t)
{
    return json_pack("{s:o,s:o,s:o}", "body_ml", cts_json_new_number(t->body_mm3 / 1000), "removed_ml",
                     cts_json_new_number(t->removed_mm3 / 1000), "lost_percent",
                     cts_json_new_number(100 * t->thick_mm3 / t->body_mm3));
}

static void append_findings(json_t *list, const CtsFindings *findings)
{
    for (size_t i = 0; i < findings->n; i++)
        json_array_append_new(list, cts_finding_json(&findings->items[i]));
}

json_t *cts_info_json(const CtsSeries *s, const CtsPixelFacts *f, bool show_patient)
{
    json_t *object = json_object(), *findings = json_array();
    json_object_set_new(object, "series_uid", cts_json_new_text(s->uid));
    json_object_set_new(object, "modality", cts_json_new_text(s->modality));
    char *study = s->study_uid[0] ? cts_uid_hash(NULL, s->study_uid) : NULL;
    json_object_set_new(object, "study", study ? json_string(study) : json_null());
    free(study);
    if (show_patient) {
        json_object_set_new(object, "study_date", s->study_date[0] ? json_string(s->study_date) : json_null());
        json_object_set_new(object, "series_number",
                            s->series_number < 0 ? json_null() : json_integer(s->series_number));
        json_object_set_new(object, "description", s->description ? cts_json_new_text(s->description) : json_null());
    }
    json_object_set_new(object, "slices", json_integer(s->n_slices));
    json_object_set_new(object, "dims", json_pack("[i,i,i]", s->columns, s->rows, s->n_slices));
    json_t *spacing_mm = json_array();
    for (int axis = 0; axis < 3; axis++)
        json_array_append_new(spacing_mm,
                              s->spacing_mm[axis] > 0 ? cts_json_new_number(s->spacing_mm[axis]) : json_null());
    json_object_set_new(object, "spacing_mm", spacing_mm);
    json_object_set_new(object, "tilt_deg", cts_json_new_number(s->tilt_deg));
    json_object_set_new(object, "hu_min", f->known ? cts_json_new_number(f->hu_min) : json_null());
    json_object_set_new(object, "hu_max", f->known ? cts_json_new_number(f->hu_max) : json_null());
    json_object_set_new(object, "box_mm",
                        f->known ? json_pack("[f,f,f,f,f,f]", f->box_low_lps[0], f->box_high_lps[0], f->box_low_lps[1],
                                             f->box_high_lps[1], f->box_low_lps[2], f->box_high_lps[2])
                                 : json_null());
    json_object_set_new(object, "transfer_syntax", cts_json_new_text(s->transfer_syntax));
    json_object_set_new(object, "orientation", cts_json_new_text(s->orientation));
    json_object_set_new(object, "renderable", json_boolean(s->renderable && !f->refused));
    json_object_set_new(object, "passed", json_boolean(s->passed));
    append_findings(findings, &s->findings);
    append_findings(findings, &f->findings);
    json_object_set_new(object, "findings", findings);
    json_t *labels = f->has_labels ? json_array() : NULL;
    for (size_t i = 0; i < f->n_labels; i++)
        json_array_append_new(labels, cts_label_json(&f->labels[i]));
    if (labels)
        json_object_set_new(object, "labels", labels);
    return object;
}

CtsStatus cts_info_print_json(FILE *file, const CtsSeriesList *list, const CtsPixelFacts *facts, bool show_patient,
                              CtsError *err)
{
    json_t *root = json_object(), *series = json_array(), *findings = json_array();
    for (size_t i = 0; i < list->n; i++)
        json_array_append_new(series, cts_info_json(&list->items[i], &facts[i], show_patient));
    append_findings(findings, &list->findings);
    json_object_set_new(root, "series", series);
    json_t *others = json_object();
    for (size_t i = 0; i < list->n_others; i++)
        json_object_set_new(others, list->others[i].what, json_integer(list->others[i].n));
    json_object_set_new(root, "files",
                        json_pack("{s:i,s:i,s:i,s:o}", "seen", list->n_files, "not_ct", list->n_not_ct, "unreadable",
                                  list->n_unreadable, "others", others));
    json_object_set_new(root, "findings", findings);
    char *text = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    json_decref(root);
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    fprintf(file, "%s\n", text);
    free(text);
    return CTS_OK;
}
