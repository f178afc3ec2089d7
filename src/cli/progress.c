#include "cli/progress.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { BAR_WIDTH = 24 };

bool cli_progress_shows(void)
{
    const char *term = getenv("TERM");
    return isatty(STDERR_FILENO) && term && strcmp(term, "dumb");
}

void cli_progress(double done, int all, const char *what)
{
    if (!cli_progress_shows())
        return;
    const int filled = all > 0 ? (int)(BAR_WIDTH * done / all) : 0;
    char bar[BAR_WIDTH + 1];
    memset(bar, ' ', BAR_WIDTH);
    memset(bar, '#', (size_t)filled);
    bar[BAR_WIDTH] = 0;
    fprintf(stderr, "\r\033[K[%s] %s", bar, what);
    fflush(stderr);
}

CliTimeLeft cli_time_left(double seconds)
{
    CliTimeLeft left = {""};
    if (seconds >= 5400)
        snprintf(left.text, sizeof left.text, ", about %.1f hours left", seconds / 3600);
    else if (seconds >= 90)
        snprintf(left.text, sizeof left.text, ", about %.0f minutes left", seconds / 60);
    else if (seconds >= 0)
        snprintf(left.text, sizeof left.text, ", about %.0f seconds left", seconds);
    return left;
}

void cli_progress_clear(void)
{
    if (!cli_progress_shows())
        return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
}
