/* From PATH... to the volume that render and bench work on. */
#ifndef CTS_CLI_LOAD_H
#define CTS_CLI_LOAD_H

#include "cli/options.h"

typedef struct CliLoaded {
    CtsSeriesList *list;
    const CtsSeries *series; /* of the list */
    CtsVolume *volume;
} CliLoaded;

/* Finds and decodes the series that is asked for, cuts it to what is asked for, and prints what is odd about it. step
 * is called before each of the two steps. Free with cli_loaded_free(), also after a failure. */
CtsStatus cli_load(const CliOptions *options, const CtsPreset *preset, void (*step)(void *context, const char *what),
                   void *context, CliLoaded *loaded, CtsReport *report, CtsError *err);
void cli_loaded_free(CliLoaded *loaded);

#endif
