/* A row an option; its place is its place in the help. What touches is left at CTS_TOUCHES_PICTURES where in doubt: a
 * batch then makes its pictures anew. */
#include "app/words/options.h"

#define ON(command) (1u << CTS_FOR_##command)
#define ONE (ON(RENDER) | ON(JOB))
#define RENDERING (ONE | ON(BATCH))
#define LOOKS (RENDERING | ON(REQUEST))
#define PICTURES (RENDERING | ON(BENCH))
#define PEERS (RENDERING | ON(SERVE))
#define FINDING (ON(INFO) | ON(BATCH))
#define FRESH CTS_TOUCHES_PICTURES
#define PRESET CTS_TOUCHES_PRESET
#define DCM CTS_TOUCHES_DCM
#define SAME CTS_TOUCHES_NOTHING

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
#define PARSED(name) .kind = CTS_PARSED, .parse = cts_parse_##name
#define BOUNDS(which) .setting = CTS_SETTING_##which
#define RANGE(lowest, highest) .own = {.unit = "", .low = (lowest), .high = (highest)}

static const char *const interpolations[] = {"shape", "cubic", "linear"}, *const switches[] = {"on", "off"},
                         *const void_rules[] = {"strict", "key"}, *const units[] = {"mm", "voxel"},
                         *const png_bits[] = {"16", "8"}, *const nifti_forms[] = {"sform", "qform"},
                         *const reuses[] = {"auto", "always"};

const CtsOption cts_options[] = {
    {0, "path", "PATH", ON(JOB), SAME, "a file, folder, zip file, DICOMDIR or NIfTI CT to search for series", NULL,
     TEXTS(paths)},
    {'o', "output", "FILE", ONE, SAME,
     "write this file, whose name ends in {outputs}; may be repeated; - is standard output", NULL, TEXTS(outputs)},
    {0, "format", "NAME", ON(RENDER), SAME, "{formats}: what -o - writes", NULL, PARSED(format)},
    {'O', "output-dir", "DIR", ON(BATCH) | ON(BENCH) | ON(RECEIVE), SAME,
     "write into this folder; it is made where it does not exist", NULL, TEXT(output_dir)},
    {0, "paper", NULL, ON(BENCH), SAME,
     "the tables of the paper instead: its engines as it has them, in per cent of plain splatting, beside its own",
     NULL, FLAG(paper)},
    {'p', "preset", "NAME or FILE", PICTURES | ON(REQUEST), SAME,
     "a built-in preset, one of your own, or a preset file", "bone", TEXT(preset), .several = "presets"},
    {0, "view", "NAME or AZ,EL", PICTURES | ON(REQUEST), SAME, "{views}, or azimuth and elevation in degrees",
     "anterior", PARSED(view), .several = "views"},
    {0, "presets", "LIST", ON(BATCH), SAME, "presets, names or files with commas between them: each with every view",
     "--preset", TEXT(presets)},
    {0, "views", "LIST", ON(BATCH), SAME, "views with commas between them, such as anterior,left,30,-20", "--view",
     TEXT(views)},
    {0, "formats", "LIST", ON(BATCH), SAME, "{formats}, with commas between them", "png", TEXT(formats)},
    {0, "rotation", "N", LOOKS, FRESH,
     "N views over 360 degrees about the head-foot axis, from --view on: FILE becomes FILE-000 and so on, but {stacks} "
     "one file of N frames",
     "off", INT(rotation), BOUNDS(FRAMES)},
    {0, "swivel", "RANGE,STEP", LOOKS, FRESH,
     "views to and fro about the head-foot axis, over RANGE degrees with --view in their middle, STEP apart; files as "
     "of --rotation",
     "off", PARSED(swivel)},
    {0, "frame-rate", "N", LOOKS, FRESH, "pictures a second of an animated .webp", "10", INT(export.frame_rate),
     RANGE(1, 1000)},
    {0, "size", "WxH", PICTURES | ON(REQUEST), FRESH, "picture size in pixels", "1024x1024", PARSED(size),
     BOUNDS(WIDTH)},
    {0, "fit", "NAME", PICTURES | ON(REQUEST), FRESH,
     "what the frame shows: the whole volume, or all that the preset can show", "visible",
     CHOICE(render.fit, cts_fit_names)},
    {0, "mm-per-pixel", "X", LOOKS, FRESH, "scale, about the centre of the volume", "as --fit says",
     NUMBER(render.mm_per_pixel), BOUNDS(MM_PER_PIXEL)},
    {0, "centre", "X,Y,Z", LOOKS, FRESH,
     "what the middle of the picture shows, millimetres in patient coordinates (LPS)", "as --fit says", PARSED(centre)},
    {0, "series", "UID", PICTURES, SAME, "which series, when PATH holds several", "the one with the most slices",
     TEXT(source.series_uid)},
    {0, "allow-missing-slices", NULL, PICTURES | ON(SERVE) | ON(INFO), FRESH,
     "render a series in which slices are missing, with a warning", NULL, FLAG(source.rules.allow_missing_slices)},
    {0, "nifti-form", "sform or qform", PICTURES | ON(SERVE) | ON(INFO), FRESH,
     "which of two forms that disagree places a NIfTI file",
     "the sform, with a warning; refused where left and right or an axis differ",
     CHOICE(source.rules.nifti_form, nifti_forms), .first = CTS_NIFTI_FORM_S},
    {0, "labels", "PATH", PICTURES | ON(SERVE) | ON(INFO), FRESH,
     "segmentations: DICOM SEG, RT Structure Set, NIfTI label map, a folder of masks named by their files; "
     "auto: what lies beside the series and refers to it; {series_uid}, {stem} (of a NIfTI CT) and * are filled in; "
     "may be "
     "repeated",
     NULL, TEXTS(labels)},
    {0, "label-names", "FILE", PICTURES | ON(SERVE) | ON(INFO), FRESH,
     "names, colours and regions for the numbers of label maps: JSON, nnU-Net's dataset.json or an ITK-SNAP table",
     "the file's own", TEXT(source.label_names)},
    {0, "show", "LIST", LOOKS, FRESH,
     "labels that are seen, by name (* stands for any letters) or number, all, rest (what no label holds); all else is "
     "hidden",
     "everything", TEXT(source.choice.show)},
    {0, "hide", "LIST", LOOKS, FRESH, "labels that are not seen, whatever --show says", "none",
     TEXT(source.choice.hide)},
    {0, "label", "NAME=LOOK", LOOKS, FRESH,
     "how labels look: a preset, #RRGGBB (the picture's preset in this colour), #RRGGBB:OPACITY (a body of this "
     "opacity per mm); may be repeated",
     "as the preset says", TEXTS(label_looks)},
    {0, "label-colours", NULL, LOOKS, FRESH,
     "labels in the colours of their files, else in some that are easy to tell apart", NULL,
     FLAG(source.choice.own_colours)},
    {0, "label-order", "LIST", LOOKS, FRESH, "which labels own what several of them hold, the first one first",
     "the smallest", TEXT(source.choice.order)},
    {0, "look", "FILE", LOOKS, SAME, "show, hide, label, label_colours and label_order as JSON; options beside it win",
     NULL, TEXT(look_path)},
    {0, "engine", "NAME", LOOKS, FRESH, "how the picture is made", "tiled", CHOICE(render.engine, cts_engine_names)},
    {0, "kernel", "NAME[:RADIUS]", LOOKS, FRESH,
     "{kernels}: what a voxel is reconstructed with (cone-paper without normalised weights, as the paper has it), and "
     "how far it reaches",
     "tent", PARSED(kernel), BOUNDS(KERNEL_RADIUS)},
    {0, "samples", "N", LOOKS, FRESH, "sub-sheets per layer", "chosen by the engine", INT(render.samples),
     BOUNDS(SAMPLES)},
    {0, "max-error", "E", LOOKS, FRESH, "choose the cheapest plan whose error stays below E/255 rms",
     "chosen by the engine", NUMBER(render.max_error), BOUNDS(MAX_ERROR)},
    {0, "void", "strict or key", LOOKS, FRESH,
     "what counts as a void voxel: provably invisible, or improbable by the mixture model (engines void and combined; "
     "lossy: what is lost is told, and measured as by --verify)",
     "strict", CHOICE(render.void_key, void_rules)},
    {0, "grey-bits", "N", LOOKS, FRESH, "quantise grey levels over the preset's window, as the paper does", "16",
     INT(render.grey_bits), BOUNDS(GREY_BITS)},
    {0, "opacity-unit", "mm or voxel", LOOKS, FRESH,
     "opacity per millimetre, or per voxel along the ray as in Slicer's GPU rendering", "mm",
     CHOICE(render.opacity_per_voxel, units)},
    {0, "tolerance", "HU", LOOKS, FRESH, "layer similarity: the largest change taken for none", "0",
     NUMBER(render.tolerance_hu), BOUNDS(TOLERANCE)},
    {0, "occlusion", "on or off", LOOKS, SAME,
     "stop behind what is opaque (engines void and combined); off: as the paper has it, the picture is the same", "on",
     CHOICE(render.sees_hidden, switches)},
    {0, "reuse", "auto or always", LOOKS, SAME,
     "reuse layers where it pays (engines layers and combined), or always, as the paper does; the picture is the same",
     "auto", CHOICE(render.reuses_always, reuses)},
    {0, "mode", "NAME", LOOKS, PRESET,
     "how values along a ray become a pixel; minip and average look at the body alone, with --remove-table off at "
     "everything",
     "as the preset says", CHOICE(render.mode, cts_mode_names)},
    {0, "interpolation", "shape, cubic or linear", LOOKS, FRESH,
     "along the slice axis, where slices lie further apart than 1.5 pixels: what moves from slice to slice is moved, "
     "or "
     "cubics, or straight lines",
     "shape", CHOICE(source.interpolation, interpolations)},
    {0, "smooth", "MM", LOOKS, FRESH, "smooth the volume first, with a Gaussian of this standard deviation", "0",
     NUMBER(source.smooth_mm), RANGE(0, CTS_MAX_SMOOTH_MM)},
    {0, "fill", "HU", LOOKS, FRESH,
     "voxels of exactly this value that are connected to the volume's border are air (filling outside the scan)", "off",
     PARSED(fill)},
    {0, "slab", "MM", LOOKS, FRESH, "only a slab of this thickness across the view (engines tiled and raycast)", "off",
     NUMBER(render.slab_mm), RANGE(1e-3, 1e5)},
    {0, "slab-at", "MM", LOOKS, FRESH, "the slab's middle, so far in front of the volume's centre", "0",
     NUMBER(render.slab_at_mm), RANGE(-1e5, 1e5)},
    {0, "window", "LOW,HIGH", LOOKS, PRESET, "the HU that mip, minip and average show black and white",
     "as the preset says; one that fits for a --mode without a preset", PARSED(window)},
    {0, "shade", "on or off", LOOKS, PRESET, "gradient lighting", "as the preset says", SWITCH(render.shade)},
    {0, "background", "#RRGGBB or none", LOOKS, PRESET, "colour behind the volume; none writes alpha",
     "as the preset says", PARSED(background)},
    {0, "crop", "X0,X1,Y0,Y1,Z0,Z1", PICTURES | ON(REQUEST), FRESH,
     "keep this box, millimetres in patient coordinates (LPS)", "all", PARSED(crop)},
    {0, "remove-table", "on or off", LOOKS, PRESET, "drop what is not the patient", "as the preset says",
     SWITCH(remove_table)},
    {0, "annotate", "LIST", LOOKS, FRESH,
     "orientation,scale,labels drawn on the picture; labels: the names of those that have a colour, in it", "none",
     PARSED(annotate)},
    {0, "verify", "N", RENDERING, SAME,
     "render N random pixels again with the float64 ray caster; the log and stderr tell the error", "0",
     INT(render.verify), BOUNDS(VERIFY)},
    {0, "compress", "NAME", LOOKS, DCM, "compression of {objects} outputs", "none",
     CHOICE(export.compression, cts_sc_compression_names)},
    {0, "png-bits", "16 or 8", LOOKS, FRESH, "bits a sample of .png outputs", "16",
     CHOICE(export.png_8_bits, png_bits)},
    {0, "quality", "N", LOOKS, FRESH, "quality of .jpg and .webp outputs", "90", INT(export.quality), RANGE(1, 100)},
    {0, "series-number", "N", LOOKS, DCM, "SeriesNumber of .dcm outputs",
     "the source's, then three digits for mode and preset", INT(export.series_number), RANGE(1, 2147483647)},
    {0, "series-description", "TEXT", LOOKS, DCM, "SeriesDescription of .dcm outputs, at most 64 ASCII characters",
     "mode and preset", TEXT(export.series_description)},
    {0, "new-uids", NULL, LOOKS, DCM, "fresh UIDs in {objects} outputs, other ones in each run", NULL,
     FLAG(export.new_uids)},
    {0, "deidentify", NULL, LOOKS, DCM, "leave the patient's identity out of {objects} outputs", NULL,
     FLAG(export.deidentify)},
    {0, "key", "FILE", PEERS, SAME, "key of the UIDs that --deidentify gives and of the log's hashes", "the site's own",
     TEXT(export.key)},
    {0, "state", "FILE", ONE, SAME,
     "make the picture that a presentation state of ctsplat's describes; options beside it win", NULL,
     TEXT(state_path)},
    {0, "write-state", "FILE", ONE, SAME,
     "write how the picture was made as a Volume Rendering Volumetric Presentation State", NULL, TEXT(write_state)},
    {0, "send", "PEER", RENDERING, SAME,
     "store the DICOM outputs to a PACS: AET@HOST:PORT (C-STORE) or the URL of a DICOMweb service (STOW-RS)", NULL,
     PARSED(send)},
    {0, "from", "PEER", ONE | FINDING | ON(SERVE), SAME,
     "fetch the series from a PACS instead of PATH: AET@HOST:PORT (C-GET) or the URL of a DICOMweb service (WADO-RS)",
     NULL, PARSED(from)},
    {0, "study-uid", "UID", ONE | FINDING, SAME, "the study to fetch", NULL, TEXT(find.study_uid)},
    {0, "series-uid", "UID", ONE | FINDING, SAME, "the one series of it to fetch", "all", TEXT(find.series_uid)},
    {0, "accession", "NUMBER", FINDING, SAME, "studies at the peer with this accession number", NULL,
     TEXT(find.accession)},
    {0, "patient-id", "ID", FINDING, SAME, "studies of this patient at the peer", NULL, TEXT(find.patient_id)},
    {0, "study-date", "DATE", FINDING, SAME,
     "studies at the peer of YYYYMMDD, or from one such date to another with - between", NULL, TEXT(find.study_date)},
    {0, "modality", "NAME", FINDING, SAME, "series at the peer of this modality", "CT", TEXT(find.modality)},
    {0, "aet", "AET", PEERS | ON(INFO) | ON(RECEIVE), SAME, "ctsplat's own AE title", "CTSPLAT", TEXT(net.own_aet)},
    {0, "move-port", "PORT", ONE | ON(BATCH) | ON(SERVE), SAME,
     "fetch by C-MOVE to this port, for peers that do not know C-GET", "C-GET", INT(net.move_port), RANGE(1, 65535)},
    {0, "tls-ca", "FILE", PEERS | ON(INFO) | ON(RECEIVE), SAME,
     "talk to peers over TLS, and trust the certificates in this PEM file", NULL, TEXT(net.tls_ca)},
    {0, "tls-key", "FILE", PEERS | ON(INFO) | ON(RECEIVE), SAME,
     "private key (PEM) that ctsplat shows itself with over TLS", "none", TEXT(net.tls_key)},
    {0, "tls-cert", "FILE", PEERS | ON(INFO) | ON(RECEIVE), SAME, "its certificate (PEM)", "none",
     TEXT(net.tls_certificate)},
    {0, "credentials", "FILE", PEERS | ON(INFO), SAME, "file with user:password, or Bearer and a token, for DICOMweb",
     "$CTSPLAT_CREDENTIALS", TEXT(net.credentials)},
    {0, "insecure-http", NULL, PEERS | ON(INFO), SAME,
     "let credentials, and what serve shows, go over plain http to other machines", NULL, FLAG(net.insecure_http)},
    {0, "peer-timeout", "SECONDS", PEERS | ON(INFO) | ON(RECEIVE), SAME, "how long a silent peer is waited for", "30",
     INT(net.timeout_s), RANGE(1, 3600)},
    {0, "listen", "ADDRESS:PORT", ON(RECEIVE) | ON(SERVE), SAME,
     "where peers or clients connect to; port 0 is any that is free; unix:PATH (serve) a socket of this user's alone",
     "127.0.0.1:11112, of serve 127.0.0.1:8484", TEXT(listen)},
    {0, "allow", "AET@ADDRESS", ON(RECEIVE), SAME,
     "who may send: AE title or *, and an address in numbers or ADDRESS/BITS for a net; may be repeated",
     "this machine alone", TEXTS(allow)},
    {0, "per-peer", "N", ON(RECEIVE), SAME, "associations of one address at a time", "8", INT(most_of_one),
     RANGE(1, 64)},
    {0, "per-minute", "N", ON(RECEIVE), SAME, "associations that one address may begin in a minute", "600",
     INT(most_a_minute), RANGE(1, 100000)},
    {0, "association-time", "SECONDS", ON(RECEIVE), SAME, "how long an association may last", "3600", INT(deadline_s),
     RANGE(1, 86400)},
    {0, "object-size", "MIB", ON(RECEIVE), SAME, "how large an object may be", "2048", NUMBER(object_mib),
     RANGE(0.001, 1e6)},
    {0, "keep-free", "PERCENT", ON(RECEIVE), SAME, "nothing is received while less of the disk is free", "10",
     NUMBER(free_percent), RANGE(0, 100)},
    {0, "only", "NAME", ON(CHECK), SAME, "run the case of this name alone, or those with this in their name", NULL,
     TEXT(only)},
    {0, "threads", "N", PICTURES | ON(SERVE) | ON(INFO) | ON(CHECK), SAME, "threads at work",
     "the cores this process may use", INT(render.n_threads), BOUNDS(THREADS)},
    {0, "jobs", "N", ON(BATCH), SAME, "series rendered at once, which share the threads; one more is read ahead",
     "one more than threads", INT(jobs), RANGE(1, 256)},
    {0, "shard", "I/N", ON(BATCH), SAME, "take the I-th of N parts of the series, I from 0; shards may share DIR",
     "0/1", PARSED(shard)},
    {0, "resume", NULL, ON(BATCH), SAME, "go on where an earlier run was stopped, as a batch does anyway", NULL,
     FLAG(resume)},
    {0, "fresh", NULL, ON(BATCH), SAME, "start over: make every output anew", NULL, FLAG(fresh)},
    {0, "merge", "DIR", ON(BATCH), SAME, "make one contact sheet of all shards in DIR, and render nothing", NULL,
     TEXT(merge)},
    {0, "series-timeout", "SECONDS", ON(BATCH), SAME,
     "give up a series that takes longer to read, or to render; 0: never", "3600", NUMBER(series_timeout_s),
     RANGE(0, 1e7)},
    {0, "series-memory", "MIB", ON(BATCH), SAME,
     "give up a series that needs more memory; 0: what the machine can spare", "0", NUMBER(series_mib), RANGE(0, 1e9)},
    {0, "memory", "SIZE", ON(SERVE), SAME,
     "how much the loaded volumes may take, such as 6G or 2GiB; what was not asked for longest goes first",
     "half of what is free", PARSED(memory)},
    {0, "token-file", "FILE", ON(SERVE), SAME, "what every request must bring, 16 characters or more",
     "one made at the start", TEXT(token_file)},
    {0, "host", "NAME", ON(SERVE), SAME,
     "a name that clients call the server by, beside localhost and addresses; may be repeated", NULL, TEXTS(hosts)},
    {0, "allow-origin", "ORIGIN", ON(SERVE), SAME, "let the pages of another site ask, such as https://viewer.example",
     "none", TEXT(allow_origin)},
    {0, "explain", NULL, ON(RENDER), SAME, "print the plan and stop: what will run, what is left out and why", NULL,
     FLAG(render.explain)},
    {0, "force", NULL, PICTURES, SAME, "overwrite outputs that exist", NULL, FLAG(export.force)},
    {0, "log", "FILE", (RENDERING & ~ON(JOB)) | ON(RECEIVE), SAME,
     "append a timing log, JSON Lines; - is stderr; receive: the record of who sent what, in DIR/received.jsonl by "
     "default",
     "none", TEXT(log)},
    {0, "json", NULL, ON(INFO) | ON(CHECK) | ON(COMPARE) | ON(PRESETS), SAME, "print JSON", NULL, FLAG(json)},
    {0, "show-patient", NULL, ON(INFO) | ON(BATCH), SAME,
     "tell study dates, series numbers and descriptions too, which may identify the patient", NULL, FLAG(show_patient)},
    {0, "show-paths", NULL, ON(RENDER) | ON(BATCH), SAME,
     "let journal, contact sheet and log name input files, which may identify the patient", NULL, FLAG(show_paths)},
    {'h', "help", NULL, ON(JOB) - 1, SAME, "print this and stop", NULL, FLAG(help)},
    {.name = NULL},
};

const CtsBounds *cts_option_bounds(const CtsOption *option)
{
    return option->own.low < option->own.high ? &option->own : cts_setting_bounds(option->setting);
}
