#include "dicom/protocol/dicom_begin.h"

#include <stdio.h>
#include <string.h>

static uint32_t read16(const uint8_t *p, bool big)
{
    return big ? (uint32_t)p[0] << 8 | p[1] : (uint32_t)p[1] << 8 | p[0];
}

static uint32_t read32(const uint8_t *p, bool big)
{
    return big ? read16(p, true) << 16 | read16(p + 2, true) : read16(p + 2, false) << 16 | read16(p, false);
}

uint32_t cts_read_tag(const uint8_t *p, bool big)
{
    return read16(p, big) << 16 | read16(p + 2, big);
}

static bool is_one_of(const char *vrs, const uint8_t vr[2])
{
    for (; *vrs; vrs += 2)
        if (memcmp(vrs, vr, 2) == 0)
            return true;
    return false;
}

/* Explicit VRs with a length of 2 bytes, and those with 4 after two reserved bytes. */
static const char short_vrs[] = "AEASATCSDADSDTFDFLISLOLTPNSHSLSSSTTMUIULUS", long_vrs[] = "OBODOFOLOVOWSQSVUCUNURUTUV";

bool cts_vr_is_known(const uint8_t vr[2])
{
    return is_one_of(short_vrs, vr) || is_one_of(long_vrs, vr);
}

/* An unknown VR of two capitals is treated as a future one, which all have the long form; any other bytes as a faulty
 * writer's, in the short form. */
static bool long_vr(const uint8_t vr[2])
{
    return !is_one_of(short_vrs, vr) && vr[0] >= 'A' && vr[0] <= 'Z' && vr[1] >= 'A' && vr[1] <= 'Z';
}

bool cts_read_element(const uint8_t *p, uint64_t n, bool explicit_vr, bool big, CtsRawElement *e)
{
    if (n < 8)
        return false;
    *e = (CtsRawElement){.tag = cts_read_tag(p, big), .n_bytes = 8};
    if (e->tag >> 16 == 0xFFFE || !explicit_vr) {
        e->length = read32(p + 4, big);
        return true;
    }
    memcpy(e->vr, p + 4, 2);
    if (!long_vr(e->vr)) {
        e->length = read16(p + 6, big);
        return true;
    }
    if (n < 12)
        return false;
    e->length = read32(p + 8, big);
    e->n_bytes = 12;
    return true;
}

static void copy_uid(char uid[65], const uint8_t *p, size_t n)
{
    n = n > 64 ? 64 : n;
    memcpy(uid, p, n);
    uid[n] = 0;
    for (n = strlen(uid); n > 0 && uid[n - 1] == ' '; n--)
        uid[n - 1] = 0;
}

/* A meta header in implicit VR, which some writers make: its first element, of a plausible length, and a second one. */
static bool implicit_meta(const uint8_t *p, size_t n)
{
    enum { MOST = 64 }; /* bytes of the first element: the group's length, its version or a UID */
    const uint32_t length = read32(p + 4, false);
    return read16(p + 2, false) <= 0x0010 && length <= MOST && length % 2 == 0 && 8 + length + 4 <= n &&
           read16(p + 8 + length, false) == 0x0002 && read16(p + 8 + length + 2, false) > read16(p + 2, false);
}

const CtsSyntax *cts_scan_guess(const uint8_t *p, size_t n)
{
    if (n < 8)
        return NULL;
    const uint32_t little = read16(p, false), big = read16(p, true);
    if (little == 0x0002 || (little >= 0x0008 && little <= 0x0020)) {
        if (cts_vr_is_known(p + 4))
            return cts_syntax_native(true, false);
        if (little == 0x0002)
            return implicit_meta(p, n) ? cts_syntax_native(false, false) : NULL;
        /* Without VR letters the tests are a tag at the start of a data set (0008,00xx), and a plausible even
         * length. */
        const uint32_t length = read32(p + 4, false);
        const bool first = little == 0x0008 && read16(p + 2, false) <= 0x00FF && length <= 0xFFFF && length % 2 == 0;
        return first ? cts_syntax_native(false, false) : NULL;
    }
    if (big >= 0x0008 && big <= 0x0020 && cts_vr_is_known(p + 4))
        return cts_syntax_native(true, true);
    return NULL;
}

static bool has_preamble(const uint8_t *bytes, size_t n)
{
    return n >= 132 && memcmp(bytes + 128, "DICM", 4) == 0;
}

bool cts_scan_begins_dicom(const uint8_t *bytes, size_t n)
{
    return has_preamble(bytes, n) || cts_scan_guess(bytes, n);
}

CtsScanResult cts_scan_meta(const uint8_t *bytes, size_t n, uint64_t file_bytes, CtsMetaScan *scan)
{
    /* 132: preamble and DICM. 4096: more than a meta header has. 1 MiB: limit of one element. */
    *scan = (CtsMetaScan){0};
    size_t pos = 0;
    if (has_preamble(bytes, n)) {
        scan->has_preamble = true;
        pos = 132;
    } else if (!cts_scan_guess(bytes, n)) {
        return CTS_SCAN_NOT_DICOM;
    }
    for (;;) {
        CtsRawElement e;
        if (pos + 12 > n && n < file_bytes) {
            scan->need = pos + 4096;
            return CTS_SCAN_MORE;
        }
        if (pos + 8 > n)
            break;
        if (read16(bytes + pos, false) != 0x0002)
            break;
        if (!cts_read_element(bytes + pos, n - pos, cts_vr_is_known(bytes + pos + 4), false, &e) ||
            e.length > file_bytes - pos - e.n_bytes || e.length > 1 << 20) {
            snprintf(scan->why, sizeof scan->why, "the meta header is cut short at byte %zu", pos);
            return CTS_SCAN_BAD;
        }
        if (pos + e.n_bytes + e.length > n) {
            scan->need = pos + e.n_bytes + e.length + 4096;
            return CTS_SCAN_MORE;
        }
        if (e.tag == 0x00020010)
            copy_uid(scan->syntax_uid, bytes + pos + e.n_bytes, e.length);
        else if (e.tag == 0x00020002)
            copy_uid(scan->sop_class_uid, bytes + pos + e.n_bytes, e.length);
        pos += e.n_bytes + e.length;
    }
    scan->data_offset = pos;
    return CTS_SCAN_DONE;
}
