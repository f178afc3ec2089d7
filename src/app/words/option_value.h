/* Option arguments that are more than a number or a word. Each names the option it reads in its message. */
#ifndef CTS_WORDS_OPTION_VALUE_H
#define CTS_WORDS_OPTION_VALUE_H

#include "app/words/options.h"

/* The whole of text as a finite decimal number, or as an integer; false when it is not one. */
bool cts_number(const char *text, double *value);
bool cts_integer(const char *text, int *value);
/* n numbers with commas between them, no more and no fewer. */
bool cts_numbers(const char *text, double *values, int n);

/* The place of text's first length bytes among n names; -1 where there is none such, and err names them, and more. */
int cts_name_find(const char *option, const char *text, size_t length, const char *const *names, int n,
                  const char *more, CtsError *err);

/* A view by its name or its two angles; option: whose argument it is. */
CtsStatus cts_view_of(const char *option, const char *text, double *azimuth_deg, double *elevation_deg, CtsError *err);
/* Likewise a format by its name. */
CtsStatus cts_format_of(const char *option, const char *text, const CtsFormatInfo **format, CtsError *err);

CtsOptionParser cts_parse_annotate, cts_parse_background, cts_parse_centre, cts_parse_crop, cts_parse_format,
    cts_parse_from, cts_parse_kernel, cts_parse_memory, cts_parse_send, cts_parse_shard, cts_parse_size,
    cts_parse_swivel, cts_parse_view, cts_parse_window;

#endif
