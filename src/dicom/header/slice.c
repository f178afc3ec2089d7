#include "dicom/header/slice.h"

#include "base/mem.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool cts_slice_has_scale(const CtsSlice *s)
{
    const bool is_ct = s->modality_id == CTS_MODALITY_CT;
    return fabs(s->slope) >= (is_ct ? 1e-6 : 1e-30) &&
           fabs(s->slope) * 65535 + fabs(s->intercept) <= (is_ct ? 1e7 : 1e30);
}

void cts_slice_free(CtsSlice *slice)
{
    for (CtsSlice *next; slice; slice = next) {
        next = slice->copy;
        free(slice);
    }
}

void cts_slice_fault(CtsSlice *slice, CtsStatus status, const char *format, ...)
{
    if (slice->fault)
        return;
    va_list args;
    va_start(args, format);
    vsnprintf(slice->fault_text, sizeof slice->fault_text, format, args);
    va_end(args);
    slice->fault = status;
}

CtsStored cts_slice_stored(const CtsSlice *s)
{
    return (CtsStored){.shift = s->high_bit + 1 - s->bits_stored,
                       .bits = s->bits_stored,
                       .is_signed = s->is_signed,
                       .padding_low = s->padding_low,
                       .padding_high = s->padding_high,
                       .padding_word = s->padding_word};
}

bool cts_slice_same_values(const CtsSlice *a, const CtsSlice *b)
{
    const CtsStored x = cts_slice_stored(a), y = cts_slice_stored(b);
    return a->slope == b->slope && a->intercept == b->intercept && x.shift == y.shift && x.bits == y.bits &&
           x.is_signed == y.is_signed && x.padding_low == y.padding_low && x.padding_high == y.padding_high &&
           x.padding_word == y.padding_word;
}

const char *cts_slice_name(const CtsSlice *slice)
{
    const char *slash = strrchr(slice->path, '/');
    return slash ? slash + 1 : slice->path;
}

CtsSliceLabel cts_slice_label(const CtsSlice *slice)
{
    CtsSliceLabel label;
    if (slice->n_frames)
        snprintf(label.text, sizeof label.text, "%.255s, frame %d", cts_slice_name(slice), slice->frame + 1);
    else
        snprintf(label.text, sizeof label.text, "%.255s", cts_slice_name(slice));
    return label;
}

CtsSlice *cts_object_add_slice(CtsObject *object, const CtsSlice *like)
{
    CtsSlice *const slice = cts_grow(&object->slices, object->n_slices, NULL) ? NULL : malloc(sizeof *slice);
    if (!slice)
        return NULL;
    *slice = like ? *like : cts_slice_unknown();
    slice->kind = object->kind;
    slice->modality_id = object->modality_id;
    return object->slices[object->n_slices++] = slice;
}

void cts_object_free(CtsObject *object)
{
    for (int i = 0; i < object->n_slices; i++)
        cts_slice_free(object->slices[i]);
    free(object->slices);
    *object = (CtsObject){0};
}

CtsStatus cts_slice_open(const CtsSlice *s, CtsFileBytes *file, CtsError *err)
{
    CtsStatus st =
        cts_file_bytes_open(file, &(CtsFile){.path = s->path, .memory = s->memory, .n_memory = s->file_bytes}, err);
    if (!st && file->fd < 0)
        st = cts_fail(err, CTS_ERR_READ, "is no longer a file");
    if (!st && !s->memory && (file->n_bytes != s->file_bytes || file->mtime_ns != s->mtime_ns))
        st = cts_fail(err, CTS_ERR_READ, "changed while it was being read (wait until it is complete)");
    return st;
}

static uint16_t grey_of_word(const CtsSlice *s, const CtsStored *stored, uint16_t word)
{
    const int32_t value = cts_stored_value(word, stored);
    if (cts_stored_is_padding(word, value, stored))
        return 0;
    return (uint16_t)fmin(fmax(floor(s->slope * value + s->intercept + 1024.5), 0), UINT16_MAX);
}

void cts_slice_sample(const CtsSlice *s, const uint16_t *words, bool are_grey, uint16_t sample[CTS_SAMPLES])
{
    const CtsStored stored = cts_slice_stored(s);
    int column[CTS_SAMPLE_SIDE];
    for (int i = 0; i < CTS_SAMPLE_SIDE; i++)
        column[i] = (2 * i + 1) * s->columns / (2 * CTS_SAMPLE_SIDE);
    for (int j = 0; j < CTS_SAMPLE_SIDE; j++) {
        const uint16_t *row = words + (size_t)((2 * j + 1) * s->rows / (2 * CTS_SAMPLE_SIDE)) * (size_t)s->columns;
        for (int i = 0; i < CTS_SAMPLE_SIDE; i++)
            *sample++ = are_grey ? row[column[i]] : grey_of_word(s, &stored, row[column[i]]);
    }
}
