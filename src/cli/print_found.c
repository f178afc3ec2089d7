#include "cli/print_found.h"

#include "base/json.h"
#include "base/text.h"
#include "cli/print_json.h"
#include <stdio.h>
#include <string.h>

/* A peer's words drive no terminal. */
static void print_text(const char *name, const char *text)
{
    char clean[80];
    snprintf(clean, sizeof clean, "%s", text);
    cts_text_clean(clean);
    printf("  %-16s %s\n", name, clean);
}

void cli_print_found(const CtsFound *found, bool show_patient)
{
    printf("%d series found\n", found->n);
    for (int i = 0; i < found->n; i++) {
        const CtsFoundSeries *s = &found->items[i];
        printf("\nseries %s\n", s->series_uid);
        print_text("study", s->study_uid);
        print_text("modality", s->modality);
        if (s->n_objects)
            printf("  %-16s %d\n", "objects", s->n_objects);
        if (show_patient)
            print_text("study date", s->study_date);
        if (show_patient)
            print_text("description", s->description);
    }
}

static json_t *series_json(const CtsFoundSeries *s, bool show_patient)
{
    json_t *object = json_object();
    json_object_set_new(object, "series_uid", json_string(s->series_uid));
    json_object_set_new(object, "study_uid", json_string(s->study_uid));
    json_object_set_new(object, "modality", cts_json_new_text(s->modality));
    json_object_set_new(object, "objects", s->n_objects ? json_integer(s->n_objects) : json_null());
    if (show_patient) {
        json_object_set_new(object, "study_date", cts_json_new_text(s->study_date));
        json_object_set_new(object, "description", cts_json_new_text(s->description));
    }
    return object;
}

CtsStatus cli_print_found_json(const CtsFound *found, bool show_patient, CtsError *err)
{
    json_t *root = json_object(), *series = json_array();
    for (int i = 0; i < found->n; i++)
        json_array_append_new(series, series_json(&found->items[i], show_patient));
    json_object_set_new(root, "series", series);
    return cli_print_json(root, err);
}
