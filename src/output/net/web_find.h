/* QIDO-RS: the series that a query names (PS3.18 10.6). */
#ifndef CTS_NET_WEB_FIND_H
#define CTS_NET_WEB_FIND_H

#include "output/net/peer.h"
#include <jansson.h>

enum { CTS_WEB_QUERY = 1200 };

/* What the peer answers to GET of its root and `what`, the caller's to release; NULL when it has nothing (204). */
CtsStatus cts_web_ask(const CtsPeer *peer, const CtsNet *net, const char *what, json_t **told, CtsError *err);
/* The first value of an attribute of DICOM's JSON model (PS3.18 F.2), as text ("" for none) or as a number. */
const char *cts_web_text(const json_t *object, const char *tag);
json_int_t cts_web_integer(const json_t *object, const char *tag);

CtsStatus cts_web_find(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *query, CtsFound *found,
                       CtsError *err);

#endif
