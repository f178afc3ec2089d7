/* Conversion of stored words to stored values (PS3.5 8.1.1): shifted, masked, sign-extended, padding separated. */
#pragma once

#include "ctsplat/api.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Encoding of one slice's words: shifted right, masked, sign-extended, then compared with the padding. */
typedef struct CtsStored {
    int shift, bits; /* the stored value is `bits` wide and begins at bit `shift` */
    bool is_signed;
    int32_t padding_low, padding_high; /* stored values, inclusive; low > high: no padding */
    int32_t padding_word;              /* a whole word that is padding; -1: none */
} CtsStored;

/* Smallest and largest stored value that is not padding; low > high when all is padding. */
typedef struct CtsStoredRange {
    int32_t low, high;
} CtsStoredRange;

static inline int32_t cts_stored_value(uint16_t word, const CtsStored *s)
{
    const int32_t sign = s->is_signed ? 1 << (s->bits - 1) : 0, mask = (int32_t)((1u << s->bits) - 1);
    return ((((int32_t)word >> s->shift) & mask) ^ sign) - sign;
}

static inline bool cts_stored_is_padding(uint16_t word, int32_t value, const CtsStored *s)
{
    return (value >= s->padding_low && value <= s->padding_high) || word == s->padding_word;
}

CtsStoredRange cts_stored_range(const uint16_t *words, size_t n, const CtsStored *stored);
/* The union of two ranges. */
CtsStoredRange cts_stored_range_join(CtsStoredRange a, CtsStoredRange b);

CTS_C_END
