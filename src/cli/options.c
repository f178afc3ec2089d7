#include "cli/options.h"

#include "cli/interrupt.h"
#include "cli/values.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ON(command) (1u << (command))
#define RENDERING (ON(CLI_RENDER) | ON(CLI_BATCH))
#define PICTURES (RENDERING | ON(CLI_BENCH))
#define FIELD(name) offsetof(CliOptions, name)
#define CHOICES(names, n) .kind = CLI_CHOICE, .choices = (names), .n_choices = (n)
#define RANGE(lowest, highest) .own = {.unit = "", .low = (lowest), .high = (highest)}
#define BOUNDED(which) .setting = CTS_SETTING_##which
#define PARSED(parser) .kind = CLI_CUSTOM, .parse = (parser)

static const char *const interpolations[] = {"linear", "cubic"};

const CliOption cli_options[] = {
    {
        .letter = 'o',
        .name = "output",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        PARSED(cli_parse_output),
        .help = "write this file, whose name ends in {outputs}; may be repeated",
    },
    {
        .letter = 'O',
        .name = "output-dir",
        .argument = "DIR",
        .commands = ON(CLI_BATCH) | ON(CLI_BENCH),
        .kind = CLI_TEXT,
        .field = FIELD(output_dir),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "write into this folder; it is made where it does not exist",
    },
    {
        .letter = 'p',
        .name = "preset",
        .argument = "NAME or FILE",
        .commands = PICTURES,
        .kind = CLI_TEXT,
        .field = FIELD(preset),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "a built-in preset, one of your own, or a preset file",
        .fallback = "bone",
    },
    {
        .name = "view",
        .argument = "NAME or AZ,EL",
        .commands = PICTURES,
        PARSED(cli_parse_view),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "{views}, or azimuth and elevation in degrees",
        .fallback = "anterior",
    },
    {
        .name = "presets",
        .argument = "LIST",
        .commands = ON(CLI_BATCH),
        .kind = CLI_TEXT,
        .field = FIELD(presets),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "presets, names or files with commas between them: each with every view",
        .fallback = "--preset",
    },
    {
        .name = "views",
        .argument = "LIST",
        .commands = ON(CLI_BATCH),
        .kind = CLI_TEXT,
        .field = FIELD(views),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "views with commas between them, such as anterior,left,30,-20",
        .fallback = "--view",
    },
    {
        .name = "formats",
        .argument = "LIST",
        .commands = ON(CLI_BATCH),
        .kind = CLI_TEXT,
        .field = FIELD(formats),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "of png, exr and dcm, with commas between them",
        .fallback = "png",
    },
    {
        .name = "rotation",
        .argument = "N",
        .commands = RENDERING,
        .kind = CLI_INT,
        .field = FIELD(rotation),
        BOUNDED(FRAMES),
        .help =
            "N views over 360 degrees about the head-foot axis, from --view on: FILE becomes FILE-000 and so on, but "
            "{stacks} one file of N frames",
        .fallback = "off",
    },
    {
        .name = "size",
        .argument = "WxH",
        .commands = PICTURES,
        PARSED(cli_parse_size),
        BOUNDED(WIDTH),
        .help = "picture size in pixels",
        .fallback = "1024x1024",
    },
    {
        .name = "fit",
        .argument = "NAME",
        .commands = PICTURES,
        CHOICES(cts_fit_names, CTS_N_FITS),
        .field = FIELD(render.fit),
        .help = "what the frame shows: the whole volume, or all that the preset can show",
        .fallback = "visible",
    },
    {
        .name = "mm-per-pixel",
        .argument = "X",
        .commands = RENDERING,
        .kind = CLI_NUMBER,
        .field = FIELD(render.mm_per_pixel),
        BOUNDED(MM_PER_PIXEL),
        .help = "scale, about the centre of the volume",
        .fallback = "as --fit says",
    },
    {
        .name = "series",
        .argument = "UID",
        .commands = PICTURES | ON(CLI_PRESETS),
        .kind = CLI_TEXT,
        .field = FIELD(series_uid),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "which series, when PATH holds several",
        .fallback = "the one with the most slices",
    },
    {
        .name = "engine",
        .argument = "NAME",
        .commands = RENDERING,
        CHOICES(cts_engine_names, CTS_N_ENGINES),
        .field = FIELD(render.engine),
        .help = "how the picture is made",
        .fallback = "tiled",
    },
    {
        .name = "kernel",
        .argument = "NAME[:RADIUS]",
        .commands = RENDERING,
        PARSED(cli_parse_kernel),
        BOUNDED(KERNEL_RADIUS),
        .help = "{kernels}: what a voxel is reconstructed with (cone-paper without normalised weights, as the paper "
                "has it), and how far it reaches",
        .fallback = "tent",
    },
    {
        .name = "samples",
        .argument = "N",
        .commands = RENDERING,
        .kind = CLI_INT,
        .field = FIELD(render.samples),
        BOUNDED(SAMPLES),
        .help = "sub-sheets per layer",
        .fallback = "chosen by the engine",
    },
    {
        .name = "max-error",
        .argument = "E",
        .commands = RENDERING,
        .kind = CLI_NUMBER,
        .field = FIELD(render.max_error),
        BOUNDED(MAX_ERROR),
        .help = "choose the cheapest plan whose error stays below E/255 rms",
        .fallback = "chosen by the engine",
    },
    {
        .name = "void",
        .argument = "strict or key",
        .commands = RENDERING,
        PARSED(cli_parse_void),
        .help = "what counts as a void voxel: provably invisible, or improbable by the mixture model (engines void "
                "and combined; lossy: what is lost is told, and measured as by --verify)",
        .fallback = "strict",
    },
    {
        .name = "grey-bits",
        .argument = "N",
        .commands = RENDERING,
        .kind = CLI_INT,
        .field = FIELD(render.grey_bits),
        BOUNDED(GREY_BITS),
        .help = "quantise grey levels over the preset's window, as the paper does",
        .fallback = "16",
    },
    {
        .name = "opacity-unit",
        .argument = "mm or voxel",
        .commands = RENDERING,
        PARSED(cli_parse_unit),
        .help = "opacity per millimetre, or per voxel along the ray as in Slicer's GPU rendering",
        .fallback = "mm",
    },
    {
        .name = "tolerance",
        .argument = "HU",
        .commands = RENDERING,
        .kind = CLI_NUMBER,
        .field = FIELD(render.tolerance_hu),
        BOUNDED(TOLERANCE),
        .help = "layer similarity: the largest change taken for none",
        .fallback = "0",
    },
    {
        .name = "mode",
        .argument = "NAME",
        .commands = RENDERING,
        CHOICES(cts_mode_names, CTS_N_MODES),
        .field = FIELD(render.mode),
        .help = "how values along a ray become a pixel; minip and average look at the body alone, with --remove-table "
                "off at everything",
        .fallback = "as the preset says",
    },
    {
        .name = "interpolation",
        .argument = "cubic or linear",
        .commands = RENDERING,
        CHOICES(interpolations, 2),
        .field = FIELD(interpolation),
        .help = "along the slice axis, where slices lie further apart than 1.5 pixels: monotone cubics, or straight "
                "lines",
        .fallback = "linear",
    },
    {
        .name = "smooth",
        .argument = "MM",
        .commands = RENDERING,
        PARSED(cli_parse_smooth),
        .help = "smooth the volume first, with a Gaussian of this standard deviation",
        .fallback = "off",
    },
    {
        .name = "slab",
        .argument = "MM",
        .commands = RENDERING,
        .kind = CLI_NUMBER,
        .field = FIELD(render.slab_mm),
        RANGE(1e-3, 1e5),
        .help = "only a slab of this thickness across the view (engines tiled and raycast)",
        .fallback = "off",
    },
    {
        .name = "slab-at",
        .argument = "MM",
        .commands = RENDERING,
        .kind = CLI_NUMBER,
        .field = FIELD(render.slab_at_mm),
        RANGE(-1e5, 1e5),
        .help = "the slab's middle, so far in front of the volume's centre",
        .fallback = "0",
    },
    {
        .name = "window",
        .argument = "LOW,HIGH",
        .commands = RENDERING,
        PARSED(cli_parse_window),
        .help = "the HU that mip, minip and average show black and white",
        .fallback = "as the preset says",
    },
    {
        .name = "shade",
        .argument = "on or off",
        .commands = RENDERING,
        PARSED(cli_parse_shade),
        .help = "gradient lighting",
        .fallback = "as the preset says",
    },
    {
        .name = "background",
        .argument = "#RRGGBB or none",
        .commands = RENDERING,
        PARSED(cli_parse_background),
        .help = "colour behind the volume; none writes alpha",
        .fallback = "as the preset says",
    },
    {
        .name = "crop",
        .argument = "X0,X1,Y0,Y1,Z0,Z1",
        .commands = PICTURES | ON(CLI_PRESETS),
        PARSED(cli_parse_crop),
        .help = "keep this box, millimetres in patient coordinates (LPS)",
        .fallback = "all",
    },
    {
        .name = "remove-table",
        .argument = "on or off",
        .commands = RENDERING | ON(CLI_PRESETS),
        PARSED(cli_parse_table),
        .help = "drop what is not the patient",
        .fallback = "as the preset says",
    },
    {
        .name = "annotate",
        .argument = "LIST",
        .commands = RENDERING,
        PARSED(cli_parse_annotate),
        .help = "orientation,scale drawn on the picture",
        .fallback = "none",
    },
    {
        .name = "verify",
        .argument = "N",
        .commands = RENDERING,
        .kind = CLI_INT,
        .field = FIELD(render.verify),
        .touches = CLI_TOUCHES_NOTHING,
        BOUNDED(VERIFY),
        .help = "render N random pixels again with the float64 ray caster; the log and stderr tell the error",
        .fallback = "0",
    },
    {
        .name = "compress",
        .argument = "NAME",
        .commands = RENDERING,
        CHOICES(cts_sc_compression_names, CTS_SC_N_COMPRESSIONS),
        .field = FIELD(compression),
        .touches = CLI_TOUCHES_DCM,
        .help = "compression of {objects} outputs",
        .fallback = "none",
    },
    {
        .name = "series-number",
        .touches = CLI_TOUCHES_DCM,
        .argument = "N",
        .commands = RENDERING,
        .kind = CLI_INT,
        .field = FIELD(series_number),
        RANGE(1, 2147483647),
        .help = "SeriesNumber of .dcm outputs",
        .fallback = "one for each series, preset, mode and view",
    },
    {
        .name = "series-description",
        .touches = CLI_TOUCHES_DCM,
        .argument = "TEXT",
        .commands = RENDERING,
        .kind = CLI_TEXT,
        .field = FIELD(series_description),
        .help = "SeriesDescription of .dcm outputs, at most 64 ASCII characters",
        .fallback = "mode, preset and view",
    },
    {
        .name = "new-uids",
        .commands = RENDERING,
        .field = FIELD(new_uids),
        .touches = CLI_TOUCHES_DCM,
        .help = "fresh UIDs in {objects} outputs, other ones in each run",
    },
    {
        .name = "deidentify",
        .commands = RENDERING,
        .field = FIELD(deidentify),
        .touches = CLI_TOUCHES_DCM,
        .help = "leave the patient's identity out of {objects} outputs",
    },
    {
        .name = "state",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(state_path),
        .help = "make the picture that a presentation state of ctsplat's describes; options beside it win",
    },
    {
        .name = "write-state",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(write_state),
        .help = "write how the picture was made as a Volume Rendering Volumetric Presentation State",
    },
    {
        .name = "send",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "PEER",
        .commands = ON(CLI_RENDER),
        PARSED(cli_parse_send),
        .help = "store the DICOM outputs to a PACS: AET@HOST:PORT (C-STORE) or the URL of a DICOMweb service (STOW-RS)",
    },
    {
        .name = "from",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "PEER",
        .commands = ON(CLI_RENDER),
        PARSED(cli_parse_from),
        .help = "fetch the series from a PACS instead of PATH: AET@HOST:PORT (C-GET) or the URL of a DICOMweb service "
                "(WADO-RS)",
    },
    {
        .name = "study-uid",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "UID",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(study_uid),
        .help = "the study to fetch",
    },
    {
        .name = "series-uid",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "UID",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(peer_series_uid),
        .help = "the one series of it to fetch",
        .fallback = "all",
    },
    {
        .name = "aet",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "AET",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(net.own_aet),
        .help = "ctsplat's own AE title",
        .fallback = "CTSPLAT",
    },
    {
        .name = "move-port",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "PORT",
        .commands = ON(CLI_RENDER),
        .kind = CLI_INT,
        .field = FIELD(net.move_port),
        RANGE(1, 65535),
        .help = "fetch by C-MOVE to this port, for peers that do not know C-GET",
        .fallback = "C-GET",
    },
    {
        .name = "tls-ca",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(net.tls_ca),
        .help = "talk to the peer over TLS, and trust the certificates in this PEM file",
    },
    {
        .name = "tls-key",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(net.tls_key),
        .help = "private key (PEM) that ctsplat shows itself with over TLS",
        .fallback = "none",
    },
    {
        .name = "tls-cert",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(net.tls_certificate),
        .help = "its certificate (PEM)",
        .fallback = "none",
    },
    {
        .name = "credentials",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_RENDER),
        .kind = CLI_TEXT,
        .field = FIELD(net.credentials),
        .help = "file with user:password, or Bearer and a token, for DICOMweb",
        .fallback = "$CTSPLAT_CREDENTIALS",
    },
    {
        .name = "peer-timeout",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "SECONDS",
        .commands = ON(CLI_RENDER),
        .kind = CLI_INT,
        .field = FIELD(net.timeout_s),
        RANGE(1, 3600),
        .help = "how long a silent peer is waited for",
        .fallback = "30",
    },
    {
        .name = "plot",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "FILE",
        .commands = ON(CLI_CHECK),
        .kind = CLI_TEXT,
        .field = FIELD(plot),
        .help = "draw how much of its bound each error takes, as SVG",
    },
    {
        .name = "propose",
        .touches = CLI_TOUCHES_NOTHING,
        .argument = "PATH",
        .commands = ON(CLI_PRESETS),
        .kind = CLI_TEXT,
        .field = FIELD(propose),
        .help = "print the mixture of tissues found in the volume, and the void key it proposes for the preset "
                "(bone, where none is named); --series, --crop, --remove-table and --threads go with it",
    },
    {
        .name = "threads",
        .argument = "N",
        .commands = PICTURES | ON(CLI_INFO) | ON(CLI_CHECK) | ON(CLI_PRESETS),
        .kind = CLI_INT,
        .field = FIELD(render.n_threads),
        .touches = CLI_TOUCHES_NOTHING,
        BOUNDED(THREADS),
        .help = "threads at work",
        .fallback = "the cores this process may use",
    },
    {
        .name = "jobs",
        .argument = "N",
        .commands = ON(CLI_BATCH),
        .kind = CLI_INT,
        .field = FIELD(jobs),
        RANGE(1, 256),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "series rendered at once, which share the threads; one more is read ahead",
        .fallback = "one more than threads",
    },
    {
        .name = "shard",
        .argument = "I/N",
        .commands = ON(CLI_BATCH),
        PARSED(cli_parse_shard),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "take the I-th of N parts of the series, I from 0; shards may share DIR",
        .fallback = "0/1",
    },
    {
        .name = "resume",
        .commands = ON(CLI_BATCH),
        .field = FIELD(resume),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "go on where an earlier run was stopped, as a batch does anyway",
    },
    {
        .name = "fresh",
        .commands = ON(CLI_BATCH),
        .field = FIELD(fresh),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "start over: make every output anew",
    },
    {
        .name = "merge",
        .argument = "DIR",
        .commands = ON(CLI_BATCH),
        .kind = CLI_TEXT,
        .field = FIELD(merge),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "make one contact sheet of all shards in DIR, and render nothing",
    },
    {
        .name = "series-timeout",
        .argument = "SECONDS",
        .commands = ON(CLI_BATCH),
        .kind = CLI_NUMBER,
        .field = FIELD(series_timeout_s),
        RANGE(0, 1e7),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "give up a series that takes longer to read, or to render; 0: never",
        .fallback = "3600",
    },
    {
        .name = "series-memory",
        .argument = "MIB",
        .commands = ON(CLI_BATCH),
        .kind = CLI_NUMBER,
        .field = FIELD(series_mib),
        RANGE(0, 1e9),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "give up a series that needs more memory; 0: what the machine can spare",
        .fallback = "0",
    },
    {
        .name = "explain",
        .commands = ON(CLI_RENDER),
        .field = FIELD(render.explain),
        .help = "print the plan and stop: what will run, what is left out and why",
    },
    {
        .name = "force",
        .commands = PICTURES | ON(CLI_CHECK),
        .field = FIELD(force),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "overwrite outputs that exist",
    },
    {
        .name = "log",
        .argument = "FILE",
        .commands = RENDERING,
        .kind = CLI_TEXT,
        .field = FIELD(log),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "append a timing log, JSON Lines; - is stderr",
        .fallback = "none",
    },
    {
        .name = "json",
        .commands = ON(CLI_INFO) | ON(CLI_CHECK) | ON(CLI_COMPARE) | ON(CLI_PRESETS),
        .field = FIELD(json),
        .help = "print JSON",
    },
    {
        .name = "show-patient",
        .commands = ON(CLI_INFO) | ON(CLI_BATCH),
        .field = FIELD(show_patient),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "print series descriptions too, which may identify the patient",
    },
    {
        .letter = 'h',
        .name = "help",
        .commands = ON(CLI_N_COMMANDS) - 1,
        .field = FIELD(help),
        .touches = CLI_TOUCHES_NOTHING,
        .help = "print this and stop",
    },
    {.name = NULL},
};
_Static_assert(sizeof cli_options / sizeof *cli_options <= CLI_MOST_OPTIONS, "room for what is given");

const CtsBounds *cli_bounds(const CliOption *option)
{
    return option->own.low < option->own.high ? &option->own : cts_setting_bounds(option->setting);
}

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
    if (o->parse == cli_parse_output)
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
    return o->touches == CLI_TOUCHES_PICTURES || strcmp(o->name, "view") == 0;
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
    *options = (CliOptions){.n_shards = 1, .series_timeout_s = 3600, .net.stop = &cli_stop};
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
