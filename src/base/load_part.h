/* Parts of the program that are libraries of their own, loaded when they are wanted: what they need would cost every
 * other run its time. */
#ifndef CTS_BASE_LOAD_PART_H
#define CTS_BASE_LOAD_PART_H

#include "ctsplat/status.h"

/* What `name` stands for in the library `file`, which lies beside the object that this code is in: where it was built,
 * or installed. It stays loaded. CTS_ERR_INTERNAL when it is not there or of another program. */
CtsStatus cts_part_load(const char *file, const char *name, void **symbol, CtsError *err);

#endif
