/* A secondary capture read back: framing and sizes are checked here before DCMTK sees any of it. */
#include "output/objects/dcm_sc.h"

#include "base/mem.h"
#include "input/codec/codec.h"
#include "input/codec/pixels.h"
#include "input/files/file_bytes.h"
#include "input/files/tag_scan.h"
#include "input/header/pixel_places.h"
#include "output/objects/dcm_writers.h"
#include <string.h>

/* PixelData of 4 GiB and the largest header. */
static const uint64_t max_file_bytes = (1ULL << 32) + CTS_MAX_HEADER_BYTES;

typedef struct ScFile {
    uint8_t *bytes;
    size_t n;
    CtsMetaScan meta;
    CtsDataScan data;
    const CtsSyntax *syntax, *native;
    CtsScHeader header;
    uint8_t *frame; /* one decoded frame; owned when the pixels are compressed */
    size_t frame_bytes;
} ScFile;

static CtsStatus load(const char *path, ScFile *f, CtsError *err)
{
    CtsFileBytes file;
    CtsStatus st = cts_file_bytes_open(&file, path, err);
    if (!st && file.fd < 0)
        st = cts_fail(err, CTS_ERR_READ, "is no regular file");
    if (!st && file.n_bytes > max_file_bytes)
        st = cts_fail(err, CTS_ERR_READ, "is larger than a DICOM picture can be");
    if (!st && !(st = cts_alloc_array(&f->bytes, (size_t)file.n_bytes, err))) {
        f->n = (size_t)file.n_bytes;
        st = cts_file_bytes_read(&file, f->bytes, f->n, 0, err);
    }
    cts_file_bytes_close(&file);
    return st;
}

static CtsStatus scan(ScFile *f, CtsError *err)
{
    const CtsScanResult meta = cts_scan_meta(f->bytes, f->n, f->n, &f->meta);
    if (meta != CTS_SCAN_DONE)
        return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s",
                        meta == CTS_SCAN_BAD ? f->meta.why : "its meta header does not end");
    if (!f->meta.syntax_uid[0])
        return cts_fail(err, CTS_ERR_READ, "damaged: it names no transfer syntax");
    f->syntax = cts_syntax_find(f->meta.syntax_uid);
    if (!f->syntax || f->syntax->codec == CTS_CODEC_NONE || f->syntax->big_endian || f->syntax->deflated)
        return cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s is not one pictures are read from (try dcmconv +te)",
                        f->meta.syntax_uid);
    f->native = cts_syntax_native(f->syntax->explicit_vr, false);
    const CtsScanResult data = cts_scan_data(f->bytes, f->n, f->n, f->meta.data_offset, f->native, &f->data);
    if (data != CTS_SCAN_DONE)
        return cts_fail(err, CTS_ERR_READ, "damaged or cut short: %s",
                        data == CTS_SCAN_BAD ? f->data.why : "its header does not end");
    if (!f->data.has_pixels || f->data.encapsulated != cts_syntax_encapsulated(f->syntax))
        return cts_fail(err, CTS_ERR_READ, "holds no pixels as its transfer syntax has them");
    return CTS_OK;
}

/* The first frame. Nothing is taken apart here: a process of its own does. */
static CtsStatus decode(ScFile *f, CtsError *err)
{
    const CtsScHeader *h = &f->header;
    const CtsFrameFormat format = {.syntax = f->syntax,
                                   .n_colours = h->n_samples == 3 ? 3 : 0,
                                   .columns = h->width,
                                   .rows = h->height,
                                   .bits_allocated = h->bits_allocated,
                                   .bits_stored = h->bits_stored,
                                   .high_bit = h->bits_stored - 1,
                                   .padding_word = -1};
    const CtsFileBytes bytes = cts_file_bytes_in_memory(f->bytes, f->n);
    CtsSandbox decoder = cts_sandbox_make(cts_codec_work, "decoder");
    uint64_t *offset = NULL;
    uint8_t *stream;
    const void *pixels;
    CtsStatus st = cts_find_frames(&bytes, f->data.pixel_offset, h->n_frames, &offset, err);
    size_t n = st ? 0 : (size_t)(offset[1] - offset[0]);
    if (st || (st = cts_alloc_array(&f->frame, f->frame_bytes, err)) ||
        (st = cts_codec_room(&decoder, &format, n, &stream, err)))
        goto end;
    memcpy(stream, f->bytes + offset[0], n);
    if ((st = cts_join_fragments(&stream, &n, err)))
        goto end;
    cts_codec_send(&decoder, &format, stream, n);
    if (!(st = cts_sandbox_take(&decoder, &pixels, err)))
        memcpy(f->frame, pixels, f->frame_bytes);
    f->header.planar = false;
end:
    cts_free(&offset);
    cts_sandbox_stop(&decoder);
    return st;
}

static CtsStatus find_frame(ScFile *f, CtsError *err)
{
    const CtsScHeader *h = &f->header;
    const uint64_t left = f->n - f->data.pixel_offset;
    f->frame_bytes = (size_t)h->width * h->height * h->n_samples * (h->bits_allocated / 8);
    if (f->data.encapsulated)
        return decode(f, err);
    f->frame = f->bytes + f->data.pixel_offset;
    return f->data.pixel_bytes >= f->frame_bytes && left >= f->frame_bytes
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "truncated: a frame needs %zu bytes, PixelData has %llu", f->frame_bytes,
                          (unsigned long long)(left < f->data.pixel_bytes ? left : f->data.pixel_bytes));
}

static void widen(const ScFile *f, CtsScPixels *pixels)
{
    const CtsScHeader *h = &f->header;
    const size_t n = (size_t)h->width * h->height;
    pixels->largest = (1 << h->bits_stored) - 1;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < h->n_samples; c++) {
            const size_t at = h->planar ? c * n + i : i * h->n_samples + c;
            const int v = (h->bits_allocated == 8 ? f->frame[at] : f->frame[2 * at] | f->frame[2 * at + 1] << 8) &
                          pixels->largest;
            pixels->samples[i * h->n_samples + c] = (uint16_t)(h->inverted ? pixels->largest - v : v);
        }
}

CtsStatus cts_dcm_sc_read(const char *path, CtsScPixels *pixels, CtsError *err)
{
    ScFile f = {0};
    *pixels = (CtsScPixels){0};
    CtsStatus st = load(path, &f, err);
    const CtsDcmWriters *dcm = NULL;
    if (st || (st = scan(&f, err)) || (st = cts_dcm_writers(&dcm, err)) ||
        (st = dcm->sc_header(f.bytes + f.meta.data_offset, f.data.header_end - f.meta.data_offset, f.native, &f.header,
                             err)) ||
        (st = find_frame(&f, err)))
        goto end;
    pixels->width = f.header.width;
    pixels->height = f.header.height;
    pixels->n_samples = f.header.n_samples;
    st = cts_alloc_array(&pixels->samples, (size_t)pixels->width * pixels->height * pixels->n_samples, err);
    if (!st)
        widen(&f, pixels);
end:
    if (f.data.encapsulated)
        cts_free(&f.frame);
    cts_free(&f.bytes);
    return st == CTS_OK ? st : cts_context(err, "%s", path);
}
