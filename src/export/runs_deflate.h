/* Deflate (RFC 1951) with runs of one byte and Huffman codes alone, for bytes in which a search for anything else finds
 * next to nothing: the low bytes of a render are noise. zlib's strategy for them, Z_RLE, takes four times as long. */
#ifndef CTS_EXPORT_RUNS_DEFLATE_H
#define CTS_EXPORT_RUNS_DEFLATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What n bytes take at most. */
size_t cts_runs_deflate_bound(size_t n);

/* Blocks for n bytes, as many bytes as this returns; out has room for cts_runs_deflate_bound(n). The last blocks of a
 * stream end it; others end on a byte with a block that is not final, so that more can follow. */
size_t cts_runs_deflate(const uint8_t *in, size_t n, bool last, uint8_t *out);

#endif
