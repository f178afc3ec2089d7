/* Series found in a folder of files that a test writes. */
#pragma once

#include "ctsplat/series.h"
#include "dicom_files.h"

typedef struct Found {
    char folder[64];
    CtsSeriesList *list;
    CtsError err;
    CtsStatus status;
} Found;

static inline void find(Found *f)
{
    const char *path = f->folder;
    f->status = cts_series_find(&path, 1, 2, &f->list, NULL, &f->err);
    assert_true((f->status == CTS_OK) == (f->list != NULL));
}

/* In a folder of its own. */
static inline void find_stack(Found *f, const double *z, int n)
{
    make_folder(f->folder);
    write_stack(f->folder, z, n);
    find(f);
}

static inline void done(Found *f)
{
    cts_series_list_free(&f->list);
    assert_null(f->list);
    remove_folder(f->folder);
}
