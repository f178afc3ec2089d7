#include "dicom/header/dicom_object.h"

#include "base/mem.h"
#include "base/sandbox.h"
#include "dicom/protocol/dicom_begin.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* FIRST_READ: most captures, structure sets without contours, DICOMDIRs. CPU_S: of the largest header. */
enum { FIRST_READ = 64 << 10, CPU_S = 300 };

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

/* Passes the file's first n bytes, and the order's records; the answer may have n_answer bytes. */
static CtsStatus ask(const CtsDicomObject *o, CtsSandbox *reader, size_t n, size_t n_answer, CtsReaderOrder order,
                     const uint8_t *records, const uint8_t **answer, CtsError *err)
{
    const CtsHeaderItem item = {sizeof item, n, o->file.n_bytes};
    const void *shared;
    uint8_t *stream;
    order.records_at = sizeof item + n;
    const size_t n_all = (size_t)(order.records_at + order.n_records);
    CtsStatus st = cts_sandbox_room(reader, n_all, n_answer, &stream, err);
    if (st)
        return st;
    memcpy(stream, &item, sizeof item);
    if (records)
        memcpy(stream + order.records_at, records, (size_t)order.n_records);
    if ((st = cts_file_bytes_read(&o->file, stream + sizeof item, n, 0, err)))
        return st;
    cts_sandbox_send(reader, &order, sizeof order, stream, n_all, n_answer);
    st = cts_sandbox_take(reader, &shared, err);
    *answer = shared;
    if (st == CTS_ERR_PIXELS)
        err->status = records ? CTS_ERR_OUTPUT : CTS_ERR_READ;
    return st == CTS_ERR_PIXELS ? err->status : st;
}

static CtsStatus take_bytes(CtsDicomObject *o, const CtsHeaderAnswer *a, const uint8_t *answer, size_t n_answer,
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
static CtsStatus ask_enough(CtsDicomObject *o, CtsReaderOrder order, const uint8_t *records, CtsError *err)
{
    size_t n = FIRST_READ, n_answer = 2 * FIRST_READ + 2 * (size_t)order.n_records;
    CtsSandbox reader = cts_sandbox_make(CTS_READER_PROGRAM, order.task, records ? "writer" : "reader");
    CtsHeaderAnswer a = {.result = CTS_HEADER_MORE};
    CtsStatus st = CTS_OK;
    order.n_files = 1;
    reader.cpu_limit_s = CPU_S;
    while (!st && a.result != CTS_HEADER_DONE) {
        const uint8_t *answer;
        n = o->file.n_bytes < n ? (size_t)o->file.n_bytes : n;
        /* Measured: DCMTK's objects of a segmentation take 11 bytes for each of the file's. */
        reader.memory_limit = ((size_t)256 << 20) + 24 * (n + (size_t)order.n_records);
        if ((st = ask(o, &reader, n, n_answer, order, records, &answer, err)))
            break;
        memcpy(&a, answer, sizeof a);
        if (a.result == CTS_HEADER_DONE)
            st = take_bytes(o, &a, answer, n_answer, err);
        else if (a.result == CTS_HEADER_MORE && n < o->file.n_bytes && a.need > n && a.need <= 2 * order.max_header)
            n = a.need > 4 * (uint64_t)n ? (size_t)a.need : 4 * n;
        else if (a.result == CTS_HEADER_ROOM && a.need > n_answer && a.need <= 8 * order.max_header)
            n_answer = (size_t)a.need + 2 * FIRST_READ;
        else
            st = a.result == CTS_HEADER_BAD      ? cts_fail(err, CTS_ERR_READ, "%.*s", (int)sizeof a.why, a.why)
                 : a.result == CTS_HEADER_MEMORY ? cts_fail(err, CTS_ERR_READ, "needs too much memory")
                                                 : cts_header_no_sense(err);
    }
    cts_sandbox_stop(&reader);
    return st;
}

CtsStatus cts_dicom_object_open(CtsDicomObject *o, const CtsFile *source, uint64_t max_header, CtsError *err)
{
    *o = (CtsDicomObject){.file.fd = -1};
    CtsStatus st = open_file(o, source, err);
    if (!st)
        st = ask_enough(o, (CtsReaderOrder){.task = CTS_READER_OBJECT, .max_header = max_header}, NULL, err);
    return st;
}

CtsStatus cts_dicom_object_make(CtsDicomObject *o, const CtsSlice *source, CtsReaderOrder order, const uint8_t *records,
                                CtsError *err)
{
    *o = (CtsDicomObject){.file.fd = -1};
    order.task = CTS_READER_WRITE;
    order.max_header = CTS_MAX_HEADER_BYTES;
    CtsStatus st = cts_slice_open(source, &o->file, err);
    if (!st && (st = ask_enough(o, order, records, err)))
        cts_context(err, "%s", source->path);
    return st;
}

void cts_dicom_object_close(CtsDicomObject *o)
{
    cts_file_bytes_close(&o->file);
    free(o->records);
    *o = (CtsDicomObject){.file.fd = -1};
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
