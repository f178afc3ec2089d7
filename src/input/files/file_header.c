#include "input/files/file_header.h"

#include "dicom/header/dicom_header.h"
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

static CtsStatus read_nifti_header(const CtsDicomHeader *h, const CtsFile *source, CtsNiftiForm form, CtsObject *object,
                                   CtsError *err)
{
    /* In a folder it may be a mask or a picture of anything. */
    if (source->named)
        return cts_nifti_slices(source, &h->file, form, object, err);
    object->packed = "NIfTI";
    return CTS_OK;
}

CtsFileKind cts_file_read_header(const CtsFile *source, CtsNiftiForm form, CtsScratch *scratch, CtsObject *object,
                                 uint64_t *bytes_read, CtsError *err)
{
    CtsDicomHeader h;
    CtsStatus st = cts_dicom_header_begin(&h, source, scratch, err);
    if (!st && h.n && cts_nifti_slices_are(source->path, scratch->file, h.n)) {
        h.kind = CTS_FILE_NIFTI;
        st = read_nifti_header(&h, source, form, object, err);
    } else if (!st && !(st = cts_dicom_header_read(&h, err))) {
        if (h.kind == CTS_FILE_DICOM)
            st = cts_dicom_header_object(&h, source, object, err);
        else if (h.n)
            object->packed = packer_of(scratch->file, h.n);
    }
    *bytes_read += h.n;
    cts_dicom_header_close(&h);
    if (!st)
        return h.kind;
    cts_object_free(object);
    return CTS_FILE_UNREADABLE;
}
