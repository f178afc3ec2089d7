/* The contact sheet: one page of all series in a batch's journals, that opens from disk in any browser. */
#ifndef CTS_CONTACT_SHEET_H
#define CTS_CONTACT_SHEET_H

#include "ctsplat/status.h"
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

/* How far the batch is that the sheet is of. */
typedef struct CtsContactRun {
    size_t n_ended, n_series;
    bool goes_on;
} CtsContactRun;

typedef struct CtsContactWanted {
    const CtsContactRun *run;                    /* NULL: all is over */
    void (*change)(void *context, json_t *line); /* of the journal, before it is shown; or NULL */
    void *context;
} CtsContactWanted;

/* Writes dir/index.html, whole or not at all, from dir/batch.jsonl and dir/batch-I-of-N.jsonl, and from
 * those in folders directly below dir. Of a series with several
 * lines the last of a journal counts, and of several journals the one that ended last. Lines that are no series (a torn
 * last line is passed over in silence) are counted on the page. Holds one line at a time. CTS_ERR_READ when dir holds
 * no journal. */
CtsStatus cts_contact_sheet_write(const char *dir, const CtsContactWanted *wanted, CtsError *err);

/* What stands before and behind the data, a JSON object in a script element. */
extern const unsigned char cts_contact_head[], cts_contact_tail[];
extern const size_t cts_contact_head_bytes, cts_contact_tail_bytes;

#endif
