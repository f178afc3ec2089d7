#include "dicom/objects/records.h"

#include "dicom/header/slice.h"
#include <stdlib.h>
#include <string.h>

void cts_put_numbers(CtsRecords *to, uint32_t tag, const double *values, size_t n)
{
    cts_put_bytes(to, tag, CTS_VALUE_NUMBERS, values, n * sizeof *values);
}

void cts_put_all_texts(CtsRecords *to, const CtsPutText *rows, size_t n)
{
    for (size_t i = 0; i < n; i++)
        cts_put_bytes(to, rows[i].tag, CTS_VALUE_TEXT, rows[i].text, strlen(rows[i].text));
}

void cts_put_all_numbers(CtsRecords *to, const CtsPutNumber *rows, size_t n)
{
    for (size_t i = 0; i < n; i++)
        cts_put_numbers(to, rows[i].tag, &rows[i].number, 1);
}

size_t cts_put_item(CtsRecords *to, uint32_t sequence)
{
    cts_put_begin(to, sequence, CTS_VALUE_ITEMS);
    return cts_put_begin(to, 0, CTS_VALUE_ITEM);
}

void cts_put_item_end(CtsRecords *to, size_t item)
{
    cts_put_end(to, item);
    cts_put_end(to, item - sizeof(CtsRecord));
}

void cts_put_code(CtsRecords *to, uint32_t sequence, CtsScCode code)
{
    const size_t item = cts_put_item(to, sequence);
    CTS_PUT_TEXTS(to, {DCM_CodeValue, code.value}, {DCM_CodingSchemeDesignator, code.scheme},
                  {DCM_CodeMeaning, code.meaning});
    cts_put_item_end(to, item);
}

size_t cts_put_reference(CtsRecords *to, uint32_t sequence, const char *class_uid, const char *uid)
{
    const size_t item = cts_put_item(to, sequence);
    CTS_PUT_TEXTS(to, {DCM_ReferencedSOPClassUID, class_uid}, {DCM_ReferencedSOPInstanceUID, uid});
    return item;
}

/* The frames of an object that the series is a part of. */
static void put_frame_numbers(CtsRecords *to, CtsSlice *const *slices, int n)
{
    const size_t numbers = cts_put_begin(to, DCM_ReferencedFrameNumber, CTS_VALUE_NUMBERS);
    for (int i = 0; i < n; i++)
        cts_put_more(to, &(double){slices[i]->frame + 1}, sizeof(double));
    cts_put_end(to, numbers);
}

void cts_put_sources(CtsRecords *to, uint32_t sequence, const CtsSeries *source, void (*complete)(CtsRecords *to))
{
    for (int i = 0, end; i < source->n_slices; i = end) {
        const CtsSlice *const first = source->slices[i];
        for (end = i + 1; end < source->n_slices && !strcmp(source->slices[end]->sop_uid, first->sop_uid);)
            end++;
        if (!*first->sop_uid)
            continue;
        const size_t item = cts_put_reference(to, sequence, source->slices[0]->class_uid, first->sop_uid);
        if (end - i < first->n_frames && sequence != DCM_ReferencedInstanceSequence)
            put_frame_numbers(to, source->slices + i, end - i);
        if (complete)
            complete(to);
        cts_put_item_end(to, item);
    }
}

void cts_put_source_series(CtsRecords *to, const CtsSeries *source)
{
    const size_t series = cts_put_item(to, DCM_ReferencedSeriesSequence);
    CTS_PUT_TEXTS(to, {DCM_SeriesInstanceUID, source->uid});
    cts_put_sources(to, DCM_ReferencedInstanceSequence, source, NULL);
    cts_put_item_end(to, series);
}

void cts_put_label_series(CtsRecords *to, const CtsLabels *labels, const char *study_uid)
{
    for (size_t i = 0; labels && i < labels->n_objects; i++) {
        const CtsLabelObject *const label = &labels->objects[i];
        if (!*label->sop_uid || !*label->series_uid || strcmp(label->study_uid, study_uid) != 0)
            continue;
        const size_t series = cts_put_item(to, DCM_ReferencedSeriesSequence);
        CTS_PUT_TEXTS(to, {DCM_SeriesInstanceUID, label->series_uid});
        cts_put_item_end(to, cts_put_reference(to, DCM_ReferencedInstanceSequence, label->class_uid, label->sop_uid));
        cts_put_item_end(to, series);
    }
}

void cts_put_profile(CtsRecords *to)
{
    cts_put_bytes(to, DCM_ICCProfile, CTS_VALUE_BYTES, cts_icc_srgb, CTS_ICC_BYTES);
    CTS_PUT_TEXTS(to, {DCM_ColorSpace, "SRGB"});
}

CtsStatus cts_records_write(CtsRecords *records, CtsReaderOrder order, const CtsSlice *source, CtsTempFile *file,
                            CtsError *err)
{
    CtsDicomObject object;
    order.n_records = records->n;
    CtsStatus st = records->status ? cts_fail(err, records->status, "out of memory")
                                   : cts_dicom_object_make(&object, source, order, records->bytes, err);
    if (!records->status) {
        if (!st)
            st = cts_temp_write(file, object.elements.at, (size_t)(object.elements.end - object.elements.at), err);
        cts_dicom_object_close(&object);
    }
    free(records->bytes);
    return st;
}
