#include "dicom/protocol/pixel_sandbox.h"

#include <string.h>

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

CtsStatus cts_codec_inflate(CtsSandbox **sandbox, const uint8_t *stream, size_t n, uint8_t *bytes, size_t n_wanted,
                            size_t *got, CtsError *err)
{
    const size_t n_answer = sizeof *got + n_wanted;
    uint8_t *room;
    const void *answer;
    CtsStatus st = cts_sandbox_new(sandbox, CTS_PIXELS_PROGRAM, CTS_PIXELS_INFLATE, "decoder", 1, err);
    if (st || (st = cts_sandbox_room(*sandbox, n, n_answer, &room, err)))
        return st;
    memcpy(room, stream, n);
    cts_sandbox_send(*sandbox, NULL, 0, room, n, n_answer);
    if ((st = cts_sandbox_take(*sandbox, &answer, err)))
        return st;
    memcpy(got, answer, sizeof *got);
    *got = *got < n_wanted ? *got : n_wanted;
    memcpy(bytes, (const uint8_t *)answer + sizeof *got, *got);
    return CTS_OK;
}
