/* DICOM files built byte by byte, with deliberate faults; without a library, so that the tests are independent of
 * one. */
#pragma once

#include "folder.h"
#include <stdbool.h>

typedef struct Bytes {
    uint8_t *data;
    size_t n, room;
} Bytes;

static inline void put(Bytes *b, const void *data, size_t n)
{
    if (b->n + n >= b->room) {
        b->room = 2 * (b->n + n) + 64;
        b->data = realloc(b->data, b->room);
        assert_non_null(b->data);
    }
    if (n)
        memcpy(b->data + b->n, data, n);
    b->n += n;
}

static inline void put16(Bytes *b, unsigned v)
{
    put(b, (uint8_t[]){(uint8_t)v, (uint8_t)(v >> 8)}, 2);
}

static inline void put32(Bytes *b, uint32_t v)
{
    put16(b, v & 0xFFFF);
    put16(b, v >> 16);
}

static inline void put_tag(Bytes *b, uint32_t tag)
{
    put16(b, tag >> 16);
    put16(b, tag & 0xFFFF);
}

/* Explicit VR little endian; VRs with a long length field get one. */
static inline void put_element(Bytes *b, uint32_t tag, const char *vr, const void *value, uint32_t n)
{
    put_tag(b, tag);
    put(b, vr, 2);
    if (strstr("OBOWSQUN", vr)) {
        put16(b, 0);
        put32(b, n);
    } else {
        put16(b, n);
    }
    put(b, value, n);
}

/* Padded to even length; nothing at all for NULL. */
static inline void put_text(Bytes *b, uint32_t tag, const char *vr, const char *text)
{
    if (!text)
        return;
    char padded[300];
    const int n = snprintf(padded, sizeof padded, "%s%s", text, strlen(text) % 2 ? " " : "");
    if (strcmp(vr, "UI") == 0 && strlen(text) % 2)
        padded[n - 1] = 0;
    put_element(b, tag, vr, padded, (uint32_t)n);
}

/* Nothing for a negative value. */
static inline void put_us(Bytes *b, uint32_t tag, int value)
{
    if (value >= 0)
        put_element(b, tag, "US", (uint8_t[]){(uint8_t)value, (uint8_t)(value >> 8)}, 2);
}

/* Attributes of a slice; NULL or a negative number omits the attribute. */
typedef struct Slice {
    const char *syntax, *sop_class, *sop, *series, *patient, *frame, *type, *acquisition, *time, *instance, *temporal;
    const char *position, *orientation, *spacing, *slope, *intercept, *rescale_type, *frames, *photometric,
        *description;
    int rows, columns, allocated, stored, high, is_signed, padding, samples;
    int base;           /* of the pixels: base + column + 10 * row */
    int n_more;         /* bytes after the pixels, still in PixelData */
    int n_cut;          /* bytes missing at the end of the file */
    const Bytes *extra; /* elements between group 0008 and 0010 */
    const Bytes *after; /* after the pixels */
} Slice;

enum { SLICE_COLUMNS = 6, SLICE_ROWS = 5 };

/* A sound slice; the texts live in the caller's buffers. */
static inline Slice sound_slice(void)
{
    return (Slice){.syntax = "1.2.840.10008.1.2.1",
                   .sop_class = "1.2.840.10008.5.1.4.1.1.2",
                   .sop = "1.2.3.1",
                   .series = "1.2.3",
                   .patient = "P1",
                   .frame = "1.2.9",
                   .type = "ORIGINAL\\PRIMARY\\AXIAL",
                   .acquisition = "1",
                   .position = "-1\\-2\\0",
                   .orientation = "1\\0\\0\\0\\1\\0",
                   .spacing = "0.75\\0.5",
                   .slope = "1",
                   .intercept = "-1024",
                   .photometric = "MONOCHROME2",
                   .rows = SLICE_ROWS,
                   .columns = SLICE_COLUMNS,
                   .allocated = 16,
                   .stored = 16,
                   .high = 15,
                   .is_signed = 0,
                   .padding = -1,
                   .samples = 1,
                   .base = 1000};
}

static inline void put_meta(Bytes *b, const Slice *s)
{
    static const uint8_t preamble[128];
    put(b, preamble, sizeof preamble);
    put(b, "DICM", 4);
    put_text(b, 0x00020002, "UI", s->sop_class);
    put_text(b, 0x00020010, "UI", s->syntax);
}

static inline void put_header(Bytes *b, const Slice *s)
{
    put_text(b, 0x00080008, "CS", s->type);
    put_text(b, 0x00080016, "UI", s->sop_class);
    put_text(b, 0x00080018, "UI", s->sop);
    put_text(b, 0x00080032, "TM", s->time);
    put_text(b, 0x00080060, "CS", "CT");
    put_text(b, 0x0008103E, "LO", s->description);
    if (s->extra)
        put(b, s->extra->data, s->extra->n);
    put_text(b, 0x00100020, "LO", s->patient);
    put_text(b, 0x0020000E, "UI", s->series);
    put_text(b, 0x00200012, "IS", s->acquisition);
    put_text(b, 0x00200013, "IS", s->instance);
    put_text(b, 0x00200032, "DS", s->position);
    put_text(b, 0x00200037, "DS", s->orientation);
    put_text(b, 0x00200052, "UI", s->frame);
    put_text(b, 0x00200100, "IS", s->temporal);
    put_us(b, 0x00280002, s->samples);
    put_text(b, 0x00280004, "CS", s->photometric);
    put_text(b, 0x00280008, "IS", s->frames);
    put_us(b, 0x00280010, s->rows);
    put_us(b, 0x00280011, s->columns);
    put_text(b, 0x00280030, "DS", s->spacing);
    put_us(b, 0x00280100, s->allocated);
    put_us(b, 0x00280101, s->stored);
    put_us(b, 0x00280102, s->high);
    put_us(b, 0x00280103, s->is_signed);
    put_us(b, 0x00280120, s->padding);
    put_text(b, 0x00281052, "DS", s->intercept);
    put_text(b, 0x00281053, "DS", s->slope);
    put_text(b, 0x00281054, "LO", s->rescale_type);
}

static inline int slice_word(const Slice *s, int i, int j)
{
    return s->base + i + 10 * j;
}

static inline void put_pixels(Bytes *b, const Slice *s)
{
    Bytes pixels = {0};
    for (int j = 0; j < s->rows; j++)
        for (int i = 0; i < s->columns; i++)
            if (s->allocated == 8)
                put(&pixels, (uint8_t[]){(uint8_t)slice_word(s, i, j)}, 1);
            else
                put16(&pixels, (unsigned)slice_word(s, i, j) & 0xFFFF);
    for (int i = 0; i < s->n_more || pixels.n % 2; i++)
        put(&pixels, "", 1);
    put_element(b, 0x7FE00010, "OW", pixels.data, (uint32_t)pixels.n);
    free(pixels.data);
}

static inline Bytes slice_bytes(const Slice *s)
{
    Bytes b = {0};
    put_meta(&b, s);
    put_header(&b, s);
    put_pixels(&b, s);
    if (s->after)
        put(&b, s->after->data, s->after->n);
    b.n -= (size_t)s->n_cut;
    return b;
}

static inline void write_bytes(const char *folder, const char *name, const void *data, size_t n)
{
    char path[400];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
}

static inline void write_slice(const char *folder, const char *name, const Slice *s)
{
    Bytes b = slice_bytes(s);
    write_bytes(folder, name, b.data, b.n);
    free(b.data);
}

/* Slice k of a stack along z: its position, its own UID, pixels that identify k. */
typedef struct StackTexts {
    char position[64], sop[64];
} StackTexts;

static inline Slice stack_slice(StackTexts *t, int k, double x, double y, double z)
{
    Slice s = sound_slice();
    snprintf(t->position, sizeof t->position, "%.6g\\%.6g\\%.9g", x, y, z);
    snprintf(t->sop, sizeof t->sop, "1.2.3.%d", k + 1);
    s.position = t->position;
    s.sop = t->sop;
    s.base = 1000 + 100 * k;
    return s;
}

/* Writes a slice as the file of this number. */
static inline void write_numbered(const char *folder, int k, const Slice *s)
{
    char name[16];
    snprintf(name, sizeof name, "IM%03d", k);
    write_slice(folder, name, s);
}

/* n slices at z[k], named so that the order of names is not the order of positions. */
static inline void write_stack(const char *folder, const double *z, int n)
{
    for (int k = 0; k < n; k++) {
        StackTexts t;
        char name[32];
        const Slice s = stack_slice(&t, k, -1, -2, z[k]);
        snprintf(name, sizeof name, "IM%d", (k * 11 + 3) % n + 10 * n);
        write_slice(folder, name, &s);
    }
}
