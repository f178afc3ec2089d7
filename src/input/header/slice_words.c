/* A slice's bytes -> words, and what they range over. */
#include "input/header/slice.h"

#include <string.h>

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

void cts_slice_see_pixels(CtsSlice *s, const uint8_t *pixels)
{
    enum { BLOCK = 1024 };
    const CtsStored stored = cts_slice_stored(s);
    const size_t n = (size_t)s->rows * (size_t)s->columns, word_bytes = (size_t)(s->bits_allocated / 8);
    s->range = (CtsStoredRange){INT32_MAX, INT32_MIN};
    for (size_t first = 0; first < n; first += BLOCK) {
        const size_t part = n - first < BLOCK ? n - first : BLOCK;
        uint16_t words[BLOCK];
        uint8_t bytes[2 * BLOCK];
        memcpy(word_bytes == 1 ? bytes : (uint8_t *)words, pixels + first * word_bytes, part * word_bytes);
        cts_slice_widen(s, word_bytes == 1 ? bytes : (uint8_t *)words, words, 0, part * word_bytes);
        s->range = cts_stored_range_join(s->range, cts_stored_range(words, part, &stored));
    }
    s->range_known = true;
}
