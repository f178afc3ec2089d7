/* JSON on stdout. */
#ifndef CTS_CLI_PRINT_JSON_H
#define CTS_CLI_PRINT_JSON_H

#include "ctsplat/status.h"
#include <jansson.h>

/* Prints value and a newline; takes over the reference. NULL, as from json_pack without memory, is CTS_ERR_MEMORY. */
CtsStatus cli_print_json(json_t *value, CtsError *err);

#endif
