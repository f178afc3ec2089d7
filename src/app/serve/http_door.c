#include "app/serve/http.h"

#include "base/load_part.h"

CtsStatus cts_http(const CtsHttp **http, CtsError *err)
{
    static const void *kept; /* the state of this file */
    return cts_part_table(CTS_HTTP_PART, "cts_http_table", &kept, (const void **)http, err);
}
