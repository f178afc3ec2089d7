/* Messages of the library name options of ctsplat without dashes, and settings by their fields. */
#ifndef CTS_CLI_OPTION_NAMES_H
#define CTS_CLI_OPTION_NAMES_H

#include <stddef.h>

/* text with what stands there as `max_error` written as an option, cut to size, in out; returns out. What is no option
 * stays as it is. */
const char *cli_with_options(const char *text, char *out, size_t size);

#endif
