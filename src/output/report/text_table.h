/* Tables, for stdout with columns as wide as their widest cell, and for pages. */
#pragma once

#include <stdio.h>

typedef struct CtsTable CtsTable;

/* headings: titles with tabs between them; a title that starts with '>' (not printed) aligns its column to the right.
 * NULL when memory runs out, which all of the following accept. */
CtsTable *cts_table_new(const char *headings);
/* The cells of the next row, with tabs between them. */
void cts_table_row(CtsTable *table, const char *format, ...) __attribute__((format(printf, 2, 3)));
void cts_table_print(const CtsTable *table, FILE *file);
/* Text with < > & and quotes as entities. */
void cts_html_text(FILE *file, const char *text);
void cts_table_free(CtsTable **table);
