/* Headers of many files, read by a process of its own (dicom/reader) while the next files are opened. */
#pragma once

#include "base/sandbox.h"
#include "dicom/header/header_answer.h"

CTS_C_BEGIN

enum { CTS_HEADER_FIRST_READ = 16 << 10 /* measured: holds 376 of the headers of 379 files whole */ };

/* Contents of one file. */
typedef struct CtsHeaderRead {
    CtsObject object; /* must not outlive the path of its file, and the reader's texts */
    CtsError why;     /* of a file that cannot be read; without the path */
} CtsHeaderRead;

/* A file whose answer is outstanding. */
typedef struct CtsPendingHeader {
    const CtsFile *source;
    CtsHeaderRead *result;
    uint64_t n_file;
    int64_t mtime_ns;
} CtsPendingHeader;

typedef struct CtsHeaderMessage {
    CtsPendingHeader files[CTS_HEADERS_A_MESSAGE];
    int n_files;
    size_t n; /* bytes of the message until now */
} CtsHeaderMessage;

/* The reader of one thread. Zero-initialise; free with cts_header_reader_free(). */
typedef struct CtsHeaderReader {
    CtsSandbox *sandbox;
    CtsHeaderMessage messages[CTS_SANDBOX_SLOTS + 1]; /* n_sent of them, the oldest first, then one that is filled */
    int n_sent;
    uint8_t *stream;         /* of the message that is filled */
    CtsPendingHeader *alone; /* files to be asked for alone, with more bytes or room; owned */
    size_t n_alone;
    uint8_t *first_bytes; /* of the file that is being added; owned */
    size_t first_capacity, first_read;
    uint8_t *copy; /* of an answer that is checked; owned */
    size_t copy_capacity;
    CtsStringPool texts; /* of the slices read; the caller may take them over */
    uint64_t bytes_read;
} CtsHeaderReader;

/* Sets the fields of an object's slices that follow from the file and its facts. */
CtsStatus cts_header_complete(const CtsHeaderFacts *facts, const CtsPendingHeader *file, CtsStringPool *texts,
                              CtsObject *object, CtsError *err);

/* Asks about one file, with records to be written or NULL, until its first bytes and the room for the answer, a->n
 * `bytes`, are enough: they are valid until the next use of the reader, which is idle. CTS_ERR_READ or CTS_ERR_OUTPUT
 * without the path. */
CtsStatus cts_header_ask(CtsSandbox *reader, const CtsFileBytes *file, CtsReaderOrder order, const uint8_t *records,
                         CtsHeaderAnswer *answer, const uint8_t **bytes, CtsError *err);

void cts_header_reader_free(CtsHeaderReader *reader);

/* Opens a file and reads its first n bytes into first_bytes; n is 0 for a file that is not regular. CTS_ERR_READ,
 * without the path. Close the file in any case. */
CtsStatus cts_header_begin(CtsHeaderReader *reader, const CtsFile *source, CtsFileBytes *file, size_t *n,
                           CtsError *err);

/* Queues the file that was just begun, of which n bytes were read, unless it is clearly no DICOM: true then. The
 * result, zeroed by the caller, is filled by the time cts_header_finish() returns; source and result must stay until
 * then. */
bool cts_header_add(CtsHeaderReader *reader, const CtsFile *source, const CtsFileBytes *file, size_t n,
                    CtsHeaderRead *result);

/* Completes the results of all queued files. */
void cts_header_finish(CtsHeaderReader *reader);

/* Reads the header of one DICOM file into a zeroed object, which must not outlive source's path and the reader's texts.
 * CTS_ERR_READ, without the path, for one that cannot be read. Files of any format: input/files/file_header.h. */
CtsStatus cts_slice_read_header(const CtsFile *source, CtsHeaderReader *reader, CtsObject *object, CtsError *err);

CTS_C_END
