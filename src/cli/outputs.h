/* The files that one render writes: names for each frame, checked before any work. */
#ifndef CTS_CLI_OUTPUTS_H
#define CTS_CLI_OUTPUTS_H

#include "cli/options.h"

/* frame 7 of 36 of "a/head.png" is "a/head-007.png"; with n_frames 0 (no rotation) path as it is. Free with free();
 * NULL when memory runs out. */
char *cli_output_name(const char *path, int frame, int n_frames);

/* Formats that hold several frames in one file. */
bool cli_output_is_multi_frame(const char *path);

/* Some output has a place for depth. */
bool cli_outputs_hold_depth(const CliOptions *options);

/* Every -o has a known ending, is given once, can be written, and is no CT slice that --force would destroy. */
CtsStatus cli_outputs_check(const CliOptions *options, const CtsExportSettings *settings, CtsError *err);

#endif
