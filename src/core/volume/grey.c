#include "core/volume/grey.h"

#include "base/cpu.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* For slope 1, which nearly every CT has, in 16-bit numbers: u counts stored values up from their smallest, so grey = u
 * + rise, and clamping u first keeps the sum inside 16 bits. |rise| must not exceed 65535. Integer arithmetic, so that
 * all SIMD paths give the same bytes. */
static inline __attribute__((always_inline)) CtsStoredRange slope_one(uint16_t *to, const uint16_t *words, size_t n,
                                                                      const CtsStored *s, int32_t rise)
{
    const int32_t smallest = s->is_signed ? -(1 << (s->bits - 1)) : 0, last = (int32_t)((1u << s->bits) - 1);
    const uint16_t sign = (uint16_t)-smallest, mask = (uint16_t)last, shift = (uint16_t)s->shift;
    const uint16_t floor_u = (uint16_t)(rise < 0 ? -rise : 0), ceil_u = (uint16_t)(rise > 0 ? 65535 - rise : 65535);
    int32_t first_padding = s->padding_low - smallest, last_padding = s->padding_high - smallest;
    first_padding = first_padding < 0 ? 0 : first_padding;
    last_padding = last_padding > last ? last : last_padding;
    const bool has_range = s->padding_low <= s->padding_high && first_padding <= last_padding;
    const uint16_t range_start = (uint16_t)first_padding, range = (uint16_t)(last_padding - first_padding);
    const uint16_t use_range = has_range ? 0xFFFF : 0, use_word = s->padding_word >= 0 ? 0xFFFF : 0;
    const uint16_t padding_word = (uint16_t)s->padding_word;
    uint16_t low = 0xFFFF, high = 0;
    for (size_t i = 0; i < n; i++) {
        const uint16_t word = words[i], u = (uint16_t)(((word >> shift) & mask) ^ sign);
        const uint16_t in_range = (uint16_t)(u - range_start) <= range ? use_range : 0;
        const uint16_t is_word = word == padding_word ? use_word : 0;
        const uint16_t padding = in_range | is_word;
        uint16_t clamped = u < floor_u ? floor_u : u;
        clamped = clamped > ceil_u ? ceil_u : clamped;
        to[i] = (uint16_t)((uint16_t)(clamped + rise) & ~padding);
        const uint16_t for_low = u | padding, for_high = (uint16_t)(u & ~padding);
        low = for_low < low ? for_low : low;
        high = for_high > high ? for_high : high;
    }
    /* All padding leaves low at 65535 and high at 0. */
    return low > high ? (CtsStoredRange){INT32_MAX, INT32_MIN} : (CtsStoredRange){low + smallest, high + smallest};
}

CtsStoredRange cts_grey_whole_plain(uint16_t *to, const uint16_t *words, size_t n, const CtsStored *stored,
                                    int32_t slope, int32_t offset)
{
    CtsStoredRange range = {INT32_MAX, INT32_MIN};
    for (size_t i = 0; i < n; i++) {
        const int32_t value = cts_stored_value(words[i], stored), grey = slope * value + offset;
        if (cts_stored_is_padding(words[i], value, stored)) {
            to[i] = 0;
            continue;
        }
        to[i] = (uint16_t)(grey < 0 ? 0 : grey > 65535 ? 65535 : grey);
        range.low = value < range.low ? value : range.low;
        range.high = value > range.high ? value : range.high;
    }
    return range;
}

/* In place is a case of its own: compilers see that nothing overlaps. */
static inline __attribute__((always_inline)) CtsStoredRange
whole_any(uint16_t *to, const uint16_t *words, size_t n, const CtsStored *stored, int32_t slope, int32_t offset)
{
    const int32_t rise = offset - (stored->is_signed ? 1 << (stored->bits - 1) : 0);
    if (slope != 1 || rise < -65535 || rise > 65535)
        return cts_grey_whole_plain(to, words, n, stored, slope, offset);
    return to == words ? slope_one(to, to, n, stored, rise) : slope_one(to, words, n, stored, rise);
}

CTS_CPU_VARIANTS(CtsStoredRange, whole,
                 (uint16_t * to, const uint16_t *words, size_t n, const CtsStored *stored, int32_t slope,
                  int32_t offset),
                 return whole_any(to, words, n, stored, slope, offset))

CtsStoredRange cts_grey_whole(uint16_t *to, const uint16_t *words, size_t n, const CtsStored *stored, int32_t slope,
                              int32_t offset)
{
    return CTS_CPU_CHOICE(cts_cpu_flags(), whole)(to, words, n, stored, slope, offset);
}

void cts_grey_table(uint16_t table[65536], const CtsStored *stored, double slope, double intercept, double hu_offset,
                    double hu_step)
{
    for (int word = 0; word < 65536; word++) {
        const int32_t value = cts_stored_value((uint16_t)word, stored);
        const double grey = floor((slope * value + intercept - hu_offset) / hu_step + 0.5);
        table[word] = (uint16_t)(cts_stored_is_padding((uint16_t)word, value, stored) ? 0 : fmin(fmax(grey, 0), 65535));
    }
}

void cts_grey_look_up(uint16_t *words, size_t n, const uint16_t table[65536])
{
    for (size_t i = 0; i < n; i++)
        words[i] = table[words[i]];
}

double cts_grey_rounding(CtsStoredRange range, double slope, double intercept, double hu_offset, double hu_step)
{
    double most = 0;
    for (int32_t value = range.low; value <= range.high; value++) {
        const double steps = (slope * value + intercept - hu_offset) / hu_step;
        most = fmax(most, fabs(steps - floor(steps + 0.5)));
    }
    return most * hu_step;
}

enum { GREY_MAX = 65535 };

static double finest_step_hu(double hu_max)
{
    enum { FINEST_BITS = 16 };
    double step = 1;
    for (int bits = 0; bits < FINEST_BITS && (hu_max - CTS_LEAST_HU) / (step / 2) <= GREY_MAX; bits++)
        step /= 2;
    return step;
}

double cts_grey_decimal_step(double span, int n_steps)
{
    double step = 1;
    if (!(span > 0))
        return step;
    /* As text, for the double that is nearest to it. */
    for (int power = (int)floor(log10(span / n_steps)) - 1, digit = 1;;
         digit = digit == 5 ? 1 : 2 * digit + digit / 2) {
        char text[16];
        snprintf(text, sizeof text, "%de%d", digit, power);
        step = strtod(text, NULL);
        if (span / step <= n_steps)
            return step;
        power += digit == 5;
    }
}

void cts_volume_set_range(CtsVolume *v, double low, double high)
{
    v->hu_min = low <= high ? low : v->quantity == CTS_QUANTITY_HU ? CTS_LEAST_HU : 0;
    v->hu_max = low <= high ? high : v->hu_min;
}

void cts_volume_set_scale(CtsVolume *v)
{
    const bool is_hu = v->quantity == CTS_QUANTITY_HU;
    v->hu_offset = is_hu ? CTS_LEAST_HU : v->hu_min;
    v->hu_step = is_hu ? finest_step_hu(v->hu_max) : cts_grey_decimal_step(v->hu_max - v->hu_min, GREY_MAX);
}
