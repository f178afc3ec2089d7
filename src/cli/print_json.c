#include "cli/print_json.h"

#include <stdio.h>
#include <stdlib.h>

CtsStatus cli_print_json(json_t *value, CtsError *err)
{
    char *text = value ? json_dumps(value, JSON_INDENT(2) | JSON_REAL_PRECISION(15)) : NULL;
    json_decref(value);
    if (!text)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    printf("%s\n", text);
    free(text);
    return CTS_OK;
}
