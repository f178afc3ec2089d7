/* The lists that a batch is told: presets, views and formats, each with each. */
#ifndef CTS_BATCH_BATCH_LISTS_H
#define CTS_BATCH_BATCH_LISTS_H

#include "app/words/options.h"

typedef struct CtsBatchView {
    const char *name; /* as the user wrote it; part of file names */
    double azimuth_deg, elevation_deg;
} CtsBatchView;

typedef struct CtsBatchLists {
    char *texts[3]; /* copies that the names point into */
    const char **preset_names, **view_texts, **formats;
    CtsPreset *presets;
    CtsBatchView *views;
    int n_presets, n_views, n_formats;
    char *options, *dcm_options; /* the words that act on pictures, and on .dcm files alone: a change makes them anew */
    char send_to[1100];          /* the PACS that .dcm files go to, as the journal names it; "": none */
} CtsBatchLists;

/* Free with cts_batch_lists_free(), also after a failure. */
CtsStatus cts_batch_lists(const CtsOptions *options, CtsBatchLists *lists, CtsReport *report, CtsError *err);
void cts_batch_lists_free(CtsBatchLists *lists);

#endif
