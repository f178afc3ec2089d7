/* Gzip files, part by part, by zlib. */
#include "dicom/pixels/pixel_tasks.h"

#include <string.h>
#include <zlib.h>

/* State of this process, which unpacks one file: the stream, and whether a member of it has ended. */
static z_stream z;
static bool between;

/* A member follows another one; bytes that are none are ignored. */
static bool begins_member(void)
{
    if (between && (z.avail_in < 2 || z.next_in[0] != 0x1F || z.next_in[1] != 0x8B || inflateReset(&z) != Z_OK))
        return false;
    between = false;
    return true;
}

CtsStatus cts_pixels_gunzip(const void *order, const uint8_t *part, size_t n, void *answer, size_t n_answer,
                            CtsError *err)
{
    static uint64_t n_made;
    CtsUnpacked made;
    uint64_t n_before;
    int result = Z_OK;
    memcpy(&n_before, order, sizeof n_before);
    if (!z.state && inflateInit2(&z, MAX_WBITS + 16) != Z_OK)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (n_made != n_before)
        return cts_fail(err, CTS_ERR_PIXELS, "its unpacker was killed");
    z.next_in = (uint8_t *)(uintptr_t)part;
    z.avail_in = (unsigned)n;
    z.next_out = (uint8_t *)answer + sizeof made;
    z.avail_out = (unsigned)(n_answer - sizeof made);
    while (result == Z_OK && begins_member()) {
        result = inflate(&z, Z_NO_FLUSH);
        between = result == Z_STREAM_END;
        result = between ? Z_OK : result;
    }
    if (result != Z_OK && result != Z_BUF_ERROR) /* no input or room is left */
        return cts_fail(err, CTS_ERR_PIXELS, "its gzip stream is damaged");
    made = (CtsUnpacked){n - z.avail_in, n_answer - sizeof made - z.avail_out};
    n_made += made.n_bytes;
    memcpy(answer, &made, sizeof made);
    return CTS_OK;
}
