/* ctsplat: looks up the command, runs it, turns its status into an exit code and at most one error line. */
#include "base/exit_code.h"
#include "cli/interrupt.h"
#include "cli/message.h"
#include "cli/options.h"
#include "cli/version.h"
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

/* In the order of CLI_INFO... */
const CliCommand cli_commands[CLI_N_COMMANDS] = {
    {"info", "PATH... [--json]", "Tell what series PATH holds and whether they can be rendered.", 1, INT_MAX, "PATH",
     cli_info},
    {"render", "PATH... -o FILE [-o FILE]... [options]", "Render a series as PNG, OpenEXR or DICOM.", 1, INT_MAX,
     "PATH", cli_render},
    {"batch", "PATH... -O DIR [options]", "Render every series with every preset and view; can be stopped and resumed.",
     0, INT_MAX, "PATH", cli_batch},
    {"bench", "PATH... -O DIR [options]", "Measure error against run time for each engine and setting on a series.", 1,
     INT_MAX, "PATH", cli_bench},
    {"check", "[--json]", "Run the numerical stability suite.", 0, 0, "", cli_check},
    {"compare", "A B [--json]", "Compare two pictures of the same size; exit 0 when equal to the bit, 1 when not.", 2,
     2, "a picture", cli_compare},
    {"presets", "[NAME or FILE] [--propose PATH] [--json]",
     "List the presets, show one, or find the tissues of a volume and which of them one does not show.", 0, 1, "NAME",
     cli_presets},
};

static int find_command(const char *name)
{
    for (int c = 0; c < CLI_N_COMMANDS; c++)
        if (!strcmp(name, cli_commands[c].name))
            return c;
    return -1;
}

static CtsStatus run_command(int argc, const char *const *argv, int *exit_code, CtsError *err)
{
    CtsStatus st;
    CliOptions options;
    const int command = find_command(argv[0]);
    if (command < 0) {
        char names[256] = "";
        for (int c = 0; c < CLI_N_COMMANDS; c++) {
            strncat(names, " ", sizeof names - strlen(names) - 1);
            strncat(names, cli_commands[c].name, sizeof names - strlen(names) - 1);
        }
        return cts_fail(err, CTS_ERR_USAGE, "%s: not one of:%s (see ctsplat --help)", argv[0], names);
    }
    if ((st = cli_options_parse(&options, command, argc, argv, err)))
        goto end;
    if (options.help)
        cli_help_command(command);
    else
        st = cli_commands[command].run(&options, exit_code, err);
end:
    cli_options_free(&options);
    return st;
}

static CtsStatus run(int argc, const char *const *argv, int *exit_code, CtsError *err)
{
    if (argc < 2)
        return cts_fail(err, CTS_ERR_USAGE, "a command is missing (see ctsplat --help)");
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h")) {
        cli_help();
        return CTS_OK;
    }
    if (!strcmp(argv[1], "--version")) {
        cli_version();
        return CTS_OK;
    }
    if (argv[1][0] == '-')
        return cts_fail(err, CTS_ERR_USAGE, "%s: no such option before the command (see ctsplat --help)", argv[1]);
    return run_command(argc - 1, argv + 1, exit_code, err);
}

int main(int argc, char **argv)
{
    /* A core file would hold the patient's volume. */
    const struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    cli_interrupt_init();

    CtsError err = {0};
    int exit_code = 0;
    CtsStatus st = run(argc, (const char *const *)argv, &exit_code, &err);
    /* Output that did not reach its reader is not done, as with a full disk. */
    const bool lost = fflush(stdout) || ferror(stdout);
    if (lost && errno == EPIPE) {
        /* As `ctsplat info | head` is expected to end. */
        signal(SIGPIPE, SIG_DFL);
        raise(SIGPIPE);
    }
    if (lost && !st)
        st = cts_fail(&err, CTS_ERR_OUTPUT, "standard output: %s", errno ? strerror(errno) : "cannot be written");
    if (st) {
        cli_error(&err);
        exit_code = cts_exit_code(st);
    }
    return exit_code;
}
