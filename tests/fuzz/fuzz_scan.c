/* The framing's check and the reader of headers, as its process runs them, and the check of its answers. */
#include "dicom/header/header_answer.h"
#include "dicom/protocol/dicom_begin.h"
#include "dicom/reader/reader.h"
#include "fuzz.h"
#include <stdlib.h>
#include <string.h>

enum { ROOM = 1 << 20 };

static CtsHeaderAnswer *read_header(const uint8_t *data, size_t n)
{
    const CtsReaderOrder order = {.n_files = 1, .max_header = ROOM};
    const CtsHeaderItem item = {sizeof item, n, n};
    uint8_t *const stream = malloc(sizeof item + n);
    CtsHeaderAnswer *const answer = calloc(1, ROOM);
    CtsError err = {0};
    assert(stream && answer && !cts_reader_prepare(&err));
    memcpy(stream, &item, sizeof item);
    memcpy(stream + sizeof item, data, n);
    assert(!cts_reader_answer(&order, stream, sizeof item + n, answer, ROOM, &err));
    free(stream);
    return answer;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    if (!cts_scan_begins_dicom(data, n))
        return 0;
    CtsHeaderAnswer *const answer = read_header(data, n);
    CtsStringPool texts = {0};
    CtsObject object = {0};
    CtsError err = {0};
    assert(answer->result != CTS_HEADER_BAD || answer->why[0]);
    if (answer->result == CTS_HEADER_DONE) {
        uint8_t *const bytes = (uint8_t *)answer + answer->at;
        assert(!cts_header_unpack(answer, bytes, answer->n, &texts, &object, &err));
        for (int i = 0; i < object.n_slices; i++)
            assert(!object.slices[i]->fault == !object.slices[i]->fault_text[0]);
        cts_object_free(&object);
        /* An answer of a reader that was taken over. */
        for (size_t i = 0; i < n && i < 64; i++)
            bytes[(data[i] * 37u + i * 101) % answer->n] = data[n - 1 - i];
        if (cts_header_unpack(answer, bytes, answer->n, &texts, &object, &err))
            assert(err.text[0]);
    }
    cts_object_free(&object);
    cts_string_pool_free(&texts);
    free(answer);
    return 0;
}
