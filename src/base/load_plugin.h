/* Plug-ins: parts of the program in libraries of their own that are loaded on demand, since loading their dependencies
 * would slow down every run. */
#pragma once

#include "ctsplat/status.h"

/* The function table that the function `name` of the library `file` returns. The library is in the build folder or
 * installed beside the object that contains this code. It stays loaded, and *kept, NULL at first, caches the table.
 * Thread-safe; no process is forked meanwhile. CTS_ERR_INTERNAL when it is missing or belongs to another version. */
CtsStatus cts_plugin_table(const char *file, const char *name, const void **kept, const void **table, CtsError *err);

/* The function `name`, which finds that table for its callers. */
#define CTS_PLUGIN_ENTRY(Table, name, file)                                                                            \
    CtsStatus name(const Table **found, CtsError *err)                                                                 \
    {                                                                                                                  \
        static const void *kept;                                                                                       \
        const void *table = NULL;                                                                                      \
        const CtsStatus st = cts_plugin_table(file, #name "_table", &kept, &table, err);                               \
        *found = table;                                                                                                \
        return st;                                                                                                     \
    }
/* The same on the other side: `name` for callers there, and NAME_table, of one type for all tables, for the loader. */
#define CTS_PLUGIN_TABLE(Table, name, ...)                                                                             \
    __attribute__((visibility("default"))) const void *name##_table(void);                                             \
    const void *name##_table(void)                                                                                     \
    {                                                                                                                  \
        static const Table here = {__VA_ARGS__};                                                                       \
        return &here;                                                                                                  \
    }                                                                                                                  \
    CtsStatus name(const Table **found, CtsError *err)                                                                 \
    {                                                                                                                  \
        (void)err;                                                                                                     \
        *found = (const Table *)name##_table();                                                                        \
        return CTS_OK;                                                                                                 \
    }
