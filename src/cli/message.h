/* Lines on stderr, for people. */
#ifndef CTS_CLI_MESSAGE_H
#define CTS_CLI_MESSAGE_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"

void cli_error(const CtsError *err);
void cli_warning(const char *format, ...) __attribute__((format(printf, 1, 2)));
void cli_note(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* Warnings among findings[from..n), each text once. */
void cli_print_findings(const CtsFindings *findings, size_t from);

#endif
