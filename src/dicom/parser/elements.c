#include "dicom/parser/elements.h"

#include "dicom/parser/tag_scan.h"
#include <string.h>

enum { ITEM = 0xFFFEE000, DELIMITER_BYTES = 8 };

/* Skips a value of undefined length, or an item, and determines its end. */
static bool skip_undefined(CtsElements *rest, CtsElements *value, bool is_item, bool is_raw)
{
    const size_t n = cts_scan_undefined(value->at, (size_t)(rest->end - value->at), value->explicit_vr,
                                        value->big_endian, is_item, is_raw);
    rest->damaged = n == 0;
    rest->at = n ? value->at + n : rest->end;
    value->end = n ? rest->at - DELIMITER_BYTES : value->at;
    return n > 0;
}

/* Reads the next tag of n bytes. They count as damaged until it is clear that they are not. */
static bool read_raw(CtsElements *rest, size_t n, CtsRawElement *raw)
{
    if (n == 0 || rest->damaged)
        return false;
    rest->damaged = true;
    return cts_read_element(rest->at, n, rest->explicit_vr, rest->big_endian, raw);
}

bool cts_elements_next(CtsElements *rest, CtsElement *e)
{
    CtsRawElement raw;
    const size_t n = (size_t)(rest->end - rest->at);
    if (!read_raw(rest, n, &raw))
        return false;
    const uint8_t *const value = rest->at + raw.n_bytes;
    const bool is_un = memcmp(raw.vr, "UN", 2) == 0, is_raw = raw.vr[0] == 'O';
    *e = (CtsElement){
        .tag = raw.tag,
        .vr = {raw.vr[0], raw.vr[1]},
        .value = {.at = value, .explicit_vr = rest->explicit_vr && !is_un, .big_endian = rest->big_endian && !is_un},
        .undefined = raw.length == UINT32_MAX};
    if (e->undefined)
        return skip_undefined(rest, &e->value, false, is_raw);
    if (raw.length > n - raw.n_bytes)
        return false;
    rest->at = e->value.end = value + raw.length;
    rest->damaged = false;
    return true;
}

bool cts_items_next(CtsElements *rest, CtsElements *item)
{
    CtsRawElement raw;
    const size_t n = (size_t)(rest->end - rest->at);
    if (!read_raw(rest, n, &raw) || raw.tag != ITEM)
        return false;
    *item = *rest;
    item->at += raw.n_bytes;
    item->damaged = false;
    if (raw.length == UINT32_MAX)
        return skip_undefined(rest, item, true, false);
    if (raw.length > n - raw.n_bytes)
        return false;
    rest->at = item->end = item->at + raw.length;
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
    const bool is_text = tag == 0x00280008 || tag >> 16 == 0x3006; /* among the requested attributes, those of VR IS */
    if (is_text)
        return n && cts_dcm_parse_is((const char *)v.at, n, value);
    if (n != 2 && n != 4)
        return false;
    uint32_t number = 0;
    for (size_t i = 0; i < n; i++)
        number |= (uint32_t)v.at[v.big_endian ? n - 1 - i : i] << 8 * i;
    *value = (int)number;
    return number <= INT32_MAX;
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
        values[i] = v.at[2 * i + v.big_endian] | v.at[2 * i + !v.big_endian] << 8;
    return true;
}
