/* ctsplat: looks up the command, runs it, turns its status into an exit code and at most one error line. */
#include "base/did_you_mean.h"
#include "base/exit_code.h"
#include "base/isolation.h"
#include "base/libexec.h"
#include "base/thread.h"
#include "cli/commands.h"
#include "cli/terminal.h"
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

/* The index of a command, -1 for none. */
static int find_command(const char *name, CtsError *err)
{
    const char *names[CLI_N_COMMANDS];
    for (int c = 0; c < CLI_N_COMMANDS; c++)
        names[c] = cli_commands[c].name;
    if (strcmp(name, "receive"))
        return cts_name_find(NULL, name, strlen(name), names, CLI_N_COMMANDS, " (see ctsplat --help)", err);
    cts_fail(err, CTS_ERR_USAGE,
             "receive: gone since 0.5.0: Orthanc or storescp receives, and batch with `settled` renders what came "
             "(see man ctsplat-batch, RECEIVERS)");
    return -1;
}

static CtsStatus run_command(int argc, const char *const *argv, int *exit_code, CtsError *err)
{
    CtsOptions options;
    const int command = find_command(argv[0], err);
    if (command < 0)
        return err->status;
    cts_options_begin(&options);
    options.net.stop = options.render.stop = &cli_stop;
    CtsStatus st = cli_arguments(&options, command, argc, argv, err);
    if (!st && options.help)
        cli_help_command(command, options.paths.n > 0 && !strcmp(options.paths.items[0], "all"));
    else if (!st && !cli_commands[command].run)
        st = cts_libexec_become("ctsplat-serve", argv - 1, err);
    else if (!st) {
        if (cts_isolation_is_waived())
            cli_warning(CTS_ISOLATION_WAIVED "=1: where the system refuses a sandbox, files are read without one");
        st = cli_commands[command].run(&options, exit_code, err);
    }
    cts_options_free(&options);
    return st;
}

static CtsStatus run_arguments(int argc, const char *const *argv, int *exit_code, CtsError *err)
{
    if (argc < 2)
        return cts_fail(err, CTS_ERR_USAGE, "a command is missing (see ctsplat --help)");
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help")) {
        const int command = argc > 2 && argv[2][0] != '-' ? find_command(argv[2], err) : -1;
        if (command >= 0)
            cli_help_command(command, argc > 3 && !strcmp(argv[3], "all"));
        else if (!err->status)
            cli_help();
        return err->status;
    }
    if (!strcmp(argv[1], "--version")) {
        cli_version();
        return CTS_OK;
    }
    static const char *const words[] = {"--version", "--help"};
    if (argv[1][0] == '-')
        return cts_fail(err, CTS_ERR_USAGE, "%s: no such option before the command (see ctsplat --help)%s", argv[1],
                        cts_did_you_mean(argv[1], strlen(argv[1]), words, 2).text);
    return run_command(argc - 1, argv + 1, exit_code, err);
}

/* A file opened later must not get the descriptor of a closed standard stream, since messages would go into it. The
 * replacement fails when it is used. */
static void hold_standard_files(void)
{
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0 && open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY) != fd)
            _exit(1);
}

typedef struct Call {
    int argc;
    const char *const *argv;
    int *exit_code;
    CtsError *err;
    CtsStatus status;
} Call;

static void *run_call(void *context)
{
    Call *const call = context;
    call->status = run_arguments(call->argc, call->argv, call->exit_code, call->err);
    return NULL;
}

int main(int argc, char **argv)
{
    hold_standard_files();
    signal(SIGCHLD, SIG_DFL); /* with SIGCHLD ignored, waiting for a process would fail */
    /* A core file would hold the patient's volume. */
    const struct rlimit no_core = {0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    cli_interrupt_init();

    CtsError err = {0};
    int exit_code = 0;
    Call call = {.argc = argc, .argv = (const char *const *)argv, .exit_code = &exit_code, .err = &err};
    cts_thread_with_stack(run_call, &call);
    CtsStatus st = call.status;
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
        cli_message("error: ", "%s", err.text);
        exit_code = cts_exit_code(st);
    }
    return exit_code;
}
