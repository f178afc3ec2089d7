/* A progress bar on stderr, drawn only when that is a terminal. */
#ifndef CTS_CLI_PROGRESS_H
#define CTS_CLI_PROGRESS_H

/* Step done of all is at hand: what says what happens in it. */
void cli_progress(int done, int all, const char *what);
/* Take the bar off the line, before a message and at the end. */
void cli_progress_clear(void);

#endif
