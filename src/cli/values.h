/* Option arguments that are more than a number or a word. Each names the option it reads in its message. */
#ifndef CTS_CLI_VALUES_H
#define CTS_CLI_VALUES_H

#include "cli/options.h"

/* The whole of text as a finite decimal number, or as an integer; false when it is not one. */
bool cli_number(const char *text, double *value);
bool cli_integer(const char *text, int *value);
/* n numbers with commas between them, no more and no fewer. */
bool cli_numbers(const char *text, double *values, int n);

CtsStatus cli_parse_shard(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_view(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_size(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_kernel(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_void(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_unit(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_shade(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_background(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_crop(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_table(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_smooth(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_window(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_annotate(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_send(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_from(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_format(CliOptions *options, const char *text, CtsError *err);
CtsStatus cli_parse_output(CliOptions *options, const char *text, CtsError *err);

/* What was parsed, as cli_options_text() has it. */
void cli_print_size(const CliOptions *options, FILE *file);
void cli_print_kernel(const CliOptions *options, FILE *file);
void cli_print_void(const CliOptions *options, FILE *file);
void cli_print_unit(const CliOptions *options, FILE *file);
void cli_print_smooth(const CliOptions *options, FILE *file);
void cli_print_crop(const CliOptions *options, FILE *file);
void cli_print_annotate(const CliOptions *options, FILE *file);

#endif
