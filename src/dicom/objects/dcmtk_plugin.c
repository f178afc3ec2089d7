/* Loads DCMTK's plug-in and its function tables (dicom/header/dcm_readers.h). */
#include "base/load_plugin.h"
#include "dicom/header/dcm_readers.h"
#include "dicom/objects/objects.h"

CTS_PLUGIN_ENTRY(CtsDcmReaders, cts_dcm_readers, CTS_DCMTK_PLUGIN)
CTS_PLUGIN_ENTRY(CtsDcmWriters, cts_dcm_writers, CTS_DCMTK_PLUGIN)
