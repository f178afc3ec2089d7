/* DCMTK made ready in the programs that link it. */
#pragma once

#include "ctsplat/api.h"
#include "ctsplat/status.h"

CTS_C_BEGIN

/* Must precede any other use of DCMTK: turns its log off and makes its dictionary, of the program alone. */
CtsStatus cts_dcm_start(CtsError *err);

CTS_C_END
