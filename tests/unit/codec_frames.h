/* Frames for sandboxed codecs. */
#pragma once

#include "base/sandbox.h"
#include "dicom/pixels/pixel_tasks.h"
#include "unit.h"

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

static inline CtsStatus run_frame(CtsSandbox *d, const CtsFrameFormat *format, const uint8_t *stream, size_t n,
                                  const void **pixels, CtsError *err)
{
    cts_codec_send(d, format, stream, n);
    return cts_sandbox_take(d, pixels, err);
}
