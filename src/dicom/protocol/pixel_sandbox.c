#include "dicom/protocol/pixel_sandbox.h"

CtsSandbox cts_codec_make(void)
{
    return cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_DECODE, "decoder");
}

/* DCMTK needs an even number of bytes. */
static size_t room_for(const CtsFrameFormat *format)
{
    return cts_frame_bytes(format) + 1;
}

bool cts_codec_fits(CtsSandbox *sandbox, const CtsFrameFormat *format, size_t n)
{
    return cts_sandbox_fits(sandbox, n, room_for(format));
}

CtsStatus cts_codec_room(CtsSandbox *sandbox, const CtsFrameFormat *format, size_t n, uint8_t **stream, CtsError *err)
{
    return cts_sandbox_room(sandbox, n, room_for(format), stream, err);
}

void cts_codec_send(CtsSandbox *sandbox, const CtsFrameFormat *format, const uint8_t *stream, size_t n)
{
    const CtsFrameOrder order = {*format, cts_syntax_number(format->syntax)};
    cts_sandbox_send(sandbox, &order, sizeof order, stream, n, room_for(format));
}
