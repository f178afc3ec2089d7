/* What the page is told of one series. */
#ifndef CTS_SHEET_CARD_H
#define CTS_SHEET_CARD_H

#include <jansson.h>

/* From a line of the journal: what it says but hashes and sizes, with outputs and thumbnails gathered to pictures, one
 * for each preset and view:
 *     {"preset", "view", "files":{"png":{"first":PATH, "frames":N}, ...}, "thumb":PATH, "turn":{"path", "frames",
 *      "width", "height"}}
 * Paths that leave the folder are left out. A new reference; NULL when memory runs out. */
json_t *cts_sheet_card(const json_t *line);

#endif
