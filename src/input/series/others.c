#include "input/series/series_check.h"

#include "base/mem.h"
#include "base/text.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static CtsStatus add_other(CtsSeriesList *list, const char *what, int n, CtsError *err)
{
    for (size_t i = 0; i < list->n_others; i++)
        if (!strcmp(list->others[i].what, what)) {
            list->others[i].n += n;
            return CTS_OK;
        }
    const CtsStatus st = cts_grow(&list->others, list->n_others, err);
    if (st)
        return st;
    CtsFileCount *added = &list->others[list->n_others++];
    snprintf(added->what, sizeof added->what, "%s", what);
    added->n = n;
    return CTS_OK;
}

CtsStatus cts_others_add_files(CtsSeriesList *list, int n, const char *packed, CtsError *err)
{
    char what[40];
    if (packed && !strcmp(packed, "NIfTI"))
        snprintf(what, sizeof what, "NIfTI (name the file itself)");
    else
        snprintf(what, sizeof what, packed ? "packed with %s (unpack first)" : "not DICOM", packed);
    return n ? add_other(list, what, n, err) : CTS_OK;
}

CtsStatus cts_others_add_special(CtsSeriesList *list, int n, CtsError *err)
{
    return n ? add_other(list, "links to folders or devices (name them)", n, err) : CTS_OK;
}

CtsStatus cts_others_add_object(CtsSeriesList *list, const char *class_name, CtsError *err)
{
    return add_other(list, class_name, 1, err);
}

static int by_number(const void *a, const void *b)
{
    const CtsFileCount *x = a, *y = b;
    return x->n != y->n ? (x->n < y->n) - (x->n > y->n) : strcmp(x->what, y->what);
}

void cts_others_sort(CtsSeriesList *list)
{
    if (list->n_others)
        qsort(list->others, list->n_others, sizeof *list->others, by_number);
}

void cts_series_list_others(const CtsSeriesList *list, char *text, size_t size)
{
    text[0] = 0;
    for (size_t i = 0; i < list->n_others; i++)
        cts_text_append(text, size, ", ", "%d %s", list->others[i].n, list->others[i].what);
}
