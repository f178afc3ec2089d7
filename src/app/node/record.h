/* Who sent what, when and how much: a file of JSON Lines, opened for each of them, so that it may be moved away. */
#ifndef CTS_NODE_RECORD_H
#define CTS_NODE_RECORD_H

#include "app/node/visits.h"

/* CTS_ERR_OUTPUT when the file (0640; "-" is standard error) cannot be written. */
CtsStatus cts_record_check(const char *path, CtsError *err);
/* An association that has ended, how being the wait status of its process. Nothing but the reason's text is believed of
 * what that process told. */
CtsStatus cts_record_visit(const char *path, const CtsVisitor *visitor, int how, double now_ms, CtsError *err);
/* Connections that were closed at once, the last of them from this address. */
CtsStatus cts_record_turned_away(const char *path, uint64_t n, const CtsAddress *last, CtsError *err);

#endif
