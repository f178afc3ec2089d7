/* SIGINT, SIGTERM and SIGHUP: stop cleanly, exit 130, leave no temporary file. */
#ifndef CTS_CLI_INTERRUPT_H
#define CTS_CLI_INTERRUPT_H

#include "ctsplat/status.h"
#include <signal.h>

/* Set once a signal asked to stop; for CtsRenderSettings.stop. */
extern volatile sig_atomic_t cli_stop;

void cli_interrupt_init(void);
/* CTS_ERR_INTERRUPTED when a signal asked to stop. */
CtsStatus cli_interrupted(CtsError *err);
/* While immediate is set nothing needs cleaning up, so that a signal ends the process at once: for reading, which
 * cannot be asked to stop. */
void cli_interrupt_immediate(int immediate);

#endif
