#include "cli/terminal.h"

#include "base/file.h"
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static bool is_standard_output(const char *output)
{
    return !strcmp(output, "-");
}

static CtsStatus check_outputs(const CtsOptions *options, int n, CtsError *err)
{
    if (n == 0 && options->format)
        return cts_fail(err, CTS_ERR_USAGE, "--format %s: says what -o - writes, and no output is -",
                        options->format->name);
    if (n == 0)
        return CTS_OK;
    if (n > 1)
        return cts_fail(err, CTS_ERR_USAGE, "-: given twice with -o");
    if (!options->format)
        return cts_fail(err, CTS_ERR_USAGE, "-o -: has no ending that names a format (give --format)");
    if (options->rotation > 1 && !options->format->many_frames)
        return cts_fail(err, CTS_ERR_USAGE, "-o -: one .%s holds one picture, not the %d of a rotation",
                        options->format->name, options->rotation);
    if (isatty(STDOUT_FILENO))
        return cts_fail(err, CTS_ERR_USAGE, "-o -: standard output is a terminal (send it into a file or a program)");
    return CTS_OK;
}

CtsStatus cli_standard_output_begin(CliStandardOutput *to, const CtsOptions *options, CtsJob *job, CtsError *err)
{
    int n = 0;
    for (int i = 0; i < options->outputs.n; i++)
        n += is_standard_output(options->outputs.items[i]);
    CtsStatus st = check_outputs(options, n, err);
    if (st || n == 0 || options->render.explain)
        return st;
    if ((st = cts_temp_folder("ctsplat-", &to->folder, err)))
        return st;
    cli_interrupt_removes(to->folder);
    to->format = options->format->name;
    to->outputs = calloc((size_t)options->outputs.n, sizeof *to->outputs);
    if (!to->outputs || asprintf(&to->path, "%s/picture.%s", to->folder, to->format) < 0) {
        to->path = NULL;
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    for (int i = 0; i < options->outputs.n; i++)
        to->outputs[i] = is_standard_output(options->outputs.items[i]) ? to->path : options->outputs.items[i];
    job->outputs.paths = to->outputs;
    return CTS_OK;
}

CtsStatus cli_standard_output_write(const CliStandardOutput *to, uint64_t *bytes, CtsError *err)
{
    char piece[1 << 16];
    CtsStatus st = CTS_OK;
    ssize_t n = 0;
    *bytes = 0;
    const int fd = open(to->path, O_RDONLY | O_CLOEXEC);
    while (fd >= 0 && !st && (n = read(fd, piece, sizeof piece)) > 0) {
        if (!cts_write_all(STDOUT_FILENO, piece, (size_t)n))
            st = cts_fail(err, CTS_ERR_OUTPUT, "standard output: %s", strerror(errno));
        *bytes += (uint64_t)n;
    }
    if (!st && (fd < 0 || n < 0))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be read back: %s", to->path, strerror(errno));
    if (fd >= 0)
        close(fd);
    return st;
}

void cli_standard_output_end(CliStandardOutput *to)
{
    cli_interrupt_removes(NULL);
    if (to->path)
        unlink(to->path);
    if (to->folder)
        rmdir(to->folder);
    free(to->path);
    free(to->folder);
    free(to->outputs);
    *to = (CliStandardOutput){0};
}
