/* The command line as plain data. One table drives parsing, ranges, --help and error messages. */
#ifndef CTS_CLI_OPTIONS_H
#define CTS_CLI_OPTIONS_H

#include "ctsplat/ctsplat.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { CLI_MOST_OPTIONS = 100 };

/* What the user asked for, defaults where nothing was said. Strings point into argv. */
typedef struct CliOptions {
    const char *const *operands; /* PATH..., A B, NAME */
    int n_operands;
    const char **outputs; /* every -o, in order */
    int n_outputs;
    const CtsFormatInfo *format; /* of standard output; NULL when not given */
    const char *output_dir;      /* NULL when not given */
    const char *peers;           /* bench: NULL when not given */
    bool help;
    double start_ms; /* when the run began */

    const char *preset;
    CtsRenderSettings render;
    int rotation; /* 0: off */
    const char *series_uid;
    bool background_given, background_none;
    double background[3];
    bool crop_given;
    double crop_low_lps[3], crop_high_lps[3];
    CtsSwitch remove_table;
    int interpolation; /* 0 cubic, 1 linear */
    double smooth_mm;
    bool window_given;
    double window_low_hu, window_high_hu;
    bool annotate_orientation, annotate_scale;
    int compression;   /* CtsScCompression */
    int series_number; /* 0: chosen by ctsplat */
    const char *series_description;
    bool send_given, from_given;
    CtsPeer send, from;
    CtsNet net;
    const char *study_uid, *peer_series_uid; /* what to fetch */
    const char *state_path, *write_state;
    CtsState *state; /* of state_path; its preset holds where --preset is not given */
    bool new_uids, deidentify, force;
    const char *log;
    char command[512]; /* the options, without names of files: what a log may tell */

    const char *only; /* check: NULL when not given */
    const char *plot; /* check: NULL when not given */

    const char *propose; /* presets: the volume to propose a key for; NULL when not given */

    bool json, show_patient;

    const char *presets, *views, *formats; /* batch: lists, as given; NULL when not */
    int jobs, shard, n_shards;             /* 0: as many as threads; 0 of 1 */
    double series_timeout_s, series_mib;   /* 0: no limit of its own */
    bool resume, fresh;
    const char *merge;

    CtsStateOption recipe[CLI_MOST_OPTIONS]; /* what a presentation state holds of them */
    int n_recipe;
    const char *given[CLI_MOST_OPTIONS]; /* by place in cli_options: the argument that counts, "" for a flag */
} CliOptions;

/* A command: what --help prints and what runs. *exit_code is 0 on entry; a status other than CTS_OK becomes the one
 * error line and the exit code of that status. */
typedef struct CliCommand {
    const char *name;
    const char *usage;   /* what follows the name */
    const char *summary; /* one line */
    int min_operands, max_operands;
    const char *operand; /* how a message calls one */
    CtsStatus (*run)(const CliOptions *options, int *exit_code, CtsError *err);
} CliCommand;

/* Bits of the commands that an option belongs to; the order of cli_commands. */
enum { CLI_INFO, CLI_RENDER, CLI_BATCH, CLI_BENCH, CLI_CHECK, CLI_COMPARE, CLI_PRESETS, CLI_N_COMMANDS };
extern const CliCommand cli_commands[CLI_N_COMMANDS];

CtsStatus cli_batch(const CliOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_bench(const CliOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_check(const CliOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_info(const CliOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_render(const CliOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_compare(const CliOptions *options, int *exit_code, CtsError *err);
CtsStatus cli_presets(const CliOptions *options, int *exit_code, CtsError *err);

/* argv[0] is the command's name. Free with cli_options_free(), also after a failure. */
CtsStatus cli_options_parse(CliOptions *options, int command, int argc, const char *const *argv, CtsError *err);
void cli_options_free(CliOptions *options);

/* What `ctsplat --help` and `ctsplat COMMAND --help` print. */
void cli_help(void);
void cli_help_command(int command);

typedef enum CliKind {
    CLI_FLAG,   /* bool: true when given */
    CLI_TEXT,   /* const char * */
    CLI_INT,    /* int within the setting's bounds */
    CLI_NUMBER, /* double within the setting's bounds */
    CLI_CHOICE, /* int: place among choices */
    CLI_CUSTOM  /* parse() */
} CliKind;

/* What has to be made anew where a batch goes on with another value of the option. */
typedef enum CliTouches {
    CLI_TOUCHES_PICTURES,
    CLI_TOUCHES_PRESET, /* pictures too: the option stands in for what the preset says */
    CLI_TOUCHES_DCM,
    CLI_TOUCHES_NOTHING
} CliTouches;

typedef struct CliOption {
    char letter; /* 0: none */
    const char *name;
    const char *argument; /* as --help prints it; NULL for a flag */
    unsigned commands;    /* bit 1 << command */
    CliKind kind;
    size_t field;       /* offset in CliOptions */
    CtsSetting setting; /* of the library, whose bounds hold; 0: none */
    CtsBounds own;      /* the bounds of what is no setting of the library */
    const char *const *choices;
    int n_choices;
    CtsStatus (*parse)(CliOptions *options, const char *text, CtsError *err); /* text: the argument */
    void (*print)(const CliOptions *options, FILE *file); /* what parse understood; where pictures are touched */
    CliTouches touches;
    const char *help;
    const char *fallback; /* the default as --help prints it; NULL: none to tell */
} CliOption;

/* The table; name is NULL in its last row. */
extern const CliOption cli_options[];

/* The values of all options that touch this, given or not, each in one way of writing it: NAME=VALUE, a line each. Free
 * with free(); NULL without memory. */
char *cli_options_text(const CliOptions *options, CliTouches touches);

/* The bounds of an option's number, NULL where it has none. */
const CtsBounds *cli_bounds(const CliOption *option);

#endif
