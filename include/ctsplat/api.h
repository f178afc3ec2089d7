/* Macros around declarations: C linkage in C++, and export of those between CTS_API_BEGIN and CTS_API_END. */
#pragma once

#ifdef __cplusplus
#define CTS_C_BEGIN extern "C" {
#define CTS_C_END }
#else
#define CTS_C_BEGIN
#define CTS_C_END
#endif
#define CTS_API_BEGIN CTS_C_BEGIN _Pragma("GCC visibility push(default)")
#define CTS_API_END _Pragma("GCC visibility pop") CTS_C_END
