#include "dicom/reader/tag_scan.h"

#include <stdio.h>
#include <string.h>

#define UNDEFINED UINT64_MAX

enum { TAG_ITEM = 0xFFFEE000, TAG_ITEM_END = 0xFFFEE00D, TAG_SEQUENCE_END = 0xFFFEE0DD, TAG_PIXELS = 0x7FE00010 };

/* Attributes that affect the picture: where one of them occurs twice with different values, the file is ambiguous. */
static const struct {
    uint32_t tag;
    bool decides, is_uid;
} checked_tags[CTS_N_CHECKED_TAGS] = {
    {0x00080016, true, false}, {0x00080018, false, true}, {0x00100010, true, false}, {0x00100020, true, false},
    {0x00100021, true, false}, {0x00100030, true, false}, {0x00100040, true, false}, {0x00101030, true, false},
    {0x00189701, true, false}, {0x00189758, true, false}, {0x00189759, true, false}, {0x0020000D, true, true},
    {0x0020000E, true, true},  {0x00200032, true, false}, {0x00200037, true, false}, {0x00200052, true, true},
    {0x00280002, true, false}, {0x00280008, true, false}, {0x00280010, true, false}, {0x00280011, true, false},
    {0x00280030, true, false}, {0x00280051, true, false}, {0x00280100, true, false}, {0x00280101, true, false},
    {0x00280102, true, false}, {0x00280103, true, false}, {0x00280120, true, false}, {0x00280121, true, false},
    {0x00281052, true, false}, {0x00281053, true, false}, {0x00541001, true, false}, {0x00541006, true, false},
    {0x00541102, true, false},
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
    if (w->height / 2 >= CTS_MAX_NESTING) {
        w->maybe_end = 0;
        return bad(w, "sequences are nested more than 64 deep");
    }
    w->stack[w->height++] = (OpenElement){end, item, implicit_vr, fragments};
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
        if (cts_read_tag(w->bytes + value, w->big && !is_un) == TAG_ITEM) {
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
    const bool encapsulated = e->length == UINT32_MAX;
    w->scan->pixels = (CtsPixelFraming){.found = true,
                                        .are_words = memcmp(e->vr, "OB", 2) != 0,
                                        .encapsulated = encapsulated,
                                        .offset = w->pos + e->n_bytes,
                                        .n_bytes = encapsulated ? 0 : e->length};
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
        w->scan->pixels.float_tag = e->tag;
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
    if (start + 8 <= n && cts_vr_is_known(bytes + start + 4) != syntax->explicit_vr) {
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
