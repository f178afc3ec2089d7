/* Conversion of a slice's bytes to words, and their range. */
#include "dicom/header/slice.h"

#include <math.h>

static void swap_pairs(uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i + 1 < n; i += 2) {
        const uint8_t first = bytes[i];
        bytes[i] = bytes[i + 1];
        bytes[i + 1] = first;
    }
}

void cts_slice_widen(const CtsSlice *s, const uint8_t *bytes, uint16_t *words, size_t first, size_t end)
{
    if (s->syntax->big_endian && (s->bits_allocated == 16 || s->pixel_words))
        swap_pairs((uint8_t *)(uintptr_t)bytes + first, end - first);
    if (s->bits_allocated == 8)
        for (size_t i = first; i < end; i++)
            words[i] = bytes[i];
}

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
