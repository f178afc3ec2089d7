/* Prints the fields of each slice as its header has them, for comparison with another reader: header_dump FILE...
 * A line for each slice: the file's number, then name=value, separated by tabs; texts are escaped like those of C. */
#include "input/files/file_header.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static void text(const char *name, const char *value)
{
    printf("\t%s=", name);
    for (const unsigned char *c = (const unsigned char *)(value ? value : ""); *c; c++)
        if (*c < 0x20 || *c >= 0x7F || *c == '\\')
            printf("\\x%02x", *c);
        else
            putchar(*c);
}

static void numbers(const char *name, const double *values, int n)
{
    printf("\t%s=", name);
    for (int i = 0; i < n; i++)
        printf("%s%.17g", i ? " " : "", values[i]);
}

static void whole(const char *name, int value)
{
    printf("\t%s=%d", name, value);
}

static void dump(int file, const CtsSlice *s)
{
    static const char *const identities[CTS_N_IDENTITY] = {
        "PatientID",  "IssuerOfPatientID", "PatientName",        "PatientBirthDate",
        "PatientSex", "StudyInstanceUID",  "FrameOfReferenceUID"};
    const double spacing[2] = {s->row_spacing_mm, s->column_spacing_mm};
    printf("%d", file);
    text("SOPInstanceUID", s->sop_uid);
    text("SeriesInstanceUID", s->series_uid);
    text("SOPClassUID", s->class_uid);
    for (int i = 0; i < CTS_N_IDENTITY; i++)
        text(identities[i], s->identity[i]);
    text("Modality", s->modality);
    text("SeriesDescription", s->description);
    text("SpecificCharacterSet", s->charset);
    text("StudyDate", s->study_date);
    text("ConvolutionKernel", s->kernel);
    whole("frame", s->frame);
    whole("SeriesNumber", s->series_number);
    if (s->has_instance)
        whole("InstanceNumber", s->instance_number);
    if (!isnan(s->volume_number[CTS_ACQUISITION_NUMBER]))
        whole("AcquisitionNumber", (int)s->volume_number[CTS_ACQUISITION_NUMBER]);
    if (!isnan(s->volume_number[CTS_VOLTAGE]))
        numbers("KVP", &s->volume_number[CTS_VOLTAGE], 1);
    if (!isnan(s->volume_number[CTS_TRIGGER_TIME]))
        numbers("TriggerTime", &s->volume_number[CTS_TRIGGER_TIME], 1);
    numbers("SliceThickness", &s->thickness_mm, 1);
    if (s->rows)
        whole("Rows", s->rows);
    if (s->columns)
        whole("Columns", s->columns);
    if (!s->fault) {
        whole("BitsAllocated", s->bits_allocated);
        whole("BitsStored", s->bits_stored);
        whole("HighBit", s->high_bit);
        whole("PixelRepresentation", s->is_signed);
        numbers("RescaleSlope", &s->slope, 1);
        numbers("RescaleIntercept", &s->intercept, 1);
        numbers("ImagePositionPatient", s->position_lps, 3);
        numbers("PixelSpacing", spacing, 2);
        numbers("row", s->row_lps, 3);
        printf("\tPixelData=%llu", (unsigned long long)s->pixel_offset);
    }
    putchar('\n');
}

int main(int argc, char **argv)
{
    CtsHeaderReader reader = {0};
    CtsFile *const files = calloc((size_t)argc, sizeof *files);
    CtsHeaderRead *const read = calloc((size_t)argc, sizeof *read);
    for (int i = 1; i < argc; i++)
        files[i].path = argv[i];
    cts_file_headers_read(files + 1, (size_t)argc - 1, CTS_NIFTI_FORM_AUTO, &reader, 1, read + 1);
    for (int i = 1; i < argc; i++) {
        for (int k = 0; k < read[i].object.n_slices; k++)
            dump(i - 1, read[i].object.slices[k]);
        cts_object_free(&read[i].object);
    }
    cts_header_reader_free(&reader);
    free(read);
    free(files);
    return 0;
}
