#include "ctsplat/label_files.h"

#include "base/mem.h"
#include "dicom/header/slice.h"
#include "input/files/nifti.h"
#include "input/files/scan.h"
#include "input/labels/label_reading.h"
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum {
    HEAD_BYTES = 4096, /* enough to detect a file's format: DICOM's preamble and meta header, NIfTI's header */
    SOP_UID = 0x00080018,
    STUDY_UID = 0x0020000D,
    SERIES_UID = 0x0020000E,
    FRAME_UID = 0x00200052
};

/* DICOM objects that hold labels. */
static const struct {
    const char *class_uid;
    CtsStatus (*read)(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err);
} objects[] = {
    {"1.2.840.10008.5.1.4.1.1.66.4", cts_label_read_seg},
    {"1.2.840.10008.5.1.4.1.1.66.7", cts_label_read_seg}, /* LABELMAP */
    {"1.2.840.10008.5.1.4.1.1.481.3", cts_label_read_rtstruct},
};
enum { N_OBJECTS = sizeof objects / sizeof *objects };

static int object_kind(const char *class_uid)
{
    for (int i = 0; i < N_OBJECTS; i++)
        if (!strcmp(objects[i].class_uid, class_uid))
            return i;
    return -1;
}

/* A label file that is open, and how it begins. */
typedef struct Opened {
    CtsFileBytes bytes;
    uint8_t head[HEAD_BYTES];
    size_t n_head;
    char class_uid[65]; /* from its meta header */
    bool is_dicom;
} Opened;

static CtsStatus open_label(const CtsFile *file, Opened *o, CtsError *err)
{
    *o = (Opened){0};
    CtsStatus st = cts_file_bytes_open(&o->bytes, file, err);
    if (!st && o->bytes.fd < 0)
        st = cts_fail(err, CTS_ERR_READ, "is no regular file");
    o->n_head = o->bytes.n_bytes < HEAD_BYTES ? (size_t)o->bytes.n_bytes : HEAD_BYTES;
    if (!st)
        st = cts_file_bytes_read(&o->bytes, o->head, o->n_head, 0, err);
    o->is_dicom = !st && cts_label_is_dicom(o->head, o->n_head, o->class_uid);
    return st;
}

/* The label files of one series. */
typedef struct LabelSearch {
    const CtsLabelRequest *request;
    CtsLabelReading reading;
    bool only_referring; /* of the files beside the series */
    bool in_folder;      /* files of other kinds are passed over */
    int n_read;
} LabelSearch;

static CtsLabelObject uids_of(const CtsLabelDicom *object)
{
    CtsLabelObject uids = {.class_uid = ""};
    memcpy(uids.class_uid, object->class_uid, sizeof uids.class_uid);
    cts_elements_text(object->head.elements, SOP_UID, uids.sop_uid, sizeof uids.sop_uid);
    cts_elements_text(object->head.elements, SERIES_UID, uids.series_uid, sizeof uids.series_uid);
    cts_elements_text(object->head.elements, STUDY_UID, uids.study_uid, sizeof uids.study_uid);
    return uids;
}

/* Reads a wanted object, unless it is a copy of one that was read. */
static CtsStatus read_once(LabelSearch *s, int kind, const CtsLabelDicom *object, CtsError *err)
{
    CtsLabels *const labels = s->reading.labels;
    const CtsLabelObject uids = uids_of(object);
    CtsStatus st;
    for (size_t i = 0; i < labels->n_objects; i++)
        if (*uids.sop_uid && !strcmp(labels->objects[i].sop_uid, uids.sop_uid))
            return CTS_OK;
    s->n_read++;
    if (!(st = cts_label_check_patient(&s->reading, object, err)) &&
        !(st = objects[kind].read(&s->reading, object, err)) &&
        !(st = cts_grow(&labels->objects, labels->n_objects, err)))
        labels->objects[labels->n_objects++] = uids;
    return st;
}

static CtsStatus read_object(LabelSearch *s, const CtsFile *file, CtsError *err)
{
    CtsLabelDicom object;
    CtsStatus st = cts_label_dicom_open(&object, file, err);
    const int kind = st ? -1 : object_kind(object.class_uid);
    const bool wanted = kind >= 0 && (!s->only_referring || cts_label_refers(object.head.elements, s->reading.series));
    if (!st && kind < 0 && !s->in_folder)
        st = cts_fail(err, CTS_ERR_READ, "is no segmentation and no structure set, but %s",
                      object.head.facts.class_name);
    if (!st && wanted)
        st = read_once(s, kind, &object, err);
    cts_label_dicom_close(&object);
    return st;
}

static CtsStatus read_file(LabelSearch *s, const CtsFile *file, CtsError *err)
{
    Opened o;
    CtsStatus st = open_label(file, &o, err);
    const char *const other = st ? NULL : cts_nifti_other(o.head, o.n_head, file->path);
    if (st) {
        ;
    } else if (o.is_dicom) {
        if (!s->in_folder || !o.class_uid[0] || object_kind(o.class_uid) >= 0)
            st = read_object(s, file, err);
    } else if (!other && cts_nifti_is(o.head, o.n_head)) {
        char stem[256];
        cts_label_stem(file->path, stem, sizeof stem);
        s->reading.name = s->in_folder ? stem : NULL;
        s->reading.number++;
        if (!s->only_referring) {
            s->n_read++;
            st = cts_label_read_nifti(&s->reading, &o.bytes, err);
        }
        s->reading.name = NULL;
    } else if (!s->in_folder) {
        st = cts_fail(err, CTS_ERR_READ, "%s",
                      other ? other : "is neither a DICOM segmentation or structure set nor a NIfTI file");
    }
    cts_file_bytes_close(&o.bytes);
    if (st && s->request->unnamed)
        cts_context(err, "label file %d", s->reading.file);
    else if (st)
        cts_context(err, "%s", file->path);
    return st;
}

static CtsStatus read_folder(LabelSearch *s, const char *const *paths, int n_paths, CtsError *err)
{
    CtsFileList list = {0};
    CtsStatus st = cts_scan_paths(s->request->archives, paths, n_paths, &list, err);
    s->in_folder = true;
    s->reading.number = 0;
    for (size_t i = 0; !st && i < list.n; i++)
        st = read_file(s, &list.items[i], err);
    s->in_folder = false;
    cts_file_list_free(&list);
    return st;
}

/* Reads label files from the folders of the series' slices and of its search paths. */
static CtsStatus read_beside(LabelSearch *s, CtsError *err)
{
    const CtsSeries *const series = s->reading.series;
    CtsStringPool texts = {0};
    const size_t most = (size_t)s->request->n_series_paths + (size_t)series->n_slices;
    const char **folders = calloc(most + 1, sizeof *folders);
    int n = 0;
    CtsStatus st = folders ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; !st && i < s->request->n_series_paths; i++) {
        struct stat info;
        if (s->request->listed || !stat(s->request->series_paths[i], &info))
            folders[n++] = s->request->series_paths[i];
    }
    for (int k = 0; !st && !s->request->listed && k < series->n_slices; k++) {
        const CtsSlice *slice = series->slices[k];
        const size_t length = (size_t)(cts_slice_name(slice) - slice->path);
        const char *folder =
            slice->memory ? NULL : cts_string_pool_add(&texts, length ? slice->path : "./", length ? length : 2);
        bool known = !folder;
        for (int i = 0; i < n && !known; i++)
            known = !strncmp(folders[i], folder, strlen(folders[i]));
        if (!known)
            folders[n++] = folder;
    }
    s->only_referring = true;
    if (!st)
        st = read_folder(s, folders, n, err);
    s->only_referring = false;
    cts_string_pool_free(&texts);
    free(folders);
    return st;
}

static CtsStatus read_named(LabelSearch *s, const char *path, CtsError *err)
{
    struct stat info;
    const int n_before = s->n_read;
    if (stat(path, &info) || !S_ISDIR(info.st_mode))
        return read_file(s, &(CtsFile){.path = path, .named = true}, err);
    CtsStatus st = read_folder(s, &path, 1, err);
    if (!st && s->n_read == n_before)
        st = cts_fail(err, CTS_ERR_READ, "%s: holds no mask (.nii, .nii.gz), no segmentation and no structure set",
                      s->request->unnamed ? "its folder of labels" : path);
    return st;
}

static CtsStatus read_pattern(LabelSearch *s, const char *pattern, CtsError *err)
{
    const CtsSeries *const series = s->reading.series;
    const bool is_nifti = series->no_patient;
    CtsLabelPaths paths;
    if (!strcmp(pattern, "auto"))
        return read_beside(s, err);
    CtsStatus st = cts_label_paths(pattern, series->uid, is_nifti ? series->slices[0]->path : NULL, &paths, err);
    if (!st && paths.n == 0)
        cts_report_diagnostic(s->reading.report, CTS_DIAGNOSTIC_LABELS_MISSING,
                              "label file %d: no file is named as its pattern says for this series", s->reading.file);
    for (size_t i = 0; !st && i < paths.n; i++)
        st = read_named(s, paths.items[i], err);
    cts_label_paths_free(&paths);
    return st;
}

CtsStatus cts_labels_read(const CtsLabelRequest *request, const CtsSeries *series, CtsLabels **labels,
                          CtsReport *report, CtsError *err)
{
    CtsLabelGrid grid;
    CtsLabelNames names = {0};
    LabelSearch s = {.request = request, .reading = {.series = series, .names = &names, .report = report}};
    *labels = NULL;
    CtsStatus st = request->names ? cts_label_names_read(request->names, &names, err) : CTS_OK;
    if (!st && !(st = cts_label_grid_of(&grid, series, err)))
        st = cts_labels_new(labels, &grid, err);
    s.reading.labels = *labels;
    for (int i = 0; !st && i < request->n_paths; i++) {
        s.reading.file = i + 1;
        st = read_pattern(&s, request->paths[i], err);
    }
    cts_label_names_free(&names);
    if (st)
        cts_labels_free(labels);
    return st;
}

/* The first series that can be rendered and that the label file at path belongs to; NULL: none. */
static const CtsSeries *series_of_labels(const char *path, const CtsSeriesList *list)
{
    CtsLabelDicom object;
    char uid[65] = "";
    const CtsSeries *found = NULL;
    const bool is_open = !cts_label_dicom_open(&object, &(CtsFile){.path = path}, NULL);
    cts_elements_text(object.head.elements, FRAME_UID, uid, sizeof uid);
    for (size_t k = 0; is_open && !found && k < list->n; k++)
        if (list->items[k].renderable &&
            (cts_label_refers(object.head.elements, &list->items[k]) || cts_label_shares_space(uid, &list->items[k])))
            found = &list->items[k];
    cts_label_dicom_close(&object);
    return found;
}

CtsStatus cts_labels_choose(const CtsLabelRequest *request, const CtsSeriesList *list, const CtsSeries **series,
                            CtsError *err)
{
    for (int i = 0; i < request->n_paths; i++)
        if ((*series = series_of_labels(request->paths[i], list)))
            return CTS_OK;
    return cts_series_choose(list, "1", series, err); /* which says why the labels are not its own */
}
