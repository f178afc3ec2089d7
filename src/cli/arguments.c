#include "cli/commands.h"

#include <stdio.h>
#include <string.h>

static const CtsOption *find_short_option(char letter)
{
    for (const CtsOption *o = cts_options; o->name; o++)
        if (o->letter && o->letter == letter)
            return o;
    return NULL;
}

static CtsStatus fail_unknown_word(const char *word, size_t length, int command, CtsError *err)
{
    const char *const near = cts_option_near((CtsCommand)command, word + 2, length > 2 ? length - 2 : 0);
    return cts_fail(err, CTS_ERR_USAGE, "%.*s: no such option%s%s%s (see ctsplat %s --help)", (int)length, word,
                    near ? " (did you mean --" : "", near ? near : "", near ? "?)" : "", cli_commands[command].name);
}

/* An option that other commands have. */
static CtsStatus fail_elsewhere(const CtsOption *o, int command, CtsError *err)
{
    char others[128] = "";
    int first = -1;
    for (int c = 0; c < CLI_N_COMMANDS; c++)
        if (cts_option_is_of(o, (CtsCommand)c)) {
            const size_t n = strlen(others);
            snprintf(others + n, sizeof others - n, "%s%s", first < 0 ? "" : ", ", cli_commands[c].name);
            first = first < 0 ? c : first;
        }
    /* -o and -O are the other's of two commands. */
    const CtsOption *const other_case = o->letter ? find_short_option((char)(o->letter ^ ('a' ^ 'A'))) : NULL;
    char hint[64] = "";
    if (other_case && cts_option_is_of(other_case, (CtsCommand)command))
        snprintf(hint, sizeof hint, "did you mean -%c %s? ", other_case->letter, other_case->argument);
    return cts_fail(err, CTS_ERR_USAGE, "--%s: not an option of %s, but of %s (%ssee ctsplat %s --help)", o->name,
                    cli_commands[command].name, others, hint, cli_commands[first < 0 ? command : first].name);
}

/* Parses one argument that starts with a dash; advances *argv past it and its value. */
static CtsStatus take_option(CtsOptions *options, int command, const char *const **argv, const char *const *end,
                             CtsError *err)
{
    const char *word = *(*argv)++, *argument = NULL;
    const bool is_long = word[1] == '-';
    const size_t length = is_long ? 2 + strcspn(word + 2, "=") : 2;
    const CtsOption *o = is_long ? cts_option(word + 2, length - 2) : find_short_option(word[1]);
    if (!o || o->commands == 1u << CTS_FOR_JOB)
        return fail_unknown_word(word, length, command, err);
    if (!cts_option_is_of(o, (CtsCommand)command))
        return fail_elsewhere(o, command, err);
    if (word[length])
        argument = word + length + is_long;
    if (o->kind == CTS_FLAG && argument)
        return cts_fail(err, CTS_ERR_USAGE, "%s: --%s takes no argument", word, o->name);
    if (o->kind != CTS_FLAG && !argument) {
        if (*argv == end)
            return cts_fail(err, CTS_ERR_USAGE, "%s: its argument is missing (%s)", word, o->argument);
        argument = *(*argv)++;
    }
    const CtsJobOption said = {.name = o->name, .value = argument ? argument : ""};
    return cts_options_take(options, (CtsCommand)command, &said, err);
}

static CtsStatus check_operands(const CtsOptions *options, const CliCommand *command, CtsError *err)
{
    if (options->paths.n < command->min_operands && !options->from.given)
        return cts_fail(err, CTS_ERR_USAGE, "%s: %s is missing (see ctsplat %s --help)", command->name,
                        command->operand, command->name);
    if (options->paths.n > command->max_operands)
        return cts_fail(err, CTS_ERR_USAGE, "%s: one argument too many: %s (see ctsplat %s --help)", command->name,
                        options->paths.items[command->max_operands], command->name);
    return CTS_OK;
}

CtsStatus cli_arguments(CtsOptions *options, int command, int argc, const char *const *argv, CtsError *err)
{
    const char *const *end = argv + argc;
    bool only_operands = false;
    CtsStatus st = CTS_OK;
    for (argv++; argv < end && !st;) {
        const char *word = *argv;
        if (!only_operands && !strcmp(word, "--")) {
            only_operands = true;
            argv++;
        } else if (!only_operands && word[0] == '-' && word[1]) {
            st = take_option(options, command, &argv, end, err);
        } else {
            st = cts_options_take(options, CTS_FOR_JOB, &(CtsJobOption){.name = "path", .value = word}, err);
            argv++;
        }
    }
    if (st || options->help)
        return st;
    st = cts_options_end(options, (CtsCommand)command, err);
    return st ? st : check_operands(options, &cli_commands[command], err);
}
