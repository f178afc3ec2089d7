/* Headers as they pass between the program and its reader (dicom/reader), in shared memory: files' first bytes one way,
 * plain data of fixed layout with their texts behind them the other. The reader works on untrusted bytes, so that its
 * answers are not trusted either: cts_header_unpack() checks every offset, count and range. */
#pragma once

#include "dicom/header/slice.h"
#include "dicom/protocol/dicom_begin.h"

CTS_C_BEGIN

/* The program of libexec that reads headers and writes objects, and its tasks. */
#define CTS_READER_PROGRAM "ctsplat-dicom"
typedef enum CtsReaderTask {
    CTS_READER_HEADERS,
    CTS_READER_OBJECT,
    CTS_READER_WRITE,
    CTS_N_READER_TASKS
} CtsReaderTask;

enum {
    CTS_MAX_HEADER_BYTES = 64 << 20, /* everything before PixelData, of a slice; measured: up to 68 kB in 379 files */
    CTS_HEADERS_A_MESSAGE = 32,
    CTS_MAX_FRAMES = 20000, /* limit of slices in a series */
    CTS_MAX_TEXT = 1 << 16  /* longest text of a header; of most attributes 64 characters are permitted */
};

/* The order of a message. */
typedef struct CtsReaderOrder {
    CtsReaderTask task;
    uint64_t n_files, max_header; /* limit of bytes in front of the pixels */
    /* CTS_READER_WRITE: of the object's attributes as records (dicom/header/elements.h), in the message. */
    uint64_t records_at, n_records;
    int syntax_number;
    bool deidentified, body_side; /* the file's patient and study are not copied; the side of its body part is */
} CtsReaderOrder;

/* A file whose first n bytes lie `at` bytes behind the start of the message, which begins with one of these for each
 * file. */
typedef struct CtsHeaderItem {
    uint64_t at, n, n_file;
} CtsHeaderItem;

typedef enum CtsHeaderResult {
    CTS_HEADER_DONE,
    CTS_HEADER_MORE, /* needs the first `need` bytes of the file */
    CTS_HEADER_ROOM, /* needs `need` bytes of answer */
    CTS_HEADER_BAD,  /* DICOM, but broken: see why */
    CTS_HEADER_MEMORY
} CtsHeaderResult;

/* The facts of a file that all of its slices share. */
typedef struct CtsHeaderFacts {
    char syntax_uid[65];
    char class_name[64];   /* readable name of its SOP class, of a file without slices or with an image */
    unsigned deviations;   /* CTS_DEVIATION_... of the file */
    uint64_t data_offset;  /* offset of the data set */
    uint64_t header_bytes; /* of the data set up to its pixels, inflated when deflated */
    CtsPixelFraming pixels;
} CtsHeaderFacts;

/* The answer for one file; slices and texts are at `at` bytes behind the answer's start, which begins with one of these
 * for each file. */
typedef struct CtsHeaderAnswer {
    uint32_t result; /* CtsHeaderResult */
    uint64_t at, n, need;
    char why[200];
    CtsHeaderFacts facts;
    CtsObject object; /* its texts are offsets */
} CtsHeaderAnswer;

/* Writes an object and its texts into at most n bytes and completes the answer; the number of bytes needed, more than n
 * where they do not fit. */
size_t cts_header_pack(const CtsObject *object, CtsHeaderAnswer *answer, uint8_t *bytes, size_t n);

/* Reads back the answer's n bytes, which must not change meanwhile, into a zeroed object whose texts are kept in texts.
 * CTS_ERR_READ for an answer that no sound reader gives. Free the object in any case. */
CtsStatus cts_header_unpack(const CtsHeaderAnswer *answer, const uint8_t *bytes, size_t n, CtsStringPool *texts,
                            CtsObject *object, CtsError *err);

/* False for facts about a file of n bytes that no sound reader gives. */
bool cts_header_facts_hold(const CtsHeaderFacts *facts, uint64_t n_file);

/* The failure of an answer that no sound reader gives. */
CtsStatus cts_header_no_sense(CtsError *err);

CTS_C_END
