#include "output/report/text_table.h"

#include "base/mem.h"
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

struct CtsTable {
    int n_columns, n_cells;
    char **cells; /* the headings first */
    unsigned char *right;
};

static void add_cell(CtsTable *table, const char *text)
{
    if (!cts_grow(&table->cells, table->n_cells, NULL) && (table->cells[table->n_cells] = strdup(text)))
        table->n_cells++;
}

CtsTable *cts_table_new(const char *const *headings, int n_columns)
{
    CtsTable *table = calloc(1, sizeof *table);
    if (!table || !(table->right = calloc((size_t)n_columns, 1))) {
        free(table);
        return NULL;
    }
    table->n_columns = n_columns;
    for (int c = 0; c < n_columns; c++) {
        table->right[c] = headings[c][0] == '>';
        add_cell(table, headings[c] + table->right[c]);
    }
    return table;
}

void cts_table_cell(CtsTable *table, const char *format, ...)
{
    if (!table)
        return;
    char text[256];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    add_cell(table, text);
}

void cts_table_print(const CtsTable *table, FILE *file)
{
    if (!table)
        return;
    for (int i = 0; i < table->n_cells; i++) {
        const int c = i % table->n_columns;
        int width = 0;
        for (int j = c; j < table->n_cells; j += table->n_columns)
            if ((int)strlen(table->cells[j]) > width)
                width = (int)strlen(table->cells[j]);
        const int last = c == table->n_columns - 1;
        /* No blanks at the end of a line. */
        if (last && !table->right[c])
            width = 0;
        fprintf(file, "%*s%s", table->right[c] ? width : -width, table->cells[i], last ? "\n" : "  ");
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
    free((*table)->right);
    free(*table);
    *table = NULL;
}
