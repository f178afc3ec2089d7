#include "core/volume/stored.h"

#include "base/cpu.h"

/* Integers alone, so that every compilation of it gives the same numbers. */
static inline __attribute__((always_inline)) CtsStoredRange range_of(const uint16_t *words, size_t n,
                                                                     const CtsStored *stored)
{
    const CtsStored s = *stored;
    const int32_t sign = s.is_signed ? 1 << (s.bits - 1) : 0, mask = (int32_t)((1u << s.bits) - 1);
    int32_t low = INT32_MAX, high = INT32_MIN;
    for (size_t i = 0; i < n; i++) {
        const int32_t word = words[i], value = (((word >> s.shift) & mask) ^ sign) - sign;
        /* All ones for padding: bit operations keep the loop free of branches, so that it becomes vector code. */
        const int32_t padding = -(((value >= s.padding_low) & (value <= s.padding_high)) | (word == s.padding_word));
        const int32_t for_low = (value & ~padding) | (INT32_MAX & padding);
        const int32_t for_high = (value & ~padding) | (INT32_MIN & padding);
        low = for_low < low ? for_low : low;
        high = for_high > high ? for_high : high;
    }
    return (CtsStoredRange){low, high};
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static CtsStoredRange range_avx2(const uint16_t *words, size_t n,
                                                                 const CtsStored *stored)
{
    return range_of(words, n, stored);
}
#endif

CtsStoredRange cts_stored_range(const uint16_t *words, size_t n, const CtsStored *stored)
{
#if defined(__x86_64__)
    if (cts_cpu_flags() & CTS_CPU_AVX2)
        return range_avx2(words, n, stored);
#endif
    return range_of(words, n, stored);
}

CtsStoredRange cts_stored_range_join(CtsStoredRange a, CtsStoredRange b)
{
    return (CtsStoredRange){a.low < b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
}
