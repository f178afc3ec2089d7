/* The program's side of the doors to DCMTK (input/header/dcm_readers.h). */
#include "base/load_part.h"
#include "input/codec/dcm_decoder.h"
#include "input/header/dcm_readers.h"
#include "output/objects/objects.h"

CTS_PART_DOOR(CtsDcmReaders, cts_dcm_readers, CTS_DCMTK_PART)
CTS_PART_DOOR(CtsDcmDecoder, cts_dcm_decoder, CTS_DCMTK_PART)
CTS_PART_DOOR(CtsDcmWriters, cts_dcm_writers, CTS_DCMTK_PART)
