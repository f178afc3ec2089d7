#include "input/files/nifti.h"

#include "base/mem.h"
#include "base/vec3.h"
#include "dicom/protocol/pixel_sandbox.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* SIZE_1, SIZE_2: bytes of the headers of NIfTI-1 and NIfTI-2. PART: numbers that are read at a time, 64 KiB on the
 * stack; changes no result. MAX_EXTENSION: longest extension that is read for names of labels, 256 bytes for each of
 * 65536. MAX_DIM: largest dimension of NIfTI-1. */
enum { SIZE_1 = 348, SIZE_2 = 540, PART = 4096, MAX_EXTENSION = 16 << 20, MAX_DIM = 32767 };
/* Parts of a packed file in a sandbox, packed and unpacked: large enough that messages cost nothing. */
enum { PACKED_PART = 1 << 18, UNPACKED_PART = (1 << 20) - (int)sizeof(CtsUnpacked) };
enum { MAX_PACKED = 1032 }; /* largest ratio of deflate: matches of 258 bytes in 2 bits */

/* All datatypes that hold one number a voxel. */
static const struct {
    int code, bytes;
    bool is_whole, is_signed;
} types[] = {{2, 1, true, false},   {4, 2, true, true},    {8, 4, true, true},    {16, 4, false, true},
             {64, 8, false, true},  {256, 1, true, true},  {512, 2, true, false}, {768, 4, true, false},
             {1024, 8, true, true}, {1280, 8, true, false}};

bool cts_nifti_is(const uint8_t *head, size_t n)
{
    if (n >= 2 && head[0] == 0x1F && head[1] == 0x8B)
        return true;
    return n >= 348 && (!memcmp(head + 344, "n+1", 4) || !memcmp(head + 344, "ni1", 4) || !memcmp(head + 4, "n+2", 4) ||
                        !memcmp(head + 4, "ni2", 4));
}

const char *cts_nifti_other(const uint8_t *head, size_t n, const char *path)
{
    static const struct {
        const char *magic, *ending, *how;
    } formats[] = {
        {"NRRD", ".nrrd", "is NRRD (convert it to .nii.gz, as with Slicer or SimpleITK)"},
        {"ObjectType", ".mha", "is MetaImage (convert it to .nii.gz, as with ITK-SNAP or SimpleITK)"},
        {NULL, ".mgz", "is FreeSurfer's MGH (convert it with mri_convert to .nii.gz)"},
        {NULL, ".mgh", "is FreeSurfer's MGH (convert it with mri_convert to .nii.gz)"},
        {NULL, ".hdr", "is half of an Analyze or NIfTI pair (convert it to one .nii file)"},
        {NULL, ".img", "is half of an Analyze or NIfTI pair (convert it to one .nii file)"},
    };
    const size_t length = strlen(path);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        const size_t m = formats[i].magic ? strlen(formats[i].magic) : 0, e = strlen(formats[i].ending);
        if ((m && n >= m && !memcmp(head, formats[i].magic, m)) ||
            (length > e && !strcmp(path + length - e, formats[i].ending)))
            return formats[i].how;
    }
    return NULL;
}

/* The next part of a packed file, unpacked in a sandbox. */
static CtsStatus unpack_part(CtsNifti *f, CtsError *err)
{
    const uint64_t left = f->file->n_bytes - f->file_at;
    const size_t n = left < PACKED_PART ? (size_t)left : PACKED_PART;
    CtsUnpacked made;
    uint8_t *packed;
    const void *answer;
    CtsStatus st = cts_sandbox_new(&f->unpacker, CTS_PIXELS_PROGRAM, CTS_PIXELS_GUNZIP, "unpacker", 1, err);
    if (!st)
        st = cts_sandbox_room(f->unpacker, PACKED_PART, sizeof made + UNPACKED_PART, &packed, err);
    if (st || (st = cts_file_bytes_read(f->file, packed, n, f->file_at, err)))
        return st;
    cts_sandbox_send(f->unpacker, &f->n_unpacked, sizeof f->n_unpacked, packed, n, sizeof made + UNPACKED_PART);
    if ((st = cts_sandbox_take(f->unpacker, &answer, err)))
        return st == CTS_ERR_PIXELS ? (err->status = CTS_ERR_READ) : st;
    memcpy(&made, answer, sizeof made);
    if (made.n_taken > n || made.n_bytes > UNPACKED_PART || (made.n_taken == 0 && made.n_bytes == 0))
        return cts_fail(err, CTS_ERR_READ, "cut short: its gzip stream ends before the last voxel");
    f->part = (const uint8_t *)answer + sizeof made;
    f->n_part = (size_t)made.n_bytes;
    f->file_at += made.n_taken;
    f->n_unpacked += made.n_bytes;
    return CTS_OK;
}

/* bytes NULL: skips them. */
static CtsStatus read_nifti_bytes(CtsNifti *f, uint8_t *bytes, size_t n, CtsError *err)
{
    f->at += n;
    if (!f->is_packed && f->at > f->file->n_bytes)
        return cts_fail(err, CTS_ERR_READ, "cut short: its %llu bytes end before the last voxel",
                        (unsigned long long)f->file->n_bytes);
    if (!f->is_packed)
        return bytes ? cts_file_bytes_read(f->file, bytes, n, f->at - n, err) : CTS_OK;
    while (n > 0) {
        const size_t m = n < f->n_part ? n : f->n_part;
        if (bytes && m) {
            memcpy(bytes, f->part, m);
            bytes += m;
        }
        if (m)
            f->part += m;
        f->n_part -= m;
        n -= m;
        const CtsStatus st = n > 0 ? unpack_part(f, err) : CTS_OK;
        if (st)
            return st;
    }
    return CTS_OK;
}

static uint64_t integer_at(const CtsNifti *f, const uint8_t *p, int n)
{
    uint64_t x = 0;
    for (int i = 0; i < n; i++)
        x |= (uint64_t)p[f->big_endian ? n - 1 - i : i] << (8 * i);
    return x;
}

static int64_t signed_at(const CtsNifti *f, const uint8_t *p, int n)
{
    const uint64_t x = integer_at(f, p, n), sign = 1ull << (8 * n - 1);
    return (int64_t)((x ^ sign) - sign);
}

static double real_at(const CtsNifti *f, const uint8_t *p, int n)
{
    const uint64_t x = integer_at(f, p, n);
    const uint32_t half = (uint32_t)x;
    float single;
    double value;
    memcpy(&single, &half, sizeof single);
    memcpy(&value, &x, sizeof value);
    return n == 4 ? (double)single : value;
}

/* Offsets and sizes of fields in both versions. */
typedef struct NiftiLayout {
    int datatype, dim, dim_bytes, pixdim, real_bytes, offset, slope, forms, form_bytes, quatern, rows, units;
} NiftiLayout;

static const NiftiLayout layouts[2] = {{70, 40, 2, 76, 4, 108, 112, 252, 2, 256, 280, 123},
                                       {12, 16, 8, 104, 8, 168, 176, 344, 4, 352, 400, 500}};

static double real_of(const CtsNifti *f, const uint8_t *h, const NiftiLayout *l, int at, int i)
{
    return real_at(f, h + at + i * l->real_bytes, l->real_bytes);
}

/* Rotation by the quaternion (a, b, c, d), a found from the others; 1e-7 as in the reference, nifti1_io. */
static void from_quaternion(const CtsNifti *f, const uint8_t *h, const NiftiLayout *l, double m[3][4])
{
    const double b = real_of(f, h, l, l->quatern, 0), c = real_of(f, h, l, l->quatern, 1),
                 d = real_of(f, h, l, l->quatern, 2), left = 1 - (b * b + c * c + d * d);
    const double a = left > 1e-7 ? sqrt(left) : 0, n = left > 1e-7 ? 1 : 1 / sqrt(b * b + c * c + d * d);
    const double q[4] = {a, b * n, c * n, d * n};
    const double r[3][3] = {{q[0] * q[0] + q[1] * q[1] - q[2] * q[2] - q[3] * q[3], 2 * (q[1] * q[2] - q[0] * q[3]),
                             2 * (q[1] * q[3] + q[0] * q[2])},
                            {2 * (q[1] * q[2] + q[0] * q[3]), q[0] * q[0] + q[2] * q[2] - q[1] * q[1] - q[3] * q[3],
                             2 * (q[2] * q[3] - q[0] * q[1])},
                            {2 * (q[1] * q[3] - q[0] * q[2]), 2 * (q[2] * q[3] + q[0] * q[1]),
                             q[0] * q[0] + q[3] * q[3] - q[1] * q[1] - q[2] * q[2]}};
    const double handed = real_of(f, h, l, l->pixdim, 0) < 0 ? -1 : 1;
    for (int row = 0; row < 3; row++) {
        for (int axis = 0; axis < 3; axis++)
            m[row][axis] = r[row][axis] * real_of(f, h, l, l->pixdim, axis + 1) * (axis == 2 ? handed : 1);
        m[row][3] = real_of(f, h, l, l->quatern, 3 + row);
    }
}

/* The volume that the steps span, negative where they are left-handed. */
static double spanned(const CtsNiftiPlace *p)
{
    double normal[3];
    cts_cross3(p->step_lps[0], p->step_lps[1], normal);
    return cts_dot3(normal, p->step_lps[2]);
}

/* From RAS rows to LPS: x and y change sign. mm: length of the rows' unit. Axes that span less than 1e-3 of an upright
 * cell lie in one plane. */
static void set_place(CtsNiftiPlace *p, const double m[3][4], double mm)
{
    for (int row = 0; row < 3; row++) {
        const double sign = row < 2 ? -mm : mm;
        p->origin_lps[row] = sign * m[row][3];
        for (int axis = 0; axis < 3; axis++)
            p->step_lps[axis][row] = sign * m[row][axis];
    }
    const double sides = cts_norm3(p->step_lps[0]) * cts_norm3(p->step_lps[1]) * cts_norm3(p->step_lps[2]);
    p->given = fabs(spanned(p)) > 1e-3 * sides && isfinite(sides + cts_norm3(p->origin_lps));
}

static CtsStatus read_forms(CtsNifti *f, const uint8_t *h, const NiftiLayout *l, CtsError *err)
{
    double m[3][4];
    const int64_t q_code = signed_at(f, h + l->forms, l->form_bytes),
                  s_code = signed_at(f, h + l->forms + l->form_bytes, l->form_bytes);
    const int units = h[l->units + (l == &layouts[1] && f->big_endian ? 3 : 0)] & 7;
    const double mm = units == 1 ? 1000 : units == 3 ? 0.001 : 1;
    if (s_code > 0) {
        for (int i = 0; i < 12; i++)
            m[i / 4][i % 4] = real_of(f, h, l, l->rows, i);
        set_place(&f->sform, m, mm);
    }
    if (q_code > 0) {
        from_quaternion(f, h, l, m);
        set_place(&f->qform, m, mm);
    }
    if (s_code <= 0 && q_code <= 0)
        return cts_fail(err, CTS_ERR_GEOMETRY, "has neither an sform nor a qform, so its position is unknown");
    if (!f->sform.given && !f->qform.given)
        return cts_fail(err, CTS_ERR_GEOMETRY, "its axes do not span space");
    cts_nifti_take_form(f, CTS_NIFTI_FORM_AUTO);
    return CTS_OK;
}

void cts_nifti_take_form(CtsNifti *f, CtsNiftiForm form)
{
    f->place = (form == CTS_NIFTI_FORM_Q ? f->qform.given : !f->sform.given) ? f->qform : f->sform;
}

/* The largest displacement of a corner in voxels, with the voxel sizes of the first form for both, and in mm. */
static double largest_corner_difference(const CtsNifti *f, const double size_mm[3], double *off_mm)
{
    double most = 0;
    *off_mm = 0;
    for (int corner = 0; corner < 8; corner++) {
        double off[3], voxels = 0;
        for (int c = 0; c < 3; c++) {
            off[c] = f->sform.origin_lps[c] - f->qform.origin_lps[c];
            for (int a = 0; a < 3; a++)
                if (corner >> a & 1)
                    off[c] += (f->dims[a] - 1) * size_mm[a] *
                              (f->sform.step_lps[a][c] / cts_norm3(f->sform.step_lps[a]) -
                               f->qform.step_lps[a][c] / cts_norm3(f->qform.step_lps[a]));
        }
        for (int a = 0; a < 3; a++)
            voxels = fmax(voxels, fabs(cts_dot3(off, f->sform.step_lps[a])) / (size_mm[a] * size_mm[a]));
        if (voxels > most) {
            most = voxels;
            *off_mm = cts_norm3(off);
        }
    }
    return most;
}

CtsNiftiForms cts_nifti_compare_forms(const CtsNifti *f, char text[CTS_NIFTI_FORMS_TEXT])
{
    const double pi = 3.14159265358979323846;
    double s_mm[3], q_mm[3], off_mm, max_deg = 0, max_share = 0;
    int turned = 0;
    text[0] = 0;
    if (!f->sform.given || !f->qform.given)
        return CTS_NIFTI_FORMS_AGREE;
    for (int a = 0; a < 3; a++) {
        s_mm[a] = cts_norm3(f->sform.step_lps[a]);
        q_mm[a] = cts_norm3(f->qform.step_lps[a]);
        const double cosine = cts_dot3(f->sform.step_lps[a], f->qform.step_lps[a]) / (s_mm[a] * q_mm[a]);
        const double deg = acos(fmin(fmax(cosine, -1), 1)) * (180 / pi);
        max_share = fmax(max_share, fabs(s_mm[a] - q_mm[a]) / fmax(s_mm[a], q_mm[a]));
        if (deg > max_deg) {
            max_deg = deg;
            turned = a;
        }
    }
    const bool mirrored = spanned(&f->sform) * spanned(&f->qform) < 0;
    if (mirrored)
        snprintf(text, CTS_NIFTI_FORMS_TEXT, "one is the other mirrored");
    else if (max_deg > 1)
        snprintf(text, CTS_NIFTI_FORMS_TEXT, "their axes %d point %.3g degrees apart", turned + 1, max_deg);
    else if (max_share > 0.01)
        snprintf(text, CTS_NIFTI_FORMS_TEXT,
                 "voxels of %.4g x %.4g x %.4g mm by one, %.4g x %.4g x %.4g mm by the other", s_mm[0], s_mm[1],
                 s_mm[2], q_mm[0], q_mm[1], q_mm[2]);
    else if (largest_corner_difference(f, s_mm, &off_mm) > 1)
        snprintf(text, CTS_NIFTI_FORMS_TEXT, "a corner lies %.3g mm apart", off_mm);
    return mirrored || max_deg > 45 ? CTS_NIFTI_FORMS_CONTRADICT
           : text[0]                ? CTS_NIFTI_FORMS_DIFFER
                                    : CTS_NIFTI_FORMS_AGREE;
}

static CtsStatus read_shape(CtsNifti *f, const uint8_t *h, const NiftiLayout *l, CtsError *err)
{
    const int64_t n_dims = signed_at(f, h + l->dim, l->dim_bytes);
    for (int i = 1; i <= 7; i++) {
        int64_t n = i <= n_dims ? signed_at(f, h + l->dim + i * l->dim_bytes, l->dim_bytes) : 1;
        n = i > 3 && n == 0 ? 1 : n; /* some writers count dimensions that they leave empty */
        if (n < 1 || n > MAX_DIM || n_dims < 1 || n_dims > 7)
            return cts_fail(err, CTS_ERR_READ, "its dimension %d is %lld (1 to %d)", i, (long long)n, MAX_DIM);
        if (i > 3 && n > 1)
            return cts_fail(err, CTS_ERR_READ, "has %lld dimensions; one volume a file is read", (long long)n_dims);
        if (i <= 3)
            f->dims[i - 1] = (int)n;
    }
    f->datatype = (int)signed_at(f, h + l->datatype, 2);
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (types[i].code == f->datatype) {
            f->bytes = types[i].bytes;
            f->is_whole = types[i].is_whole;
            f->is_signed = types[i].is_signed;
        }
    if (!f->bytes)
        return cts_fail(err, CTS_ERR_READ, "its datatype %d is not one number a voxel", f->datatype);
    f->slope = real_of(f, h, l, l->slope, 0);
    f->intercept = real_of(f, h, l, l->slope, 1);
    if (!isfinite(f->slope) || f->slope == 0)
        f->slope = 1, f->intercept = 0;
    f->intercept = isfinite(f->intercept) ? f->intercept : 0;
    return CTS_OK;
}

/* The extension between header and voxels: 4 bytes, then blocks of a size, a code and text of any kind. */
static CtsStatus read_extension(CtsNifti *f, uint64_t offset, CtsError *err)
{
    const uint64_t at = f->at;
    if (offset < at)
        return cts_fail(err, CTS_ERR_READ, "its voxels begin inside its header");
    /* where the file ends earlier, reading the voxels fails with a message */
    if (offset - at <= 12 || offset - at > MAX_EXTENSION)
        return read_nifti_bytes(f, NULL, (size_t)(offset - at), err);
    if (!f->is_packed && offset > f->file->n_bytes)
        return cts_fail(err, CTS_ERR_READ, "cut short in its extension");
    if (!(f->extension = malloc((size_t)(offset - at))))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    f->n_extension = (size_t)(offset - at);
    return read_nifti_bytes(f, (uint8_t *)f->extension, f->n_extension, err);
}

CtsStatus cts_nifti_open(CtsNifti *f, const CtsFileBytes *file, CtsError *err)
{
    CtsStatus st;
    uint8_t h[SIZE_2] = {0}, magic[2];
    *f = (CtsNifti){.file = file};
    if (file->n_bytes < 2)
        return cts_fail(err, CTS_ERR_READ, "is empty");
    if ((st = cts_file_bytes_read(file, magic, 2, 0, err)))
        return st;
    f->is_packed = magic[0] == 0x1F && magic[1] == 0x8B;
    if ((st = read_nifti_bytes(f, h, SIZE_1, err)))
        return st;
    f->big_endian = h[0] == 0;
    const uint64_t size = integer_at(f, h, 4);
    const bool second = size == SIZE_2;
    if (size != SIZE_1 && !second)
        return cts_fail(err, CTS_ERR_READ, "is no NIfTI file (its header does not begin with 348 or 540)");
    if (second && (st = read_nifti_bytes(f, h + SIZE_1, SIZE_2 - SIZE_1, err)))
        return st;
    const char *const form_magic = (const char *)h + (second ? 4 : 344);
    if (!strncmp(form_magic, "ni", 2))
        return cts_fail(err, CTS_ERR_READ, "is half of a NIfTI pair .hdr/.img (convert it to one .nii file)");
    if (strncmp(form_magic, second ? "n+2" : "n+1", 3))
        return cts_fail(err, CTS_ERR_READ, "is no NIfTI file (Analyze headers contain no position)");
    const NiftiLayout *const l = &layouts[second];
    const double offset = second ? (double)signed_at(f, h + l->offset, 8) : real_at(f, h + l->offset, 4);
    if ((st = read_shape(f, h, l, err)) || (st = read_forms(f, h, l, err)))
        return st;
    if (!(offset >= 0 && offset <= 1e9)) /* bytes; headers and extensions are far smaller */
        return cts_fail(err, CTS_ERR_READ, "its voxels begin at byte %g", offset);
    return read_extension(f, offset > 0 ? (uint64_t)offset : size + 4, err);
}

void cts_nifti_close(CtsNifti *f)
{
    cts_sandbox_free(&f->unpacker);
    free(f->extension);
    *f = (CtsNifti){0};
}

CtsStatus cts_nifti_count(const CtsNifti *f, size_t bytes_each, size_t *n, CtsError *err)
{
    const size_t n_row = (size_t)f->dims[0] * (size_t)f->dims[1];
    const uint64_t most = f->is_packed ? f->file->n_bytes * MAX_PACKED : f->file->n_bytes;
    if (cts_mul_overflows(n_row, (size_t)f->dims[2], n) || *n > most / (uint64_t)f->bytes)
        return cts_fail(err, CTS_ERR_READ, "cut short: it claims %d x %d x %d voxels of %d bytes, and has %llu bytes",
                        f->dims[0], f->dims[1], f->dims[2], f->bytes, (unsigned long long)f->file->n_bytes);
    if (!cts_memory_allows((double)*n * (double)bytes_each, cts_memory_available()))
        return cts_fail(err, CTS_ERR_MEMORY, "%d x %d x %d voxels need more memory than is free", f->dims[0],
                        f->dims[1], f->dims[2]);
    return CTS_OK;
}

/* A number as the file has it. */
static double number_at(const CtsNifti *f, const uint8_t *p)
{
    return !f->is_whole   ? real_at(f, p, f->bytes)
           : f->is_signed ? (double)signed_at(f, p, f->bytes)
                          : (double)integer_at(f, p, f->bytes);
}

CtsStatus cts_nifti_read(CtsNifti *f, size_t n, const volatile sig_atomic_t *stop, CtsNiftiSink take, void *context,
                         CtsError *err)
{
    uint8_t bytes[PART * sizeof(double)];
    double values[PART];
    CtsStatus st = CTS_OK;
    for (size_t done = 0; !st && done < n; done += PART) {
        const size_t part = n - done < PART ? n - done : PART, size = (size_t)f->bytes;
        if (stop && *stop)
            return cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
        st = read_nifti_bytes(f, bytes, part * size, err);
        if (size == 1 && !f->is_signed) /* label maps, mostly */
            for (size_t i = 0; i < part; i++)
                values[i] = f->slope * bytes[i] + f->intercept;
        else
            for (size_t i = 0; i < part; i++)
                values[i] = f->slope * number_at(f, bytes + i * size) + f->intercept;
        if (!st)
            st = take(context, values, done, part, err);
    }
    return st;
}
