/* Samples of a slice. */
#include "dicom/header/slice.h"

#include <math.h>

static uint16_t grey_of_word(const CtsSlice *s, const CtsStored *stored, uint16_t word)
{
    const int32_t value = cts_stored_value(word, stored);
    if (cts_stored_is_padding(word, value, stored))
        return 0;
    return (uint16_t)fmin(fmax(floor(s->slope * value + s->intercept + 1024.5), 0), UINT16_MAX);
}

void cts_slice_sample(const CtsSlice *s, const uint16_t *words, bool are_grey, uint16_t sample[CTS_SAMPLES])
{
    const CtsStored stored = cts_slice_stored(s);
    int column[CTS_SAMPLE_SIDE];
    for (int i = 0; i < CTS_SAMPLE_SIDE; i++)
        column[i] = (2 * i + 1) * s->columns / (2 * CTS_SAMPLE_SIDE);
    for (int j = 0; j < CTS_SAMPLE_SIDE; j++) {
        const uint16_t *row = words + (size_t)((2 * j + 1) * s->rows / (2 * CTS_SAMPLE_SIDE)) * (size_t)s->columns;
        for (int i = 0; i < CTS_SAMPLE_SIDE; i++)
            *sample++ = are_grey ? row[column[i]] : grey_of_word(s, &stored, row[column[i]]);
    }
}
