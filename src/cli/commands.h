/* The commands: what help prints of them, and what runs. */
#ifndef CTS_CLI_COMMANDS_H
#define CTS_CLI_COMMANDS_H

#include "app/words/options.h"

/* *exit_code is 0 on entry; a status other than CTS_OK becomes the one error line and the exit code of that status. */
typedef struct CliCommand {
    const char *name;
    const char *usage;   /* what follows the name */
    const char *summary; /* one line */
    int min_operands, max_operands;
    const char *operand; /* how a message calls one */
    CtsStatus (*run)(const CtsOptions *options, int *exit_code, CtsError *err);
} CliCommand;

/* In the order of CTS_FOR_INFO...; CTS_FOR_JOB is none. */
enum { CLI_N_COMMANDS = CTS_FOR_JOB };
extern const CliCommand cli_commands[CLI_N_COMMANDS];

CtsStatus cli_batch(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_bench(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_check(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_info(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_render(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_compare(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_presets(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_receive(const CtsOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_serve(const CtsOptions *options, int *exit_code, CtsError *err);

#endif
