/* The tag scanner, and the reader of the elements that it accepts. */
#include "dicom/header/dcm_read.h"
#include "fuzz.h"

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
    if (cts_scan_data(data, n, n, meta.data_offset, native, CTS_MAX_HEADER_BYTES, &scan) != CTS_SCAN_DONE)
        return 0;
    assert(scan.header_end >= meta.data_offset && scan.header_end <= n);
    const CtsDataSet set = {data + meta.data_offset, scan.header_end - meta.data_offset, &scan, native};
    CtsStringPool texts = {0};
    CtsObject object = {0};
    CtsError err = {0};
    if (cts_dcm_read_object(&set, &texts, meta.sop_class_uid, &object, &err))
        assert(err.text[0]);
    for (int i = 0; i < object.n_slices; i++)
        assert(!object.slices[i]->fault == !object.slices[i]->fault_text);
    cts_object_free(&object);
    cts_string_pool_free(&texts);
    return 0;
}
