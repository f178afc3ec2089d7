/* SIGINT, SIGTERM and SIGHUP: stop cleanly, exit 130, leave no temporary file. */
#ifndef CTS_CLI_INTERRUPT_H
#define CTS_CLI_INTERRUPT_H

#include <signal.h>
#include <stddef.h>

/* Set once a signal asked to stop; for CtsRenderSettings.stop. */
extern volatile sig_atomic_t cli_stop;

void cli_interrupt_init(void);
/* At first a signal ends the process at once, which suits work that leaves nothing behind and cannot be asked to stop,
 * such as reading a series. From this call on it sets cli_stop. */
void cli_interrupt_asks(void);

/* What a signal that ends the program at once writes before, to this file; text must stay. NULL: nothing. */
void cli_interrupt_says(int fd, const char *text, size_t size);
/* An empty folder that it removes then; must stay. NULL: none. */
void cli_interrupt_removes(const char *folder);

#endif
