#ifndef CTS_EXPORT_EXR_H
#define CTS_EXPORT_EXR_H

#include "output/export/format.h"
#include <openexr.h>

/* Keeps the library from printing. It is called with the file's lock held, so that asking the file for anything would
 * wait for ever; the code that the failing call returns tells what is wrong. */
void cts_exr_say_nothing(exr_const_context_t file, exr_result_t code, const char *message);

#endif
