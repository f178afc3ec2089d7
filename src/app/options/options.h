/* The table of all options of all commands: it drives parsing, ranges, help, messages, the contents of presentation
 * states, and what a batch renders again. Messages write an option as `size`. */
#pragma once

#include "app/job/montage.h"
#include "app/job/render_job.h"
#include "base/remakes.h"
#include "ctsplat/bounds.h"
#include "ctsplat/job.h"
#include "ctsplat/state.h"

/* Commands that have options. CTS_FOR_JOB: cts_options_run(); CTS_FOR_REQUEST: a client's request to `serve`, without
 * options that name files. */
typedef enum CtsCommand {
    CTS_FOR_INFO,
    CTS_FOR_RENDER,
    CTS_FOR_BATCH,
    CTS_FOR_SERVE,
    CTS_FOR_PRESETS,
    CTS_FOR_BENCH,
    CTS_FOR_CHECK,
    CTS_FOR_COMPARE,
    CTS_FOR_JOB,
    CTS_FOR_REQUEST
} CtsCommand;

/* Values of a repeated option, in order. */
typedef struct CtsTextList {
    const char **items;
    int n;
} CtsTextList;

/* The options of an appearance file, JSON equivalents of the label options; names are static, texts belong to the
 * CtsAppearanceFile. */
typedef struct CtsAppearanceFile {
    CtsJobOption *options;
    char **texts;
    int n;
} CtsAppearanceFile;

/* Of a file, or of the JSON itself. Free with cts_appearance_file_free(), also after a failure. */
CtsStatus cts_appearance_file_read(const char *file_or_json, CtsAppearanceFile *look, CtsError *err);
void cts_appearance_file_free(CtsAppearanceFile *look);

/* Values of all options, defaults where not given. Strings point into the option texts. */
typedef struct CtsOptions {
    CtsTextList paths, outputs;
    const CtsFormatInfo *format; /* of `formats`, except of a batch; NULL when not given */
    const char *output_dir;      /* NULL when not given */
    const char *log;

    const char *preset, *view, *formats; /* as given, of a batch lists; NULL: by modality, anterior, none or png */
    CtsRenderSettings render;
    const char *montage_list; /* NULL when not given */
    CtsMontage montage;       /* of it, and columns as given */
    int rotation;             /* frames; 0: off */
    double swivel_step_deg;   /* the rotation is a swivel; 0: it is not */
    CtsSource source;         /* fields that are options; cts_options_source() completes them */
    CtsTextList labels, label_appearances;
    const char *appearance_path;       /* NULL when not given */
    CtsAppearanceFile appearance_file; /* of it */
    struct CtsBackground {
        bool given, none;
        double rgb[3];
    } background;
    bool depth; /* of the picture in memory */
    CtsSwitch remove_table;
    struct CtsWindow {
        bool given;
        double low_hu, high_hu;
    } window;
    CtsMarks annotate;
    CtsExportSettings export;
    struct CtsGivenPeer {
        bool given;
        CtsPeer peer;
    } send, from;
    CtsNet net;
    CtsSeriesQuery find; /* the study or series to fetch */
    const char *state_path, *write_state;
    CtsState *state; /* of state_path; its preset is used where none is given */

    int jobs;                   /* 0: as many as threads */
    int settled_s, forget_days; /* 0: off */
    struct CtsShard {
        int i, n; /* i of n */
    } shard;
    double series_timeout_s, series_mib; /* 0: no limit of its own */
    bool fresh;
    const char *merge;

    const char *listen, *token_file, *allow_origin; /* serve: the last two NULL when not given */
    CtsTextList hosts;
    uint64_t memory_bytes; /* 0: half of the free memory */

    bool help, json, show_patient, show_paths, summary, paper, full;
    bool no_sections; /* of a batch's contact sheet */
    const char *only; /* NULL when not given */

    CtsJobOption *given; /* options in order of appearance, n_given */
    int n_given;
    CtsJobOption *recipe; /* the subset that a presentation state contains, n_recipe */
    int n_recipe;
} CtsOptions;

typedef enum CtsOptionKind {
    CTS_FLAG,   /* bool: true when given */
    CTS_TEXT,   /* const char * */
    CTS_TEXTS,  /* CtsTextList: one more each time it is given */
    CTS_INT,    /* int within the bounds */
    CTS_NUMBER, /* double within the bounds */
    CTS_CHOICE, /* place among choices: int or enum from first on, or bool */
    CTS_PEER,   /* struct CtsGivenPeer */
    CTS_PARSED  /* parse() */
} CtsOptionKind;

/* Parses an option's argument. */
typedef CtsStatus CtsOptionParser(CtsOptions *options, const char *text, CtsError *err);

typedef struct CtsOption {
    char letter; /* 0: none */
    const char *name;
    const char *argument; /* as printed by the help; NULL for a flag */
    unsigned commands;    /* bits 1 << CtsCommand */
    CtsRemakes remakes;   /* first stage that depends on it; a batch makes it again when the value changes */
    const char *help;
    const char *fallback; /* default, for the help; NULL: none */
    CtsOptionKind kind;
    size_t field, size; /* offset in CtsOptions, bytes; of all but CTS_PARSED */
    CtsSetting setting; /* of the library, whose bounds apply; 0: none */
    CtsBounds own;      /* bounds of an option that is not a setting of the library */
    const char *const *choices;
    int n_choices, first;
    CtsOptionParser *parse;
    bool is_basic;         /* one of the dozen that most people need */
    bool is_list_of_batch; /* has several values in a batch; elsewhere it is given once. Of others the last applies */
} CtsOption;

/* The table, in groups whose headings are rows without a name; name is NULL in its last row. */
extern const CtsOption cts_options[];

/* By its name or another spelling; NULL for none. */
const CtsOption *cts_option(const char *name, size_t length);
/* The option of the command whose name is nearest to one of this length; NULL where none is near. */
const char *cts_option_near(CtsCommand command, const char *name, size_t length);
static inline bool cts_option_is_of(const CtsOption *option, CtsCommand command)
{
    return option->commands >> command & 1;
}
/* The bounds of an option's number, NULL where it has none. */
const CtsBounds *cts_option_bounds(const CtsOption *option);

/* Defaults; free with cts_options_free(), also after a failure. */
void cts_options_begin(CtsOptions *options);
/* Adds an option, whose texts must stay valid. CTS_ERR_USAGE for an option that command does not have. */
CtsStatus cts_options_take(CtsOptions *options, CtsCommand command, const CtsJobOption *word, CtsError *err);
/* To be called after the last option: applies the presentation state where an option is not given, and checks
 * combinations. */
CtsStatus cts_options_end(CtsOptions *options, CtsCommand command, CtsError *err);
void cts_options_free(CtsOptions *options);

/* The argument that counts, "" for a flag; NULL where it was not given. */
const char *cts_options_given(const CtsOptions *options, const char *name);

/* The options of every picture: from CTS_REMAKES_SCAN to CTS_REMAKES_FILE, except those of the preset, which is
 * compared itself. */
bool cts_option_is_of_pictures(const CtsOption *option);
/* The values of all options of pictures, or those of DICOM objects alone, given or not: NAME=VALUE, one per line. Free
 * with free(); NULL without memory. */
char *cts_options_text(const CtsOptions *options, bool of_objects);

/* The options without names of files and patients, for the log. */
void cts_options_command(const CtsOptions *options, char *text, size_t size);

/* Texts with lists from the library's tables, so that new rows appear in help and messages. Largest size of such a
 * text. */
enum { CTS_VALUE_LISTS_MAX = 600 };

/* text with these replaced, in out; returns out. {views}, {kernels}, {formats}: their names; of the formats' endings
 * {outputs} has all, {objects} those of DICOM objects, {stacks} those of which one file holds a rotation. */
const char *cts_value_lists(const char *text, char out[CTS_VALUE_LISTS_MAX]);

/* Parsers of option arguments that are more than a number or a word; each names its option in its message.
 * cts_number(): the whole text as a finite decimal number; false when it is not one. cts_integer() likewise. */
bool cts_number(const char *text, double *value);
bool cts_integer(const char *text, int *value);
/* n numbers with commas between them, no more and no fewer. */
bool cts_numbers(const char *text, double *values, int n);

/* The index of text's first length bytes among n names; -1 where it is missing, and err lists the names and `more`.
 * option: NULL where the text is no option's argument. */
int cts_name_find(const char *option, const char *text, size_t length, const char *const *names, int n,
                  const char *more, CtsError *err);

/* Lists of names for it; their lengths. */
enum { CTS_NAMES_MAX = 16 };
int cts_view_names(const char *names[CTS_NAMES_MAX]);
int cts_format_names(const char *names[CTS_NAMES_MAX]);

/* A view by its name or its two angles. */
CtsStatus cts_view_of(const char *text, double *azimuth_deg, double *elevation_deg, CtsError *err);
/* The format of this name. */
CtsStatus cts_format_of(const char *text, const CtsFormatInfo **format, CtsError *err);

/* Reads montage_list into montage, after all other options. */
CtsStatus cts_options_montage(CtsOptions *options, CtsCommand command, CtsError *err);

CtsOptionParser cts_parse_annotate, cts_parse_background, cts_parse_centre, cts_parse_crop, cts_parse_fill,
    cts_parse_kernel, cts_parse_memory, cts_parse_shard, cts_parse_size, cts_parse_slab, cts_parse_smooth,
    cts_parse_swivel, cts_parse_window;

/* The caller sets remove_table, from the preset (cts_options_preset()). */
CtsSource cts_options_source(const CtsOptions *options);

/* The settings common to all jobs of these options; preset is NULL, and the view is that of `view`. */
CtsJob cts_options_job(const CtsOptions *options);

/* Loads a preset (NULL: `bone`) and replaces window, background, mode, lighting and table removal by the options'
 * values. The report gets warnings about options without effect. */
CtsStatus cts_options_preset(const CtsOptions *options, const char *name_or_file, CtsPreset *preset, CtsReport *report,
                             CtsError *err);

/* The single job of the options: loads their preset into *preset; *job points to it and to the options. Without
 * `preset` it is complete once cts_options_settle() knows the series. */
CtsStatus cts_options_one_job(const CtsOptions *options, CtsPreset *preset, CtsJob *job, CtsReport *report,
                              CtsError *err);
/* Loads the preset that a series of this kind has without `preset`; one that is given is checked. */
CtsStatus cts_options_settle(const CtsOptions *options, CtsModality modality, CtsQuantity quantity, CtsPreset *preset,
                             CtsJob *job, CtsReport *report, CtsError *err);
/* Finds the series, settles the job, loads and renders. */
CtsStatus cts_options_run_job(const CtsOptions *options, CtsPreset *preset, CtsJob *job, const CtsWatch *watch,
                              CtsReport *report, CtsError *err);

/* Warns about options that act on DICOM outputs only, where there is none. but: an option that acts on other outputs
 * here too, or "". */
void cts_options_report_objects(const CtsOptions *options, bool any_object, const char *but, CtsReport *report);

/* Sends every DICOM output once it is written; does nothing without `send`. */
CtsStatus cts_options_send(const CtsOptions *options, CtsReport *report, CtsError *err);
