/* The page without its data: page.html with its style and script, put into C by embed.py. */
#ifndef CTS_SHEET_PAGE_H
#define CTS_SHEET_PAGE_H

#include <stddef.h>

/* What stands before and behind the data, a JSON object in a script element. */
extern const unsigned char cts_sheet_head[], cts_sheet_tail[];
extern const size_t cts_sheet_head_bytes, cts_sheet_tail_bytes;

#endif
