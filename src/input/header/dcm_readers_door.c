#include "base/load_part.h"
#include "input/header/dcm_readers.h"

CtsStatus cts_dcm_readers(const CtsDcmReaders **readers, CtsError *err)
{
    static const void *kept;
    const void *table = NULL;
    const CtsStatus st = cts_part_table(CTS_DCMTK_PART, "cts_dcm_readers", &kept, &table, err);
    *readers = table;
    return st;
}
