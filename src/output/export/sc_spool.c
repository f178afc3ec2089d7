#include "output/export/sc_texts.h"

#include "base/mem.h"
#include <endian.h>
#include <errno.h>
#include <string.h>
#include <unistd.h>

static const uint32_t item_tag = 0xE000FFFE, delimiter_tag = 0xE0DDFFFE; /* (FFFE,E000), (FFFE,E0DD) */

/* The head of an item, a delimiter or a value: two numbers of 32 bits. */
static CtsStatus put_pair(CtsTempFile *to, uint32_t first, uint32_t second, CtsError *err)
{
    const uint32_t pair[2] = {htole32(first), htole32(second)};
    return cts_temp_write(to, pair, sizeof pair, err);
}

CtsStatus cts_sc_spool_open(CtsScSpool *spool, const char *path, const char *syntax_uid, const CtsScFrame *frame,
                            int n_frames, CtsError *err)
{
    CtsStatus st;
    *spool = (CtsScSpool){.syntax_uid = syntax_uid, .frame = *frame, .max_frames = n_frames};
    spool->frame.n_samples_bytes = (size_t)frame->width * (size_t)frame->height * (frame->grey ? 2 : 3);
    if (syntax_uid && (st = cts_alloc_array(&spool->offsets, (size_t)n_frames, err)))
        return st;
    return cts_temp_open(&spool->file, path, err);
}

/* An item of its only fragment. */
static CtsStatus compress(CtsScSpool *spool, CtsError *err)
{
    const void *fragment;
    size_t n;
    CtsStatus st = cts_frame_encode(&spool->frame, spool->syntax_uid, &fragment, &n, err);
    if (st)
        return st;
    if (n >= UINT32_MAX)
        return cts_fail(err, CTS_ERR_OUTPUT, "a compressed frame is more than a fragment can hold, 4 GiB");
    spool->offsets[spool->n_frames] = (uint32_t)spool->n_bytes; /* unused where it does not fit */
    spool->n_bytes += 8 + n;
    st = put_pair(spool->file, item_tag, (uint32_t)n, err);
    return st ? st : cts_temp_write(spool->file, fragment, n, err);
}

CtsStatus cts_sc_spool_write(CtsScSpool *spool, void *samples, size_t n_bytes, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!spool->syntax_uid) {
        uint16_t *const texts = samples;
        for (size_t i = 0; spool->frame.grey && i < n_bytes / 2; i++)
            texts[i] = htole16(texts[i]);
        st = cts_temp_write(spool->file, samples, n_bytes, err);
        spool->n_bytes += n_bytes;
    } else {
        if (n_bytes > spool->frame.n_samples_bytes - spool->n_frame_bytes || spool->n_frames == spool->max_frames)
            return cts_fail(err, CTS_ERR_INTERNAL, "more rows than the secondary capture has");
        if (spool->n_frame_bytes == 0 && (st = cts_frame_room(&spool->frame, err)))
            return st;
        memcpy((uint8_t *)spool->frame.samples + spool->n_frame_bytes, samples, n_bytes);
    }
    spool->n_frame_bytes += n_bytes;
    if (st || spool->n_frame_bytes < spool->frame.n_samples_bytes)
        return st;
    if (spool->syntax_uid)
        st = compress(spool, err);
    spool->n_frame_bytes = 0;
    spool->n_frames++;
    return st;
}

static CtsStatus copy_file(const CtsScSpool *spool, CtsTempFile *to, CtsError *err)
{
    enum { PIECE = 1 << 20 };
    uint8_t *piece = NULL;
    CtsStatus st = cts_alloc_array(&piece, PIECE, err);
    for (uint64_t at = 0; at < spool->n_bytes && !st;) {
        const uint64_t left = spool->n_bytes - at;
        const ssize_t n = pread(cts_temp_fd(spool->file), piece, left < PIECE ? (size_t)left : PIECE, (off_t)at);
        if (n > 0) {
            st = cts_temp_write(to, piece, (size_t)n, err);
            at += (uint64_t)n;
        } else if (n == 0 || errno != EINTR)
            st = cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be read back: %s", cts_temp_path(spool->file),
                          n ? strerror(errno) : "cut short");
    }
    cts_free(&piece);
    return st;
}

/* The table of offsets is empty where they do not fit 32 bits. */
static CtsStatus put_offsets(const CtsScSpool *spool, CtsTempFile *to, CtsError *err)
{
    const int n = spool->n_bytes <= UINT32_MAX ? spool->n_frames : 0;
    CtsStatus st = put_pair(to, item_tag, 4 * (uint32_t)n, err);
    for (int i = 0; i < n && !st; i++) {
        const uint32_t offset = htole32(spool->offsets[i]);
        st = cts_temp_write(to, &offset, sizeof offset, err);
    }
    return st;
}

CtsStatus cts_sc_spool_copy(const CtsScSpool *spool, CtsTempFile *to, CtsError *err)
{
    const bool texts = spool->frame.grey && !spool->syntax_uid;
    const uint32_t n = spool->syntax_uid ? UINT32_MAX : (uint32_t)(spool->n_bytes + spool->n_bytes % 2);
    CtsStatus st = cts_temp_write(to, "\xe0\x7f\x10\x00", 4, err);
    if (st || (st = cts_temp_write(to, texts ? "OW\0" : "OB\0", 4, err)))
        return st;
    const uint32_t length = htole32(n);
    if ((st = cts_temp_write(to, &length, sizeof length, err)) ||
        (spool->syntax_uid && (st = put_offsets(spool, to, err))) || (st = copy_file(spool, to, err)))
        return st;
    if (spool->syntax_uid)
        return put_pair(to, delimiter_tag, 0, err);
    return spool->n_bytes % 2 ? cts_temp_write(to, "", 1, err) : CTS_OK;
}

void cts_sc_spool_close(CtsScSpool *spool)
{
    cts_temp_discard(&spool->file);
    cts_sandbox_free(&spool->frame.encoder);
    cts_free(&spool->offsets);
}
