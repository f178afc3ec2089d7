#include "dicom/header/header_reader.h"

#include "base/mem.h"
#include "dicom/protocol/dicom_begin.h"
#include <stdlib.h>
#include <string.h>

enum {
    MESSAGE_BYTES = CTS_HEADERS_A_MESSAGE * CTS_HEADER_FIRST_READ,
    MAX_FIRST_READ = MESSAGE_BYTES / 4,                 /* longer headers come one in a message */
    MAX_HEADER_READ = CTS_MAX_HEADER_BYTES + (1 << 20), /* and the file's meta header */
    /* Texts of a slice take 300 to 500 bytes; where they do not fit, the file is asked for alone. */
    FILE_ANSWER_BYTES = sizeof(CtsHeaderAnswer) + sizeof(CtsSlice) + 1024,
    MESSAGE_ANSWER_BYTES = CTS_HEADERS_A_MESSAGE * FILE_ANSWER_BYTES,
    MAX_ANSWER = CTS_MAX_FRAMES * (sizeof(CtsSlice) + 1024) + CTS_MAX_HEADER_BYTES,
    CPU_S = 60 /* for one message; measured: the largest header takes 2 s */
};

void cts_header_reader_free(CtsHeaderReader *r)
{
    cts_sandbox_free(&r->sandbox);
    free(r->again);
    free(r->first_bytes);
    free(r->copy);
    cts_string_pool_free(&r->texts);
    *r = (CtsHeaderReader){0};
}

CtsStatus cts_header_begin(CtsHeaderReader *r, const CtsFile *source, CtsFileBytes *file, const uint8_t **bytes,
                           size_t *n, CtsError *err)
{
    CtsStatus st = CTS_OK;
    *n = 0;
    *bytes = NULL;
    if (source->memory)
        *file = cts_file_bytes_in_memory(source->memory, source->n_memory);
    else
        st = cts_file_bytes_open(file, source->path, err);
    if (st || file->fd < 0)
        return st;
    if (r->first_read < CTS_HEADER_FIRST_READ)
        r->first_read = CTS_HEADER_FIRST_READ;
    *n = file->n_bytes < r->first_read ? (size_t)file->n_bytes : r->first_read;
    if ((st = cts_bytes_reserve(&r->first_bytes, &r->first_capacity, r->first_read, err)) ||
        (st = cts_file_bytes_read(file, r->first_bytes, *n, 0, err)))
        return st;
    r->bytes_read += *n;
    *bytes = r->first_bytes;
    return CTS_OK;
}

static void refuse_file(const CtsPendingHeader *file)
{
    cts_object_free(&file->result->object);
    file->result->kind = CTS_FILE_UNREADABLE;
}

/* Asks for a file alone, later: with its first n bytes, and room for an answer. */
static void ask_again(CtsHeaderReader *r, const CtsPendingHeader *file, uint64_t n, uint64_t n_answer)
{
    if (cts_grow(&r->again, r->n_again, &file->result->why)) {
        refuse_file(file);
        return;
    }
    CtsPendingHeader *const again = &r->again[r->n_again++];
    *again = *file;
    again->n = (size_t)(n < file->n_file ? n : file->n_file);
    again->n_answer = (size_t)n_answer;
}

/* A header that is longer than the bytes at hand: read ahead, so that it costs few messages, and more of later files.
 */
static CtsStatus ask_for_more(CtsHeaderReader *r, const CtsPendingHeader *file, uint64_t need, CtsError *err)
{
    const uint64_t want = need > 4 * (uint64_t)file->n ? need : 4 * (uint64_t)file->n;
    if (need > MAX_HEADER_READ)
        return cts_fail(err, CTS_ERR_READ, "damaged or cut short: more than 64 MiB precede the pixels");
    if (need <= file->n || file->n >= file->n_file)
        return cts_header_no_sense(err);
    if (want <= MAX_FIRST_READ && r->first_read < want)
        r->first_read = (size_t)want;
    ask_again(r, file, want, file->n_answer);
    return CTS_OK;
}

/* The object of an answer, of which the reader process may write any byte at any time. */
static CtsStatus take_object(CtsHeaderReader *r, const CtsPendingHeader *file, const CtsHeaderAnswer *a,
                             const uint8_t *answer, size_t n_answer, CtsError *err)
{
    if (a->at > n_answer || a->n > n_answer - a->at || !cts_header_facts_hold(&a->facts, file->n_file))
        return cts_header_no_sense(err);
    CtsStatus st = cts_bytes_reserve(&r->copy, &r->copy_capacity, (size_t)a->n, err);
    if (st)
        return st;
    memcpy(r->copy, answer + a->at, (size_t)a->n);
    st = cts_header_unpack(a, r->copy, (size_t)a->n, &r->texts, &file->result->object, err);
    file->result->kind = CTS_FILE_DICOM;
    return st ? st : cts_header_complete(&a->facts, file, &r->texts, &file->result->object, err);
}

static void take_header_answer(CtsHeaderReader *r, const CtsPendingHeader *file, const uint8_t *answer, int i,
                               size_t n_answer)
{
    CtsHeaderAnswer a;
    CtsError *const err = &file->result->why;
    CtsStatus st = CTS_OK;
    memcpy(&a, answer + (size_t)i * sizeof a, sizeof a);
    switch (a.result) {
    case CTS_HEADER_DONE:
        st = take_object(r, file, &a, answer, n_answer, err);
        break;
    case CTS_HEADER_MORE:
        st = ask_for_more(r, file, a.need, err);
        break;
    case CTS_HEADER_ROOM:
        if (file->n_answer == FILE_ANSWER_BYTES && a.need <= MAX_ANSWER)
            ask_again(r, file, file->n, a.need + FILE_ANSWER_BYTES);
        else
            st = cts_header_no_sense(err);
        break;
    case CTS_HEADER_MEMORY:
        st = cts_fail(err, CTS_ERR_READ, "its header needs more memory than its reader has");
        break;
    case CTS_HEADER_BAD:
        st = cts_fail(err, CTS_ERR_READ, "%.*s", (int)sizeof a.why, a.why);
        break;
    default:
        st = cts_header_no_sense(err);
    }
    if (st)
        refuse_file(file);
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
        if (!st) {
            take_header_answer(r, file, answer, i, m->n_answer);
        } else if (st == CTS_ERR_PIXELS && m->n_files > 1) {
            ask_again(r, file, file->n, file->n_answer);
        } else {
            cts_fail(&file->result->why, st == CTS_ERR_PIXELS ? CTS_ERR_READ : st, "%s", why.text);
            refuse_file(file);
        }
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
    cts_sandbox_send(r->sandbox, &order, sizeof order, r->stream, m->n, m->n_answer);
    r->messages[++r->n_sent].n_files = 0;
}

/* An empty message for n bytes of files, and an answer to it. */
static CtsStatus begin_message(CtsHeaderReader *r, size_t n, size_t n_answer, CtsError *err)
{
    const size_t n_all = n + CTS_HEADERS_A_MESSAGE * sizeof(CtsHeaderItem);
    CtsStatus st =
        cts_sandbox_new(&r->sandbox, CTS_READER_PROGRAM, CTS_READER_HEADERS, "reader", CTS_SANDBOX_SLOTS, err);
    if (st)
        return st;
    r->sandbox->cpu_limit_s = CPU_S;
    while (r->n_sent && !cts_sandbox_fits(r->sandbox, n_all, n_answer))
        take_oldest(r);
    st = cts_sandbox_room(r->sandbox, n_all, n_answer, &r->stream, err);
    r->messages[r->n_sent] =
        (CtsHeaderMessage){.n = CTS_HEADERS_A_MESSAGE * sizeof(CtsHeaderItem), .n_answer = n_answer};
    return st;
}

/* Room in the message for n bytes of one more file. */
static uint8_t *append_file(CtsHeaderReader *r, const CtsPendingHeader *file)
{
    CtsHeaderMessage *const m = &r->messages[r->n_sent];
    const CtsHeaderItem item = {m->n, file->n, file->n_file};
    memcpy(r->stream + (size_t)m->n_files * sizeof item, &item, sizeof item);
    m->files[m->n_files++] = *file;
    m->n += (file->n + 7) / 8 * 8;
    return r->stream + item.at;
}

bool cts_header_add(CtsHeaderReader *r, const CtsFile *source, const CtsFileBytes *file, size_t n,
                    CtsHeaderRead *result)
{
    const CtsPendingHeader pending = {source, result, file->n_bytes, file->mtime_ns, n, FILE_ANSWER_BYTES};
    CtsHeaderMessage *m = &r->messages[r->n_sent];
    CtsStatus st = CTS_OK;
    result->kind = CTS_FILE_NOT_DICOM;
    if (!cts_scan_begins_dicom(r->first_bytes, n))
        return false;
    if (m->n_files == CTS_HEADERS_A_MESSAGE || (m->n_files && m->n + n > MESSAGE_BYTES))
        send_message(r);
    m = &r->messages[r->n_sent];
    if (!m->n_files)
        st = begin_message(r, MESSAGE_BYTES, MESSAGE_ANSWER_BYTES, &result->why);
    if (st)
        refuse_file(&pending);
    else
        memcpy(append_file(r, &pending), r->first_bytes, n);
    return true;
}

/* A file that is asked for alone must be the one whose first bytes were read. */
static CtsStatus read_again(CtsHeaderReader *r, const CtsPendingHeader *pending, CtsError *err)
{
    CtsFileBytes file;
    const CtsSlice slice = {.path = pending->source->path,
                            .memory = pending->source->memory,
                            .file_bytes = pending->n_file,
                            .mtime_ns = pending->mtime_ns};
    CtsStatus st = begin_message(r, pending->n, pending->n_answer, err);
    if (st)
        return st;
    if (!(st = cts_slice_open(&slice, &file, err)))
        st = cts_file_bytes_read(&file, append_file(r, pending), pending->n, 0, err);
    cts_file_bytes_close(&file);
    r->bytes_read += pending->n;
    return st;
}

void cts_header_finish(CtsHeaderReader *r)
{
    send_message(r);
    while (r->n_sent || r->n_again) {
        while (r->n_sent)
            take_oldest(r);
        if (!r->n_again)
            break;
        const CtsPendingHeader file = r->again[--r->n_again];
        if (read_again(r, &file, &file.result->why)) {
            r->messages[r->n_sent].n_files = 0;
            refuse_file(&file);
        }
        send_message(r);
    }
}

CtsFileKind cts_slice_read_header(const CtsFile *source, CtsHeaderReader *r, CtsObject *object, CtsError *err)
{
    CtsFileBytes file;
    const uint8_t *bytes;
    size_t n;
    CtsHeaderRead result = {.kind = CTS_FILE_NOT_DICOM};
    const CtsStatus st = cts_header_begin(r, source, &file, &bytes, &n, &result.why);
    if (st)
        result.kind = CTS_FILE_UNREADABLE;
    else if (n && cts_header_add(r, source, &file, n, &result))
        cts_header_finish(r);
    cts_file_bytes_close(&file);
    *object = result.object;
    if (err && result.kind == CTS_FILE_UNREADABLE)
        *err = result.why;
    return result.kind;
}
