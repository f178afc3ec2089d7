#include "base/load_part.h"
#include "output/objects/dcm_writers.h"

CtsStatus cts_dcm_writers(const CtsDcmWriters **writers, CtsError *err)
{
    static const void *kept;
    const void *table = NULL;
    const CtsStatus st = cts_part_table(CTS_DCMTK_PART, "cts_dcm_writers", &kept, &table, err);
    *writers = table;
    return st;
}
