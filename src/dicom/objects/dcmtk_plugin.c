/* Loads DCMTK's plug-in and its function tables (dicom/objects/objects.h). */
#include "base/load_plugin.h"
#include "dicom/objects/objects.h"

CTS_PLUGIN_ENTRY(CtsDcmWriters, cts_dcm_writers, CTS_DCMTK_PLUGIN)
