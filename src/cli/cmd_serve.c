/* ctsplat serve: until a signal stops it. */
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
