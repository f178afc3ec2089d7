#include "dicom/header/elements.h"

#include "base/file_bytes.h"
#include <limits.h>
#include <math.h>
#include <string.h>

bool cts_elements_next(CtsElements *rest, CtsElement *e)
{
    CtsRecord record;
    const size_t n = (size_t)(rest->end - rest->at);
    if (n < sizeof record)
        return false;
    memcpy(&record, rest->at, sizeof record);
    const uint64_t padded = record.n + (8 - record.n % 8) % 8;
    if (record.n > n - sizeof record || padded > n - sizeof record)
        return false;
    const uint8_t *const value = rest->at + sizeof record;
    *e = (CtsElement){record.tag, (CtsValueKind)record.kind, {value, value + record.n}};
    rest->at = value + padded;
    return true;
}

bool cts_items_next(CtsElements *rest, CtsElements *item)
{
    CtsElement e;
    if (!cts_elements_next(rest, &e) || e.kind != CTS_VALUE_ITEM)
        return false;
    *item = e.value;
    return true;
}

bool cts_elements_get(CtsElements elements, uint32_t tag, CtsElement *e)
{
    while (cts_elements_next(&elements, e))
        if (e->tag == tag)
            return true;
    return false;
}

/* The value of an element of this kind; an empty one if there is none. */
static CtsElements value_of(CtsElements elements, uint32_t tag, CtsValueKind kind)
{
    CtsElement e;
    return cts_elements_get(elements, tag, &e) && e.kind == kind ? e.value : (CtsElements){elements.end, elements.end};
}

CtsElements cts_elements_find(CtsElements elements, uint32_t tag)
{
    CtsElement e;
    return cts_elements_get(elements, tag, &e) ? e.value : (CtsElements){elements.end, elements.end};
}

CtsElements cts_elements_item(CtsElements elements, uint32_t sequence_tag)
{
    CtsElements sequence = value_of(elements, sequence_tag, CTS_VALUE_ITEMS), item;
    return cts_items_next(&sequence, &item) ? item : (CtsElements){sequence.end, sequence.end};
}

bool cts_elements_text(CtsElements elements, uint32_t tag, char *text, size_t size)
{
    CtsElement e;
    *text = 0;
    return cts_elements_get(elements, tag, &e) && cts_element_text(&e, text, size);
}

bool cts_element_text(const CtsElement *e, char *text, size_t size)
{
    const bool is_text = e->kind == CTS_VALUE_TEXT || e->kind == CTS_VALUE_BYTES;
    const char *p = (const char *)e->value.at;
    size_t n = is_text ? (size_t)(e->value.end - e->value.at) : 0;
    while (n && (p[n - 1] == ' ' || p[n - 1] == 0))
        n--;
    for (; n && *p == ' '; n--)
        p++;
    n = n < size ? n : size - 1;
    if (n)
        memcpy(text, p, n);
    text[n] = 0;
    return n > 0;
}

bool cts_elements_integer(CtsElements elements, uint32_t tag, int *value)
{
    double number;
    if (!cts_elements_decimals(elements, tag, &number, 1) || !(number >= INT_MIN && number <= INT_MAX) ||
        number != (int)number)
        return false;
    *value = (int)number;
    return true;
}

bool cts_elements_shorts(CtsElements elements, uint32_t tag, int *values, size_t n)
{
    double numbers[3];
    bool found = n <= 3 && cts_elements_decimals(elements, tag, numbers, n);
    for (size_t i = 0; found && i < n; i++) {
        found = numbers[i] >= 0 && numbers[i] <= UINT16_MAX;
        values[i] = found ? (int)numbers[i] : 0;
    }
    return found;
}

bool cts_elements_decimals(CtsElements elements, uint32_t tag, double *values, size_t n)
{
    const CtsElements v = value_of(elements, tag, CTS_VALUE_NUMBERS);
    if ((size_t)(v.end - v.at) != n * sizeof *values)
        return false;
    memcpy(values, v.at, n * sizeof *values);
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

void cts_put_more(CtsRecords *to, const void *bytes, size_t n)
{
    if (!n || to->status ||
        (to->n + n > to->capacity &&
         (to->status = cts_bytes_reserve(&to->bytes, &to->capacity, 2 * (to->n + n), NULL))))
        return;
    memcpy(to->bytes + to->n, bytes, n);
    to->n += n;
}

size_t cts_put_begin(CtsRecords *to, uint32_t tag, CtsValueKind kind)
{
    cts_put_more(to, &(CtsRecord){tag, kind, 0}, sizeof(CtsRecord));
    return to->n;
}

void cts_put_end(CtsRecords *to, size_t value)
{
    const uint64_t n = to->n - value, zeros = 0;
    cts_put_more(to, &zeros, (8 - n % 8) % 8);
    if (!to->status)
        memcpy(to->bytes + value - sizeof n, &n, sizeof n);
}

void cts_put_bytes(CtsRecords *to, uint32_t tag, CtsValueKind kind, const void *bytes, size_t n)
{
    const size_t value = cts_put_begin(to, tag, kind);
    cts_put_more(to, bytes, n);
    cts_put_end(to, value);
}
