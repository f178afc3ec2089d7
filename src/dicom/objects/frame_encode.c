/* Frames compressed by ctsplat-pixels. */
#include "dicom/objects/objects.h"

#include "dicom/protocol/pixel_sandbox.h"
#include <string.h>

/* Twice the samples, since noise may expand, and headers. */
static size_t room_for_fragment(const CtsScFrame *frame)
{
    return sizeof(size_t) + 2 * frame->n_samples_bytes + (1 << 16);
}

CtsStatus cts_frame_room(CtsScFrame *frame, CtsError *err)
{
    uint8_t *samples;
    CtsStatus st = cts_sandbox_new(&frame->encoder, CTS_PIXELS_PROGRAM, CTS_PIXELS_ENCODE, "encoder", 1, err);
    frame->n_samples_bytes = (size_t)frame->width * (size_t)frame->height * (frame->grey ? 2 : 3);
    if (!st &&
        !(st = cts_sandbox_room(frame->encoder, frame->n_samples_bytes, room_for_fragment(frame), &samples, err)))
        frame->samples = samples;
    return st;
}

CtsStatus cts_frame_encode(CtsScFrame *frame, const char *syntax_uid, const void **fragment, size_t *n, CtsError *err)
{
    const int bits = frame->grey ? 16 : 8;
    const CtsFrameOrder order = {.format = {.n_colours = frame->grey ? 0 : 3,
                                            .columns = frame->width,
                                            .rows = frame->height,
                                            .bits_allocated = bits,
                                            .bits_stored = bits,
                                            .high_bit = bits - 1},
                                 .syntax_number = cts_syntax_number(cts_syntax_find(syntax_uid))};
    const size_t n_answer = room_for_fragment(frame);
    const void *answer;
    CtsError why = {0};
    cts_sandbox_send(frame->encoder, &order, sizeof order, frame->samples, frame->n_samples_bytes, n_answer);
    if (cts_sandbox_take(frame->encoder, &answer, &why))
        return cts_fail(err, CTS_ERR_OUTPUT, "a frame of %d x %d pixels cannot be compressed: %s", frame->width,
                        frame->height, why.text);
    memcpy(n, answer, sizeof *n);
    *fragment = (const uint8_t *)answer + sizeof *n;
    return *n <= n_answer - sizeof *n ? CTS_OK : cts_fail(err, CTS_ERR_OUTPUT, "its encoder's answer makes no sense");
}
