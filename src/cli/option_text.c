/* What options say, in one way of writing it, so that two command lines can be compared. */
#include "cli/options.h"
#include <stdlib.h>

static void print_value(const CliOptions *options, const CliOption *o, FILE *file)
{
    const void *field = (const char *)options + o->field;
    const char *text;
    switch (o->kind) {
    case CLI_FLAG:
        fprintf(file, "%d", *(const bool *)field);
        break;
    case CLI_TEXT:
        text = *(const char *const *)field;
        fprintf(file, "%s", text ? text : "");
        break;
    case CLI_INT:
    case CLI_CHOICE:
        fprintf(file, "%d", *(const int *)field);
        break;
    case CLI_NUMBER:
        fprintf(file, "%.17g", *(const double *)field);
        break;
    case CLI_CUSTOM:
        o->print(options, file);
        break;
    }
}

char *cli_options_text(const CliOptions *options, CliTouches touches)
{
    char *text = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&text, &size);
    for (const CliOption *o = cli_options; file && o->name; o++)
        if (o->touches == touches && o->commands >> CLI_BATCH & 1) {
            fprintf(file, "%s=", o->name);
            print_value(options, o, file);
            fputc('\n', file);
        }
    if (file && fclose(file)) {
        free(text);
        text = NULL;
    }
    return text;
}
