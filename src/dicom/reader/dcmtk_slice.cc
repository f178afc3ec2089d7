/* Attributes -> slice record. */
#include "dicom/reader/dcmtk_attributes.hpp"

#include "base/vec3.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <string_view>
#include <vector>

namespace
{

/* The classes of slices and, with frames, of enhanced and legacy converted objects. */
const struct {
    std::string_view uid;
    CtsModality modality;
    CtsObjectKind kind;
} slice_classes[] = {
    {"1.2.840.10008.5.1.4.1.1.2", CTS_MODALITY_CT, CTS_OBJECT_SLICE},
    {"1.2.840.10008.5.1.4.1.1.2.1", CTS_MODALITY_CT, CTS_OBJECT_FRAMES},
    {"1.2.840.10008.5.1.4.1.1.2.2", CTS_MODALITY_CT, CTS_OBJECT_FRAMES},
    {"1.2.840.10008.5.1.4.1.1.4", CTS_MODALITY_MR, CTS_OBJECT_SLICE},
    {"1.2.840.10008.5.1.4.1.1.4.1", CTS_MODALITY_MR, CTS_OBJECT_FRAMES},
    {"1.2.840.10008.5.1.4.1.1.4.4", CTS_MODALITY_MR, CTS_OBJECT_FRAMES},
    {"1.2.840.10008.5.1.4.1.1.128", CTS_MODALITY_PT, CTS_OBJECT_SLICE},
    {"1.2.840.10008.5.1.4.1.1.130", CTS_MODALITY_PT, CTS_OBJECT_FRAMES},
    {"1.2.840.10008.5.1.4.1.1.128.1", CTS_MODALITY_PT, CTS_OBJECT_FRAMES},
};
const char directory_class[] = "1.2.840.10008.1.3.10";
const std::string_view label_classes[] = {"1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7",
                                          "1.2.840.10008.5.1.4.1.1.481.3"};

bool integer(CtsAttributes &item, const DcmTagKey &tag, int *value)
{
    const std::string_view text = cts_attribute_text(item, tag);
    return !text.empty() && cts_parse_is(text.data(), text.size(), value);
}

/* Capitals without blanks, which hand-written headers differ by. */
std::string plain_word(std::string_view text)
{
    std::string word;
    for (const char c : text)
        if (c != ' ')
            word += static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
    return word;
}

/* Classes of images whose pixels equipment does not label with names. */
bool has_plain_class(std::string_view sop_class)
{
    for (const char *plain :
         {UID_ComputedRadiographyImageStorage, UID_DigitalXRayImageStorageForPresentation,
          UID_DigitalXRayImageStorageForProcessing, UID_DigitalMammographyXRayImageStorageForPresentation,
          UID_DigitalMammographyXRayImageStorageForProcessing, UID_DigitalIntraOralXRayImageStorageForPresentation,
          UID_DigitalIntraOralXRayImageStorageForProcessing, UID_XRay3DCraniofacialImageStorage,
          UID_BreastTomosynthesisImageStorage, UID_BreastProjectionXRayImageStorageForPresentation,
          UID_BreastProjectionXRayImageStorageForProcessing, UID_NuclearMedicineImageStorage,
          UID_RETIRED_NuclearMedicineImageStorage, UID_RTImageStorage, UID_EnhancedMRColorImageStorage})
        if (sop_class == plain)
            return true;
    return std::any_of(std::begin(slice_classes), std::end(slice_classes),
                       [=](const auto &row) { return row.uid == sop_class; });
}

/* True for text in the pixels, or where none is excluded: of other classes, and of screens in these, which have colours
 * or are no scanner's own images. */
bool may_name(CtsAttributes &item, std::string_view sop_class)
{
    int samples = 1;
    const std::string_view burned_in = cts_attribute_text(item, DCM_BurnedInAnnotation);
    if (burned_in == "NO" || burned_in == "YES")
        return burned_in == "YES";
    cts_attribute_word(item, DCM_SamplesPerPixel, &samples);
    return !has_plain_class(sop_class) || samples != 1 ||
           (cts_text_value(cts_attribute_text(item, DCM_ImageType), 1) == "SECONDARY" &&
            !cts_attribute_has(item, DCM_ImagePositionPatient) &&
            !cts_attribute_has(item, DCM_PerFrameFunctionalGroupsSequence));
}

CtsObjectKind kind_of(CtsAttributes &item, std::string_view sop_class, CtsModality *modality)
{
    for (const auto &row : slice_classes)
        if (row.uid == sop_class) {
            *modality = row.modality;
            return row.kind;
        }
    if (sop_class == directory_class || cts_attribute_has(item, DCM_DirectoryRecordSequence))
        return CTS_OBJECT_DIRECTORY;
    if (std::find(std::begin(label_classes), std::end(label_classes), sop_class) != std::end(label_classes))
        return CTS_OBJECT_LABELS;
    /* This program's own captures, which come back from a PACS, are pictures of a series that is there. */
    const bool is_image = sop_class != UID_RTDoseStorage &&
                          cts_attribute_text(item, DCM_ManufacturerModelName) != "ctsplat" &&
                          cts_attribute_has(item, DCM_PhotometricInterpretation) && cts_attribute_has(item, DCM_Rows);
    const CtsObjectKind other = is_image ? CTS_OBJECT_IMAGE : CTS_OBJECT_OTHER;
    if (!sop_class.empty() || !cts_attribute_has(item, DCM_ImagePositionPatient))
        return other;
    const std::string word = plain_word(cts_attribute_text(item, DCM_Modality));
    for (int i = 0; i < CTS_N_MODALITIES; i++)
        if (word == cts_modality_names[i]) {
            *modality = static_cast<CtsModality>(i);
            return CTS_OBJECT_SLICE;
        }
    return other;
}

/* True if a value of ImageType means a quantity other than attenuation (PS3.3 C.8.15.2.1.1, C.8.16.1, and
 * manufacturers' own); values that begin with MAT are material images. */
bool names_quantity(std::string_view image_type)
{
    for (const char *word : {"SUBTRACT", "IODINE", "PERFUSION", "MATERIAL", "DENSITY", "ATOMIC_NUM", "EFF_ATOMIC"})
        if (image_type.find(word) != std::string_view::npos)
            return true;
    for (int i = 2; i < 16; i++)
        if (cts_text_value(image_type, i).substr(0, 4) == "MAT_")
            return true;
    return false;
}

/* HU and spellings of it that occur in files (RescaleType is a free text). */
bool is_hu(const std::string &word)
{
    for (const char *name : {"HU", "HOUNSFIELD", "HOUNSFIELDUNIT", "HOUNSFIELDUNITS", "HOUNSFIELDUNIT(S)",
                             "HOUNDSFIELD", "HOUNDSFIELDUNIT", "HOUNDSFIELDUNITS", "HOUNDSFIELDUNIT(S)"})
        if (word == name)
            return true;
    return false;
}

/* Not shared: no two slices have the same. */
const char *keep_uid(CtsStringPool &texts, std::string_view uid)
{
    uid = uid.substr(0, 64);
    const char *kept = cts_string_pool_add(&texts, uid.data(), uid.size());
    if (!kept)
        throw std::bad_alloc();
    return kept;
}

/* Trailing delimiters of a name's components are insignificant (PS3.5 6.2.1.2), as are blanks among them. */
std::string_view without_delimiters(std::string_view text)
{
    const size_t last = text.find_last_not_of("^= ");
    return text.substr(0, last == std::string_view::npos ? 0 : last + 1);
}

const char *scanner_of(CtsAttributes &item, CtsStringPool &texts)
{
    std::string scanner;
    for (const DcmTagKey &tag : {DCM_Manufacturer, DCM_ManufacturerModelName, DCM_DeviceSerialNumber}) {
        const std::string_view text = cts_attribute_text(item, tag);
        if (!text.empty())
            scanner.append(text).append("\\");
    }
    return cts_dcm_share(texts, scanner);
}

/* Those that slices of any modality may have. */
void read_volume_numbers(CtsAttributes &item, CtsSlice *s)
{
    double *const v = s->volume_number;
    v[CTS_ACQUISITION_NUMBER] = cts_attribute_number_or_nan(item, DCM_AcquisitionNumber);
    v[CTS_VOLTAGE] = cts_attribute_number_or_nan(item, DCM_KVP);
    v[CTS_TEMPORAL_POSITION] = cts_attribute_number_or_nan(item, DCM_TemporalPositionIdentifier);
    v[CTS_TRIGGER_TIME] = cts_attribute_number_or_nan(item, DCM_TriggerTime);
    v[CTS_PHASE_PERCENT] = cts_attribute_number_or_nan(item, DCM_NominalPercentageOfCardiacPhase);
    v[CTS_PHASE_DELAY] = cts_attribute_number_or_nan(item, DCM_NominalCardiacTriggerDelayTime);
    v[CTS_CONTENT_TIME] = cts_seconds_of_day(cts_attribute_text(item, DCM_ContentTime));
    v[CTS_ACQUISITION_TIME] = cts_seconds_of_day(cts_attribute_text(item, DCM_AcquisitionTime));
    if (std::isnan(v[CTS_ACQUISITION_TIME]))
        v[CTS_ACQUISITION_TIME] = v[CTS_CONTENT_TIME];
}

void read_identity(CtsAttributes &item, CtsStringPool &texts, CtsSlice *s)
{
    static const DcmTagKey tags[CTS_N_IDENTITY] = {DCM_PatientID,          DCM_IssuerOfPatientID, DCM_PatientName,
                                                   DCM_PatientBirthDate,   DCM_PatientSex,        DCM_StudyInstanceUID,
                                                   DCM_FrameOfReferenceUID};
    for (int i = 0; i < CTS_N_IDENTITY; i++)
        s->identity[i] = cts_dcm_share(texts, without_delimiters(cts_attribute_text(item, tags[i])));
    s->sop_uid = keep_uid(texts, cts_attribute_text(item, DCM_SOPInstanceUID));
    s->series_uid = cts_dcm_share(texts, cts_attribute_text(item, DCM_SeriesInstanceUID), 64);
    s->study_date = cts_dcm_share(texts, cts_attribute_text(item, DCM_StudyDate));
    integer(item, DCM_SeriesNumber, &s->series_number);
    s->modality = cts_dcm_share(texts, cts_attribute_text(item, DCM_Modality), 16);
    s->scanner = scanner_of(item, texts);
    s->description = cts_dcm_share(texts, cts_attribute_text(item, DCM_SeriesDescription));
    s->charset = cts_dcm_share(texts, cts_attribute_text(item, DCM_SpecificCharacterSet));
    s->has_instance = integer(item, DCM_InstanceNumber, &s->instance_number);
    read_volume_numbers(item, s);
    s->kernel = cts_dcm_share(texts, cts_attribute_text(item, DCM_ConvolutionKernel), 64);
    cts_attribute_decimals(item, DCM_SliceThickness, &s->thickness_mm, 1);
    s->contrast = !cts_attribute_text(item, DCM_ContrastBolusAgent).empty() ||
                  cts_attribute_has(item, DCM_ContrastBolusAgentSequence);
    const std::string_view image_type = s->image_type =
        cts_dcm_share(texts, cts_attribute_text(item, DCM_ImageType), 64);
    for (int i = 2; i < 8; i++)
        s->localizer |= cts_text_value(image_type, i) == "LOCALIZER";
    if (s->modality_id == CTS_MODALITY_CT && names_quantity(image_type))
        s->deviations |= CTS_DEVIATION_NOT_HU;
    if (cts_attribute_text(item, DCM_BurnedInAnnotation) == "YES")
        s->deviations |= CTS_DEVIATION_BURNED_IN;
    const bool derived = cts_text_value(image_type, 0) == "DERIVED" || cts_text_value(image_type, 1) == "SECONDARY";
    s->is_report = derived && !s->identity[CTS_FRAME_UID][0] && !cts_attribute_has(item, DCM_ImagePositionPatient) &&
                   !cts_attribute_has(item, DCM_ImageOrientationPatient);
    const std::string_view lossy = cts_attribute_text(item, DCM_LossyImageCompression);
    if (lossy == "01")
        s->deviations |= CTS_DEVIATION_LOSSY;
    s->declared_lossless = lossy == "00";
    s->lossy_ratio = cts_dcm_share(texts, cts_attribute_text(item, DCM_LossyImageCompressionRatio));
    s->lossy_method = cts_dcm_share(texts, cts_attribute_text(item, DCM_LossyImageCompressionMethod));
}

bool read_shape(CtsAttributes &item, CtsSlice *s)
{
    const struct {
        DcmTagKey tag;
        const char *name;
        int *value, low, high;
    } needed[] = {
        /* Matrices of scanners have up to 2048 rows and columns. */
        {DCM_Rows, "Rows", &s->rows, 1, 4096},
        {DCM_Columns, "Columns", &s->columns, 1, 4096},
        {DCM_BitsAllocated, "BitsAllocated", &s->bits_allocated, 8, 16},
        {DCM_BitsStored, "BitsStored", &s->bits_stored, 1, 16},
        {DCM_HighBit, "HighBit", &s->high_bit, 0, 15},
    };
    for (const auto &n : needed) {
        const unsigned group = n.tag.getGroup(), number = n.tag.getElement();
        if (!cts_attribute_word(item, n.tag, n.value)) {
            cts_slice_fault(s, CTS_ERR_PIXELS, "%s (%04x,%04x) is missing or not one number", n.name, group, number);
            return false;
        }
        if (*n.value < n.low || *n.value > n.high) {
            cts_slice_fault(s, CTS_ERR_PIXELS, "%s (%04x,%04x) is %d, and must be %d to %d", n.name, group, number,
                            *n.value, n.low, n.high);
            return false;
        }
    }
    if ((s->bits_allocated != 8 && s->bits_allocated != 16) || s->bits_stored > s->bits_allocated ||
        s->high_bit < s->bits_stored - 1 || s->high_bit >= s->bits_allocated) {
        cts_slice_fault(s, CTS_ERR_PIXELS, "%d bits allocated, %d stored, high bit %d fit no pixel", s->bits_allocated,
                        s->bits_stored, s->high_bit);
        return false;
    }
    int value = 1;
    if (!cts_attribute_word(item, DCM_PixelRepresentation, &value) || value > 1)
        cts_slice_fault(s, CTS_ERR_PIXELS, "PixelRepresentation (0028,0103) is missing or neither 0 nor 1");
    s->is_signed = value == 1;
    return true;
}

/* Before the position, which an object of many frames has for each frame. */
void read_frame_count(CtsAttributes &item, CtsSlice *s)
{
    int frames = 1;
    if (!cts_attribute_has(item, DCM_NumberOfFrames) || cts_attribute_text(item, DCM_NumberOfFrames).empty() ||
        (integer(item, DCM_NumberOfFrames, &frames) && frames == 1))
        return;
    cts_slice_fault(s, CTS_ERR_PIXELS, "NumberOfFrames (0028,0008) is not 1: its SOP class holds one frame");
    s->is_report = false; /* no screen capture */
}

void read_image_kind(CtsAttributes &item, CtsSlice *s)
{
    int samples = 1;
    if (cts_attribute_has(item, DCM_SamplesPerPixel) &&
        (!cts_attribute_word(item, DCM_SamplesPerPixel, &samples) || samples != 1))
        cts_slice_fault(s, CTS_ERR_PIXELS, "SamplesPerPixel (0028,0002) is not 1: a colour picture is no slice");
    const std::string_view photometric = cts_attribute_text(item, DCM_PhotometricInterpretation);
    if (photometric == "MONOCHROME1")
        s->deviations |= CTS_DEVIATION_MONOCHROME1;
    else if (!photometric.empty() && photometric != "MONOCHROME2")
        cts_slice_fault(s, CTS_ERR_PIXELS, "PhotometricInterpretation (0028,0004) is not MONOCHROME2: no slice");
}

void check_rescale(CtsSlice *s)
{
    if (!cts_slice_has_scale(s))
        cts_slice_fault(s, CTS_ERR_PIXELS, "RescaleSlope %g and RescaleIntercept %g give no %s", s->slope, s->intercept,
                        s->modality_id == CTS_MODALITY_CT ? "Hounsfield units" : "values");
    if (s->slope < 0)
        s->deviations |= CTS_DEVIATION_FALLING;
}

void read_rescale_type(CtsAttributes &item, CtsStringPool &texts, CtsSlice *s)
{
    const std::string_view type = cts_attribute_text(item, DCM_RescaleType);
    const std::string word = plain_word(type);
    if (word == "US" || word == "UNSPECIFIED")
        s->deviations |= CTS_DEVIATION_UNSPECIFIED;
    else if (!type.empty() && !is_hu(word))
        s->rescale_type = cts_dcm_share(texts, type, 16);
}

void read_rescale(CtsAttributes &item, CtsStringPool &texts, CtsSlice *s)
{
    if (cts_attribute_has(item, DCM_ModalityLUTSequence)) {
        cts_slice_fault(s, CTS_ERR_PIXELS, "a Modality LUT (0028,3000) stands in for the rescale slope; not supported");
        return;
    }
    s->slope = 1;
    /* MR needs none. */
    if (s->modality_id == CTS_MODALITY_MR && !cts_attribute_has(item, DCM_RescaleSlope) &&
        !cts_attribute_has(item, DCM_RescaleIntercept))
        return;
    if (!cts_attribute_decimals(item, DCM_RescaleSlope, &s->slope, 1) ||
        !cts_attribute_decimals(item, DCM_RescaleIntercept, &s->intercept, 1)) {
        cts_slice_fault(s, CTS_ERR_PIXELS,
                        "RescaleSlope (0028,1053) or RescaleIntercept (0028,1052) is missing or not a number, so its "
                        "pixels are not %s (set the right ones with dcmodify)",
                        s->modality_id == CTS_MODALITY_CT ? "Hounsfield units" : "values");
        return;
    }
    check_rescale(s);
    if (s->modality_id == CTS_MODALITY_CT)
        read_rescale_type(item, texts, s);
}

/* A padding pattern as a stored value; false when no pixel of that many bits can hold it. */
bool stored_value(unsigned pattern, const CtsSlice *s, int *value)
{
    const unsigned mask = (1u << s->bits_stored) - 1, high = pattern & ~mask & 0xFFFFu;
    const bool negative = s->is_signed && (pattern >> (s->bits_stored - 1) & 1);
    if (high != 0 && !(negative && high == (~mask & 0xFFFFu)))
        return false;
    *value = static_cast<int>(pattern & mask) - (negative ? 1 << s->bits_stored : 0);
    return true;
}

void read_padding(CtsAttributes &item, CtsSlice *s)
{
    unsigned value = 0, limit = 0;
    if (!cts_attribute_pattern(item, DCM_PixelPaddingValue, &value))
        return;
    if (!cts_attribute_pattern(item, DCM_PixelPaddingRangeLimit, &limit))
        limit = value;
    int a = 0, b = 0;
    if (stored_value(value, s, &a) && stored_value(limit, s, &b)) {
        s->padding_low = a < b ? a : b;
        s->padding_high = a < b ? b : a;
    } else {
        s->padding_word = static_cast<int>(value);
    }
}

/* (0020,0037), made orthonormal; off by more than 0.001 is odd, by more than 0.01 no reading is right. */
void read_orientation(CtsAttributes &item, CtsSlice *s)
{
    double v[6];
    if (!cts_attribute_decimals(item, DCM_ImageOrientationPatient, v, 6)) {
        cts_slice_fault(s, CTS_ERR_GEOMETRY, "ImageOrientationPatient (0020,0037) is missing or not six numbers");
        return;
    }
    const double *row = v, *column = v + 3;
    const double row_norm = cts_norm3(row), column_norm = cts_norm3(column);
    const double off =
        std::fmax(std::fmax(std::fabs(row_norm - 1), std::fabs(column_norm - 1)), std::fabs(cts_dot3(row, column)));
    if (!(off <= 1e-2)) {
        cts_slice_fault(s, CTS_ERR_GEOMETRY,
                        "ImageOrientationPatient (0020,0037) is not two unit vectors at right angles");
        return;
    }
    if (off > 1e-3)
        s->deviations |= CTS_DEVIATION_ORIENTATION;
    for (int c = 0; c < 3; c++)
        s->row_lps[c] = row[c] / row_norm;
    const double along = cts_dot3(column, s->row_lps);
    for (int c = 0; c < 3; c++)
        s->column_lps[c] = column[c] - along * s->row_lps[c];
    const double norm = cts_norm3(s->column_lps);
    for (int c = 0; c < 3; c++)
        s->column_lps[c] /= norm;
    cts_cross3(s->row_lps, s->column_lps, s->normal_lps);
}

void read_geometry(CtsAttributes &item, CtsSlice *s)
{
    read_orientation(item, s);
    if (!cts_attribute_decimals(item, DCM_ImagePositionPatient, s->position_lps, 3))
        cts_slice_fault(s, CTS_ERR_GEOMETRY, "ImagePositionPatient (0020,0032) is missing or not three numbers");
    for (const double p : s->position_lps)
        if (std::fabs(p) > 1e5) /* a hundred metres */
            cts_slice_fault(s, CTS_ERR_GEOMETRY, "ImagePositionPatient (0020,0032) is %g mm away", std::fabs(p));
    double spacing[2] = {0, 0};
    if (!cts_attribute_decimals(item, DCM_PixelSpacing, spacing, 2))
        cts_slice_fault(s, CTS_ERR_GEOMETRY, "PixelSpacing (0028,0030) is missing or not two numbers");
    else if (!(spacing[0] > 0 && spacing[0] <= 10 && spacing[1] > 0 && spacing[1] <= 10))
        cts_slice_fault(s, CTS_ERR_GEOMETRY,
                        "PixelSpacing (0028,0030) is %g, %g mm, and must be above 0 and at most 10", spacing[0],
                        spacing[1]);
    s->row_spacing_mm = spacing[0];
    s->column_spacing_mm = spacing[1];
}

void read_image(CtsAttributes &item, CtsStringPool &texts, CtsSlice *s)
{
    read_identity(item, texts, s);
    s->deviations = 0; /* of slices */
    cts_attribute_word(item, DCM_Rows, &s->rows);
    cts_attribute_word(item, DCM_Columns, &s->columns);
    cts_slice_fault(s, CTS_ERR_GEOMETRY, "is an image without a place");
}

} // namespace

const char *cts_dcm_share(CtsStringPool &texts, std::string_view text, size_t longest)
{
    const char *shared = cts_string_pool_share(&texts, text.data() ? text.data() : "",
                                               std::min({text.size(), longest, size_t{CTS_MAX_TEXT}}));
    if (!shared)
        throw std::bad_alloc();
    return shared;
}

void cts_dcm_read_slice(CtsAttributes &item, CtsStringPool &texts, CtsSlice *s)
{
    read_identity(item, texts, s);
    read_frame_count(item, s);
    read_geometry(item, s);
    read_image_kind(item, s);
    if (read_shape(item, s))
        read_padding(item, s);
    read_rescale(item, texts, s);
    if (s->modality_id == CTS_MODALITY_MR)
        cts_dcm_read_mr(item, texts, s);
    else if (s->modality_id == CTS_MODALITY_PT)
        cts_dcm_read_pet(item, s);
}

void cts_dcm_read_object(DcmItem &data_set, CtsStringPool *texts, const char *class_uid, CtsObject *object)
{
    const CtsTopLevel top(data_set);
    CtsAttributes item{top};
    const std::string_view own_class = cts_attribute_text(item, DCM_SOPClassUID);
    const std::string_view sop_class = own_class.empty() ? std::string_view(class_uid) : own_class;
    object->kind = kind_of(item, sop_class, &object->modality_id);
    object->class_uid =
        cts_dcm_share(*texts, object->kind == CTS_OBJECT_DIRECTORY ? std::string_view(directory_class) : sop_class, 64);
    object->study_uid = cts_dcm_share(*texts, cts_attribute_text(item, DCM_StudyInstanceUID), 64);
    object->has_number = integer(item, DCM_InstanceNumber, &object->instance_number);
    if (object->kind == CTS_OBJECT_SLICE)
        cts_dcm_read_slice(item, *texts, cts_dcm_add_slice(object));
    if (object->kind == CTS_OBJECT_FRAMES)
        cts_dcm_read_frames(top, *texts, object);
    if (object->kind == CTS_OBJECT_IMAGE)
        read_image(item, *texts, cts_dcm_add_slice(object));
    for (int i = 0; i < object->n_slices && may_name(item, sop_class); i++)
        object->slices[i]->deviations |= CTS_DEVIATION_MAY_NAME;
}
