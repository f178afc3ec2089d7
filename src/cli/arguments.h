/* argv as words. */
#ifndef CTS_CLI_ARGUMENTS_H
#define CTS_CLI_ARGUMENTS_H

#include "app/words/options.h"

/* argv[0] is the command's name. */
CtsStatus cli_arguments(CtsOptions *options, int command, int argc, const char *const *argv, CtsError *err);

#endif
