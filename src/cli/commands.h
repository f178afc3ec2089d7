/* The commands: their help texts, their functions, and the parser of their arguments. */
#pragma once

#include "app/options/options.h"

/* *exit_code is 0 on entry; a status other than CTS_OK becomes the one error line and the exit code of that status. */
typedef CtsStatus CliRun(const CtsOptions *options, int *exit_code, CtsError *err);

typedef struct CliCommand {
    const char *name;
    const char *usage;   /* arguments, for the usage line */
    const char *summary; /* one line */
    int min_operands, max_operands;
    const char *operand; /* name of an operand in messages */
    CliRun *run; /* NULL: of the program ctsplat-serve */
} CliCommand;

/* In the order of CTS_FOR_INFO...; CTS_FOR_JOB is not a command. */
enum { CLI_N_COMMANDS = CTS_FOR_JOB };
extern const CliCommand cli_commands[CLI_N_COMMANDS];

CliRun cli_batch, cli_bench, cli_check, cli_info, cli_render, cli_compare, cli_presets;
/* The program ctsplat-serve of libexec has the same files as ctsplat, and this command; in ctsplat it is NULL. */
CliRun cli_serve __attribute__((weak));

/* argv[0] is the command's name. */
CtsStatus cli_arguments(CtsOptions *options, int command, int argc, const char *const *argv, CtsError *err);

/* Print the output of `ctsplat --help` and `ctsplat COMMAND --help`. */
void cli_help(void);
/* all: every option, not only those that most people need. */
void cli_help_command(int command, bool all);
/* This program and the libraries it runs with. */
void cli_version(void);
