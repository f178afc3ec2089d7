/* ctsplat serve and ctsplat receive: until a signal stops them. */
#include "app/node/node.h"
#include "app/serve/server.h"
#include "cli/commands.h"
#include "cli/terminal.h"
#include <stdio.h>

/* Prints the URL on standard output. */
static void ready(const char *url)
{
    printf("%s\n", url);
    fflush(stdout);
}

static void print_note(const char *text)
{
    cli_note("%s", text);
}

CtsStatus cli_serve(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    cli_interrupt_sets_stop();
    return cts_serve(options, ready, print_note, err);
}

CtsStatus cli_receive(const CtsOptions *options, int *exit_code, CtsError *err)
{
    (void)exit_code;
    if (!options->output_dir)
        return cts_fail(err, CTS_ERR_USAGE, "receive: no folder to write into (give -O DIR)");
    cli_interrupt_sets_stop();
    return cts_receive(options, print_note, err);
}
