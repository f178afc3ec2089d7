#include "dicom/header/dicom_object.h"

#include "base/mem.h"
#include "base/sandbox.h"
#include "dicom/header/header_reader.h"
#include <stdlib.h>
#include <string.h>

enum { CPU_S = 300 }; /* of the largest header */

/* Reads the elements in front of the pixels, or those of an object that is written. */
static CtsStatus take_elements(CtsDicomObject *o, CtsReaderOrder order, const uint8_t *records, CtsError *err)
{
    CtsSandbox reader = cts_sandbox_make(CTS_READER_PROGRAM, order.task, records ? "writer" : "reader");
    CtsHeaderAnswer a;
    const uint8_t *bytes;
    reader.cpu_limit_s = CPU_S;
    CtsStatus st = cts_header_ask(&reader, &o->file, order, records, &a, &bytes, err);
    if (!st && !(o->records = malloc((size_t)a.n + 1)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st) {
        memcpy(o->records, bytes, (size_t)a.n);
        o->elements = (CtsElements){o->records, o->records + a.n};
        o->facts = a.facts;
        o->syntax = cts_syntax_find(o->facts.syntax_uid);
    }
    cts_sandbox_stop(&reader);
    return st;
}

CtsStatus cts_dicom_object_open(CtsDicomObject *o, const CtsFile *source, uint64_t max_header, CtsError *err)
{
    *o = (CtsDicomObject){.file.fd = -1};
    CtsStatus st = cts_file_bytes_open(&o->file, source, err);
    if (!st)
        st = take_elements(o, (CtsReaderOrder){.task = CTS_READER_OBJECT, .max_header = max_header}, NULL, err);
    return st;
}

CtsStatus cts_dicom_object_make(CtsDicomObject *o, const CtsSlice *source, CtsReaderOrder order, const uint8_t *records,
                                CtsError *err)
{
    *o = (CtsDicomObject){.file.fd = -1};
    order.task = CTS_READER_WRITE;
    order.max_header = CTS_MAX_HEADER_BYTES;
    CtsStatus st = cts_slice_open(source, &o->file, err);
    if (!st && (st = take_elements(o, order, records, err)))
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
