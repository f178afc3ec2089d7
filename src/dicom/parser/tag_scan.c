#include "dicom/parser/tag_scan.h"

#include <stdio.h>
#include <string.h>

#define UNDEFINED UINT64_MAX

enum { TAG_ITEM = 0xFFFEE000, TAG_ITEM_END = 0xFFFEE00D, TAG_SEQUENCE_END = 0xFFFEE0DD, TAG_PIXELS = 0x7FE00010 };

static uint32_t read16(const uint8_t *p, bool big)
{
    return big ? (uint32_t)p[0] << 8 | p[1] : (uint32_t)p[1] << 8 | p[0];
}

static uint32_t read32(const uint8_t *p, bool big)
{
    return big ? read16(p, true) << 16 | read16(p + 2, true) : read16(p + 2, false) << 16 | read16(p, false);
}

static uint32_t read_tag(const uint8_t *p, bool big)
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

static bool known_vr(const uint8_t vr[2])
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
    *e = (CtsRawElement){.tag = read_tag(p, big), .n_bytes = 8};
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
        if (known_vr(p + 4))
            return cts_syntax_native(true, false);
        if (little == 0x0002)
            return implicit_meta(p, n) ? cts_syntax_native(false, false) : NULL;
        /* Without VR letters the tests are a tag at the start of a data set (0008,00xx), and a plausible even
         * length. */
        const uint32_t length = read32(p + 4, false);
        const bool first = little == 0x0008 && read16(p + 2, false) <= 0x00FF && length <= 0xFFFF && length % 2 == 0;
        return first ? cts_syntax_native(false, false) : NULL;
    }
    if (big >= 0x0008 && big <= 0x0020 && known_vr(p + 4))
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
        if (!cts_read_element(bytes + pos, n - pos, known_vr(bytes + pos + 4), false, &e) ||
            e.length > file_bytes - pos - e.n_bytes || e.length > 1 << 20) {
            snprintf(scan->why, sizeof scan->why, "the meta header is cut short at byte %zu", pos);
            return CTS_SCAN_BAD;
        }
        scan->has_meta = true;
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

/* Attributes that affect the picture: where one of them occurs twice with different values, the file is ambiguous. */
static const struct {
    uint32_t tag;
    bool decides, is_uid;
} checked_tags[CTS_N_CHECKED_TAGS] = {
    {0x00080016, true, false}, {0x00080018, false, true}, {0x00100010, true, false}, {0x00100020, true, false},
    {0x00100021, true, false}, {0x00100030, true, false}, {0x00100040, true, false}, {0x0020000D, true, true},
    {0x0020000E, true, true},  {0x00200032, true, false}, {0x00200037, true, false}, {0x00200052, true, true},
    {0x00280002, true, false}, {0x00280008, true, false}, {0x00280010, true, false}, {0x00280011, true, false},
    {0x00280030, true, false}, {0x00280100, true, false}, {0x00280101, true, false}, {0x00280102, true, false},
    {0x00280103, true, false}, {0x00280120, true, false}, {0x00280121, true, false}, {0x00281052, true, false},
    {0x00281053, true, false},
};

typedef struct OpenElement {
    uint64_t end; /* UNDEFINED: until its delimiter */
    bool item;    /* else a sequence */
    bool implicit_vr;
    bool fragments; /* its items are raw bytes */
} OpenElement;

typedef struct TagWalk {
    const uint8_t *bytes;
    uint64_t n, total, pos;
    bool explicit_vr, big;
    int height;         /* of the stack */
    OpenElement *stack; /* 2 * CTS_MAX_NESTING */
    /* An element of implicit VR or VR UN that begins like a sequence may be one. If it turns out not to be, it is
     * skipped. */
    int maybe_height;
    uint64_t maybe_end;
    size_t start, most;
    CtsDataScan *scan;
} TagWalk;

static CtsScanResult bad(TagWalk *w, const char *what)
{
    if (w->maybe_end) {
        w->height = w->maybe_height;
        w->pos = w->maybe_end;
        w->maybe_end = 0;
        return CTS_SCAN_DONE;
    }
    snprintf(w->scan->why, sizeof w->scan->why, "%s at byte %llu", what, (unsigned long long)w->pos);
    return CTS_SCAN_BAD;
}

static CtsScanResult more(TagWalk *w, uint64_t need)
{
    w->scan->need = need;
    return CTS_SCAN_MORE;
}

static CtsScanResult push(TagWalk *w, bool item, uint64_t end, bool implicit_vr, bool fragments)
{
    /* Sequences and items alternate on the stack, beginning with a sequence. */
    const int nesting = w->height / 2 + 1;
    if (nesting > CTS_MAX_NESTING) {
        w->maybe_end = 0;
        return bad(w, "sequences are nested more than 64 deep");
    }
    w->stack[w->height++] = (OpenElement){end, item, implicit_vr, fragments};
    if (nesting > w->scan->depth)
        w->scan->depth = nesting;
    return CTS_SCAN_DONE;
}

/* A sequence may contain only items and its end. */
static CtsScanResult sequence_step(TagWalk *w, const CtsRawElement *e)
{
    OpenElement *top = &w->stack[w->height - 1];
    if (e->tag == TAG_SEQUENCE_END) {
        w->pos += 8;
        if (top->end == UNDEFINED)
            w->height--;
        return CTS_SCAN_DONE;
    }
    if (e->tag != TAG_ITEM)
        return bad(w, "a sequence holds something other than items");
    w->pos += 8;
    if (top->fragments) {
        if (e->length == UINT32_MAX || e->length > w->total - w->pos)
            return bad(w, "a fragment is longer than the file");
        w->pos += e->length;
        return CTS_SCAN_DONE;
    }
    if (e->length != UINT32_MAX && e->length > w->total - w->pos)
        return bad(w, "an item is longer than the file");
    return push(w, true, e->length == UINT32_MAX ? UNDEFINED : w->pos + e->length, top->implicit_vr, false);
}

/* A UID with control characters would be a different one in software that strips them. */
static CtsScanResult check_uid(TagWalk *w, const CtsRawElement *e, const uint8_t *value)
{
    uint32_t n = e->length;
    while (n > 0 && value[n - 1] == 0)
        n--;
    for (uint32_t i = 0; i < n; i++)
        if (value[i] < 0x20 || value[i] == 0x7F) {
            snprintf(w->scan->why, sizeof w->scan->why, "its UID (%04X,%04X) holds control characters", e->tag >> 16,
                     e->tag & 0xFFFF);
            return CTS_SCAN_BAD;
        }
    return CTS_SCAN_DONE;
}

/* Values of the data set that are compared or read here must be among the bytes at hand. */
static CtsScanResult check_repetition(TagWalk *w, const CtsRawElement *e)
{
    int i = 0;
    while (i < CTS_N_CHECKED_TAGS && checked_tags[i].tag != e->tag)
        i++;
    const uint64_t offset = w->pos + e->n_bytes;
    if (i == CTS_N_CHECKED_TAGS || e->length == UINT32_MAX || offset + e->length > w->total)
        return CTS_SCAN_DONE;
    CtsScannedValue *first = &w->scan->checked[i];
    if (offset + e->length > w->n)
        return more(w, offset + e->length);
    if (!first->offset) {
        *first = (CtsScannedValue){(size_t)offset, e->length};
    } else if (checked_tags[i].decides &&
               (first->n != e->length || memcmp(w->bytes + first->offset, w->bytes + offset, e->length) != 0)) {
        snprintf(w->scan->why, sizeof w->scan->why, "(%04x,%04x) occurs twice with different values", e->tag >> 16,
                 e->tag & 0xFFFF);
        return CTS_SCAN_BAD;
    }
    return checked_tags[i].is_uid ? check_uid(w, e, w->bytes + offset) : CTS_SCAN_DONE;
}

static CtsScanResult element_step(TagWalk *w, const CtsRawElement *e, bool implicit_vr)
{
    const bool undefined = e->length == UINT32_MAX;
    const uint64_t value = w->pos + e->n_bytes;
    const bool is_sq = memcmp(e->vr, "SQ", 2) == 0, is_un = memcmp(e->vr, "UN", 2) == 0;
    if (!undefined && e->length > w->total - value)
        return bad(w, "an element is longer than the file");
    if (undefined) {
        const bool raw = memcmp(e->vr, "OB", 2) == 0 || memcmp(e->vr, "OW", 2) == 0;
        if (!implicit_vr && !is_sq && !is_un && !raw)
            return bad(w, "an element that is no sequence has no length");
        w->pos = value;
        return push(w, false, UNDEFINED, implicit_vr || is_un, raw);
    }
    if (is_sq) {
        w->pos = value;
        return push(w, false, value + e->length, false, false);
    }
    if ((implicit_vr || is_un) && e->length >= 8) {
        if (value + 4 > w->n)
            return more(w, value + 4);
        if (read_tag(w->bytes + value, w->big && !is_un) == TAG_ITEM) {
            if (!w->maybe_end) {
                w->maybe_end = value + e->length;
                w->maybe_height = w->height;
            }
            w->pos = value;
            return push(w, false, value + e->length, true, false);
        }
    }
    w->pos = value + e->length;
    return CTS_SCAN_DONE;
}

static void found_pixels(TagWalk *w, const CtsRawElement *e)
{
    CtsDataScan *scan = w->scan;
    scan->has_pixels = true;
    scan->pixel_words = memcmp(e->vr, "OB", 2) != 0;
    scan->encapsulated = e->length == UINT32_MAX;
    scan->pixel_offset = w->pos + e->n_bytes;
    scan->pixel_bytes = scan->encapsulated ? 0 : e->length;
}

/* The top level: stops at the pixels. *stop: the walk is over. */
static CtsScanResult top_step(TagWalk *w, const CtsRawElement *e, bool *stop)
{
    w->maybe_end = 0;
    if (e->tag >= TAG_PIXELS && e->tag < 0xFFFE0000) {
        if (e->tag == TAG_PIXELS)
            found_pixels(w, e);
        *stop = true;
        return CTS_SCAN_DONE;
    }
    if (e->tag == 0x7FE00008 || e->tag == 0x7FE00009) {
        w->scan->float_pixels = e->tag;
        *stop = true;
        return CTS_SCAN_DONE;
    }
    if (e->tag >> 16 == 0xFFFE)
        return bad(w, "an item lies outside a sequence");
    const CtsScanResult result = check_repetition(w, e);
    return result == CTS_SCAN_DONE ? element_step(w, e, !w->explicit_vr) : result;
}

static CtsScanResult next_tag(TagWalk *w, bool *stop)
{
    OpenElement *top = w->height ? &w->stack[w->height - 1] : NULL;
    if (top && top->end != UNDEFINED && w->pos >= top->end) {
        if (w->pos > top->end)
            return bad(w, "an element reaches past the end of its sequence");
        w->height--;
        if (w->maybe_end && w->height <= w->maybe_height)
            w->maybe_end = 0;
        return CTS_SCAN_DONE;
    }
    if (!top && (w->pos >= w->total || w->total - w->pos < 8)) {
        if (w->pos > w->n && w->pos - w->start <= w->most)
            return more(w, w->pos);
        *stop = true; /* up to 7 bytes of padding may follow the last element */
        return CTS_SCAN_DONE;
    }
    const bool implicit_vr = top ? top->implicit_vr || !w->explicit_vr : !w->explicit_vr;
    /* A UN value of undefined length is implicit little endian in every file (PS3.5 6.2.2). */
    const bool big = w->big && !(top && top->implicit_vr);
    CtsRawElement e;
    if (w->pos > w->n || !cts_read_element(w->bytes + w->pos, w->n - w->pos, !implicit_vr, big, &e)) {
        if (w->n < w->total)
            return more(w, w->pos + 12);
        return bad(w, "the data set is cut short");
    }
    if (!top)
        return top_step(w, &e, stop);
    if (!top->item)
        return sequence_step(w, &e);
    if (e.tag == TAG_ITEM_END && top->end == UNDEFINED) {
        w->pos += 8;
        w->height--;
        return CTS_SCAN_DONE;
    }
    if (e.tag >> 16 == 0xFFFE)
        return bad(w, "a delimiter is in the wrong place");
    return element_step(w, &e, implicit_vr);
}

CtsScanResult cts_scan_data(const uint8_t *bytes, size_t n, uint64_t total, size_t start, const CtsSyntax *syntax,
                            size_t most, CtsDataScan *scan)
{
    OpenElement stack[2 * CTS_MAX_NESTING];
    *scan = (CtsDataScan){0};
    TagWalk w = {.bytes = bytes,
                 .stack = stack,
                 .n = n,
                 .total = total,
                 .pos = start,
                 .explicit_vr = syntax->explicit_vr,
                 .big = syntax->big_endian,
                 .start = start,
                 .most = most,
                 .scan = scan};
    if (start + 8 <= n && known_vr(bytes + start + 4) != syntax->explicit_vr) {
        snprintf(scan->why, sizeof scan->why, "the data set is not in the %s VR that its transfer syntax promises",
                 syntax->explicit_vr ? "explicit" : "implicit");
        return CTS_SCAN_BAD;
    }
    for (bool stop = false; !stop;) {
        const CtsScanResult result = next_tag(&w, &stop);
        if (result != CTS_SCAN_DONE)
            return result;
        if (w.pos - start > most) {
            snprintf(scan->why, sizeof scan->why, "more than %zu MiB precede the pixels", most >> 20);
            return CTS_SCAN_BAD;
        }
    }
    scan->header_end = (size_t)w.pos;
    return CTS_SCAN_DONE;
}

size_t cts_scan_undefined(const uint8_t *bytes, size_t n, bool explicit_vr, bool big, bool is_item, bool is_raw)
{
    OpenElement stack[2 * CTS_MAX_NESTING];
    CtsDataScan scan = {.depth = 0};
    bool stop = false;
    TagWalk w = {
        .bytes = bytes, .stack = stack, .n = n, .total = n, .explicit_vr = explicit_vr, .big = big, .scan = &scan};
    push(&w, is_item, UNDEFINED, !explicit_vr, is_raw);
    while (w.height && next_tag(&w, &stop) == CTS_SCAN_DONE)
        ;
    return w.height ? 0 : (size_t)w.pos;
}
