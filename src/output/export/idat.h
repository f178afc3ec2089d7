/* A picture's rows as a PNG's zlib stream, cut into strips that are compressed side by side.
 *
 * libpng compresses on one thread, and at its default level takes many times longer than a render. The low bytes of a
 * render are noise: the fastest level finds nearly all that there is to find. Strips are cut by size alone, so the
 * bytes do not depend on the number of threads. */
#ifndef CTS_EXPORT_IDAT_H
#define CTS_EXPORT_IDAT_H

#include "ctsplat/status.h"
#include <stddef.h>
#include <stdint.h>

typedef struct CtsIdat {
    int width, height, n_samples; /* samples a pixel */
    int sample_bytes;             /* 1 or 2, then big-endian */
    size_t row_bytes;
    int rows_per_strip, n_strips;
} CtsIdat;

/* One strip: what goes into one IDAT chunk. */
typedef struct CtsIdatStrip {
    uint8_t *bytes; /* the caller's, cts_idat_bound() of them */
    size_t n_bytes;
    uint32_t crc;   /* of the chunk's name and these bytes */
    uint32_t adler; /* of the strip's filtered rows, and how many bytes these are */
    size_t n_filtered;
} CtsIdatStrip;

CtsIdat cts_idat_plan(int width, int height, int n_samples, int sample_bytes);

/* What one thread packs strips with, one after the other. */
typedef struct CtsIdatPacker CtsIdatPacker;
CtsStatus cts_idat_packer_new(CtsIdatPacker **packer, const CtsIdat *idat, CtsError *err);
void cts_idat_packer_free(CtsIdatPacker **packer);
/* What a strip takes at most. */
size_t cts_idat_bound(const CtsIdat *idat);

/* rows: the strip's rows, with the row above the first right before them (zeros above the picture's
 * first row). The first strip begins with the zlib header; the last one lacks the stream's check value, which
 * cts_idat_checksum() makes when all strips are there. */
CtsStatus cts_idat_strip(CtsIdatPacker *packer, int index, const uint8_t *rows, CtsIdatStrip *strip, CtsError *err);

/* Carry the check value over one more strip; begin with 1. */
uint32_t cts_idat_checksum(uint32_t adler, const CtsIdatStrip *strip);

#endif
