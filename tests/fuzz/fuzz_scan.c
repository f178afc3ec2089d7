/* Our tag scanner against DCMTK on the same bytes: where a header is read from the scan alone, DCMTK says the same. */
#include "input/header/dcm_read.h"
#include "fuzz.h"
#include <stdlib.h>
#include <string.h>

static void same_text(const char *a, const char *b)
{
    assert(!a == !b && (!a || strcmp(a, b) == 0));
}

static void same_slice(const CtsSlice *a, const CtsSlice *b)
{
    CtsSlice x = *a, y = *b;
    same_text(a->fault_text, b->fault_text);
    same_text(a->sop_uid, b->sop_uid);
    x.sop_uid = y.sop_uid = NULL; /* other texts are shared */
    x.fault_text = y.fault_text = NULL;
    assert(memcmp(&x, &y, sizeof x) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    CtsMetaScan meta;
    CtsDataScan scan;
    if (cts_scan_meta(data, n, n, &meta) != CTS_SCAN_DONE)
        return 0;
    const CtsSyntax *named = cts_syntax_find(meta.syntax_uid);
    if (!named || named->deflated)
        return 0;
    const CtsSyntax *native = cts_syntax_native(named->explicit_vr, named->big_endian);
    if (cts_scan_data(data, n, n, meta.data_offset, native, &scan) != CTS_SCAN_DONE)
        return 0;
    assert(scan.header_end >= meta.data_offset && scan.header_end <= n);
    const uint8_t *header = data + meta.data_offset;
    const size_t n_header = scan.header_end - meta.data_offset;
    CtsTexts texts = {0};
    CtsSlice slices[2];
    CtsStatus st[2];
    memset(slices, 0, sizeof slices);
    for (int way = 0; way < 2; way++) {
        char class_uid[65] = "";
        scan.repeats |= way == 1; /* leaves all to DCMTK */
        st[way] = cts_dcm_read_header(header, n_header, &scan, native, &texts, class_uid, &slices[way], NULL);
    }
    /* DCMTK also looks at elements that nobody asks for, and may refuse one. */
    if (!st[0] && !st[1])
        same_slice(&slices[0], &slices[1]);
    cts_slice_clear(&slices[0]);
    cts_slice_clear(&slices[1]);
    cts_texts_free(&texts);
    return 0;
}
