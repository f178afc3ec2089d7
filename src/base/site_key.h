/* The secret of a site, by which names of de-identified things repeat there and nowhere else. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stdint.h>

enum { CTS_KEY_BYTES = 32 };

typedef struct CtsKey {
    uint8_t bytes[CTS_KEY_BYTES];
} CtsKey;

/* Of a file's bytes, 16 to 4096 of them. path NULL: $XDG_STATE_HOME/ctsplat/key (or ~/.local/state), which is made
 * once, 0600, where it is missing and may be made. CTS_ERR_READ. */
CtsStatus cts_key_load(const char *path, bool may_make, CtsKey *key, CtsError *err);
