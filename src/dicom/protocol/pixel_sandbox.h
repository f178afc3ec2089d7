/* Sandboxes of the program ctsplat-pixels (dicom/pixels), the only place where compressed bytes from outside are
 * decoded, since codecs crash, hang and overrun on damaged streams; and their messages: a task's parameters, its stream
 * and its answer. */
#pragma once

#include "base/sandbox.h"
#include "dicom/protocol/syntax.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

#define CTS_PIXELS_PROGRAM "ctsplat-pixels"

typedef enum CtsPixelsTask {
    CTS_PIXELS_DECODE, /* CtsFrameOrder; a frame's fragments as items, or a deflated data set; the frame's pixels */
    CTS_PIXELS_GUNZIP, /* uint64_t, the bytes unpacked until now; a gzip file's next part; CtsUnpacked, then its bytes
                        */
    CTS_PIXELS_UNZIP,  /* a zip file; CtsMemberRecord and member, repeated */
    CTS_PIXELS_IMAGE,  /* CtsImageBox; a DICOM file; CtsImageBox of the image, then its pixels, 3 bytes each */
    CTS_PIXELS_ENCODE, /* CtsFrameOrder; a frame's samples; a size_t, then its only fragment of that length */
    CTS_N_PIXELS_TASKS
} CtsPixelsTask;

/* Format of one frame by its header: grey pixels, or red, green, blue. */
typedef struct CtsFrameFormat {
    const CtsSyntax *syntax;
    int n_colours; /* samples a pixel, side by side; 0: grey */
    int columns, rows, bits_allocated, bits_stored, high_bit;
    bool is_signed;
    int padding_word;  /* as in CtsSlice */
    uint64_t n_before; /* deflated: bytes of the data set before the pixels */
} CtsFrameFormat;

typedef struct CtsFrameOrder {
    CtsFrameFormat format; /* its syntax is set from the number */
    int syntax_number;
} CtsFrameOrder;

static inline size_t cts_frame_bytes(const CtsFrameFormat *format)
{
    const size_t n_samples = format->n_colours > 0 ? (size_t)format->n_colours : 1;
    return (size_t)format->columns * (size_t)format->rows * n_samples * (size_t)(format->bits_allocated / 8);
}

/* Sizes of an image: the largest, and its own. */
typedef struct CtsImageBox {
    int width, height;
} CtsImageBox;

static inline size_t cts_image_bytes(CtsImageBox box)
{
    return sizeof box + 3 * (size_t)box.width * (size_t)box.height;
}

/* Record of an unzipped member, followed by its name with a NUL and its bytes; the next record is at a multiple of
 * CTS_MEMBER_ALIGNMENT, and the last one has no name. */
typedef struct CtsMemberRecord {
    uint64_t n_bytes;
    uint32_t n_name;
    uint32_t is_bad; /* its bytes are the reason, a text with a NUL */
} CtsMemberRecord;

enum {
    CTS_MEMBER_ALIGNMENT = 16,
    CTS_MEMBER_MAX_NAME = 1024, /* bytes; the rest is cut off */
    CTS_MEMBER_LOOK = 4096,     /* bytes needed to detect a member's format */
    CTS_MAX_MEMBERS = 200000    /* ten series of the largest size (20000 slices) */
};

static inline size_t cts_member_aligned(size_t n)
{
    return (n + CTS_MEMBER_ALIGNMENT - 1) / CTS_MEMBER_ALIGNMENT * CTS_MEMBER_ALIGNMENT;
}

/* Progress in a gzip file: bytes taken of the part, and bytes made. Both are 0 at the file's end. */
typedef struct CtsUnpacked {
    uint64_t n_taken, n_bytes;
} CtsUnpacked;

CTS_C_END
