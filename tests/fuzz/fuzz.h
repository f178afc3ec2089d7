/* A fuzz target: bytes in, nothing out; a crash, a hang, a sanitizer's report or a failed assert() is a finding.
 *
 * With clang and -Dfuzz=true each target becomes a libFuzzer program; in every build replay.c runs it over the files of
 * testdata/fuzz/TARGET, as a test. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#undef NDEBUG
#include <assert.h>

#ifdef __cplusplus
extern "C"
#endif
    int
    LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);
