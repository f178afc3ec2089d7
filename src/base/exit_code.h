/* Exit codes of statuses. */
#pragma once

#include "ctsplat/status.h"

/* 0, 1, 2, 3, 4, 5 or 130, as ctsplat(1) has them. */
int cts_exit_code(CtsStatus status);
