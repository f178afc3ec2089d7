#include "dicom/header/dicom_object.h"

#include "base/mem.h"
#include "base/sandbox.h"
#include "dicom/protocol/dicom_begin.h"
#include "dicom/protocol/pixel_sandbox.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* FIRST_READ: most captures, structure sets without contours, DICOMDIRs. CPU_S: of the largest header. */
enum { FIRST_READ = 64 << 10, CPU_S = 300, N_ORDER = 2 };

static CtsStatus open_file(CtsDicomObject *o, const CtsFile *source, CtsError *err)
{
    uint8_t begin[132];
    CtsStatus st = CTS_OK;
    if (source->memory)
        o->file = cts_file_bytes_in_memory(source->memory, source->n_memory);
    else
        st = cts_file_bytes_open(&o->file, source->path, err);
    if (st)
        return st;
    const size_t n = o->file.fd < 0 ? 0 : o->file.n_bytes < sizeof begin ? (size_t)o->file.n_bytes : sizeof begin;
    if (n && (st = cts_file_bytes_read(&o->file, begin, n, 0, err)))
        return st;
    return n && cts_scan_begins_dicom(begin, n) ? CTS_OK : cts_fail(err, CTS_ERR_READ, "is no DICOM file");
}

/* Passes the file's first n bytes; the answer may have n_answer bytes. */
static CtsStatus ask(const CtsDicomObject *o, CtsSandbox *reader, size_t n, size_t n_answer, uint64_t max_header,
                     const uint8_t **answer, CtsError *err)
{
    const CtsHeaderItem item = {sizeof item, n, o->file.n_bytes};
    const uint64_t order[N_ORDER] = {1, max_header};
    const void *shared;
    uint8_t *stream;
    CtsStatus st = cts_sandbox_room(reader, sizeof item + n, n_answer, &stream, err);
    if (st)
        return st;
    memcpy(stream, &item, sizeof item);
    if ((st = cts_file_bytes_read(&o->file, stream + sizeof item, n, 0, err)))
        return st;
    cts_sandbox_send(reader, order, sizeof order, stream, sizeof item + n, n_answer);
    st = cts_sandbox_take(reader, &shared, err);
    *answer = shared;
    if (st == CTS_ERR_PIXELS)
        err->status = CTS_ERR_READ;
    return st == CTS_ERR_PIXELS ? CTS_ERR_READ : st;
}

static CtsStatus take_records(CtsDicomObject *o, const CtsHeaderAnswer *a, const uint8_t *answer, size_t n_answer,
                              CtsError *err)
{
    if (a->at > n_answer || a->n > n_answer - a->at || !cts_header_facts_hold(&a->facts, o->file.n_bytes))
        return cts_header_no_sense(err);
    if (!(o->records = malloc((size_t)a->n + 1)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    memcpy(o->records, answer + a->at, (size_t)a->n);
    o->elements = (CtsElements){o->records, o->records + a->n};
    o->facts = a->facts;
    o->syntax = cts_syntax_find(o->facts.syntax_uid);
    return CTS_OK;
}

/* Asks until the bytes and the room for the answer are enough. */
static CtsStatus read_elements(CtsDicomObject *o, CtsSandbox *reader, uint64_t max_header, CtsError *err)
{
    size_t n = FIRST_READ, n_answer = 2 * FIRST_READ;
    for (;;) {
        CtsHeaderAnswer a;
        const uint8_t *answer;
        n = o->file.n_bytes < n ? (size_t)o->file.n_bytes : n;
        /* Measured: DCMTK's objects of a segmentation take 11 bytes for each of the file's. */
        reader->memory_limit = ((size_t)256 << 20) + 24 * n;
        const CtsStatus st = ask(o, reader, n, n_answer, max_header, &answer, err);
        if (st)
            return st;
        memcpy(&a, answer, sizeof a);
        if (a.result == CTS_HEADER_DONE)
            return take_records(o, &a, answer, n_answer, err);
        if (a.result == CTS_HEADER_MORE && n < o->file.n_bytes && a.need > n && a.need <= 2 * max_header)
            n = a.need > 4 * (uint64_t)n ? (size_t)a.need : 4 * n;
        else if (a.result == CTS_HEADER_ROOM && a.need > n_answer && a.need <= 8 * max_header)
            n_answer = (size_t)a.need + 2 * FIRST_READ;
        else
            return a.result == CTS_HEADER_BAD      ? cts_fail(err, CTS_ERR_READ, "%.*s", (int)sizeof a.why, a.why)
                   : a.result == CTS_HEADER_MEMORY ? cts_fail(err, CTS_ERR_READ, "needs too much memory")
                                                   : cts_header_no_sense(err);
    }
}

CtsStatus cts_dicom_object_open(CtsDicomObject *o, const CtsFile *source, uint64_t max_header, CtsError *err)
{
    CtsSandbox reader = cts_sandbox_make(CTS_READER_PROGRAM, CTS_READER_OBJECT, "reader");
    reader.cpu_limit_s = CPU_S;
    *o = (CtsDicomObject){.file.fd = -1};
    CtsStatus st = open_file(o, source, err);
    if (!st)
        st = read_elements(o, &reader, max_header, err);
    cts_sandbox_stop(&reader);
    return st;
}

void cts_dicom_object_close(CtsDicomObject *o)
{
    cts_file_bytes_close(&o->file);
    free(o->records);
    *o = (CtsDicomObject){.file.fd = -1};
}

/* The n bytes of a deflated data set, by its whole file. */
static CtsStatus inflate_data_set(const CtsDicomObject *o, uint8_t *bytes, size_t n, CtsError *err)
{
    const size_t n_deflated = (size_t)(o->file.n_bytes - o->facts.data_offset);
    CtsSandbox *inflater = NULL;
    uint8_t *deflated = NULL;
    size_t got = 0;
    CtsStatus st = cts_alloc_array(&deflated, n_deflated, err);
    if (!st && !(st = cts_file_bytes_read(&o->file, deflated, n_deflated, o->facts.data_offset, err)) &&
        !(st = cts_codec_inflate(&inflater, deflated, n_deflated, bytes, n, &got, err)) && got < n)
        st = cts_header_no_sense(err);
    cts_free(&deflated);
    cts_sandbox_free(&inflater);
    return st;
}

CtsStatus cts_slice_data_set(const CtsSlice *slice, uint8_t **bytes, CtsDataSet *set, CtsError *err)
{
    CtsFileBytes now;
    CtsDicomObject o = {.file.fd = -1};
    *bytes = NULL;
    CtsStatus st = cts_slice_open(slice, &now, err);
    cts_file_bytes_close(&now);
    if (!st)
        st = cts_dicom_object_open(&o, &(CtsFile){slice->path, false, slice->memory, slice->file_bytes},
                                   CTS_MAX_HEADER_BYTES, err);
    if (!st && !o.syntax)
        st = cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s is unknown", o.facts.syntax_uid);
    const size_t n = (size_t)o.facts.header_bytes;
    if (!st && !(st = cts_alloc_array(bytes, n, err)))
        st = o.syntax->deflated ? inflate_data_set(&o, *bytes, n, err)
                                : cts_file_bytes_read(&o.file, *bytes, n, o.facts.data_offset, err);
    if (!st)
        *set = (CtsDataSet){*bytes, n, cts_syntax_native(o.syntax->explicit_vr, o.syntax->big_endian)};
    cts_dicom_object_close(&o);
    return st ? cts_context(err, "%s", slice->path) : st;
}

CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err)
{
    CtsDicomObject o;
    *ids = (CtsDcmIds){0};
    const CtsStatus st = cts_dicom_object_open(&o, &(CtsFile){.path = path}, CTS_MAX_HEADER_BYTES, err);
    if (!st) {
        cts_elements_text(o.elements, 0x00080016, ids->class_uid, sizeof ids->class_uid);
        cts_elements_text(o.elements, 0x00080018, ids->sop_uid, sizeof ids->sop_uid);
        memcpy(ids->syntax_uid, o.facts.syntax_uid, sizeof ids->syntax_uid);
    }
    cts_dicom_object_close(&o);
    return st ? cts_context(err, "%s", path) : st;
}
