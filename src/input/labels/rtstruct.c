/* RT Structure Sets (PS3.3 A.19, C.8.8.6): contours -> the voxels whose centres lie inside. */
#include "base/mem.h"
#include "input/labels/contours.h"
#include "input/labels/label_reading.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    FRAME_UID = 0x00200052,
    REFERENCED_FRAMES = 0x30060010,
    STRUCTURES = 0x30060020,
    ROI_NUMBER = 0x30060022,
    ROI_FRAME_UID = 0x30060024,
    ROI_NAME = 0x30060026,
    DISPLAY_COLOUR = 0x3006002A,
    ROI_CONTOURS = 0x30060039,
    CONTOURS = 0x30060040,
    CONTOUR_TYPE = 0x30060042,
    CONTOUR_DATA = 0x30060050,
    OBSERVATIONS = 0x30060080,
    REFERENCED_ROI = 0x30060084,
    INTERPRETED_TYPE = 0x300600A4,
    MAX_POINTS = 10000000 /* of one file: 400 MB at 40 bytes each */
};

/* One structure of the set, as plain data. */
typedef struct Structure {
    int number;
    char name[512], type[17];
    char frame_uid[65]; /* its Frame of Reference; "" where the file names none */
    bool left_out;
    CtsElements contours;
    bool coloured;
    double rgb[3]; /* display values */
} Structure;

typedef struct StructureSet {
    const CtsLabelReading *reading;
    const CtsLabelDicom *object;
    CtsOutline outline;
    Structure *items; /* n, in the order of the file */
    size_t n;
    size_t n_points;
    size_t n_ignored; /* contours that enclose nothing */
    double held;      /* area of all contours */
} StructureSet;

static CtsStatus add_contour(StructureSet *s, CtsElements item, CtsError *err)
{
    char type[17];
    const CtsElements data = cts_elements_find(item, CONTOUR_DATA);
    const size_t n = (size_t)(data.end - data.at) / sizeof(double);
    cts_elements_text(item, CONTOUR_TYPE, type, sizeof type);
    const bool is_xor = !strcmp(type, "CLOSEDPLANAR_XOR");
    if ((type[0] && strcmp(type, "CLOSED_PLANAR") && !is_xor) || n < 9) {
        s->n_ignored++;
        return CTS_OK;
    }
    s->n_points += n / 3;
    if (s->n_points > MAX_POINTS)
        return cts_fail(err, CTS_ERR_READ, "has more than %d contour points", MAX_POINTS);
    double(*lps)[3] = malloc(n * sizeof(double));
    CtsStatus st = CTS_OK;
    if (!lps)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    else if (n % 3 || !cts_elements_decimals(item, CONTOUR_DATA, lps[0], n))
        st = cts_fail(err, CTS_ERR_READ, "a contour's ContourData (3006,0050) is not points of three numbers");
    if (!st)
        st = cts_outline_add(&s->outline, (const double(*)[3])lps, n / 3, is_xor, err);
    free(lps);
    return st;
}

/* The item of a sequence with this number that follows `nth` others; *n: how many there are. */
static CtsElements item_with_number(const StructureSet *s, uint32_t sequence_tag, uint32_t number_tag, int number,
                                    size_t nth, size_t *n)
{
    CtsElements sequence = cts_elements_find(s->object->head.elements, sequence_tag), item, wanted = {.at = NULL};
    int found;
    *n = 0;
    while (cts_items_next(&sequence, &item))
        if (cts_elements_integer(item, number_tag, &found) && found == number && (*n)++ == nth)
            wanted = item;
    return wanted;
}

/* Attributes that other sequences have for a structure, paired by its number; where several structures share that, by
 * their order too, in sequences with as many items of this number. */
static CtsStatus pair_structure(const StructureSet *s, size_t i, CtsError *err)
{
    Structure *const one = &s->items[i];
    const Structure *other = NULL;
    size_t n = 0, before = 0, n_drawn, n_observed;
    for (size_t k = 0; k < s->n; k++) {
        if (s->items[k].number != one->number)
            continue;
        n++;
        before += k < i;
        other = k == i ? other : &s->items[k];
    }
    const CtsElements drawn = item_with_number(s, ROI_CONTOURS, REFERENCED_ROI, one->number, before, &n_drawn);
    const CtsElements observed = item_with_number(s, OBSERVATIONS, REFERENCED_ROI, one->number, before, &n_observed);
    if (n_drawn && n_drawn != n)
        return cts_fail(err, CTS_ERR_READ,
                        "%zu structures%s%s%s%s have the ROINumber %d, and %zu lists of contours (number them apart)",
                        n, *one->name ? ": " : "", one->name, other ? ", " : "", other ? other->name : "", one->number,
                        n_drawn);
    one->contours = cts_elements_find(drawn, CONTOURS);
    one->coloured = cts_elements_decimals(drawn, DISPLAY_COLOUR, one->rgb, 3);
    for (int c = 0; c < 3; c++)
        one->rgb[c] = fmin(fmax(one->rgb[c] / 255, 0), 1);
    if (n == 1 || n_observed == n)
        cts_elements_text(observed, INTERPRETED_TYPE, one->type, sizeof one->type);
    return CTS_OK;
}

static CtsStatus read_structures(StructureSet *s, CtsError *err)
{
    CtsElements sequence = cts_elements_find(s->object->head.elements, STRUCTURES), item;
    CtsStatus st = CTS_OK;
    while (!st && cts_items_next(&sequence, &item) && !(st = cts_grow(&s->items, s->n, err))) {
        if (s->n == CTS_MAX_LABELS)
            return cts_fail(err, CTS_ERR_READ, "more than %d labels", CTS_MAX_LABELS);
        Structure *const one = &s->items[s->n++];
        *one = (Structure){.number = 0};
        if (!cts_elements_integer(item, ROI_NUMBER, &one->number))
            return cts_fail(err, CTS_ERR_READ, "a structure has no number");
        cts_label_dicom_text(s->object, item, ROI_NAME, one->name, sizeof one->name);
        cts_elements_text(item, ROI_FRAME_UID, one->frame_uid, sizeof one->frame_uid);
    }
    for (size_t i = 0; i < s->n && !st; i++)
        st = pair_structure(s, i, err);
    return st;
}

static CtsStatus leave_out(StructureSet *s, Structure *one, const char *reason, CtsError *err)
{
    one->left_out = true;
    return cts_labels_leave_out(s->reading->labels, s->reading->file, one->number, one->name, reason, err);
}

/* The frames of reference that the file lists; `wanted`, if it is among them, else empty elements. */
static CtsElements find_listed_frame(const StructureSet *s, const char *wanted, int *n, char first_uid[65])
{
    CtsElements frames = cts_elements_find(s->object->head.elements, REFERENCED_FRAMES), item, found = {.at = NULL};
    char uid[65];
    *first_uid = 0;
    for (*n = 0; cts_items_next(&frames, &item); ++*n) {
        cts_elements_text(item, FRAME_UID, uid, sizeof uid);
        if (*n == 0)
            memcpy(first_uid, uid, sizeof uid);
        if (!found.at && !strcmp(uid, wanted))
            found = item;
    }
    return found;
}

/* Leaves out structures of other frames of reference than the scan's: the series' own where the file has it, else those
 * listed with a reference to the series. A file of one frame only is treated as a segmentation is. */
static CtsStatus check_frames(StructureSet *s, CtsError *err)
{
    const char *const own = cts_label_series_frame(s->reading->series);
    char first_uid[65];
    int n_listed;
    const bool lists_own = find_listed_frame(s, own, &n_listed, first_uid).at && *own;
    bool any_own = lists_own, differ = false;
    for (size_t i = 0; i < s->n; i++) {
        Structure *const one = &s->items[i];
        if (!one->frame_uid[0])
            strcpy(one->frame_uid, lists_own ? own : first_uid);
        any_own |= *own && !strcmp(one->frame_uid, own);
        differ |= strcmp(one->frame_uid, s->items[0].frame_uid) != 0;
    }
    const char *const uid = s->n ? s->items[0].frame_uid : lists_own ? own : first_uid;
    const bool listed = find_listed_frame(s, uid, &n_listed, first_uid).at;
    if (s->reading->series->frames_differ || (!differ && (!listed || n_listed < 2)))
        return cts_label_check_space(s->reading, s->object, uid, err);
    CtsStatus st = CTS_OK;
    for (size_t i = 0, n_named = 0; i < s->n && !st; i++) {
        Structure *const one = &s->items[i];
        const CtsElements frame = find_listed_frame(s, one->frame_uid, &n_listed, first_uid);
        if (*own && !strcmp(one->frame_uid, own))
            continue;
        if (!any_own && frame.at && cts_label_refers(frame, s->reading->series)) {
            st = n_named++ ? CTS_OK : cts_label_check_space(s->reading, s->object, one->frame_uid, err);
            continue;
        }
        char reason[256];
        snprintf(reason, sizeof reason, "its Frame of Reference %s is not the series' %s", one->frame_uid, own);
        st = leave_out(s, one, reason, err);
    }
    return st;
}

static CtsStatus add_structure(StructureSet *s, Structure *one, CtsError *err)
{
    CtsLabels *const labels = s->reading->labels;
    CtsElements contours = one->contours, contour;
    CtsStatus st = CTS_OK;
    s->outline.n_contours = s->outline.n_points = 0;
    s->outline.slant_mm = 0;
    while (!st && cts_items_next(&contours, &contour))
        st = add_contour(s, contour, err);
    if (!st && s->outline.slant_mm > 0) {
        char reason[128];
        snprintf(reason, sizeof reason, "a contour is not parallel to the slices: it spans %.3g mm across them",
                 s->outline.slant_mm);
        return leave_out(s, one, reason, err);
    }
    if (st || (st = cts_labels_add(labels, s->reading->file, one->number, one->name, CTS_LABEL_RTSTRUCT, err)))
        return st;
    CtsLabel *const label = &labels->items[labels->n - 1];
    label->surrounds = !strcmp(one->type, "EXTERNAL") || !strcmp(one->type, "SUPPORT");
    label->coloured = one->coloured;
    memcpy(label->rgb, one->rgb, sizeof label->rgb);
    s->held += cts_outline_area(&s->outline);
    return cts_outline_fill(&s->outline, label, err);
}

/* Refuses a set of which nothing is left. */
static CtsStatus check_left(const StructureSet *s, size_t first_left_out, CtsError *err)
{
    const CtsLabels *const labels = s->reading->labels;
    if (s->held > 0 || first_left_out == labels->n_left_out)
        return cts_label_check_meets(s->reading, s->held, err);
    const CtsLabelLeftOut *const one = &labels->left_out[first_left_out];
    return cts_fail(err, CTS_ERR_GEOMETRY, "%s cannot be drawn: %s", one->fact.name, one->reason);
}

static void report_outline(const StructureSet *s, size_t first_left_out)
{
    CtsReport *const report = s->reading->report;
    const CtsOutline *const o = &s->outline;
    const int file = s->reading->file;
    for (size_t i = first_left_out; i < s->reading->labels->n_left_out; i++)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_LABEL_LEFT_OUT, "label file %d: %s is left out: %s", file,
                              s->reading->labels->left_out[i].fact.name, s->reading->labels->left_out[i].reason);
    if (s->n_ignored)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_CONTOURS_IGNORED,
            "label file %d: %zu contours that are not closed or have fewer than 3 points are left out", file,
            s->n_ignored);
    if (o->n_off)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_CONTOURS_OFF,
                              "label file %d: %zu contour planes are nearest to no slice and left out", file, o->n_off);
    if (o->n_unfilled)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SLICES_WITHOUT_CONTOUR,
                              "label file %d: %zu slices between two with contours have none, and are not filled", file,
                              o->n_unfilled);
}

CtsStatus cts_label_read_rtstruct(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err)
{
    StructureSet s = {.reading = reading, .object = object, .outline = {.grid = &reading->labels->grid}};
    const size_t first_left_out = reading->labels->n_left_out;
    cts_mask_axes(s.outline.grid->step_lps, s.outline.inverse);
    CtsStatus st = read_structures(&s, err);
    st = st ? st : check_frames(&s, err);
    for (size_t i = 0; i < s.n && !st; i++)
        st = s.items[i].left_out ? CTS_OK : add_structure(&s, &s.items[i], err);
    if (!st && !(st = check_left(&s, first_left_out, err)))
        report_outline(&s, first_left_out);
    cts_outline_free(&s.outline);
    free(s.items);
    return st;
}
