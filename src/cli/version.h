/* --version: this program and the libraries it runs with. */
#ifndef CTS_CLI_VERSION_H
#define CTS_CLI_VERSION_H

void cli_version(void);

#endif
