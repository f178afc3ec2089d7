#include "dicom/header/header_reader.h"

#include "base/mem.h"
#include "dicom/protocol/dicom_begin.h"
#include <stdlib.h>
#include <string.h>

enum {
    MESSAGE_BYTES = CTS_HEADERS_A_MESSAGE * CTS_HEADER_FIRST_READ,
    LONGER_READ = 4 * CTS_HEADER_FIRST_READ,
    /* Texts of a slice take 300 to 500 bytes; where they do not fit, the file is asked for alone. */
    FILE_ANSWER_BYTES = sizeof(CtsHeaderAnswer) + sizeof(CtsSlice) + 1024,
    MESSAGE_ANSWER_BYTES = CTS_HEADERS_A_MESSAGE * FILE_ANSWER_BYTES,
    ALONE_ANSWER_BYTES = 128 << 10, /* of most captures and structure sets without contours */
    CPU_S = 60                      /* for one message; measured: the largest header takes 2 s */
};

void cts_header_reader_free(CtsHeaderReader *r)
{
    cts_sandbox_free(&r->sandbox);
    free(r->alone);
    free(r->first_bytes);
    free(r->copy);
    cts_string_pool_free(&r->texts);
    *r = (CtsHeaderReader){0};
}

CtsStatus cts_header_begin(CtsHeaderReader *r, const CtsFile *source, CtsFileBytes *file, size_t *n, CtsError *err)
{
    CtsStatus st = cts_file_bytes_open(file, source, err);
    *n = 0;
    if (st || file->fd < 0)
        return st;
    if (r->first_read < CTS_HEADER_FIRST_READ)
        r->first_read = CTS_HEADER_FIRST_READ;
    *n = file->n_bytes < r->first_read ? (size_t)file->n_bytes : r->first_read;
    if ((st = cts_bytes_reserve(&r->first_bytes, &r->first_capacity, r->first_read, err)) ||
        (st = cts_file_bytes_read(file, r->first_bytes, *n, 0, err)))
        return st;
    r->bytes_read += *n;
    return CTS_OK;
}

/* A complete answer that a sound reader gives, for a file of n_file bytes. */
static CtsStatus check_answer(const CtsHeaderAnswer *a, size_t n_answer, uint64_t n_file, CtsError *err)
{
    if (a->result == CTS_HEADER_BAD)
        return cts_fail(err, CTS_ERR_READ, "%.*s", (int)sizeof a->why, a->why);
    if (a->result == CTS_HEADER_MEMORY)
        return cts_fail(err, CTS_ERR_READ, "its header needs more memory than its reader has");
    return a->result == CTS_HEADER_DONE && a->at <= n_answer && a->n <= n_answer - a->at &&
                   cts_header_facts_hold(&a->facts, n_file)
               ? CTS_OK
               : cts_header_no_sense(err);
}

/* Passes the file's first n bytes, and the order's records. */
static CtsStatus ask_once(CtsSandbox *reader, const CtsFileBytes *file, size_t n, CtsReaderOrder order,
                          const uint8_t *records, size_t n_answer, const uint8_t **answer, CtsError *err)
{
    const CtsHeaderItem item = {sizeof item, n, file->n_bytes};
    const void *shared;
    uint8_t *stream;
    CtsError why = {0};
    order.n_files = 1;
    order.records_at = sizeof item + n;
    const size_t n_all = (size_t)(order.records_at + order.n_records);
    CtsStatus st = cts_sandbox_room(reader, n_all, n_answer, &stream, err);
    if (st || (st = cts_file_bytes_read(file, stream + sizeof item, n, 0, err)))
        return st;
    memcpy(stream, &item, sizeof item);
    if (records)
        memcpy(stream + order.records_at, records, (size_t)order.n_records);
    cts_sandbox_send(reader, &order, sizeof order, stream, n_all, n_answer);
    st = cts_sandbox_take(reader, &shared, &why);
    *answer = shared;
    if (st == CTS_ERR_PIXELS)
        st = records ? CTS_ERR_OUTPUT : CTS_ERR_READ;
    return st ? cts_fail(err, st, "%s", why.text) : CTS_OK;
}

CtsStatus cts_header_ask(CtsSandbox *reader, const CtsFileBytes *file, CtsReaderOrder order, const uint8_t *records,
                         CtsHeaderAnswer *a, const uint8_t **bytes, CtsError *err)
{
    size_t n = LONGER_READ, n_answer = ALONE_ANSWER_BYTES + 2 * (size_t)order.n_records;
    for (;;) {
        const uint8_t *answer;
        n = file->n_bytes < n ? (size_t)file->n_bytes : n;
        /* Measured: DCMTK's objects of a segmentation take 11 bytes for each of the file's. */
        if (order.task != CTS_READER_HEADERS)
            reader->memory_limit = ((size_t)256 << 20) + 24 * (n + (size_t)order.n_records);
        CtsStatus st = ask_once(reader, file, n, order, records, n_answer, &answer, err);
        if (st)
            return st;
        memcpy(a, answer, sizeof *a);
        if (a->result == CTS_HEADER_MORE && a->need > 2 * order.max_header)
            return cts_fail(err, CTS_ERR_READ, "damaged or cut short: more than %llu MiB precede the pixels",
                            (unsigned long long)order.max_header >> 20);
        if (a->result == CTS_HEADER_MORE && n < file->n_bytes && a->need > n)
            n = a->need > 4 * (uint64_t)n ? (size_t)a->need : 4 * n;
        else if (a->result == CTS_HEADER_ROOM && a->need > n_answer && a->need <= 8 * order.max_header)
            n_answer = (size_t)a->need + ALONE_ANSWER_BYTES;
        else if ((st = check_answer(a, n_answer, file->n_bytes, err)))
            return st;
        else
            return *bytes = answer + a->at, CTS_OK;
    }
}

/* The object of an answer's bytes, of which the reader process may write any at any time. */
static CtsStatus take_object(CtsHeaderReader *r, const CtsPendingHeader *file, const CtsHeaderAnswer *a,
                             const uint8_t *bytes, CtsError *err)
{
    CtsStatus st = cts_bytes_reserve(&r->copy, &r->copy_capacity, (size_t)a->n, err);
    if (st)
        return st;
    memcpy(r->copy, bytes, (size_t)a->n);
    st = cts_header_unpack(a, r->copy, (size_t)a->n, &r->texts, &file->result->object, err);
    return st ? st : cts_header_complete(&a->facts, file, &r->texts, &file->result->object, err);
}

/* Asks for a file alone, later. */
static CtsStatus put_off(CtsHeaderReader *r, const CtsPendingHeader *file, CtsError *err)
{
    const CtsStatus st = cts_grow(&r->alone, r->n_alone, err);
    if (!st)
        r->alone[r->n_alone++] = *file;
    return st;
}

static CtsStatus take_header_answer(CtsHeaderReader *r, const CtsPendingHeader *file, const uint8_t *answer, int i,
                                    CtsError *err)
{
    CtsHeaderAnswer a;
    memcpy(&a, answer + (size_t)i * sizeof a, sizeof a);
    if (a.result == CTS_HEADER_MORE)
        r->first_read = LONGER_READ; /* later files may have such headers, too */
    if (a.result == CTS_HEADER_MORE || a.result == CTS_HEADER_ROOM)
        return put_off(r, file, err);
    const CtsStatus st = check_answer(&a, MESSAGE_ANSWER_BYTES, file->n_file, err);
    return st ? st : take_object(r, file, &a, answer + a.at, err);
}

/* A message that ends the reader holds at least one damaged file: each is asked for alone then. */
static void take_oldest(CtsHeaderReader *r)
{
    const CtsHeaderMessage *m = &r->messages[0];
    const void *answer;
    CtsError why = {0};
    const CtsStatus st = cts_sandbox_take(r->sandbox, &answer, &why);
    for (int i = 0; i < m->n_files; i++) {
        const CtsPendingHeader *const file = &m->files[i];
        CtsError *const err = &file->result->why;
        const CtsStatus taken = !st ? take_header_answer(r, file, answer, i, err)
                                : st == CTS_ERR_PIXELS && m->n_files > 1
                                    ? put_off(r, file, err)
                                    : cts_fail(err, st == CTS_ERR_PIXELS ? CTS_ERR_READ : st, "%s", why.text);
        if (taken)
            cts_object_free(&file->result->object);
    }
    r->n_sent--;
    memmove(r->messages, r->messages + 1, (size_t)(r->n_sent + 1) * sizeof *r->messages);
}

static void send_message(CtsHeaderReader *r)
{
    const CtsHeaderMessage *m = &r->messages[r->n_sent];
    const CtsReaderOrder order = {.n_files = (uint64_t)m->n_files, .max_header = CTS_MAX_HEADER_BYTES};
    if (!m->n_files)
        return;
    cts_sandbox_send(r->sandbox, &order, sizeof order, r->stream, m->n, MESSAGE_ANSWER_BYTES);
    r->messages[++r->n_sent].n_files = 0;
}

/* An empty message. */
static CtsStatus begin_message(CtsHeaderReader *r, CtsError *err)
{
    const size_t n_items = CTS_HEADERS_A_MESSAGE * sizeof(CtsHeaderItem), n_all = MESSAGE_BYTES + n_items;
    CtsStatus st =
        cts_sandbox_new(&r->sandbox, CTS_READER_PROGRAM, CTS_READER_HEADERS, "reader", CTS_SANDBOX_SLOTS, err);
    if (st)
        return st;
    r->sandbox->cpu_limit_s = CPU_S;
    while (r->n_sent && !cts_sandbox_fits(r->sandbox, n_all, MESSAGE_ANSWER_BYTES))
        take_oldest(r);
    st = cts_sandbox_room(r->sandbox, n_all, MESSAGE_ANSWER_BYTES, &r->stream, err);
    r->messages[r->n_sent] = (CtsHeaderMessage){.n = n_items};
    return st;
}

bool cts_header_add(CtsHeaderReader *r, const CtsFile *source, const CtsFileBytes *file, size_t n,
                    CtsHeaderRead *result)
{
    const CtsPendingHeader pending = {source, result, file->n_bytes, file->mtime_ns};
    CtsHeaderMessage *m = &r->messages[r->n_sent];
    if (!cts_scan_begins_dicom(r->first_bytes, n))
        return false;
    if (m->n_files == CTS_HEADERS_A_MESSAGE || (m->n_files && m->n + n > MESSAGE_BYTES))
        send_message(r);
    if (!r->messages[r->n_sent].n_files && begin_message(r, &result->why))
        return true;
    m = &r->messages[r->n_sent];
    const CtsHeaderItem item = {m->n, n, file->n_bytes};
    memcpy(r->stream + (size_t)m->n_files * sizeof item, &item, sizeof item);
    memcpy(r->stream + item.at, r->first_bytes, n);
    m->files[m->n_files++] = pending;
    m->n += (n + 7) / 8 * 8;
    return true;
}

/* A file that is asked for alone must be the one whose first bytes were read. */
static CtsStatus read_alone(CtsHeaderReader *r, const CtsPendingHeader *pending, CtsError *err)
{
    CtsFileBytes file;
    CtsHeaderAnswer a;
    const uint8_t *bytes;
    const CtsSlice slice = {.path = pending->source->path,
                            .memory = pending->source->memory,
                            .file_bytes = pending->n_file,
                            .mtime_ns = pending->mtime_ns};
    CtsStatus st = cts_slice_open(&slice, &file, err);
    if (!st && !(st = cts_header_ask(r->sandbox, &file, (CtsReaderOrder){.max_header = CTS_MAX_HEADER_BYTES}, NULL, &a,
                                     &bytes, err))) {
        r->bytes_read += a.facts.data_offset + a.facts.header_bytes;
        st = take_object(r, pending, &a, bytes, err);
    }
    cts_file_bytes_close(&file);
    return st;
}

void cts_header_finish(CtsHeaderReader *r)
{
    send_message(r);
    while (r->n_sent)
        take_oldest(r);
    while (r->n_alone) {
        const CtsPendingHeader *const file = &r->alone[--r->n_alone];
        if (read_alone(r, file, &file->result->why))
            cts_object_free(&file->result->object);
    }
}

CtsStatus cts_slice_read_header(const CtsFile *source, CtsHeaderReader *r, CtsObject *object, CtsError *err)
{
    CtsFileBytes file;
    size_t n;
    CtsHeaderRead result = {0};
    if (!cts_header_begin(r, source, &file, &n, &result.why) && n && cts_header_add(r, source, &file, n, &result))
        cts_header_finish(r);
    cts_file_bytes_close(&file);
    *object = result.object;
    return result.why.status ? cts_fail(err, result.why.status, "%s", result.why.text) : CTS_OK;
}
