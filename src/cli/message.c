#include "cli/message.h"

#include "cli/option_names.h"
#include "cli/progress.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* One message is one line, whatever stands in a header or a file name. */
static void print_line(const char *prefix, const char *text)
{
    char line[1200];
    cli_with_options(text, line, sizeof line);
    for (char *c = line; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = '?';
    cli_progress_clear();
    fprintf(stderr, "ctsplat: %s%s\n", prefix, line);
}

__attribute__((format(printf, 2, 0))) static void print_text(const char *prefix, const char *format, va_list args)
{
    char text[1200];
    vsnprintf(text, sizeof text, format, args);
    print_line(prefix, text);
}

void cli_warning(const char *format, ...)
{
    va_list args;
    va_start(args, format);
    print_text("warning: ", format, args);
    va_end(args);
}

void cli_note(const char *format, ...)
{
    va_list args;
    va_start(args, format);
    print_text("", format, args);
    va_end(args);
}

void cli_error(const CtsError *err)
{
    print_line("error: ", err->text);
}

void cli_print_findings(const CtsFindings *findings, size_t from)
{
    for (size_t i = from; i < findings->n; i++) {
        const CtsFinding *f = &findings->items[i];
        bool told = f->severity != CTS_WARNING;
        for (size_t before = 0; before < i && !told; before++)
            told = findings->items[before].severity == CTS_WARNING && !strcmp(findings->items[before].text, f->text);
        if (!told)
            cli_warning("%s", f->text);
    }
}
