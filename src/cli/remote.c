#include "cli/remote.h"

#include <stdlib.h>
#include <string.h>

static bool is_dicom(const char *path)
{
    const CtsFormatInfo *format = cts_export_format(path);
    return format && format->is_object;
}

CtsStatus cli_remote_check(const CliOptions *options, CtsError *err)
{
    bool any = options->write_state != NULL;
    for (int i = 0; i < options->n_outputs; i++)
        any |= is_dicom(options->outputs[i]);
    if (options->send_given && !any)
        return cts_fail(err, CTS_ERR_USAGE, "--send: there is no DICOM output to send (give -o FILE.dcm)");
    if (options->from_given && options->n_operands > 0)
        return cts_fail(err, CTS_ERR_USAGE, "--from: %s is given too (a PATH or a peer, not both)",
                        options->operands[0]);
    if (!options->from_given && (options->study_uid || options->peer_series_uid || options->net.move_port))
        return cts_fail(err, CTS_ERR_USAGE,
                        "--study-uid, --series-uid and --move-port say what to fetch, and --from is not given");
    if (options->from_given && !options->study_uid)
        return cts_fail(err, CTS_ERR_USAGE,
                        "--from: what to fetch is not said (give --study-uid, and --series-uid for "
                        "one of its series)");
    return options->send_given || options->from_given ? cts_net_check(&options->net, err) : CTS_OK;
}

CtsStatus cli_send(const CliOptions *options, CtsError *err)
{
    int n = 0, n_sent = 0;
    if (!options->send_given)
        return CTS_OK;
    const char **paths = calloc((size_t)options->n_outputs + 1, sizeof *paths);
    if (!paths)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < options->n_outputs; i++)
        if (is_dicom(options->outputs[i]))
            paths[n++] = options->outputs[i];
    if (options->write_state)
        paths[n++] = options->write_state;
    const CtsStatus st = cts_net_send(&options->send, &options->net, paths, n, &n_sent, err);
    free(paths);
    return st;
}
