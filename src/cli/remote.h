/* What comes from a PACS before the work, and what goes to one after it. */
#ifndef CTS_CLI_REMOTE_H
#define CTS_CLI_REMOTE_H

#include "cli/options.h"

/* What can be refused about --from and --send before anything is done. */
CtsStatus cli_remote_check(const CliOptions *options, CtsError *err);

/* Every DICOM output, once it is written; nothing without --send. */
CtsStatus cli_send(const CliOptions *options, CtsError *err);

#endif
