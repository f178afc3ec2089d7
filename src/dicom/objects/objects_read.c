/* Secondary captures and presentation states read back: framing and sizes are checked before anything is allocated or
 * decoded. */
#include "dicom/objects/records.h"

#include "base/mem.h"
#include "ctsplat/bounds.h"
#include "dicom/codec/pixels.h"
#include "dicom/header/pixel_places.h"
#include <limits.h>
#include <string.h>

typedef struct ScFile {
    CtsDicomObject head;
    CtsFrameFormat format;
    int n_frames, n_samples; /* n_samples: 1 or 3 */
    bool planar;             /* all red, then all green, then all blue */
    bool inverted;           /* MONOCHROME1 */
    uint8_t *frame;          /* the first one, decoded; owned */
    size_t frame_bytes;
} ScFile;

static CtsStatus open_object(const char *path, ScFile *f, CtsError *err)
{
    const CtsStatus st = cts_dicom_object_open(&f->head, &(CtsFile){.path = path}, CTS_MAX_HEADER_BYTES, err);
    const CtsSyntax *const syntax = f->head.syntax;
    if (st)
        return st;
    if (f->head.facts.deviations & CTS_DEVIATION_NO_SYNTAX)
        return cts_fail(err, CTS_ERR_READ, "damaged: it names no transfer syntax");
    if (!syntax || syntax->codec >= CTS_CODEC_NONE || syntax->big_endian || syntax->deflated)
        return cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s is not one pictures are read from (try dcmconv +te)",
                        f->head.facts.syntax_uid);
    if (!f->head.facts.pixels.found || f->head.facts.pixels.encapsulated != cts_syntax_encapsulated(syntax))
        return cts_fail(err, CTS_ERR_READ, "holds no pixels as its transfer syntax has them");
    return CTS_OK;
}

static CtsStatus refuse_object(CtsError *err, const char *why)
{
    return cts_fail(err, CTS_ERR_READ, "is no picture that can be read: %s", why);
}

/* Unsigned RGB of 8 bits, or grey of up to 16. */
static CtsStatus read_header(ScFile *file, CtsError *err)
{
    const CtsElements all = file->head.elements;
    CtsFrameFormat *const f = &file->format;
    char colours[17];
    int planar = 0, is_signed = 0;
    CtsElement frames;
    *f = (CtsFrameFormat){.syntax = file->head.syntax, .padding_word = -1};
    file->n_frames = file->n_samples = 1;
    cts_elements_text(all, DCM_PhotometricInterpretation, colours, sizeof colours);
    const bool counted = cts_elements_integer(all, DCM_NumberOfFrames, &file->n_frames);
    cts_elements_integer(all, DCM_Columns, &f->columns);
    cts_elements_integer(all, DCM_Rows, &f->rows);
    cts_elements_integer(all, DCM_SamplesPerPixel, &file->n_samples);
    cts_elements_integer(all, DCM_PlanarConfiguration, &planar);
    cts_elements_integer(all, DCM_BitsAllocated, &f->bits_allocated);
    cts_elements_integer(all, DCM_BitsStored, &f->bits_stored);
    cts_elements_integer(all, DCM_PixelRepresentation, &is_signed);
    f->high_bit = f->bits_stored - 1;
    cts_elements_integer(all, DCM_HighBit, &f->high_bit);
    f->n_colours = file->n_samples == 3 ? 3 : 0;
    file->planar = planar == 1;
    file->inverted = strcmp(colours, "MONOCHROME1") == 0;
    if (!counted && cts_elements_get(all, DCM_NumberOfFrames, &frames))
        return refuse_object(err, "its number of frames is no number");
    if (f->columns < 1 || f->rows < 1 || f->columns > CTS_MAX_SIDE || f->rows > CTS_MAX_SIDE || file->n_frames < 1)
        return refuse_object(err, "its size is not within what a picture can have");
    const bool colour = f->n_colours && f->bits_allocated == 8 && f->bits_stored == 8 &&
                        (!strcmp(colours, "RGB") || !strcmp(colours, "YBR_RCT"));
    const bool grey = file->n_samples == 1 && (f->bits_allocated == 8 || f->bits_allocated == 16) &&
                      f->bits_stored >= 1 && f->bits_stored <= f->bits_allocated &&
                      (file->inverted || !strcmp(colours, "MONOCHROME2"));
    if ((!colour && !grey) || is_signed || f->high_bit != f->bits_stored - 1)
        return refuse_object(err, "its pixels are neither RGB of 8 bits nor unsigned grey");
    return CTS_OK;
}

/* Compressed pixels are decoded in a sandbox. */
static CtsStatus decode_object(ScFile *f, CtsError *err)
{
    CtsSandbox decoder = cts_codec_make();
    uint64_t *offset = NULL;
    const void *pixels;
    CtsStatus st = cts_find_frames(&f->head.file, f->head.facts.pixels.offset, f->n_frames, &offset, err);
    if (!st && !(st = cts_codec_submit(&decoder, &f->format, &f->head.file, offset[0], offset[1], err)) &&
        !(st = cts_sandbox_take(&decoder, &pixels, err)))
        memcpy(f->frame, pixels, f->frame_bytes);
    f->planar = false;
    cts_free(&offset);
    cts_sandbox_stop(&decoder);
    return st;
}

static CtsStatus read_frame(ScFile *f, CtsError *err)
{
    const CtsHeaderFacts *const scan = &f->head.facts;
    const uint64_t left = f->head.file.n_bytes - scan->pixels.offset;
    f->frame_bytes = cts_frame_bytes(&f->format);
    if (!scan->pixels.encapsulated && (scan->pixels.n_bytes < f->frame_bytes || left < f->frame_bytes))
        return cts_fail(err, CTS_ERR_READ, "truncated: a frame needs %zu bytes, PixelData has %llu", f->frame_bytes,
                        (unsigned long long)(left < scan->pixels.n_bytes ? left : scan->pixels.n_bytes));
    const CtsStatus st = cts_alloc_array(&f->frame, f->frame_bytes, err);
    if (st || scan->pixels.encapsulated)
        return st ? st : decode_object(f, err);
    return cts_file_bytes_read(&f->head.file, f->frame, f->frame_bytes, scan->pixels.offset, err);
}

static CtsStatus widen_pixels(const ScFile *f, CtsScPixels *pixels, CtsError *err)
{
    const size_t n = (size_t)f->format.columns * (size_t)f->format.rows, n_samples = (size_t)f->n_samples;
    *pixels = (CtsScPixels){.width = f->format.columns,
                            .height = f->format.rows,
                            .n_samples = f->n_samples,
                            .largest = (1 << f->format.bits_stored) - 1};
    const CtsStatus st = cts_alloc_array(&pixels->samples, n * n_samples, err);
    for (size_t i = 0; !st && i < n * n_samples; i++) {
        const size_t at = f->planar ? i % n_samples * n + i / n_samples : i;
        const int v = (f->format.bits_allocated == 8 ? f->frame[at] : f->frame[2 * at] | f->frame[2 * at + 1] << 8) &
                      pixels->largest;
        pixels->samples[i] = (uint16_t)(f->inverted ? pixels->largest - v : v);
    }
    return st;
}

CtsStatus cts_dcm_sc_read(const char *path, CtsScPixels *pixels, CtsError *err)
{
    ScFile f = {.head.file.fd = -1};
    *pixels = (CtsScPixels){0};
    CtsStatus st = open_object(path, &f, err);
    if (!st && !(st = read_header(&f, err)) && !(st = read_frame(&f, err)))
        st = widen_pixels(&f, pixels, err);
    cts_free(&f.frame);
    cts_dicom_object_close(&f.head);
    return st ? cts_context(err, "%s", path) : st;
}

static char *text_of(CtsElements all, uint16_t element)
{
    const CtsElements value = cts_elements_find(all, (uint32_t)CTS_STATE_GROUP << 16 | element);
    return value.at < value.end ? strndup((const char *)value.at, (size_t)(value.end - value.at)) : NULL;
}

static void read_volume(CtsElements all, CtsDcmStateRead *state)
{
    const CtsElements image = cts_elements_item(cts_elements_item(all, DCM_VolumetricPresentationInputSetSequence),
                                                DCM_ReferencedImageSequence);
    CtsElement frames;
    double first = 0;
    cts_elements_text(cts_elements_item(all, DCM_ReferencedSeriesSequence), DCM_SeriesInstanceUID, state->series_uid,
                      65);
    cts_elements_text(image, DCM_ReferencedSOPInstanceUID, state->slice_uid, 65);
    if (cts_elements_get(image, DCM_ReferencedFrameNumber, &frames) && frames.kind == CTS_VALUE_NUMBERS &&
        frames.value.end - frames.value.at >= (ptrdiff_t)sizeof first)
        memcpy(&first, frames.value.at, sizeof first);
    state->slice_frame = first >= 1 && first <= INT_MAX ? (int)first : 0;
}

static CtsStatus read_state(CtsElements all, CtsDcmStateRead *state, CtsError *err)
{
    char class_uid[65], creator[65];
    cts_elements_text(all, DCM_SOPClassUID, class_uid, sizeof class_uid);
    if (strcmp(class_uid, CTS_STATE_CLASS) != 0)
        return cts_fail(err, CTS_ERR_READ, "is no Volume Rendering Volumetric Presentation State");
    cts_elements_text(all, (uint32_t)CTS_STATE_GROUP << 16 | CTS_STATE_CREATOR, creator, sizeof creator);
    if (strcmp(creator, CTS_STATE_BLOCK) == 0) {
        state->preset = text_of(all, CTS_STATE_PRESET);
        state->options = text_of(all, CTS_STATE_OPTIONS);
        read_volume(all, state);
    }
    return state->preset && state->options
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "was not written by ctsplat: its private attributes are missing");
}

CtsStatus cts_dcm_state_read(const char *path, CtsDcmStateRead *state, CtsError *err)
{
    CtsDicomObject head;
    *state = (CtsDcmStateRead){0};
    CtsStatus st = cts_dicom_object_open(&head, &(CtsFile){.path = path}, CTS_MAX_HEADER_BYTES, err);
    if (!st)
        st = read_state(head.elements, state, err);
    cts_dicom_object_close(&head);
    return st ? cts_context(err, "%s", path) : st;
}
