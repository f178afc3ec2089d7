/* --help, printed from the tables. */
#include "cli/commands.h"

#include <expat.h>
#include <jansson.h>
#include <openexr_base.h>
#include <png.h>
#include <stdio.h>
#include <string.h>

enum { HELP_COLUMN = 30, HELP_WIDTH = 80 };
/* A command and its summary fit one line of HELP_WIDTH. */
enum { COMMAND_WIDTH = 9 };

/* Prints words from column on, wrapped at HELP_WIDTH; the cursor is at column already. */
static void print_wrapped(const char *text, int column)
{
    int at = column;
    while (*text) {
        const int n = (int)strcspn(text, " ");
        if (at > column && at + 1 + n > HELP_WIDTH) {
            printf("\n%*s", column, "");
            at = column;
        } else if (at > column) {
            putchar(' ');
            at++;
        }
        printf("%.*s", n, text);
        at += n;
        text += n + (text[n] == ' ');
    }
    putchar('\n');
}

static void print_entry(const char *left, const char *right)
{
    int at = printf("%s", left);
    if (at + 2 > HELP_COLUMN) {
        putchar('\n');
        at = 0;
    }
    printf("%*s", HELP_COLUMN - at, "");
    print_wrapped(right, HELP_COLUMN);
}

/* The range, where a setting has one, and the default. */
static void append_range(const CtsOption *o, char *text, size_t size)
{
    const CtsBounds *b = cts_option_bounds(o);
    size_t n = strlen(text);
    if (b)
        n +=
            (size_t)snprintf(text + n, size - n, " (%.10g to %.10g%s%s", b->low, b->high, *b->unit ? " " : "", b->unit);
    if (o->fallback && n < size)
        n += (size_t)snprintf(text + n, size - n, "%sdefault: %s", b ? "; " : " (", o->fallback);
    if ((b || o->fallback) && n < size)
        snprintf(text + n, size - n, ")");
}

/* brief: the help up to its first semicolon, colon or parenthesis, in one line where it fits. */
static void print_option(const CtsOption *o, bool brief)
{
    char left[128], right[2 * CTS_VALUE_LISTS_MAX] = "", help[CTS_VALUE_LISTS_MAX];
    snprintf(left, sizeof left, "  %c%c%s--%s%s%s", o->letter ? '-' : ' ', o->letter ? o->letter : ' ',
             o->letter ? ", " : "  ", o->name, o->argument ? " " : "", o->argument ? o->argument : "");
    if (brief) {
        cts_value_lists(o->help, help);
        help[strcspn(help, ";:(")] = 0;
        print_entry(left, help);
        return;
    }
    size_t n = 0;
    for (int i = 0; !strncmp(o->argument ? o->argument : "", "NAME", 4) && i < o->n_choices; i++)
        n += (size_t)snprintf(right + n, sizeof right - n, "%s%s", o->choices[i], i + 1 < o->n_choices ? " " : "; ");
    snprintf(right + n, sizeof right - n, "%s", cts_value_lists(o->help, help));
    append_range(o, right, sizeof right);
    print_entry(left, right);
}

void cli_help(void)
{
    printf("Usage: ctsplat COMMAND [options]\n"
           "Clinical pictures of CT series, each with an error estimate: ctsplat render scans/head -o head.png\n\n"
           "Commands:\n");
    for (int c = 0; c < CLI_N_COMMANDS; c++)
        printf("  %-*s%s\n", COMMAND_WIDTH, cli_commands[c].name, cli_commands[c].summary);
    printf("\nctsplat COMMAND --help   the options of a command\n"
           "ctsplat --version        this program and its libraries\n"
           "\nPATH is a DICOM file, a folder (searched to any depth), a zip file of one, a DICOMDIR or a NIfTI CT.\n"
           "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 no readable series, 4 series refused,\n"
           "5 output not written, 8 batch: a series refused or failed, 130 interrupted.\n"
           "Not for diagnostic use.\n");
}

/* At most so many options are all shown. */
enum { FEW_OPTIONS = 16 };

void cli_help_command(int command, bool all)
{
    const CliCommand *c = &cli_commands[command];
    const char *title = NULL;
    int n = 0;
    for (const CtsOption *o = cts_options; o->name; o++)
        n += cts_option_is_of(o, (CtsCommand)command);
    all |= n <= FEW_OPTIONS;
    printf("Usage: ctsplat %s %s\n", c->name, c->usage);
    print_wrapped(c->summary, 0);
    for (const CtsOption *o = cts_options; o->name; o++) {
        title = o->name[0] ? title : o->help;
        if (!cts_option_is_of(o, (CtsCommand)command) || !(all || o->is_basic))
            continue;
        if (title)
            printf("%s%s:\n", all ? "\n" : "", title);
        title = NULL;
        print_option(o, !all);
    }
    if (!all)
        printf("ctsplat %s --help all lists %d options.\n", c->name, n);
}

void cli_version(void)
{
    int major, minor, patch;
    const char *extra;
    exr_get_library_version(&major, &minor, &patch, &extra);
    printf("ctsplat %s\n", CTS_VERSION);
    printf("DCMTK %s\n", CTS_DCMTK_VERSION);
    printf("OpenEXR %d.%d.%d\n", major, minor, patch);
    printf("libpng %s\n", png_get_libpng_ver(NULL));
    printf("jansson %s\n", jansson_version_str());
    printf("%s\n", XML_ExpatVersion());
}
