#include "dicom/protocol/syntax.h"

#include <stddef.h>
#include <string.h>

static const CtsSyntax syntaxes[] = {
    {"1.2.840.10008.1.2", "Implicit VR Little Endian", CTS_CODEC_NATIVE, false, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.1", "Explicit VR Little Endian", CTS_CODEC_NATIVE, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.2", "Explicit VR Big Endian", CTS_CODEC_NATIVE, true, true, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.1.99", "Deflated Explicit VR Little Endian", CTS_CODEC_NATIVE, true, false, true, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.1.98", "Encapsulated Uncompressed Explicit VR Little Endian", CTS_CODEC_COPY, true, false,
     false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.8.1", "Deflated Image Frame Compression", CTS_CODEC_DEFLATE, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.5", "RLE Lossless", CTS_CODEC_RLE, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.50", "JPEG Baseline", CTS_CODEC_JPEG, true, false, false, CTS_LOSSY},
    {"1.2.840.10008.1.2.4.51", "JPEG Extended", CTS_CODEC_JPEG, true, false, false, CTS_LOSSY},
    {"1.2.840.10008.1.2.4.53", "JPEG Spectral Selection", CTS_CODEC_JPEG, true, false, false, CTS_LOSSY},
    {"1.2.840.10008.1.2.4.55", "JPEG Full Progression", CTS_CODEC_JPEG, true, false, false, CTS_LOSSY},
    {"1.2.840.10008.1.2.4.57", "JPEG Lossless", CTS_CODEC_JPEG, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.70", "JPEG Lossless SV1", CTS_CODEC_JPEG, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.80", "JPEG-LS Lossless", CTS_CODEC_JPEG_LS, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.81", "JPEG-LS Near-Lossless", CTS_CODEC_JPEG_LS, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.90", "JPEG 2000 Lossless", CTS_CODEC_JPEG_2000, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.91", "JPEG 2000", CTS_CODEC_JPEG_2000, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.92", "JPEG 2000 Multi-component Lossless", CTS_CODEC_JPEG_2000, true, false, false,
     CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.93", "JPEG 2000 Multi-component", CTS_CODEC_JPEG_2000, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.94", "JPIP Referenced", CTS_CODEC_REMOTE, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.95", "JPIP Referenced Deflate", CTS_CODEC_REMOTE, true, false, true, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.110", "JPEG XL Lossless", CTS_CODEC_NONE, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.111", "JPEG XL JPEG Recompression", CTS_CODEC_NONE, true, false, false, CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.112", "JPEG XL", CTS_CODEC_NONE, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.201", "High-Throughput JPEG 2000 Lossless", CTS_CODEC_JPEG_2000, true, false, false,
     CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.202", "High-Throughput JPEG 2000 RPCL", CTS_CODEC_JPEG_2000, true, false, false,
     CTS_LOSSLESS},
    {"1.2.840.10008.1.2.4.203", "High-Throughput JPEG 2000", CTS_CODEC_JPEG_2000, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.204", "JPIP HTJ2K Referenced", CTS_CODEC_REMOTE, true, false, false, CTS_MAYBE_LOSSY},
    {"1.2.840.10008.1.2.4.205", "JPIP HTJ2K Referenced Deflate", CTS_CODEC_REMOTE, true, false, true, CTS_MAYBE_LOSSY},
};

const CtsSyntax *cts_syntax_find(const char *uid)
{
    for (size_t i = 0; i < sizeof syntaxes / sizeof *syntaxes; i++)
        if (strcmp(syntaxes[i].uid, uid) == 0)
            return &syntaxes[i];
    return NULL;
}

int cts_syntax_number(const CtsSyntax *syntax)
{
    return (int)(syntax - syntaxes);
}

const CtsSyntax *cts_syntax_by_number(int number)
{
    return &syntaxes[number];
}

const CtsSyntax *cts_syntax_native(bool explicit_vr, bool big_endian)
{
    return &syntaxes[explicit_vr ? 1 + big_endian : 0];
}
