/* -o -: a picture on standard output. It is made in a folder of its own, so that nothing of it is written before it is
 * whole. */
#ifndef CTS_CLI_STANDARD_OUTPUT_H
#define CTS_CLI_STANDARD_OUTPUT_H

#include "app/job/render_job.h"
#include "app/words/options.h"

typedef struct CliStandardOutput {
    char *folder, *path; /* NULL: nothing goes there */
    const char *format;
    const char **outputs; /* the job's, with path in the place of - */
} CliStandardOutput;

/* Does nothing where no output is -. Free with cli_standard_output_end(), also after a failure. */
CtsStatus cli_standard_output_begin(CliStandardOutput *to, const CtsOptions *options, CtsJob *job, CtsError *err);
/* The picture, now that it is whole. */
CtsStatus cli_standard_output_write(const CliStandardOutput *to, uint64_t *bytes, CtsError *err);
void cli_standard_output_end(CliStandardOutput *to);

#endif
