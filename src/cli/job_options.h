/* What the command line asks for, as a job. */
#ifndef CTS_CLI_JOB_OPTIONS_H
#define CTS_CLI_JOB_OPTIONS_H

#include "cli/options.h"
#include "app/job/job.h"

CtsSource cli_source(const CliOptions *options, const CtsPreset *preset);

/* Puts background and window in the preset's place where they are given; everything: mode, lighting and table removal
 * too, which a job has settings for. */
void cli_settle_preset(const CliOptions *options, CtsPreset *preset, bool everything);

/* Loads the preset into *preset and fills *job, which points at it and at the options. */
CtsStatus cli_job(const CliOptions *options, CtsPreset *preset, CtsJob *job, CtsError *err);

#endif
