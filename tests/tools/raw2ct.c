/* raw2ct: turns a raw volume of HU into a DICOM CT series, one file for each slice.
 *
 * The raw file holds int16 or uint16 little-endian samples, x fastest. After the flips its axes are taken for patient
 * coordinates (LPS): x to the left, y to the back, z to the head. The same input and options give the same bytes and
 * the same UIDs; the patient is plainly made up. */
#include "raw2ct.h"

#include <ctype.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum Kind { TEXT, FLAG, WHOLE, REAL, LIST, TRIPLE, SIZE, FLIP, TYPE };

typedef struct Choice {
    const char *name, *value, *help;
    enum Kind kind;
    void *target;
} Choice;

bool parse_numbers(const char *text, Numbers *numbers)
{
    numbers->n = 0;
    for (const char *p = text;; p++) {
        char *end;
        const double v = strtod(p, &end);
        if (end == p || isspace((unsigned char)*p) || !isfinite(v) || numbers->n == MAX_NUMBERS)
            return false;
        numbers->v[numbers->n++] = v;
        p = end;
        if (*p != ',')
            return *p == '\0';
    }
}

double pick(const Numbers *list, int k)
{
    return list->v[k % list->n];
}

static bool parse_flips(const char *axes, bool flip[3])
{
    for (const char *a = axes; *a; a++) {
        if (*a < 'x' || *a > 'z')
            return false;
        flip[*a - 'x'] = true;
    }
    return true;
}

static bool parse_value(const Choice *c, const char *text)
{
    static Numbers numbers;
    switch (c->kind) {
    case TEXT:
        *(const char **)c->target = text;
        return true;
    case FLAG:
        *(bool *)c->target = true;
        return true;
    case FLIP:
        return parse_flips(text, c->target);
    case TYPE:
        *(bool *)c->target = *text == 'u';
        return !strcmp(text, "int16") || !strcmp(text, "uint16");
    case LIST:
        return parse_numbers(text, c->target);
    default:
        break;
    }
    if (!parse_numbers(text, &numbers) || numbers.n != (c->kind == TRIPLE || c->kind == SIZE ? 3 : 1))
        return false;
    for (int a = 0; a < numbers.n; a++) {
        if (c->kind == SIZE && !(numbers.v[a] >= 1 && numbers.v[a] <= 65535))
            return false;
        if (c->kind == SIZE || c->kind == WHOLE)
            ((int *)c->target)[a] = (int)lround(numbers.v[a]);
        else
            ((double *)c->target)[a] = numbers.v[a];
    }
    return true;
}

static int usage(const Choice *choices, const char *why)
{
    fprintf(stderr, "raw2ct: %s\nusage: raw2ct --size NX,NY,NZ [options] RAW FOLDER\n", why);
    for (const Choice *c = choices; c->name; c++)
        fprintf(stderr, "  --%-16s %-10s %s\n", c->name, c->value, c->help);
    return 2;
}

static const char *find_fault(const Options *o)
{
    if (!o->size[0])
        return "--size is needed";
    if (!(o->spacing_mm[0] > 0 && o->spacing_mm[1] > 0 && o->spacing_mm[2] > 0))
        return "--spacing must be above 0";
    if (o->bits_stored < 8 || o->bits_stored > 16 || o->high_bit < o->bits_stored - 1 || o->high_bit > 15)
        return "--bits-stored and --high-bit do not fit 16 bits";
    if (o->pad_circle && !o->padding.n)
        return "--pad-circle needs --padding";
    for (int i = 0; i < o->slopes.n; i++)
        if (o->slopes.v[i] == 0)
            return "--slope must not be 0";
    return NULL;
}

/* 0, or the exit code after a message. */
static int parse_options(int argc, char **argv, Options *o)
{
    const Choice choices[] = {
        {"size", "NX,NY,NZ", "samples of the raw volume; needed", SIZE, o->size},
        {"type", "NAME", "raw samples: int16 or uint16 (int16)", TYPE, &o->raw_unsigned},
        {"stored", "", "the raw samples are stored values, not HU", FLAG, &o->stored},
        {"spacing", "X,Y,Z", "mm between voxel centres (1,1,1)", TRIPLE, o->spacing_mm},
        {"flip", "AXES", "turn these raw axes round first: any of x, y, z", FLIP, o->flip},
        {"orientation", "O", "axial, coronal, sagittal: how slices are cut, the patient stays (axial);", TEXT,
         &o->orientation},
        {"orientation", "C,C,...", "six cosines, of a row and of a column: the patient turns", TEXT, &o->orientation},
        {"origin", "X,Y,Z", "LPS mm of the first voxel after the flips (the centre lies at 0)", TRIPLE, o->origin_lps},
        {"positions", "P,P,...", "mm of each slice on the table's way (even, by the spacing)", LIST, &o->positions_mm},
        {"tilt-deg", "A", "gantry tilt: slices turn about their rows, the table keeps its way", REAL, &o->tilt_deg},
        {"skip", "K,K,...", "leave out these slices, counted from 0", LIST, &o->skip},
        {"slope", "S,S,...", "rescale slope; several are taken in turn (1)", LIST, &o->slopes},
        {"intercept", "I,I,...", "rescale intercept; several are taken in turn (0)", LIST, &o->intercepts},
        {"unsigned", "", "PixelRepresentation 0 (1)", FLAG, &o->is_unsigned},
        {"bits-stored", "N", "8 to 16 (16)", WHOLE, &o->bits_stored},
        {"high-bit", "N", "(bits stored - 1)", WHOLE, &o->high_bit},
        {"junk", "", "fill the unused bits with ones and zeros", FLAG, &o->junk},
        {"padding", "V[,LIMIT]", "PixelPaddingValue, and PixelPaddingRangeLimit", LIST, &o->padding},
        {"pad-circle", "", "padding outside each slice's inscribed ellipse", FLAG, &o->pad_circle},
        {"syntax", "NAME", "implicit explicit big deflated rle jpeg-lossless jpeg-ls (explicit)", TEXT, &o->syntax},
        {"thickness", "T", "SliceThickness (the slice spacing)", REAL, &o->thickness_mm},
        {"patient", "NAME", "PatientName (Phantom^Test)", TEXT, &o->patient},
        {"patient-id", "ID", "PatientID (PHANTOM)", TEXT, &o->patient_id},
        {"description", "TEXT", "SeriesDescription", TEXT, &o->description},
        {"image-type", "TYPE", "ImageType (ORIGINAL\\PRIMARY\\AXIAL)", TEXT, &o->image_type},
        {"series-number", "N", "(1)", WHOLE, &o->series_number},
        {"acquisition", "N", "AcquisitionNumber (1)", WHOLE, &o->acquisition},
        {"series-uid", "UID", "(made from the content)", TEXT, &o->series_uid},
        {"study", "KEY", "series of one KEY share study and frame of reference (1)", TEXT, &o->study},
        {"first-instance", "N", "number of the first slice and of its file (1)", WHOLE, &o->first_instance},
        {"prefix", "TEXT", "start of file names (IM)", TEXT, &o->prefix},
        {"suffix", "TEXT", "end of file names (.dcm)", TEXT, &o->suffix},
        {NULL, NULL, NULL, TEXT, NULL},
    };
    struct option longs[sizeof choices / sizeof *choices] = {{0}};
    for (int i = 0; choices[i].name; i++)
        longs[i] = (struct option){choices[i].name, *choices[i].value ? required_argument : no_argument, NULL, 0};
    opterr = 0;
    for (int c, which = 0; (c = getopt_long(argc, argv, "", longs, &which)) != -1;)
        if (c || !parse_value(&choices[which], optarg))
            return usage(choices, "an option is unknown, or its value is missing or not valid");
    if (argc - optind != 2)
        return usage(choices, "a raw file and a folder are needed");
    o->raw = argv[optind];
    o->folder = argv[optind + 1];
    if (o->high_bit < 0)
        o->high_bit = o->bits_stored - 1;
    o->centred = isnan(o->origin_lps[0]);
    const char *fault = find_fault(o);
    return fault ? usage(choices, fault) : 0;
}

int main(int argc, char **argv)
{
    static Options o = {.spacing_mm = {1, 1, 1},
                        .origin_lps = {NAN, NAN, NAN},
                        .slopes = {1, {1}},
                        .intercepts = {1, {0}},
                        .bits_stored = 16,
                        .high_bit = -1,
                        .series_number = 1,
                        .first_instance = 1,
                        .acquisition = 1,
                        .orientation = "axial",
                        .syntax = "explicit",
                        .patient = "Phantom^Test",
                        .patient_id = "PHANTOM",
                        .description = "ctsplat test series",
                        .image_type = "ORIGINAL\\PRIMARY\\AXIAL",
                        .series_uid = "",
                        .study = "1",
                        .prefix = "IM",
                        .suffix = ".dcm"};
    Stack stack = {0};
    const int code = parse_options(argc, argv, &o);
    if (code)
        return code;
    const bool good = stack_make(&o, &stack) && write_series(&o, &stack);
    stack_free(&stack);
    return good ? 0 : 1;
}
