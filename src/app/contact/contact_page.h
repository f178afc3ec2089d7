/* The page without its data: page.html with its style and script, put into C by embed.py. */
#ifndef CTS_CONTACT_PAGE_H
#define CTS_CONTACT_PAGE_H

#include <stddef.h>

/* What stands before and behind the data, a JSON object in a script element. */
extern const unsigned char cts_contact_head[], cts_contact_tail[];
extern const size_t cts_contact_head_bytes, cts_contact_tail_bytes;

#endif
