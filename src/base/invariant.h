/* Asserts of what loops keep true, in builds with a sanitizer or without optimisation; elsewhere they cost nothing. */
#pragma once

#include "base/sanitized.h"

#if CTS_SANITIZED || !defined(__OPTIMIZE__)
#define CTS_INVARIANTS 1
#include <assert.h>
#define CTS_INVARIANT(condition) assert(condition)
#else
#define CTS_INVARIANTS 0
#define CTS_INVARIANT(condition) ((void)sizeof(!(condition)))
#endif
