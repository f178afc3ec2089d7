#include "input/header/elements.h"

#include "input/files/tag_scan.h"
#include "input/header/dcm_read.h"
#include <string.h>

enum { ITEM = 0xFFFEE000, ITEM_END = 0xFFFEE00D, SEQUENCE_END = 0xFFFEE0DD, DEEPEST = 2 * CTS_MAX_NESTING };

/* Behind a sequence of undefined length, its delimiter taken in; NULL where it has none. *inner: where that begins. */
static const uint8_t *skip_items(CtsElements rest, const uint8_t **inner, int depth);

/* One element's place; fragments are skipped like items. */
static bool next(CtsElements *rest, CtsElement *e, int depth)
{
    CtsRawElement raw;
    const size_t n = (size_t)(rest->end - rest->at);
    if (n == 0 || rest->damaged)
        return false;
    rest->damaged = true; /* until it is clear that it is not */
    if (depth > DEEPEST || !cts_read_element(rest->at, n, rest->explicit_vr, rest->big_endian, &raw))
        return false;
    const uint8_t *const value = rest->at + raw.n_bytes;
    const bool raw_vr = memcmp(raw.vr, "UN", 2) == 0;
    *e = (CtsElement){
        .tag = raw.tag,
        .vr = {raw.vr[0], raw.vr[1]},
        .value = {.at = value, .explicit_vr = rest->explicit_vr && !raw_vr, .big_endian = rest->big_endian && !raw_vr},
        .undefined = raw.length == UINT32_MAX};
    if (e->undefined) {
        CtsElements behind = e->value;
        behind.end = rest->end;
        rest->at = skip_items(behind, &e->value.end, depth + 1);
        rest->damaged = !rest->at;
        rest->at = rest->at ? rest->at : rest->end;
        return !rest->damaged;
    }
    if (raw.length > n - raw.n_bytes)
        return false;
    rest->at = e->value.end = value + raw.length;
    rest->damaged = false;
    return true;
}

static const uint8_t *skip_item(CtsElements rest, const uint8_t **inner, int depth)
{
    CtsElement e;
    while (rest.at < rest.end) {
        const uint8_t *const here = rest.at;
        CtsRawElement raw;
        if (!cts_read_element(here, (size_t)(rest.end - here), rest.explicit_vr, rest.big_endian, &raw))
            return NULL;
        *inner = here;
        if (raw.tag == ITEM_END)
            return here + raw.n_bytes;
        if (!next(&rest, &e, depth))
            return NULL;
    }
    return NULL;
}

static const uint8_t *skip_items(CtsElements rest, const uint8_t **inner, int depth)
{
    while (depth <= DEEPEST && rest.end - rest.at >= 8) {
        CtsRawElement raw;
        const uint8_t *ignored;
        const uint8_t *const here = rest.at;
        if (!cts_read_element(here, (size_t)(rest.end - here), rest.explicit_vr, rest.big_endian, &raw))
            return NULL;
        rest.at += raw.n_bytes;
        *inner = here;
        if (raw.tag == SEQUENCE_END)
            return rest.at;
        if (raw.tag != ITEM || (raw.length != UINT32_MAX && raw.length > (size_t)(rest.end - rest.at)))
            return NULL;
        rest.at = raw.length == UINT32_MAX ? skip_item(rest, &ignored, depth + 1) : rest.at + raw.length;
        if (!rest.at)
            return NULL;
    }
    return NULL;
}

bool cts_elements_next(CtsElements *rest, CtsElement *e)
{
    return next(rest, e, 0);
}

bool cts_items_next(CtsElements *rest, CtsElements *item)
{
    CtsRawElement raw;
    const size_t n = (size_t)(rest->end - rest->at);
    if (n == 0 || rest->damaged)
        return false;
    rest->damaged = true;
    if (!cts_read_element(rest->at, n, rest->explicit_vr, rest->big_endian, &raw) || raw.tag != ITEM)
        return false;
    *item = *rest;
    item->at += raw.n_bytes;
    item->damaged = false;
    if (raw.length == UINT32_MAX) {
        const uint8_t *const behind = skip_item(*item, &item->end, 0);
        if (!behind)
            return false;
        rest->at = behind;
    } else if (raw.length > n - raw.n_bytes) {
        return false;
    } else {
        rest->at = item->end = item->at + raw.length;
    }
    rest->damaged = false;
    return true;
}

bool cts_elements_get(CtsElements elements, uint32_t tag, CtsElement *e)
{
    while (cts_elements_next(&elements, e))
        if (e->tag == tag)
            return true;
    return false;
}

CtsElements cts_elements_find(CtsElements elements, uint32_t tag)
{
    CtsElement e;
    return cts_elements_get(elements, tag, &e) ? e.value : (CtsElements){.at = elements.end, .end = elements.end};
}

CtsElements cts_elements_item(CtsElements elements, uint32_t sequence_tag)
{
    CtsElements sequence = cts_elements_find(elements, sequence_tag), item;
    return cts_items_next(&sequence, &item) ? item : (CtsElements){.at = sequence.end, .end = sequence.end};
}

bool cts_elements_text(CtsElements elements, uint32_t tag, char *text, size_t size)
{
    const CtsElements value = cts_elements_find(elements, tag);
    const char *p = (const char *)value.at;
    size_t n = (size_t)(value.end - value.at);
    while (n && (p[n - 1] == ' ' || p[n - 1] == 0))
        n--;
    for (; n && *p == ' '; n--)
        p++;
    n = n < size ? n : size - 1;
    memcpy(text, p, n);
    text[n] = 0;
    return n > 0;
}

bool cts_elements_integer(CtsElements elements, uint32_t tag, int *value)
{
    const CtsElements v = cts_elements_find(elements, tag);
    const size_t n = (size_t)(v.end - v.at);
    const bool is_text = tag == 0x00280008 || tag >> 16 == 0x3006; /* of those that are asked for, the IS */
    if (is_text)
        return n && cts_dcm_parse_is((const char *)v.at, n, value);
    if (n != 2 && n != 4)
        return false;
    const uint32_t low = v.at[0] | (uint32_t)v.at[1] << 8, high = n == 4 ? v.at[2] | (uint32_t)v.at[3] << 8 : 0;
    *value = (int)(high << 16 | low);
    return high <= INT16_MAX;
}

bool cts_elements_decimals(CtsElements elements, uint32_t tag, double *values, int n)
{
    const CtsElements v = cts_elements_find(elements, tag);
    size_t n_bytes = (size_t)(v.end - v.at);
    while (n_bytes && (v.at[n_bytes - 1] == ' ' || v.at[n_bytes - 1] == 0))
        n_bytes--;
    return n_bytes && cts_dcm_parse_ds((const char *)v.at, n_bytes, values, n);
}

bool cts_elements_shorts(CtsElements elements, uint32_t tag, int *values, int n)
{
    const CtsElements v = cts_elements_find(elements, tag);
    if (v.end - v.at != 2 * n)
        return false;
    for (int i = 0; i < n; i++)
        values[i] = v.at[2 * i] | v.at[2 * i + 1] << 8;
    return true;
}
