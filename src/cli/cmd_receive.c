/* ctsplat receive: listens until a signal stops it. */
#include "app/node/receive.h"
#include "cli/commands.h"
#include "cli/interrupt.h"
#include "cli/message.h"

static void tell(const char *text)
{
    cli_note("%s", text);
}

CtsStatus cli_receive(const CtsOptions *options, int *exit_code, CtsError *err)
{
    const CtsReceiveSettings settings = {.folder = options->output_dir,
                                         .listen = options->listen,
                                         .record = options->log,
                                         .allow = options->allow.items,
                                         .n_allow = options->allow.n,
                                         .net = &options->net,
                                         .most_of_one = options->most_of_one,
                                         .most_a_minute = options->most_a_minute,
                                         .deadline_s = options->deadline_s,
                                         .object_mib = options->object_mib,
                                         .free_percent = options->free_percent,
                                         .told = tell};
    (void)exit_code;
    if (!options->output_dir)
        return cts_fail(err, CTS_ERR_USAGE, "receive: no folder to write into (give -O DIR)");
    cli_interrupt_asks();
    return cts_receive(&settings, err);
}
