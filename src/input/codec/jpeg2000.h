/* What a JPEG 2000 stream may be for its header, whichever library decodes it. */
#ifndef CTS_DICOM_JPEG2000_H
#define CTS_DICOM_JPEG2000_H

#include "input/codec/codec.h"
#include "input/codec/htj2k.h"

#ifdef __cplusplus
extern "C" {
#endif

CtsStatus cts_jpeg2000_check_components(const CtsFrameFormat *format, unsigned n_components, CtsError *err);
/* plain: every sample is there, and the picture begins at 0. */
CtsStatus cts_jpeg2000_check_component(const CtsFrameFormat *format, bool plain, unsigned columns, unsigned rows,
                                       unsigned precision, CtsError *err);

/* Some samples of one component, `first` those before them. */
typedef struct CtsJpeg2000Samples {
    const int32_t *values;
    size_t first, n;
    int precision;
    bool is_signed;
} CtsJpeg2000Samples;

/* pixels: where the component's first sample goes. */
CtsStatus cts_jpeg2000_take_samples(const CtsFrameFormat *format, const CtsJpeg2000Samples *samples, void *pixels,
                                    CtsError *err);

/* cts_htj2k_decode() by this library; NULL: by OpenJPEG alone, which also reads, or refuses, what OpenJPH cannot. */
CtsStatus cts_htj2k_decode_by(cts_htj2k_fn run, const CtsFrameFormat *format, const uint8_t *stream, size_t n,
                              void *pixels, CtsError *err);

#ifdef __cplusplus
}
#endif
#endif
