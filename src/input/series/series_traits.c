#include "base/text.h"
#include "input/series/series_check.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

__attribute__((format(printf, 2, 3))) static void add_trait(CtsSeries *series, const char *format, ...)
{
    const size_t n = strlen(series->traits);
    va_list args;
    va_start(args, format);
    if (n)
        strncat(series->traits, ", ", sizeof series->traits - n - 1);
    vsnprintf(series->traits + strlen(series->traits), sizeof series->traits - strlen(series->traits), format, args);
    va_end(args);
}

void cts_series_describe(CtsSeries *series)
{
    const CtsSlice *const middle = series->slices[series->n_slices / 2];
    add_trait(series, "%d x %d x %d", series->columns, series->rows, series->n_slices);
    if (series->spacing_mm[0] > 0)
        add_trait(series, "pixels of %.3g mm", series->spacing_mm[0]);
    if (series->spacing_mm[2] > 0)
        add_trait(series, "slices %.3g mm apart", series->spacing_mm[2]);
    if (middle->thickness_mm > 0)
        add_trait(series, "%.3g mm thick", middle->thickness_mm);
    if (middle->kernel && middle->kernel[0])
        add_trait(series, "kernel %.32s", middle->kernel);
    if (middle->contrast)
        add_trait(series, "contrast agent");
    /* The first two values say ORIGINAL or DERIVED, PRIMARY or SECONDARY. */
    const char *type = middle->image_type;
    for (int i = 0; type && i < 2; i++)
        type = strchr(type, '\\') ? strchr(type, '\\') + 1 : NULL;
    if (type && *type)
        add_trait(series, "%.32s", type);
    cts_text_clean(series->traits);
}
