/* What the page is told of one series. */
#ifndef CTS_CONTACT_CARD_H
#define CTS_CONTACT_CARD_H

#include <jansson.h>

/* From a line of the journal: what it says but hashes and sizes, with outputs and thumbnails gathered to pictures, one
 * for each preset and view:
 *     {"preset", "view", "files":{"png":{"first":PATH, "frames":N}, ...}, "thumb":PATH, "turn":{"path", "frames",
 *      "width", "height"}}
 * Paths are below folder ("", or with a slash at its end); those that leave it are left out. A new reference; NULL when
 * memory runs out. */
json_t *cts_contact_card(const json_t *line, const char *folder);

#endif
