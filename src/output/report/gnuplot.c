#include "output/report/gnuplot.h"

#include "base/by_id.h"
#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

CTS_BY_ID(
    char *const, cts_engine_colours,
    CTS_N_ENGINES, [CTS_ENGINE_CLASSIC] = "#7a3db8", [CTS_ENGINE_LAYERS] = "#1a8f6c", [CTS_ENGINE_VOID] = "#2f7fc1",
    [CTS_ENGINE_COMBINED] = "#c25a00", [CTS_ENGINE_TILED] = "#b3123f", [CTS_ENGINE_RAYCAST] = "#333333");

/* The whole of a file from its start, with a 0 behind it. */
static char *read_all(FILE *file)
{
    char *text = NULL;
    long n;
    if (fseek(file, 0, SEEK_END) || (n = ftell(file)) < 0 || fseek(file, 0, SEEK_SET) ||
        !(text = malloc((size_t)n + 1)))
        return NULL;
    if (fread(text, 1, (size_t)n, file) != (size_t)n) {
        free(text);
        return NULL;
    }
    text[n] = '\0';
    return text;
}

/* Files stand in for pipes, so that neither side can wait for the other. */
static CtsStatus run(FILE *in, FILE *out, FILE *complaints, CtsError *err)
{
    char name[] = "gnuplot", dash[] = "-";
    char *const argv[] = {name, dash, NULL};
    posix_spawn_file_actions_t actions;
    pid_t pid;
    int status = 0, failed = posix_spawn_file_actions_init(&actions);
    if (failed)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    failed = posix_spawn_file_actions_adddup2(&actions, fileno(in), STDIN_FILENO) ||
             posix_spawn_file_actions_adddup2(&actions, fileno(out), STDOUT_FILENO) ||
             posix_spawn_file_actions_adddup2(&actions, fileno(complaints), STDERR_FILENO);
    if (!failed)
        failed = posix_spawnp(&pid, name, &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed)
        return cts_fail(err, CTS_ERR_OUTPUT, "gnuplot cannot be run: %s (install the package gnuplot-nox)",
                        strerror(failed));
    TEMP_FAILURE_RETRY(waitpid(pid, &status, 0));
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
        return CTS_OK;
    char *why = read_all(complaints);
    cts_fail(err, CTS_ERR_OUTPUT, "gnuplot failed: %.300s", why ? why : "");
    free(why);
    for (char *c = err ? err->text : NULL; c && *c; c++)
        *c = *c == '\n' ? ' ' : *c;
    return CTS_ERR_OUTPUT;
}

CtsStatus cts_gnuplot(const char *script, char **svg, CtsError *err)
{
    CtsStatus st;
    FILE *in = tmpfile(), *out = tmpfile(), *complaints = tmpfile();
    *svg = NULL;
    if (!in || !out || !complaints || fputs(script, in) < 0 || fflush(in) || fseek(in, 0, SEEK_SET)) {
        st = cts_fail(err, CTS_ERR_OUTPUT, "no temporary file for gnuplot: %s", strerror(errno));
        goto end;
    }
    if (!(st = run(in, out, complaints, err)) && !(*svg = read_all(out)))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
end:
    for (int i = 0; i < 3; i++) {
        FILE *file = (FILE *[]){in, out, complaints}[i];
        if (file)
            fclose(file);
    }
    return st;
}
