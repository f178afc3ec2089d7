/* Parts of the program that are libraries of their own, loaded when they are wanted: what they need would cost every
 * other run its time. */
#ifndef CTS_BASE_LOAD_PART_H
#define CTS_BASE_LOAD_PART_H

#include "ctsplat/status.h"

/* What the function `name` of the library `file` tells: a table of its own. The library lies beside the object that
 * this code is in: where it was built, or installed. It stays loaded, and *kept, NULL at first, remembers the table.
 * Thread-safe; no process is forked meanwhile. CTS_ERR_INTERNAL when it is not there or of another program. */
CtsStatus cts_part_table(const char *file, const char *name, const void **kept, const void **table, CtsError *err);

/* The function `name`, which finds that table for its callers. */
#define CTS_PART_DOOR(Table, name, file)                                                                               \
    CtsStatus name(const Table **found, CtsError *err)                                                                 \
    {                                                                                                                  \
        static const void *kept;                                                                                       \
        const void *table = NULL;                                                                                      \
        const CtsStatus st = cts_part_table(file, #name, &kept, &table, err);                                          \
        *found = table;                                                                                                \
        return st;                                                                                                     \
    }
/* The same on the other side. */
#define CTS_PART_TABLE(Table, name, ...)                                                                               \
    __attribute__((visibility("default"))) CtsStatus name(const Table **found, CtsError *err)                          \
    {                                                                                                                  \
        static const Table here = {__VA_ARGS__};                                                                       \
        (void)err;                                                                                                     \
        *found = &here;                                                                                                \
        return CTS_OK;                                                                                                 \
    }

#endif
