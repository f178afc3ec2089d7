/* CTS_SANITIZED: defined in builds with a sanitizer, for gcc and clang. */
#pragma once

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CTS_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define CTS_SANITIZED 1
#endif
#endif
#ifndef CTS_SANITIZED
#define CTS_SANITIZED 0
#endif
