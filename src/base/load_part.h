/* Parts of the program that are libraries of their own, loaded when they are wanted: what they need would cost every
 * other run its time. */
#ifndef CTS_BASE_LOAD_PART_H
#define CTS_BASE_LOAD_PART_H

#include "ctsplat/status.h"

/* What `name` stands for in the library `file`, which lies beside the object that this code is in: where it was built,
 * or installed. It stays loaded. CTS_ERR_INTERNAL when it is not there or of another program. */
CtsStatus cts_part_load(const char *file, const char *name, void **symbol, CtsError *err);

/* What the function `name` of the library tells: a table of its own. *kept, NULL at first, remembers it. Thread-safe;
 * no process is forked meanwhile. */
CtsStatus cts_part_table(const char *file, const char *name, const void **kept, const void **table, CtsError *err);

#endif
