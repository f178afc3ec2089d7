/* Output of `ctsplat info`, as text and as JSON. */
#pragma once

#include "ctsplat/series.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stdio.h>

/* Facts that need the pixels. */
typedef struct CtsPixelFacts {
    bool left_out; /* the series was not asked for, and is not printed */
    bool known;    /* the pixels were read: */
    double hu_min, hu_max;
    double box_low_lps[3], box_high_lps[3]; /* mm: as used by a crop */
    bool refused;                           /* reading them failed: */
    char reason[1024];
    CtsLabelFact *labels; /* n_labels of them where has_labels; a report's */
    size_t n_labels;
    bool has_labels;
    CtsDiagnostics diagnostics; /* of reading them, the series' own left out; owned */
} CtsPixelFacts;

/* Fills in the facts from the volume. */
void cts_pixel_facts(CtsPixelFacts *facts, const CtsVolume *volume);

/* True if an equal finding is in the list. */
bool cts_diagnostics_have(const CtsDiagnostics *diagnostics, const CtsDiagnostic *diagnostic);
struct json_t *cts_diagnostic_json(const CtsDiagnostic *diagnostic);
struct json_t *cts_label_json(const CtsLabelFact *label);
struct json_t *cts_table_json(const CtsTableFact *table);
/* One series as in info's JSON, with its findings; the caller's to release. */
struct json_t *cts_info_json(const CtsSeries *series, const CtsPixelFacts *facts, bool show_patient);

/* facts: one for each series of the list. */
void cts_info_print(FILE *file, const CtsSeriesList *list, const CtsPixelFacts *facts, bool show_patient);
/* The caller's to release; NULL without memory. */
struct json_t *cts_info_list_json(const CtsSeriesList *list, const CtsPixelFacts *facts, bool show_patient);
