/* The supported transfer syntaxes, and the encoding of pixels in each (PS3.5 Annex A). */
#pragma once

#include "ctsplat/api.h"
#include <stdbool.h>

CTS_C_BEGIN

typedef enum CtsCodec {
    CTS_CODEC_NATIVE, /* pixels as they are */
    CTS_CODEC_RLE,
    CTS_CODEC_JPEG,
    CTS_CODEC_JPEG_LS,
    CTS_CODEC_JPEG_2000, /* high-throughput streams (HTJ2K, Rec. ITU-T T.814) too */
    CTS_CODEC_DEFLATE,   /* each frame alone */
    CTS_CODEC_COPY,      /* pixels as they are, in fragments */
    CTS_CODEC_NONE,      /* named here, but this build cannot decode it; nor the following */
    CTS_CODEC_REMOTE,    /* a server has the pixels */
    CTS_N_CODECS
} CtsCodec;

typedef enum CtsLoss {
    CTS_LOSSLESS,
    CTS_MAYBE_LOSSY, /* depends on the header's Lossy Image Compression (0028,2110) */
    CTS_LOSSY
} CtsLoss;

typedef struct CtsSyntax {
    const char *uid, *name;
    CtsCodec codec;
    bool explicit_vr, big_endian, deflated;
    CtsLoss loss;
} CtsSyntax;

/* NULL for a UID that is not in the table. */
const CtsSyntax *cts_syntax_find(const char *uid);

/* Place of a syntax in the table, for messages to another process; and the syntax of a place. */
int cts_syntax_number(const CtsSyntax *syntax);
const CtsSyntax *cts_syntax_by_number(int number);

/* The uncompressed syntax with this encoding of the data set. */
const CtsSyntax *cts_syntax_native(bool explicit_vr, bool big_endian);

static inline bool cts_syntax_encapsulated(const CtsSyntax *syntax)
{
    return syntax->codec != CTS_CODEC_NATIVE;
}

CTS_C_END
