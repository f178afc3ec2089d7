#include "output/report/text_table.h"

#include "base/compare.h"
#include "base/mem.h"
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct CtsTable {
    int n_columns, n_cells;
    char **cells; /* the headings first */
};

static void add_cells(CtsTable *table, char *row)
{
    for (char *cell; (cell = strsep(&row, "\t"));)
        if (!cts_grow(&table->cells, table->n_cells, NULL) && (table->cells[table->n_cells] = strdup(cell)))
            table->n_cells++;
}

void cts_table_row(CtsTable *table, const char *format, ...)
{
    char row[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(row, sizeof row, format, args);
    va_end(args);
    if (table)
        add_cells(table, row);
}

CtsTable *cts_table_new(const char *headings)
{
    CtsTable *const table = calloc(1, sizeof *table);
    cts_table_row(table, "%s", headings);
    if (table)
        table->n_columns = table->n_cells;
    return table;
}

/* A heading without the mark of its alignment. */
static const char *cell_text(const CtsTable *table, int i)
{
    return table->cells[i] + (i < table->n_columns && table->cells[i][0] == '>');
}

void cts_table_print(const CtsTable *table, FILE *file)
{
    if (!table)
        return;
    for (int i = 0; i < table->n_cells; i++) {
        const int c = i % table->n_columns;
        const bool right = table->cells[c][0] == '>', last = c == table->n_columns - 1;
        int width = 0;
        /* No blanks at the end of a line. */
        for (int j = c; j < table->n_cells && (right || !last); j += table->n_columns)
            width = cts_larger_int(width, (int)strlen(cell_text(table, j)));
        fprintf(file, "%*s%s", right ? width : -width, cell_text(table, i), last ? "\n" : "  ");
    }
}

void cts_html_text(FILE *file, const char *text)
{
    static const char marks[] = "<>&\"", *const names[] = {"&lt;", "&gt;", "&amp;", "&quot;"};
    for (; *text; text++) {
        const char *mark = strchr(marks, *text);
        if (mark)
            fputs(names[mark - marks], file);
        else
            fputc(*text, file);
    }
}

void cts_table_free(CtsTable **table)
{
    if (!*table)
        return;
    for (int i = 0; i < (*table)->n_cells; i++)
        free((*table)->cells[i]);
    free((*table)->cells);
    free(*table);
    *table = NULL;
}
