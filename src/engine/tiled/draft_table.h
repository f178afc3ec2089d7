/* Slab integration for drafts: between any two of some hundred grey levels the means of extinction and colour, ready
 * made (pre-integration: Engel, Kraus, Ertl 2001), from the sums that the finer table has. */
#ifndef CTS_TILED_DRAFT_TABLE_H
#define CTS_TILED_DRAFT_TABLE_H

#include "engine/tiled/slab.h"

/* So many levels: their pairs fit a second-level cache beside the volume's rows. */
enum { CTS_DRAFT_LEVELS = 192, CTS_DRAFT_RANGES = 3 };

/* Grey level s has the number that adds up from clamp(s - start, 0, length) * per_grey over three ranges: levels stand
 * close where the transfer function changes, and far apart before and behind. */
typedef struct CtsDraftTable {
    float start[CTS_DRAFT_RANGES], length[CTS_DRAFT_RANGES], per_grey[CTS_DRAFT_RANGES];
    float (*mean)[4]; /* at from * CTS_DRAFT_LEVELS + to: colour, and extinction per mm */
} CtsDraftTable;

/* range: the grey levels that occur. */
CtsStatus cts_draft_table_init(CtsDraftTable *draft, const CtsSlabTable *table, CtsRange range, int n_threads,
                               CtsError *err);
void cts_draft_table_free(CtsDraftTable *draft);

#endif
