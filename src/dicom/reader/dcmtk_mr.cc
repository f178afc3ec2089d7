/* Attributes of MR slices by which volumes at the same positions differ. */
#include "dicom/reader/dcmtk_attributes.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>

namespace
{

/* Diffusion weighting in private elements, of scanners that write no standard ones. */
const CtsPrivateTag b_values[] = {
    {0x0019, "SIEMENS MR HEADER", 0x0C}, {0x0043, "GEMS_PARM_01", 0x39}, {0x2001, "Philips Imaging DD 001", 0x03}};
/* Of three numbers in one element, and of three elements. */
const CtsPrivateTag whole_direction = {0x0019, "SIEMENS MR HEADER", 0x0E};
const CtsPrivateTag direction_parts[][3] = {
    {{0x0019, "GEMS_ACQU_01", 0xBB}, {0x0019, "GEMS_ACQU_01", 0xBC}, {0x0019, "GEMS_ACQU_01", 0xBD}},
    {{0x2005, "Philips MR Imaging DD 001", 0xB0},
     {0x2005, "Philips MR Imaging DD 001", 0xB1},
     {0x2005, "Philips MR Imaging DD 001", 0xB2}}};

double b_value(CtsAttributes &item)
{
    /* GE writes four numbers, and adds a multiple of 1e9 to the first. */
    const double ge_multiple = 1e9;
    double b[4] = {cts_attribute_number_or_nan(item, DCM_DiffusionBValue)};
    for (const CtsPrivateTag &of : b_values)
        if (std::isnan(b[0]))
            b[0] = cts_private_numbers(item, of, b, 4) ? std::fmod(b[0], ge_multiple) : static_cast<double>(NAN);
    return b[0];
}

bool direction(CtsAttributes &item, double d[3])
{
    const CtsAttributes nested =
        cts_attribute_item(cts_attribute_item(item, DCM_MRDiffusionSequence), DCM_DiffusionGradientDirectionSequence);
    for (const CtsAttributes *from : {&nested, static_cast<const CtsAttributes *>(&item)})
        if (cts_attribute_numbers(*from, DCM_DiffusionGradientOrientation, d, 3) == 3)
            return true;
    if (cts_private_numbers(item, whole_direction, d, 3) == 3)
        return true;
    for (const auto &of : direction_parts)
        if (cts_private_numbers(item, of[0], d, 1) && cts_private_numbers(item, of[1], d + 1, 1) &&
            cts_private_numbers(item, of[2], d + 2, 1))
            return true;
    return false;
}

/* As text to a thousandth, to which slices of one volume agree. */
const char *direction_text(CtsAttributes &item, CtsStringPool &texts)
{
    char text[64] = "";
    double d[3] = {};
    if (direction(item, d)) {
        for (double &x : d)
            x = std::floor(x * 1000 + 0.5) / 1000 + 0.0;
        std::snprintf(text, sizeof text, "%.6g %.6g %.6g", d[0], d[1], d[2]);
    }
    return cts_dcm_share(texts, text, sizeof text);
}

} // namespace

void cts_dcm_read_mr(CtsAttributes &item, CtsStringPool &texts, CtsSlice *s)
{
    s->volume_number[CTS_ECHO_NUMBER] = cts_attribute_number_or_nan(item, DCM_EchoNumbers);
    s->volume_number[CTS_ECHO_TIME] = cts_attribute_number_or_nan(item, DCM_EchoTime);
    s->volume_number[CTS_INVERSION_TIME] = cts_attribute_number_or_nan(item, DCM_InversionTime);
    s->volume_number[CTS_FLIP_ANGLE] = cts_attribute_number_or_nan(item, DCM_FlipAngle);
    s->volume_number[CTS_B_VALUE] = b_value(item);
    s->volume_word[CTS_GRADIENT_DIRECTION] = direction_text(item, texts);
    s->volume_word[CTS_COMPLEX_COMPONENT] =
        cts_dcm_share(texts, cts_attribute_text(item, DCM_ComplexImageComponent), 16);
    std::string_view type = cts_attribute_text(item, DCM_ImageType);
    for (int i = 0; !cts_text_value(type, i).empty(); i++)
        if (cts_text_value(type, i) == "MOSAIC")
            cts_slice_fault(s, CTS_ERR_PIXELS,
                            "a mosaic of Siemens, many slices in one image (ImageType (0008,0008)): not supported "
                            "(dcm2niix converts it to NIfTI)");
    for (int skipped = 0; skipped < 2; skipped++)
        type = type.find('\\') < type.size() ? type.substr(type.find('\\') + 1) : std::string_view();
    s->volume_word[CTS_IMAGE_TYPE] = cts_dcm_share(texts, type, 64);
}
