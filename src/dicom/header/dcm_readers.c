#include "dicom/header/dcm_readers.h"

#include "base/load_plugin.h"

CTS_PLUGIN_TABLE(CtsDcmReaders, cts_dcm_readers, .start = cts_dcm_start, .class_name = cts_dcm_class_name,
                 .convert = cts_dcm_convert)
