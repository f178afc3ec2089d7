/* What a request asks for, in ctsplat's own words: its query, checked and ready to be made. */
#ifndef CTS_SERVE_ASKED_H
#define CTS_SERVE_ASKED_H

#include "app/words/words_job.h"

enum { CTS_ASKED_PARTS = 64, CTS_ASKED_MADE = 8 };

/* A query: names and values as the request has them, or made here. */
typedef struct CtsQuery {
    struct {
        const char *name, *value;
    } parts[CTS_ASKED_PARTS];
    char made[CTS_ASKED_MADE][96];
    int n, n_made;
    bool too_many;
} CtsQuery;

/* Texts must stay. */
void cts_query_add(void *query, const char *name, const char *value);
void cts_query_make(CtsQuery *query, const char *name, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* NULL where it is not given. */
const char *cts_query_value(const CtsQuery *query, const char *name);

typedef struct CtsAsked {
    CtsQuery query; /* as ctsplat's own words */
    const char *media_type;
    bool metadata;                                  /* how the picture is made, not the picture */
    double swivel_range_deg, swivel_step_deg, rate; /* 0: not asked for */
    char *state_path;                               /* of the presentation state that is asked for; NULL: none */
    char instance_uid[65];                          /* the object that must be the whole series; "": none */
    char *path;                                     /* where the picture goes */
    CtsOptions options;
    CtsPreset preset;
    CtsJob job; /* points at the two */
} CtsAsked;

/* By ctsplat's words; format: what the address ends in. CTS_ERR_USAGE for what no request may ask for. folder and
 * serial name a file of its own. Free with cts_asked_free(), also after a failure. */
CtsStatus cts_asked_words(CtsAsked *asked, const CtsFormatInfo *format, const char *folder, unsigned long serial,
                          int n_threads, CtsReport *report, CtsError *err);
void cts_asked_free(CtsAsked *asked);

const char *cts_media_type_of(const CtsFormatInfo *format);

/* The parameters of PS3.18 8.3.5 in query become words, and the media type one that accept (the header; may be NULL)
 * takes; *format is NULL where it takes none. */
CtsStatus cts_asked_rendered(CtsAsked *asked, const char *accept, const CtsFormatInfo **format, CtsError *err);

#endif
