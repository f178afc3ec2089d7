/* Conversion of stored words to grey levels (PS3.3 C.7.6.3, C.11.1; PS3.5 8.1.1). */
#pragma once

#include "core/volume/stored.h"
#include "ctsplat/volume.h"

/* Sets hu_min and hu_max; of padding alone (low above high) to the value of grey 0. */
void cts_volume_set_range(CtsVolume *volume, double low, double high);
/* Sets the scale of a volume with fractional values, by its range. HU: the finest power of two, at most 1, for which
 * the largest HU fits 16 bits. Others: cts_grey_decimal_step() from the lowest value on. */
void cts_volume_set_scale(CtsVolume *volume);
/* 1, 2 or 5 times a power of ten: the least step of which n_steps span a range, which is not negative. */
double cts_grey_decimal_step(double span, int n_steps);

/* grey = clamp(slope * stored + offset, 0, 65535), padding 0. |slope| * 65535 + |offset| must fit 31 bits.
 * In place, or from elsewhere. The plain version is the truth; the other one gives the same bytes. */
CtsStoredRange cts_grey_whole(uint16_t *grey, const uint16_t *words, size_t n, const CtsStored *stored, int32_t slope,
                              int32_t offset);
CtsStoredRange cts_grey_whole_plain(uint16_t *grey, const uint16_t *words, size_t n, const CtsStored *stored,
                                    int32_t slope, int32_t offset);

/* For a fractional rescale, after cts_stored_range(): grey = floor((slope * stored + intercept - hu_offset) / hu_step +
 * 0.5), clamped, as a table of all words. */
void cts_grey_table(uint16_t table[65536], const CtsStored *stored, double slope, double intercept, double hu_offset,
                    double hu_step);
/* The largest difference between the values of stored ones in a range and their grey levels' values. */
double cts_grey_rounding(CtsStoredRange range, double slope, double intercept, double hu_offset, double hu_step);
void cts_grey_look_up(uint16_t *words, size_t n, const uint16_t table[65536]);
