/* --help, printed from the tables, and --version. */
#ifndef CTS_CLI_HELP_H
#define CTS_CLI_HELP_H

/* What `ctsplat --help` and `ctsplat COMMAND --help` print. */
void cli_help(void);
void cli_help_command(int command);
/* This program and the libraries it runs with. */
void cli_version(void);

#endif
