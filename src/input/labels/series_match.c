/* The relation of a label object to a series, and the series' grid. */
#include "base/mem.h"
#include "base/vec3.h"
#include "dicom/header/slice.h"
#include "input/labels/label_reading.h"
#include <string.h>

enum { PATIENT_ID = 0x00100020, SERIES_UID = 0x0020000E, REFERENCED_CLASS = 0x00081150, REFERENCED_SOP = 0x00081155 };
/* The UIDs of classes of images begin so; a study's or a procedure's do not. */
static const char STORAGE[] = "1.2.840.10008.5.1.4.1.1.";

CtsStatus cts_label_grid_of(CtsLabelGrid *g, const CtsSeries *series, CtsError *err)
{
    const CtsSlice *middle = series->slices[series->n_slices / 2];
    const size_t n = (size_t)series->n_slices;
    *g = (CtsLabelGrid){
        .columns = series->columns, .rows = series->rows, .n_slices = series->n_slices, .quantity = series->quantity};
    const CtsStatus st = cts_alloc_array(&g->position_lps, n, err);
    const double up = cts_dot3(series->slices[n - 1]->position_lps, middle->normal_lps) -
                      cts_dot3(series->slices[0]->position_lps, middle->normal_lps);
    for (int c = 0; c < 3; c++) {
        g->step_lps[0][c] = middle->row_lps[c] * middle->column_spacing_mm;
        g->step_lps[1][c] = middle->column_lps[c] * middle->row_spacing_mm;
        g->normal_lps[c] = up < 0 ? -middle->normal_lps[c] : middle->normal_lps[c];
    }
    for (size_t k = 0; !st && k < n; k++)
        memcpy(g->position_lps[k], series->slices[k]->position_lps, sizeof *g->position_lps);
    return st;
}

static bool names_slice(const char *uid, const CtsSeries *series)
{
    for (int k = 0; uid[0] && k < series->n_slices; k++)
        for (const CtsSlice *s = series->slices[k]; s; s = s->copy)
            if (!strcmp(uid, s->sop_uid))
                return true;
    return false;
}

/* Searches items only, to a depth of 12 (structure sets refer to slices at a depth of 4), since the object's own series
 * is another one. Slices are compared only where no series is referenced. series NULL: any series, or image. */
static bool refers(CtsElements elements, const CtsSeries *series, int depth, bool slices)
{
    CtsElement e;
    char uid[65] = "";
    while (depth < 12 && cts_elements_next(&elements, &e)) {
        CtsElements item, one = e.value;
        const bool of_image = !strncmp(uid, STORAGE, sizeof STORAGE - 1);
        const bool wanted = e.tag == (slices ? REFERENCED_SOP : SERIES_UID);
        if ((wanted || e.tag == REFERENCED_CLASS) && depth > 0) {
            cts_element_text(&e, uid, sizeof uid);
            if (wanted && (!series  ? uid[0] && (of_image || !slices)
                           : slices ? names_slice(uid, series)
                                    : uid[0] && !strcmp(uid, series->uid)))
                return true;
        }
        if (e.kind == CTS_VALUE_ITEMS)
            while (cts_items_next(&one, &item))
                if (refers(item, series, depth + 1, slices))
                    return true;
    }
    return false;
}

bool cts_label_refers(CtsElements elements, const CtsSeries *series)
{
    return refers(elements, series, 0, false) || refers(elements, series, 0, true);
}

/* Without a Frame of Reference in both, the series that it names decides. */
static CtsStatus check_named_series(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err)
{
    if (cts_label_refers(object->head.elements, reading->series))
        return CTS_OK;
    if (cts_label_refers(object->head.elements, NULL))
        return cts_fail(err, CTS_ERR_GEOMETRY,
                        "names another series than %s, and has no Frame of Reference in common with it (labels of "
                        "another scan?)",
                        reading->series->uid);
    cts_report_diagnostic(reading->report, CTS_DIAGNOSTIC_LABEL_SERIES_UNNAMED,
                          "label file %d: it names no series and has no Frame of Reference in common with this one "
                          "(check that it belongs to the series)",
                          reading->file);
    return CTS_OK;
}

CtsStatus cts_label_check_patient(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err)
{
    char id[256];
    const char *const own = reading->series->slices[0]->identity[CTS_PATIENT_ID];
    cts_elements_text(object->head.elements, PATIENT_ID, id, sizeof id);
    for (size_t n = strlen(id); n > 0 && strchr("^= ", id[n - 1]); n--) /* trailing characters as trimmed in slices */
        id[n - 1] = 0;
    if (id[0] && own[0] && strcmp(id, own))
        return cts_fail(err, CTS_ERR_GEOMETRY, "belongs to another patient than series %s (PatientID differs)",
                        reading->series->uid);
    return CTS_OK;
}

const char *cts_label_series_frame(const CtsSeries *series)
{
    return series->slices[0]->identity[CTS_FRAME_UID];
}

bool cts_label_shares_space(const char *frame_uid, const CtsSeries *series)
{
    return frame_uid[0] && !series->frames_differ && !strcmp(frame_uid, cts_label_series_frame(series));
}

CtsStatus cts_label_check_space(const CtsLabelReading *reading, const CtsLabelDicom *object, const char *frame_uid,
                                CtsError *err)
{
    const char *const own = cts_label_series_frame(reading->series);
    if (reading->series->frames_differ)
        return refers(object->head.elements, reading->series, 0, true)
                   ? CTS_OK
                   : cts_fail(err, CTS_ERR_GEOMETRY,
                              "names none of the series' slices, each of which has a Frame of Reference of its own");
    if (!frame_uid[0] || !own[0])
        return check_named_series(reading, object, err);
    if (!strcmp(frame_uid, own))
        return CTS_OK;
    if (!cts_label_refers(object->head.elements, reading->series))
        return cts_fail(err, CTS_ERR_GEOMETRY,
                        "its Frame of Reference %s is not the series' %s, and it names neither the series nor a slice "
                        "of it (labels of another scan?)",
                        frame_uid, own);
    cts_report_diagnostic(reading->report, CTS_DIAGNOSTIC_LABEL_FRAME_OF_REFERENCE,
                          "label file %d: its Frame of Reference %s is not the series' %s, but it names the series",
                          reading->file, frame_uid, own);
    return CTS_OK;
}
