#include "core/volume/stored.h"

CtsStoredRange cts_stored_range(const uint16_t *words, size_t n, const CtsStored *stored)
{
    const CtsStored s = *stored;
    CtsStoredRange range = {INT32_MAX, INT32_MIN};
    for (size_t i = 0; i < n; i++) {
        const int32_t value = cts_stored_value(words[i], &s);
        const bool padding = cts_stored_is_padding(words[i], value, &s);
        const int32_t low = padding ? INT32_MAX : value, high = padding ? INT32_MIN : value;
        range.low = low < range.low ? low : range.low;
        range.high = high > range.high ? high : range.high;
    }
    return range;
}

CtsStoredRange cts_stored_range_join(CtsStoredRange a, CtsStoredRange b)
{
    return (CtsStoredRange){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}
