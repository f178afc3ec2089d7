/* Texts whose lists come from the tables of the library: what a row adds there stands in help and messages here. */
#ifndef CTS_CLI_WORDS_H
#define CTS_CLI_WORDS_H

#include <stddef.h>

/* Longest text with its lists in place. */
enum { CLI_WORDS_MAX = 600 };

/* text with these replaced, in out; returns out. {views}, {kernels}, {formats}: their names; of the formats' endings
 * {outputs} has all, {objects} those of DICOM objects, {stacks} those of which one file holds a rotation. */
const char *cli_words(const char *text, char out[CLI_WORDS_MAX]);

/* text with the settings that messages of the library write as `max_error` written as options, cut to size, in out;
 * returns out. What is no option stays as it is. */
const char *cli_with_options(const char *text, char *out, size_t size);

#endif
