/* A socket that listens on one address. */
#pragma once

#include "ctsplat/api.h"
#include "dicom/net/peer.h"

CTS_C_BEGIN

/* HOST:PORT, an address of IPv6 in brackets; port 0 is any free one. CTS_ERR_USAGE for another
 * text, CTS_ERR_INTERNAL when it cannot be listened at. */
CtsStatus cts_listen(const char *text, int *listener, CtsError *err);
/* The same, as the listener has it by now. */
void cts_listener_name(int listener, char *text, size_t size);

CTS_C_END
