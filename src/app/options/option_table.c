/* One row per option, in the order of the help, with the first stage that depends on it (base/remakes.h). When in doubt
 * the earlier one: a batch then renders its pictures again. */
#include "app/options/options.h"

#include <string.h>

#define ON(command) (1u << CTS_FOR_##command)
#define ONE (ON(RENDER) | ON(JOB))
#define RENDERING (ONE | ON(BATCH))
#define LOOKS (RENDERING | ON(REQUEST))
#define PICTURES (RENDERING | ON(BENCH))
#define PEERS (RENDERING | ON(SERVE))
#define FINDING (ON(INFO) | ON(BATCH))
#define REMAKES(stage) CTS_REMAKES_##stage

/* A field of another type than the kind writes does not compile. */
#define OF(name) ((const CtsOptions *)0)->name
#define FIELD(name, type)                                                                                              \
    .field = offsetof(CtsOptions, name), .size = sizeof(OF(name)) + 0 * sizeof(_Generic(OF(name), type : 1))
#define FLAG(name) .kind = CTS_FLAG, FIELD(name, bool)
#define TEXT(name) .kind = CTS_TEXT, FIELD(name, const char *)
#define TEXTS(name) .kind = CTS_TEXTS, FIELD(name, CtsTextList)
#define INT(name) .kind = CTS_INT, FIELD(name, int)
#define NUMBER(name) .kind = CTS_NUMBER, FIELD(name, double)
#define CHOICE(name, names)                                                                                            \
    .kind = CTS_CHOICE, .field = offsetof(CtsOptions, name),                                                           \
    .size = sizeof(OF(name)) + 0 * sizeof(_Generic(OF(name), int : 1, unsigned : 1, bool : 1)), .choices = (names),    \
    .n_choices = sizeof(names) / sizeof *(names)
#define SWITCH(name) CHOICE(name, switches), .first = CTS_ON
#define PEER(name) .kind = CTS_PEER, FIELD(name, struct CtsGivenPeer)
#define PARSED(name) .kind = CTS_PARSED, .parse = cts_parse_##name
/* Shown by --help without "all". */
#define BASIC .is_basic = true
/* Of a batch, several values with commas between them. */
#define LIST_OF_BATCH .is_list_of_batch = true
/* A heading of the help; belongs to no command. */
#define SECTION(title)                                                                                                 \
    {                                                                                                                  \
        .name = "", .help = title                                                                                      \
    }
#define BOUNDS(which) .setting = CTS_SETTING_##which
#define RANGE(lowest, highest) .own = {.unit = "", .low = (lowest), .high = (highest)}

static const char *const interpolations[] = {"shape", "cubic", "linear"}, *const switches[] = {"on", "off"},
                         *const void_rules[] = {"strict", "key"}, *const units[] = {"mm", "voxel"},
                         *const png_bits[] = {"16", "8"}, *const nifti_forms[] = {"sform", "qform"},
                         *const reuses[] = {"auto", "always"};

const CtsOption cts_options[] = {
    SECTION("Pictures"),
    {0, "path", "PATH", ON(JOB), REMAKES(NOTHING),
     "a file, folder, zip file, DICOMDIR or NIfTI file to search for series", NULL, TEXTS(paths)},
    {'o', "output", "FILE", ONE, REMAKES(NOTHING),
     "write this file, whose name ends in {outputs}; may be repeated; - is standard output", NULL, TEXTS(outputs),
     BASIC},
    {'O', "output-dir", "DIR", ON(BATCH) | ON(BENCH), REMAKES(NOTHING),
     "write into this folder; it is made where it does not exist", NULL, TEXT(output_dir), BASIC},
    {0, "depth", NULL, ON(JOB), REMAKES(PICTURE), "the picture in memory has the depth of its surfaces, too", NULL,
     FLAG(depth)},
    {0, "paper", NULL, ON(BENCH), REMAKES(NOTHING),
     "the paper's tables instead: its engines, times in per cent of plain splatting, beside the published figures",
     NULL, FLAG(paper)},
    {0, "full", NULL, ON(BENCH), REMAKES(NOTHING),
     "every kernel, the ray caster and more requested errors too: several times as long", NULL, FLAG(full)},
    {'p', "preset", "NAME or FILE", PICTURES | ON(REQUEST), REMAKES(NOTHING),
     "a built-in preset, one of your own, or a preset file; of a batch a list: a series takes those that fit it",
     "by modality: bone, mr-mip, pet-mip", TEXT(preset), LIST_OF_BATCH, BASIC},
    {0, "view", "NAME or AZ,EL", PICTURES | ON(REQUEST), REMAKES(NOTHING),
     "{views}, or azimuth and elevation in degrees; of a batch a list, such as anterior,left,30,-20", "anterior",
     TEXT(view), LIST_OF_BATCH, BASIC},
    {0, "format", "NAME", ON(RENDER) | ON(BATCH), REMAKES(NOTHING),
     "{formats}: what -o - writes; the files of a batch, a list", "of a batch png", TEXT(formats), BASIC},
    {0, "montage", "LIST", RENDERING, REMAKES(NOTHING),
     "one picture of tiles, in reading order: views; NAME@VIEW, of a preset, or of the labels A+B alone; axial, "
     "coronal "
     "and sagittal sections, MM from the middle as axial@MM; a batch makes it beside the others",
     NULL, TEXT(montage_list)},
    {0, "columns", "N", RENDERING, REMAKES(NOTHING), "tiles of --montage side by side", "as makes them largest",
     INT(montage.columns), RANGE(1, CTS_MAX_TILES)},
    {0, "rotation", "N", LOOKS, REMAKES(PICTURE),
     "N views over 360 degrees about the head-foot axis, from --view on: FILE becomes FILE-000 and so on, but {stacks} "
     "one file of N frames",
     "off", INT(rotation), BOUNDS(FRAMES), BASIC},
    {0, "swivel", "RANGE,STEP", LOOKS, REMAKES(PICTURE),
     "views back and forth about the head-foot axis, over RANGE degrees with --view in their middle, STEP apart; files "
     "as with --rotation",
     "off", PARSED(swivel)},
    {0, "frame-rate", "N", LOOKS, REMAKES(FILE), "pictures a second of a .webp, .mp4 or .gif", "10",
     INT(export.frame_rate), RANGE(1, 1000)},
    {0, "size", "WxH", PICTURES | ON(REQUEST), REMAKES(PICTURE), "picture size in pixels", "1024x1024", PARSED(size),
     BOUNDS(WIDTH), BASIC},
    {0, "fit", "NAME", PICTURES | ON(REQUEST), REMAKES(PICTURE),
     "what the frame shows: the whole volume, or all that the preset can show", "visible",
     CHOICE(render.fit, cts_fit_names)},
    {0, "mm-per-pixel", "X", LOOKS, REMAKES(PICTURE), "scale, about the centre of the volume", "as --fit says",
     NUMBER(render.mm_per_pixel), BOUNDS(MM_PER_PIXEL)},
    {0, "centre", "X,Y,Z", LOOKS, REMAKES(PICTURE),
     "point in the middle of the picture, millimetres in patient coordinates (LPS)", "as --fit says", PARSED(centre)},
    SECTION("Which series"),
    {0, "series", "UID or N", PICTURES, REMAKES(NOTHING),
     "which series, when PATH holds several: its UID, or its number as info counts them",
     "the one with the most slices; of equal right: refused", TEXT(source.series_uid), BASIC},
    {0, "allow-missing-slices", NULL, PICTURES | ON(SERVE) | ON(INFO), REMAKES(SCAN),
     "render a series in which slices are missing, with a warning", NULL, FLAG(source.rules.allow_missing_slices)},
    {0, "nifti-form", "sform or qform", PICTURES | ON(SERVE) | ON(INFO), REMAKES(SCAN),
     "which of two forms that disagree places a NIfTI file",
     "the sform, with a warning; refused where left and right or an axis differ",
     CHOICE(source.rules.nifti_form, nifti_forms), .first = CTS_NIFTI_FORM_S},
    {0, "quantity", "NAME", PICTURES | ON(SERVE) | ON(INFO), REMAKES(SCAN),
     "HU, SUVbw, Bq/ml or stored: of a NIfTI file that is not in HU, or a CT whose RescaleType names another quantity",
     "in HU; others are refused", CHOICE(source.rules.named_quantity, cts_quantity_names), .first = 1},
    SECTION("Labels"),
    {0, "labels", "PATH", PICTURES | ON(SERVE) | ON(INFO), REMAKES(SCAN),
     "segmentations: DICOM SEG, RT Structure Set, NIfTI label map, a folder of masks named by their files; "
     "auto: what lies beside the series and refers to it; {series_uid}, {stem} (of a NIfTI CT) and * are filled in; "
     "may be "
     "repeated",
     NULL, TEXTS(labels), BASIC},
    {0, "label-names", "FILE", PICTURES | ON(SERVE) | ON(INFO), REMAKES(SCAN),
     "names, colours and regions for the numbers of label maps: JSON, nnU-Net's dataset.json or an ITK-SNAP table",
     "the file's own", TEXT(source.label_names)},
    {0, "show", "LIST", LOOKS, REMAKES(VOLUME),
     "labels that are visible, by name (* stands for any letters) or number, all, rest (voxels without a label); all "
     "others are hidden",
     "everything", TEXT(source.choice.show)},
    {0, "hide", "LIST", LOOKS, REMAKES(VOLUME), "labels that are hidden, whatever --show says", "none",
     TEXT(source.choice.hide)},
    {0, "label", "NAME=LOOK", LOOKS, REMAKES(VOLUME),
     "appearance of labels: a preset, #RRGGBB (the picture's preset in this colour), #RRGGBB:OPACITY (a body of this "
     "opacity per mm); may be repeated",
     "as the preset says", TEXTS(label_appearances)},
    {0, "label-colours", NULL, LOOKS, REMAKES(VOLUME),
     "labels in the colours of their files, otherwise in colours that are easy to distinguish", NULL,
     FLAG(source.choice.own_colours)},
    {0, "label-order", "LIST", LOOKS, REMAKES(VOLUME), "which label a voxel gets that several labels hold, by priority",
     "the smallest", TEXT(source.choice.order)},
    {0, "look", "FILE", LOOKS, REMAKES(NOTHING),
     "show, hide, label, label_colours and label_order as JSON; options beside it win", NULL, TEXT(appearance_path)},
    SECTION("Error and engines, the paper's among them"),
    {0, "engine", "NAME", LOOKS, REMAKES(RENDERER), "how the picture is rendered", "auto",
     CHOICE(render.engine, cts_engine_names)},
    {0, "level", "NAME", LOOKS, REMAKES(PICTURE), "sampling density of engine sheets", "as --max-error needs",
     CHOICE(render.level, cts_engine_level_names)},
    {0, "kernel", "NAME[:RADIUS]", LOOKS, REMAKES(RENDERER),
     "{kernels}: what a voxel is reconstructed with (cone-paper without normalised weights, as the paper has it), and "
     "how far it reaches",
     "tent", PARSED(kernel), BOUNDS(KERNEL_RADIUS)},
    {0, "samples", "N", LOOKS, REMAKES(RENDERER), "sub-sheets per layer", "chosen by the engine", INT(render.samples),
     BOUNDS(SAMPLES)},
    {0, "max-error", "E", LOOKS, REMAKES(PICTURE), "choose the cheapest plan whose error stays below E/255 rms",
     "chosen by the engine", NUMBER(render.max_error), BOUNDS(MAX_ERROR), BASIC},
    {0, "void", "strict or key", LOOKS, REMAKES(RENDERER),
     "what counts as a void voxel: provably invisible, or improbable by the mixture model (engines void and combined; "
     "lossy: the loss is reported, and measured as by --verify)",
     "strict", CHOICE(render.void_key, void_rules)},
    {0, "grey-bits", "N", LOOKS, REMAKES(RENDERER), "quantise grey levels over the preset's window, as the paper does",
     "16", INT(render.grey_bits), BOUNDS(GREY_BITS)},
    {0, "opacity-unit", "mm or voxel", LOOKS, REMAKES(RENDERER),
     "opacity per millimetre, or per voxel along the ray as in Slicer's GPU rendering", "mm",
     CHOICE(render.opacity_per_voxel, units)},
    {0, "tolerance", "HU", LOOKS, REMAKES(RENDERER), "layer similarity: largest change that counts as none", "0",
     NUMBER(render.tolerance_hu), BOUNDS(TOLERANCE)},
    {0, "occlusion-culling", "on or off", LOOKS, REMAKES(NOTHING),
     "skip what opaque pixels hide (engines void and combined); off as in the paper; the picture is the same", "on",
     CHOICE(render.no_occlusion_culling, switches)},
    {0, "reuse", "auto or always", LOOKS, REMAKES(NOTHING),
     "reuse layers where it pays (engines layers and combined), or always, as the paper does; the picture is the same",
     "auto", CHOICE(render.always_reuse_layers, reuses)},
    SECTION("Modes, light, and what is shown"),
    {0, "mode", "NAME", LOOKS, REMAKES(TRANSFER),
     "how values along a ray become a pixel; minip and average use the body alone, with --remove-table off everything",
     "as the preset says", CHOICE(render.mode, cts_mode_names), BASIC},
    {0, "interpolation", "shape, cubic or linear", LOOKS, REMAKES(VOLUME),
     "interpolation along the slice axis, where slices lie further apart than 1.5 pixels: along shapes, cubic or "
     "linear",
     "shape", CHOICE(source.interpolation, interpolations)},
    {0, "smooth", "MM or auto", LOOKS, REMAKES(VOLUME),
     "smooth the volume first (Gaussian of this standard deviation); auto: 1 where soft tissue is noisy", "0",
     PARSED(smooth), RANGE(0, CTS_MAX_SMOOTH_MM), BASIC},
    {0, "fill", "HU", LOOKS, REMAKES(VOLUME),
     "voxels of exactly this value that are connected to the volume's border are air (filling outside the scan)", "off",
     PARSED(fill)},
    {0, "slab", "MM[@MM]", LOOKS, REMAKES(PICTURE),
     "only a slab of this thickness across the view, its middle so far in front of the volume's centre (engines tiled "
     "and raycast)",
     "off", PARSED(slab)},
    {0, "window", "LOW,HIGH", LOOKS, REMAKES(TRANSFER),
     "the values (HU, SUV or as stored) that are black and white in mip, minip and average",
     "as the preset says; one that fits for a --mode without a preset", PARSED(window)},
    {0, "shade", "on or off", LOOKS, REMAKES(TRANSFER), "gradient lighting", "as the preset says",
     SWITCH(render.shade)},
    {0, "ambient-occlusion", "S", LOOKS, REMAKES(TRANSFER), "darkening of folds, of a lit picture",
     "as the preset says", NUMBER(render.occlusion), BOUNDS(OCCLUSION)},
    {0, "background", "#RRGGBB or none", LOOKS, REMAKES(TRANSFER), "colour behind the volume; none writes alpha",
     "as the preset says", PARSED(background), BASIC},
    {0, "crop", "X0,X1,Y0,Y1,Z0,Z1", PICTURES | ON(REQUEST), REMAKES(VOLUME),
     "keep this box, millimetres in patient coordinates (LPS)", "all", PARSED(crop), BASIC},
    {0, "remove-table", "on or off", LOOKS, REMAKES(TRANSFER), "remove the table and all else that is not the patient",
     "as the preset says; on for a --mode minip or average", SWITCH(remove_table), BASIC},
    {0, "annotate", "LIST", LOOKS, REMAKES(PICTURE),
     "orientation,scale,labels,captions drawn on the picture; labels: names of the labels that have a colour, in that "
     "colour; captions: what the picture, or each tile of a montage, shows",
     "none", PARSED(annotate)},
    SECTION("Checks"),
    {0, "verify", "N", RENDERING, REMAKES(NOTHING),
     "render N random pixels again with the float64 ray caster; the log and stderr report the error", "0",
     INT(render.verify), BOUNDS(VERIFY)},
    SECTION("Files and captures"),
    {0, "compress", "NAME", LOOKS, REMAKES(OBJECT), "compression of {objects} outputs", "none",
     CHOICE(export.compression, cts_sc_compression_names)},
    {0, "png-bits", "16 or 8", LOOKS, REMAKES(FILE), "bits a sample of .png outputs", "16",
     CHOICE(export.png_8_bits, png_bits)},
    {0, "quality", "N", LOOKS, REMAKES(FILE), "quality of .jpg, .webp and .mp4 outputs", "90", INT(export.quality),
     RANGE(1, 100)},
    {0, "series-number", "N", LOOKS, REMAKES(OBJECT), "SeriesNumber of .dcm outputs",
     "the source's, then three digits for mode and preset", INT(export.series_number), RANGE(1, 2147483647)},
    {0, "series-description", "TEXT", LOOKS, REMAKES(OBJECT),
     "SeriesDescription of .dcm outputs, at most 64 ASCII characters", "mode and preset",
     TEXT(export.series_description)},
    {0, "new-uids", NULL, LOOKS, REMAKES(OBJECT), "new UIDs in {objects} outputs, different in each run", NULL,
     FLAG(export.new_uids)},
    {0, "deidentify", NULL, LOOKS, REMAKES(OBJECT), "leave the patient's identity out of {objects} outputs", NULL,
     FLAG(export.deidentify)},
    {0, "key", "FILE", PEERS, REMAKES(NOTHING), "key of the UIDs that --deidentify gives and of the log's hashes",
     "the site's own", TEXT(export.key)},
    {0, "state", "FILE", ONE, REMAKES(NOTHING),
     "render the picture that a presentation state of ctsplat's describes; options beside it win", NULL,
     TEXT(state_path)},
    {0, "write-state", "FILE", ONE, REMAKES(NOTHING),
     "write how the picture was made as a Volume Rendering Volumetric Presentation State", NULL, TEXT(write_state)},
    SECTION("PACS and listening"),
    {0, "send", "PEER", RENDERING, REMAKES(NOTHING),
     "store the DICOM outputs to a PACS: AET@HOST:PORT (C-STORE) or the URL of a DICOMweb service (STOW-RS)", NULL,
     PEER(send), BASIC},
    {0, "from", "PEER", ONE | FINDING | ON(SERVE), REMAKES(NOTHING),
     "fetch the series from a PACS instead of PATH: AET@HOST:PORT (C-GET) or the URL of a DICOMweb service (WADO-RS)",
     NULL, PEER(from), BASIC},
    {0, "study-uid", "UID", ONE | FINDING, REMAKES(NOTHING), "the study to fetch", NULL, TEXT(find.study_uid)},
    {0, "series-uid", "UID", ONE | FINDING, REMAKES(NOTHING), "the one series of it to fetch", "all",
     TEXT(find.series_uid)},
    {0, "accession", "NUMBER", FINDING, REMAKES(NOTHING), "studies at the peer with this accession number", NULL,
     TEXT(find.accession)},
    {0, "patient-id", "ID", FINDING, REMAKES(NOTHING), "studies of this patient at the peer", NULL,
     TEXT(find.patient_id)},
    {0, "study-date", "DATE", FINDING, REMAKES(NOTHING),
     "studies at the peer of YYYYMMDD, or from one such date to another with - between", NULL, TEXT(find.study_date)},
    {0, "modality", "LIST", FINDING, REMAKES(NOTHING),
     "series of these modalities, with commas between them, at a peer or below PATH", "at a peer CT, below PATH all",
     TEXT(find.modality)},
    {0, "aet", "AET", PEERS | ON(INFO), REMAKES(NOTHING), "ctsplat's own AE title", "CTSPLAT", TEXT(net.own_aet)},
    {0, "move-port", "PORT", ONE | ON(BATCH) | ON(SERVE), REMAKES(NOTHING),
     "fetch by C-MOVE to this port, for peers that do not know C-GET", "C-GET", INT(net.move_port), RANGE(1, 65535)},
    {0, "tls-ca", "FILE", PEERS | ON(INFO), REMAKES(NOTHING),
     "talk to peers over TLS, and trust the certificates in this PEM file", NULL, TEXT(net.tls_ca)},
    {0, "tls-key", "FILE", PEERS | ON(INFO), REMAKES(NOTHING), "ctsplat's own private key (PEM) for TLS", "none",
     TEXT(net.tls_key)},
    {0, "tls-cert", "FILE", PEERS | ON(INFO), REMAKES(NOTHING), "its certificate (PEM)", "none",
     TEXT(net.tls_certificate)},
    {0, "credentials", "FILE", PEERS | ON(INFO), REMAKES(NOTHING),
     "file with user:password, or Bearer and a token, for DICOMweb", "$CTSPLAT_CREDENTIALS", TEXT(net.credentials)},
    {0, "insecure-http", NULL, PEERS | ON(INFO), REMAKES(NOTHING),
     "let credentials, and what serve shows, go over plain http to other machines", NULL, FLAG(net.insecure_http)},
    {0, "peer-timeout", "SECONDS", PEERS | ON(INFO), REMAKES(NOTHING), "timeout for a peer that does not answer", "30",
     INT(net.timeout_s), RANGE(1, 3600)},
    {0, "listen", "ADDRESS:PORT", ON(SERVE), REMAKES(NOTHING),
     "address that clients connect to; port 0 is any free port; unix:PATH a socket for this user alone",
     "127.0.0.1:8484", TEXT(listen), BASIC},
    SECTION("Running"),
    {0, "only", "NAME", ON(CHECK), REMAKES(NOTHING),
     "run the case of this name alone, or those with this in their name", NULL, TEXT(only)},
    {0, "threads", "N", PICTURES | ON(SERVE) | ON(INFO) | ON(CHECK), REMAKES(NOTHING), "number of threads",
     "the cores this process may use", INT(render.n_threads), BOUNDS(THREADS), BASIC},
    {0, "jobs", "N", ON(BATCH), REMAKES(NOTHING), "series in work at once, which share the threads",
     "two more than threads", INT(jobs), RANGE(1, 256), BASIC},
    {0, "shard", "I/N", ON(BATCH), REMAKES(NOTHING),
     "take the I-th of N parts of the series, I from 0; shards may share DIR", "0/1", PARSED(shard), BASIC},
    {0, "settled", "SECONDS", ON(BATCH), REMAKES(NOTHING),
     "leave a series to which a file came in the last SECONDS to the next run, and try failed ones again at growing "
     "intervals; 0: off",
     "0", INT(settled_s), RANGE(0, 86400)},
    {0, "forget", "DAYS", ON(BATCH), REMAKES(NOTHING),
     "remove pictures and record of a series that is no longer below PATH, DAYS after it ended; 0: never", "0",
     INT(forget_days), RANGE(0, 36500)},
    {0, "fresh", NULL, ON(BATCH), REMAKES(NOTHING),
     "start over: render every output again, and do not resume an earlier run", NULL, FLAG(fresh)},
    {0, "sections", "on or off", ON(BATCH), REMAKES(NOTHING),
     "an axial, a coronal and a sagittal section on the card of each volume", "on", CHOICE(no_sections, switches)},
    {0, "merge", "DIR", ON(BATCH), REMAKES(NOTHING), "make one contact sheet of all shards in DIR, and render nothing",
     NULL, TEXT(merge)},
    {0, "series-timeout", "SECONDS", ON(BATCH), REMAKES(NOTHING),
     "give up a series that takes longer to read, or to render; 0: never", "3600", NUMBER(series_timeout_s),
     RANGE(0, 1e7)},
    {0, "series-memory", "MIB", ON(BATCH), REMAKES(NOTHING),
     "give up a series that needs more memory; 0: what the machine can spare", "0", NUMBER(series_mib), RANGE(0, 1e9)},
    {0, "memory", "SIZE", ON(SERVE), REMAKES(NOTHING),
     "memory for loaded volumes, such as 6G or 2GiB; the least recently used one is unloaded first",
     "half of what is free", PARSED(memory), BASIC},
    {0, "token-file", "FILE", ON(SERVE), REMAKES(NOTHING),
     "file with the token of every request, 16 characters or more", "one generated at the start", TEXT(token_file)},
    {0, "host", "NAME", ON(SERVE), REMAKES(NOTHING),
     "a name that clients call the server by, beside localhost and addresses; may be repeated", NULL, TEXTS(hosts)},
    {0, "allow-origin", "ORIGIN", ON(SERVE), REMAKES(NOTHING),
     "accept requests from pages of another site, such as https://viewer.example", "none", TEXT(allow_origin)},
    SECTION("Messages"),
    {0, "explain", NULL, ON(RENDER), REMAKES(NOTHING),
     "print the plan and stop: what will run, what is left out and why", NULL, FLAG(render.explain)},
    {0, "summary", NULL, ON(RENDER), REMAKES(NOTHING),
     "a line for each picture on stderr: file, size, error and the one requested, time", "where stderr is a terminal",
     FLAG(summary)},
    {0, "force", NULL, PICTURES, REMAKES(NOTHING), "overwrite outputs that exist", NULL, FLAG(export.force), BASIC},
    {0, "log", "FILE", RENDERING & ~ON(JOB), REMAKES(NOTHING), "append a timing log, JSON Lines; - is stderr", "none",
     TEXT(log), BASIC},
    {0, "json", NULL, ON(INFO) | ON(CHECK) | ON(COMPARE) | ON(PRESETS), REMAKES(NOTHING), "print JSON", NULL,
     FLAG(json), BASIC},
    {0, "show-patient", NULL, ON(INFO) | ON(BATCH) | ON(SERVE), REMAKES(NOTHING),
     "show study dates, series numbers and descriptions too, which may identify the patient", NULL, FLAG(show_patient),
     BASIC},
    {0, "show-paths", NULL, ON(RENDER) | ON(BATCH) | ON(SERVE), REMAKES(NOTHING),
     "let journal, contact sheet, log and page name input files, which may identify the patient", NULL,
     FLAG(show_paths)},
    {'h', "help", NULL, ON(JOB) - 1, REMAKES(NOTHING), "print this and stop", NULL, FLAG(help), BASIC},
    {.name = NULL},
};

/* Other spellings of options, understood everywhere and shown nowhere. */
static const struct {
    const char *spelling, *name;
} aliases[] = {{"formats", "format"}, {"occlusion", "ambient-occlusion"}, {"presets", "preset"}, {"views", "view"}};

const CtsOption *cts_option(const char *name, size_t length)
{
    for (size_t i = 0; i < sizeof aliases / sizeof *aliases; i++)
        if (strlen(aliases[i].spelling) == length && !strncmp(aliases[i].spelling, name, length)) {
            name = aliases[i].name;
            length = strlen(name);
        }
    for (const CtsOption *o = cts_options; o->name; o++)
        if (strlen(o->name) == length && !strncmp(o->name, name, length))
            return o;
    return NULL;
}

const CtsBounds *cts_option_bounds(const CtsOption *option)
{
    return option->own.low < option->own.high ? &option->own : cts_setting_bounds(option->setting);
}
