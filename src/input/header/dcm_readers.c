#include "input/header/dcm_readers.h"

__attribute__((visibility("default"))) CtsStatus cts_dcm_readers(const CtsDcmReaders **readers, CtsError *err)
{
    static const CtsDcmReaders here = {
        .start = cts_dcm_start,
        .parse_header = cts_dcm_parse_header,
        .read_frames = cts_dcm_read_frames,
        .directory = cts_dcm_directory,
        .class_name = cts_dcm_class_name,
        .convert = cts_dcm_convert,
    };
    (void)err;
    *readers = &here;
    return CTS_OK;
}
