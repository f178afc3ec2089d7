/* One frame as a JPEG 2000 code stream without loss, in a process of its own: OpenJPEG crashes where memory is short.
 */
#include "dicom/objects/objects.h"

#include "dicom/protocol/pixel_sandbox.h"
#include <string.h>

/* EXTRA_BYTES: for headers of the code stream. SAMPLES_PER_CPU_S: bytes of samples for each second of the limit of
 * processor time, which ends an encoder that hangs. Measured: OpenJPEG encodes 39 MB of a picture in a second. */
enum { EXTRA_BYTES = 1 << 16, SAMPLES_PER_CPU_S = 100000 };

CtsStatus cts_j2k_encode(const CtsScFrame *frame, CtsScSink sink, void *context, CtsError *err)
{
    /* Twice the samples: noise may expand. */
    const size_t n_answer = 2 * frame->n_samples_bytes + EXTRA_BYTES;
    const size_t n = frame->n_samples_bytes;
    const CtsEncodeOrder order = {frame->width, frame->height, frame->grey, frame->n_threads};
    CtsSandbox encoder = cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_ENCODE, "encoder");
    CtsError why = {0};
    uint8_t *samples;
    const void *answer;
    encoder.cpu_limit_s = 60 + (int)(n / SAMPLES_PER_CPU_S);
    CtsStatus st = cts_sandbox_room(&encoder, n, n_answer, &samples, &why);
    if (!st) {
        memcpy(samples, frame->samples, n);
        cts_sandbox_send(&encoder, &order, sizeof order, samples, n, n_answer);
        st = cts_sandbox_take(&encoder, &answer, &why);
    }
    if (st) {
        st = cts_fail(err, CTS_ERR_OUTPUT, "a frame of %d x %d pixels cannot be compressed: %s", frame->width,
                      frame->height, why.text);
    } else {
        size_t n_stream;
        memcpy(&n_stream, answer, sizeof n_stream); /* an odd end is followed by a zero: fragments are of even length */
        st = sink(context, (const uint8_t *)answer + sizeof n_stream, n_stream + n_stream % 2, err);
    }
    cts_sandbox_stop(&encoder);
    return st;
}
