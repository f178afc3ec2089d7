/* One DICOM file -> slices and their pixels; compressed ones up to their codec, which has a process of its own. */
#include "dicom/codec/pixels.h"
#include "fuzz.h"
#include "input/files/file_header.h"
#include <stdlib.h>

enum { MAX_PIXELS = 1 << 18, MAX_READ = 8 };

static void nothing(void *context, const uint16_t *at, size_t first, size_t end)
{
    (void)context;
    assert(at && first < end);
}

static void read_pixels(const CtsSlice *s)
{
    const size_t n = (size_t)s->rows * (size_t)s->columns;
    assert(s->rows >= 1 && s->columns >= 1 && (s->bits_allocated == 8 || s->bits_allocated == 16));
    assert(s->slope != 0 && s->row_spacing_mm > 0 && s->column_spacing_mm > 0);
    if (n > MAX_PIXELS || cts_syntax_encapsulated(s->syntax) || s->syntax->deflated)
        return;
    uint16_t *words = malloc(n * sizeof *words);
    CtsError err = {0};
    CtsSandbox *decoder = NULL;
    if (words && cts_slice_read_pixels(s, &decoder, words, nothing, NULL, &err))
        assert(err.text[0]);
    cts_sandbox_free(&decoder);
    free(words);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    static char name[] = "fuzz";
    const CtsFile file = {.path = name, .memory = data, .n_memory = n};
    CtsHeaderReader reader = {0};
    CtsHeaderRead read;
    cts_file_headers_read(&file, 1, CTS_NIFTI_FORM_AUTO, &reader, 1, &read);
    assert(!read.why.status == !read.why.text[0]);
    for (int i = 0; i < read.object.n_slices; i++) {
        const CtsSlice *s = read.object.slices[i];
        assert(!s->fault == !s->fault_text[0]);
        if (!s->fault && i < MAX_READ)
            read_pixels(s);
    }
    cts_object_free(&read.object);
    cts_header_reader_free(&reader);
    return 0;
}
