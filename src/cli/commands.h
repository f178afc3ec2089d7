/* The commands: what help prints of them, what runs, and what reads their words. */
#ifndef CTS_CLI_COMMANDS_H
#define CTS_CLI_COMMANDS_H

#include "app/words/options.h"

/* *exit_code is 0 on entry; a status other than CTS_OK becomes the one error line and the exit code of that status. */
typedef CtsStatus CliRun(const CtsOptions *options, int *exit_code, CtsError *err);

typedef struct CliCommand {
    const char *name;
    const char *usage;   /* what follows the name */
    const char *summary; /* one line */
    int min_operands, max_operands;
    const char *operand; /* how a message calls one */
    CliRun *run;
} CliCommand;

/* In the order of CTS_FOR_INFO...; CTS_FOR_JOB is none. */
enum { CLI_N_COMMANDS = CTS_FOR_JOB };
extern const CliCommand cli_commands[CLI_N_COMMANDS];

CliRun cli_batch, cli_bench, cli_check, cli_info, cli_render, cli_compare, cli_presets, cli_receive, cli_serve;

/* argv[0] is the command's name. */
CtsStatus cli_arguments(CtsOptions *options, int command, int argc, const char *const *argv, CtsError *err);

/* What `ctsplat --help` and `ctsplat COMMAND --help` print. */
void cli_help(void);
void cli_help_command(int command);
/* This program and the libraries it runs with. */
void cli_version(void);

#endif
