#include "base/text.h"
#include "input/series/series_check.h"
#include <string.h>

void cts_series_describe(CtsSeries *series)
{
    const CtsSlice *const middle = series->slices[series->n_slices / 2];
    char *const traits = series->traits;
    const size_t size = sizeof series->traits;
    cts_text_append(traits, size, ", ", "%d x %d x %d", series->columns, series->rows, series->n_slices);
    if (series->spacing_mm[0] > 0)
        cts_text_append(traits, size, ", ", "pixels of %.3g mm", series->spacing_mm[0]);
    if (series->spacing_mm[2] > 0)
        cts_text_append(traits, size, ", ", "slices %.3g mm apart", series->spacing_mm[2]);
    if (middle->thickness_mm > 0)
        cts_text_append(traits, size, ", ", "%.3g mm thick", middle->thickness_mm);
    if (middle->kernel[0])
        cts_text_append(traits, size, ", ", "kernel %.32s", middle->kernel);
    if (middle->contrast)
        cts_text_append(traits, size, ", ", "contrast agent");
    /* The first two values say ORIGINAL or DERIVED, PRIMARY or SECONDARY. */
    const char *type = middle->image_type;
    for (int i = 0; type && i < 2; i++)
        type = strchr(type, '\\') ? strchr(type, '\\') + 1 : NULL;
    if (type && *type)
        cts_text_append(traits, size, ", ", "%.32s", type);
    cts_text_clean(traits);
}
