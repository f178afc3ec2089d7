/* The words of a command line, by the table in options.c. */
#include "base/clock.h"
#include "cli/interrupt.h"
#include "cli/options.h"
#include "cli/values.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const CliOption *find_long(const char *name, size_t length)
{
    for (const CliOption *o = cli_options; o->name; o++)
        if (strlen(o->name) == length && !strncmp(o->name, name, length))
            return o;
    return NULL;
}

static const CliOption *find_letter(char letter)
{
    for (const CliOption *o = cli_options; o->name; o++)
        if (o->letter && o->letter == letter)
            return o;
    return NULL;
}

static CtsStatus choose(const CliOption *o, int *field, const char *text, CtsError *err)
{
    char names[256] = "";
    for (int i = 0; i < o->n_choices; i++) {
        if (!strcmp(text, o->choices[i])) {
            *field = i;
            return CTS_OK;
        }
        strncat(names, " ", sizeof names - strlen(names) - 1);
        strncat(names, o->choices[i], sizeof names - strlen(names) - 1);
    }
    return cts_fail(err, CTS_ERR_USAGE, "--%s %s: not one of:%s", o->name, text, names);
}

/* What the argument says may stand in a log where it can name no file and no patient. */
static void note_command(CliOptions *options, const CliOption *o, const char *text)
{
    const size_t n = strlen(options->command);
    const CtsFormatInfo *format = text ? cts_export_format(text) : NULL;
    if (n + 2 > sizeof options->command)
        return;
    if (o->parse == cli_parse_output && !strcmp(text, "-"))
        snprintf(options->command + n, sizeof options->command - n, " -o -");
    else if (o->parse == cli_parse_output)
        snprintf(options->command + n, sizeof options->command - n, " -o .%s", format ? format->name : "?");
    else if (o->kind == CLI_FLAG || o->kind == CLI_TEXT)
        snprintf(options->command + n, sizeof options->command - n, " --%s", o->name);
    else
        snprintf(options->command + n, sizeof options->command - n, " --%s %s", o->name, text);
}

/* Store one option; text is its argument, NULL for a flag. */
static CtsStatus take(CliOptions *options, const CliOption *o, const char *text, CtsError *err)
{
    CtsStatus st = CTS_OK;
    void *field = (char *)options + o->field;
    const CtsBounds *b = cli_bounds(o);
    switch (o->kind) {
    case CLI_FLAG:
        *(bool *)field = true;
        break;
    case CLI_TEXT:
        if (!*text)
            return cts_fail(err, CTS_ERR_USAGE, "--%s: an empty argument (%s)", o->name, o->argument);
        *(const char **)field = text;
        break;
    case CLI_INT: {
        int n;
        if (!cli_integer(text, &n) || n < b->low || n > b->high)
            return cts_fail(err, CTS_ERR_USAGE, "--%s %s: not a whole number from %.0f to %.0f", o->name, text, b->low,
                            b->high);
        *(int *)field = n;
        break;
    }
    case CLI_NUMBER: {
        double x;
        if (!cli_number(text, &x) || x < b->low || x > b->high)
            return cts_fail(err, CTS_ERR_USAGE, "--%s %s: not a number from %g to %g", o->name, text, b->low, b->high);
        *(double *)field = x;
        break;
    }
    case CLI_CHOICE:
        st = choose(o, field, text, err);
        break;
    case CLI_CUSTOM:
        st = o->parse(options, text, err);
        break;
    }
    if (!st)
        note_command(options, o, text);
    return st;
}

/* One word of the command line that starts with a dash; *argv moves past it and its argument. */
static CtsStatus parse_option(CliOptions *options, int command, const char *const **argv, const char *const *end,
                              CtsError *err)
{
    const char *word = *(*argv)++, *argument = NULL;
    const bool is_long = word[1] == '-';
    const size_t length = is_long ? strcspn(word + 2, "=") : 1;
    const CliOption *o = is_long ? find_long(word + 2, length) : find_letter(word[1]);
    const char *its_name = cli_commands[command].name;
    if (!o)
        return cts_fail(err, CTS_ERR_USAGE, "%.*s: no such option (see ctsplat %s --help)",
                        (int)(is_long ? length + 2 : 2), word, its_name);
    if (!(o->commands >> command & 1))
        return cts_fail(err, CTS_ERR_USAGE, "--%s: not an option of %s (see ctsplat %s --help)", o->name, its_name,
                        its_name);
    if (is_long && word[2 + length] == '=')
        argument = word + 2 + length + 1;
    else if (!is_long && word[2])
        argument = word + 2;
    if (o->kind == CLI_FLAG) {
        if (argument)
            return cts_fail(err, CTS_ERR_USAGE, "%s: --%s takes no argument", word, o->name);
    } else if (!argument) {
        if (*argv == end)
            return cts_fail(err, CTS_ERR_USAGE, "%s: its argument is missing (%s)", word, o->argument);
        argument = *(*argv)++;
    }
    options->given[o - cli_options] = argument ? argument : "";
    return take(options, o, argument, err);
}

/* What a presentation state holds: how the picture looks, and from where. */
static bool is_of_recipe(const CliOption *o)
{
    return o->touches == CLI_TOUCHES_PICTURES || o->touches == CLI_TOUCHES_PRESET || strcmp(o->name, "view") == 0;
}

/* What the presentation state says, where the command line does not say otherwise. */
static CtsStatus take_state(CliOptions *options, int command, CtsError *err)
{
    CtsStatus st = cts_state_read(options->state_path, &options->state, err);
    if (st)
        return st;
    for (int i = 0; i < options->state->n_options && !st; i++) {
        const CtsStateOption *said = &options->state->options[i];
        const CliOption *o = find_long(said->name, strlen(said->name));
        if (!o || !is_of_recipe(o) || !(o->commands >> command & 1))
            st = cts_fail(err, CTS_ERR_READ, "%s: holds an option that this build does not have: %.60s",
                          options->state_path, said->name);
        else if (!options->given[o - cli_options]) {
            options->given[o - cli_options] = said->value;
            if ((st = take(options, o, o->kind == CLI_FLAG ? NULL : said->value, err)))
                cts_context(err, "%s", options->state_path);
        }
    }
    return st;
}

static void write_recipe(CliOptions *options)
{
    for (int i = 0; cli_options[i].name; i++)
        if (options->given[i] && is_of_recipe(&cli_options[i]))
            options->recipe[options->n_recipe++] = (CtsStateOption){cli_options[i].name, options->given[i]};
}

static CtsStatus check_operands(const CliOptions *options, const CliCommand *command, CtsError *err)
{
    if (options->n_operands < command->min_operands && !options->from_given)
        return cts_fail(err, CTS_ERR_USAGE, "%s: %s is missing (see ctsplat %s --help)", command->name,
                        command->operand, command->name);
    if (options->n_operands > command->max_operands)
        return cts_fail(err, CTS_ERR_USAGE, "%s: one argument too many: %s (see ctsplat %s --help)", command->name,
                        options->operands[command->max_operands], command->name);
    return CTS_OK;
}

CtsStatus cli_options_parse(CliOptions *options, int command, int argc, const char *const *argv, CtsError *err)
{
    *options = (CliOptions){.start_ms = cts_wall_ms(), .n_shards = 1, .series_timeout_s = 3600, .net.stop = &cli_stop};
    cts_render_defaults(&options->render);
    options->render.fit = CTS_FIT_VISIBLE;
    snprintf(options->command, sizeof options->command, "%s", cli_commands[command].name);
    const char **operands = calloc((size_t)argc + 1, sizeof *operands);
    options->operands = operands;
    options->outputs = calloc((size_t)argc + 1, sizeof *options->outputs);
    if (!operands || !options->outputs)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");

    const char *const *end = argv + argc;
    bool only_operands = false;
    for (argv++; argv < end;) {
        const char *word = *argv;
        if (!only_operands && !strcmp(word, "--")) {
            only_operands = true;
            argv++;
        } else if (!only_operands && word[0] == '-' && word[1]) {
            const CtsStatus st = parse_option(options, command, &argv, end, err);
            if (st)
                return st;
        } else {
            operands[options->n_operands++] = word;
            argv++;
        }
    }
    CtsStatus st = CTS_OK;
    if (!options->help && options->state_path)
        st = take_state(options, command, err);
    write_recipe(options);
    if (!options->preset)
        options->preset = options->state ? options->state->preset.name : "bone";
    else if (options->state)
        options->state->preset.name[0] = 0; /* another one is asked for */
    return st || options->help ? st : check_operands(options, &cli_commands[command], err);
}

void cli_options_free(CliOptions *options)
{
    free((void *)options->operands);
    free(options->outputs);
    cts_state_free(&options->state);
    *options = (CliOptions){0};
}
