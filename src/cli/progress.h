/* A progress bar on stderr, drawn only when that is a terminal. */
#ifndef CTS_CLI_PROGRESS_H
#define CTS_CLI_PROGRESS_H

#include <stdbool.h>

/* Step done of all is at hand: what says what happens in it. */
void cli_progress(double done, int all, const char *what);
/* Whether there is a terminal to draw it on. */
bool cli_progress_shows(void);
/* ", about 40 seconds left"; "" where seconds < 0, as it is not known. */
typedef struct CliTimeLeft {
    char text[48];
} CliTimeLeft;
CliTimeLeft cli_time_left(double seconds);
/* Take the bar off the line, before a message and at the end. */
void cli_progress_clear(void);

#endif
