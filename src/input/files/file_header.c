#include "input/files/file_header.h"

#include "base/parallel.h"
#include "base/vec3.h"
#include <math.h>
#include <string.h>

/* The packing program of a file that is not DICOM, by its first bytes. */
static const char *packer_of(const uint8_t *bytes, size_t n)
{
    static const struct {
        const char *name, *magic;
    } packers[] = {{"gzip", "\x1f\x8b\x08"},
                   {"bzip2", "BZh"},
                   {"xz", "\xfd"
                          "7zXZ"},
                   {"zstd", "\x28\xb5\x2f\xfd"},
                   {"zip", "PK\3\4"}};
    for (size_t i = 0; i < sizeof packers / sizeof *packers; i++)
        if (n >= strlen(packers[i].magic) && memcmp(bytes, packers[i].magic, strlen(packers[i].magic)) == 0)
            return packers[i].name;
    return NULL;
}

/* True if a file that begins so is NIfTI, plain or packed with gzip; for gzip the name decides. */
static bool is_nifti(const char *path, const uint8_t *head, size_t n)
{
    static const char packed[] = ".nii.gz";
    const size_t length = strlen(path), n_end = sizeof packed - 1;
    const bool is_gzip = n >= 2 && head[0] == 0x1F && head[1] == 0x8B;
    return cts_nifti_is(head, n) && (!is_gzip || (length > n_end && !strcmp(path + length - n_end, packed)));
}

CtsBox cts_nifti_box(const CtsNifti *f)
{
    CtsBox box = {.stride = {1, f->dims[0], (ptrdiff_t)f->dims[0] * f->dims[1]}};
    memcpy(box.dims, f->dims, sizeof box.dims);
    memcpy(box.origin_lps, f->place.origin_lps, sizeof box.origin_lps);
    memcpy(box.step_lps, f->place.step_lps, sizeof box.step_lps);
    return cts_box_as_scanned(&box, 2);
}

/* Fields common to all slices. */
static CtsSlice common_slice(const CtsFile *source, const CtsFileBytes *file, const CtsBox *box)
{
    CtsSlice s = cts_slice_unknown();
    s.path = source->path;
    s.memory = source->memory;
    s.file_bytes = file->n_bytes;
    s.mtime_ns = file->mtime_ns;
    s.syntax = cts_syntax_native(true, false);
    s.syntax_uid = "NIfTI";
    s.modality = "CT";
    s.n_frames = box->dims[2];
    s.rows = box->dims[1];
    s.columns = box->dims[0];
    s.bits_allocated = s.bits_stored = 16;
    s.high_bit = 15;
    s.slope = 1;
    s.column_spacing_mm = cts_norm3(box->step_lps[0]);
    s.row_spacing_mm = cts_norm3(box->step_lps[1]);
    for (int c = 0; c < 3; c++) {
        s.row_lps[c] = box->step_lps[0][c] / s.column_spacing_mm;
        s.column_lps[c] = box->step_lps[1][c] / s.row_spacing_mm;
    }
    cts_cross3(s.row_lps, s.column_lps, s.normal_lps);
    return s;
}

/* The checks of a DICOM slice's position, with the limits of dicom/header. */
static void check_place(CtsSlice *s)
{
    if (fabs(cts_dot3(s->row_lps, s->column_lps)) > 1e-3)
        cts_slice_fault(s, CTS_ERR_GEOMETRY,
                        "its rows and columns are not at right angles (resample it on an upright grid)");
    if (!(s->column_spacing_mm <= 10 && s->row_spacing_mm <= 10))
        cts_slice_fault(s, CTS_ERR_GEOMETRY, "its voxels are %g x %g mm, and may have at most 10", s->column_spacing_mm,
                        s->row_spacing_mm);
    if (cts_norm3(s->position_lps) > 1e5) /* a hundred metres */
        cts_slice_fault(s, CTS_ERR_GEOMETRY, "its place is %g mm away", cts_norm3(s->position_lps));
}

static CtsStatus add_slices(const CtsBox *box, const CtsSlice *common, CtsObject *object, CtsError *err)
{
    for (int k = 0; k < box->dims[2]; k++) {
        CtsSlice *const s = cts_object_add_slice(object, common);
        if (!s)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        s->frame = k;
        for (int c = 0; c < 3; c++)
            s->position_lps[c] = box->origin_lps[c] + k * box->step_lps[2][c];
        check_place(s);
    }
    return CTS_OK;
}

/* Only the user can know which of two contradictory forms is right. */
static void check_forms(const CtsNifti *nifti, CtsObject *object)
{
    char text[CTS_NIFTI_FORMS_TEXT];
    if (cts_nifti_compare_forms(nifti, text) != CTS_NIFTI_FORMS_CONTRADICT)
        return;
    for (int k = 0; k < object->n_slices; k++)
        cts_slice_fault(object->slices[k], CTS_ERR_GEOMETRY,
                        "its sform and its qform contradict each other: %s (choose one: `nifti-form` sform or "
                        "qform)",
                        text);
}

/* Fills a zeroed object with slices of 16-bit pixels, placed by this form; their pixel offsets and HU scale are not set
 * yet. */
static CtsStatus add_nifti(const CtsFile *source, const CtsFileBytes *file, CtsNiftiForm form, CtsObject *object,
                           CtsError *err)
{
    CtsNifti nifti;
    CtsStatus st = cts_nifti_open(&nifti, file, err);
    if (!st) {
        cts_nifti_take_form(&nifti, form);
        const CtsBox box = cts_nifti_box(&nifti);
        const CtsSlice common = common_slice(source, file, &box);
        object->kind = CTS_OBJECT_NIFTI;
        object->class_uid = "";
        st = add_slices(&box, &common, object, err);
        if (!st && form == CTS_NIFTI_FORM_AUTO)
            check_forms(&nifti, object);
    }
    cts_nifti_close(&nifti);
    return st;
}

/* Opens a file and queues its header; cts_header_finish() completes the result. */
static void add_file_header(CtsHeaderReader *reader, const CtsFile *source, CtsNiftiForm form, CtsHeaderRead *result)
{
    CtsFileBytes file;
    size_t n;
    *result = (CtsHeaderRead){0};
    CtsStatus st = cts_header_begin(reader, source, &file, &n, &result->why);
    const bool nifti = !st && n && is_nifti(source->path, reader->first_bytes, n);
    if (nifti && source->named)
        st = add_nifti(source, &file, form, &result->object, &result->why);
    else if (nifti) /* in a folder it may be a mask or a picture of anything */
        result->object.packed = "NIfTI";
    else if (!st && n && !cts_header_add(reader, source, &file, n, result))
        result->object.packed = packer_of(reader->first_bytes, n);
    cts_file_bytes_close(&file);
    if (st)
        cts_object_free(&result->object);
}

typedef struct HeaderReading {
    const CtsFile *files;
    CtsNiftiForm form;
    CtsHeaderReader *readers; /* of each thread */
    CtsHeaderRead *results;
} HeaderReading;

static void read_some_headers(void *context, int worker, size_t first, size_t end)
{
    const HeaderReading *const r = context;
    for (size_t i = first; i < end; i++)
        add_file_header(&r->readers[worker], &r->files[i], r->form, &r->results[i]);
}

void cts_file_headers_read(const CtsFile *files, size_t n, CtsNiftiForm form, CtsHeaderReader *readers, int n_threads,
                           CtsHeaderRead *results)
{
    enum { FEW = 100 }; /* files for one thread: a reader's process starts in the time of some 30 headers */
    HeaderReading reading = {files, form, readers, results};
    cts_parallel(n < FEW ? 1 : n_threads, n, 8, read_some_headers, &reading);
    for (int t = 0; t < n_threads; t++)
        cts_header_finish(&readers[t]);
}
