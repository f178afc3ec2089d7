/* Frames for sandboxed codecs. */
#pragma once

#include "base/sandbox.h"
#include "dicom/codec/pixels.h"
#include "dicom/pixels/pixel_tasks.h"
#include "unit.h"
#include <stdlib.h>
#include <string.h>

static inline CtsFrameFormat format_16(int columns, int rows)
{
    return (CtsFrameFormat){.syntax = cts_syntax_find("1.2.840.10008.1.2.4.90"),
                            .columns = columns,
                            .rows = rows,
                            .bits_allocated = 16,
                            .bits_stored = 16,
                            .high_bit = 15,
                            .padding_word = -1};
}

/* Decodes a stream as a frame of n_fragments. */
static inline CtsStatus run_frame(CtsSandbox *d, const CtsFrameFormat *format, const uint8_t *bytes, size_t n,
                                  size_t n_fragments, const void **pixels, CtsError *err)
{
    const size_t n_all = n + 8 * n_fragments;
    uint8_t *const all = malloc(n_all), *stream = all;
    assert_non_null(all);
    for (size_t i = 0, at = 0; i < n_fragments; i++, stream += 8) {
        const uint32_t end = (uint32_t)(n * (i + 1) / n_fragments), length = end - (uint32_t)at;
        memcpy(stream, "\xFE\xFF\x00\xE0", 4);
        memcpy(stream + 4, &length, 4);
        memcpy(stream + 8, bytes + at, length);
        stream += length;
        at = end;
    }
    const CtsFileBytes file = cts_file_bytes_in_memory(all, n_all);
    const CtsStatus st = cts_codec_submit(d, format, &file, 0, n_all, err);
    free(all);
    return st ? st : cts_sandbox_take(d, pixels, err);
}
