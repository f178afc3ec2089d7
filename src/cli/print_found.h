/* What a PACS has, as `info --from` prints it. */
#ifndef CTS_CLI_PRINT_FOUND_H
#define CTS_CLI_PRINT_FOUND_H

#include "ctsplat/net.h"

void cli_print_found(const CtsFound *found, bool show_patient);
CtsStatus cli_print_found_json(const CtsFound *found, bool show_patient, CtsError *err);

#endif
