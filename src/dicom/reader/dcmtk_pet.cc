/* Attributes of PET slices: those that SUV follow from (PS3.3 C.8.9.4, C.8.22), and those that tell volumes apart. */
#include "dicom/reader/dcmtk_attributes.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string>

namespace
{

const double day_s = 86400;

/* YYYYMMDD, which dots may be within, as days from 1970-01-01; NaN for anything else. */
double day_of(std::string_view text)
{
    OFDate date;
    text = cts_text_value(text, 0);
    if (DcmDate::getOFDateFromString(text.data(), text.size(), date, OFTrue).bad())
        return NAN;
    std::tm day = {};
    day.tm_year = static_cast<int>(date.getYear()) - 1900;
    day.tm_mon = static_cast<int>(date.getMonth()) - 1;
    day.tm_mday = static_cast<int>(date.getDay());
    return static_cast<double>(timegm(&day)) / day_s;
}

/* &ZZXX at the end of a date and time, or the whole of (0008,0201), in seconds; NaN if missing. */
double zone_of(std::string_view text)
{
    double hours = 0;
    text.remove_prefix(std::min(text.size(), text.find_first_of("+-")));
    return DcmTime::getTimeZoneFromString(text.data(), text.size(), hours).good() ? hours * 3600 : NAN;
}

/* YYYYMMDDHHMMSS.FFFFFF&ZZXX as seconds in the data set's time zone, where both zones are known. */
double date_time_of(CtsAttributes &object, std::string_view text)
{
    const double zone = zone_of(text);
    const std::string_view own = text.substr(0, text.find_first_of("+-"));
    const double s = own.size() > 8 ? day_of(own.substr(0, 8)) * day_s + cts_seconds_of_day(own.substr(8)) : NAN;
    const double set_zone = zone_of(cts_attribute_text(object, DCM_TimezoneOffsetFromUTC));
    return std::isnan(zone) || std::isnan(set_zone) ? s : s - zone + set_zone;
}

/* The first date that is there; NaN without any. */
double first_day(CtsAttributes &item, std::initializer_list<DcmTagKey> tags)
{
    double day = NAN;
    for (const DcmTagKey &tag : tags)
        if (std::isnan(day))
            day = day_of(cts_attribute_text(item, tag));
    return day;
}

void read_times(CtsAttributes &item, CtsPet *p)
{
    const double series_day = first_day(item, {DCM_SeriesDate, DCM_AcquisitionDate, DCM_StudyDate});
    const double day = first_day(item, {DCM_AcquisitionDate, DCM_SeriesDate, DCM_StudyDate});
    double *const v = p->value;
    p->has_date = !std::isnan(day);
    v[CTS_PET_SERIES_S] =
        (p->has_date ? series_day : 0) * day_s + cts_seconds_of_day(cts_attribute_text(item, DCM_SeriesTime));
    v[CTS_PET_ACQUISITION_S] =
        (p->has_date ? day : 0) * day_s + cts_seconds_of_day(cts_attribute_text(item, DCM_AcquisitionTime));
    const double of_frame = date_time_of(item, cts_attribute_text(item, DCM_FrameAcquisitionDateTime));
    if (item.is_frame && !std::isnan(of_frame))
        v[CTS_PET_ACQUISITION_S] = of_frame;
    v[CTS_PET_GE_SCAN_S] = date_time_of(item, cts_private_text(item, {0x0009, "GEMS_PETD_01", 0x0D}));
    v[CTS_PET_REFERENCE_S] = date_time_of(item, cts_attribute_text(item, DCM_DecayCorrectionDateTime));
    v[CTS_PET_FRAME_REFERENCE_MS] = cts_attribute_number_or_nan(item, DCM_FrameReferenceTime);
    v[CTS_PET_FRAME_DURATION_MS] = cts_attribute_number_or_nan(item, DCM_ActualFrameDuration);
}

void read_dose(CtsAttributes &item, CtsPet *p)
{
    CtsAttributes drug = cts_attribute_item(item, DCM_RadiopharmaceuticalInformationSequence);
    double *const v = p->value;
    const std::string moment(cts_attribute_text(drug, DCM_RadiopharmaceuticalStartDateTime));
    v[CTS_PET_WEIGHT_KG] = cts_attribute_number_or_nan(item, DCM_PatientWeight);
    v[CTS_PET_DOSE_BQ] = cts_attribute_number_or_nan(drug, DCM_RadionuclideTotalDose);
    v[CTS_PET_HALF_LIFE_S] = cts_attribute_number_or_nan(drug, DCM_RadionuclideHalfLife);
    v[CTS_PET_INJECTION_S] = date_time_of(item, moment);
    v[CTS_PET_INJECTION_CLOCK_S] = cts_seconds_of_day(cts_attribute_text(drug, DCM_RadiopharmaceuticalStartTime));
    if (std::isnan(v[CTS_PET_INJECTION_CLOCK_S]))
        v[CTS_PET_INJECTION_CLOCK_S] = std::fmod(v[CTS_PET_INJECTION_S], day_s);
    v[CTS_PET_N_DRUGS] = drug.groups[0] ? drug.groups[0]->getParent()->getNumberOfValues() : 0;
    v[CTS_PET_PHILIPS_SUV] = v[CTS_PET_PHILIPS_BQML] = NAN;
    cts_private_numbers(item, {0x7053, "Philips PET Private Group", 0x00}, v + CTS_PET_PHILIPS_SUV, 1);
    cts_private_numbers(item, {0x7053, "Philips PET Private Group", 0x09}, v + CTS_PET_PHILIPS_BQML, 1);
}

CtsPetUnits units_of(std::string_view word)
{
    return word == "BQML"   ? CTS_PET_BQML
           : word == "CNTS" ? CTS_PET_CNTS
           : word == "GML"  ? CTS_PET_GML
                            : CTS_PET_OTHER_UNITS;
}

/* Units of an enhanced object: UCUM's of its real world values, whose slope and intercept then hold. */
CtsPetUnits real_world_units(CtsAttributes &item, CtsSlice *s)
{
    CtsAttributes map = cts_attribute_item(item, DCM_RealWorldValueMappingSequence);
    CtsAttributes code = cts_attribute_item(map, DCM_MeasurementUnitsCodeSequence);
    const std::string_view unit = cts_attribute_text(code, DCM_CodeValue);
    const CtsPetUnits units = unit == "Bq/ml" || unit == "Bq/mL"               ? CTS_PET_BQML
                              : unit == "{SUVbw}g/ml" || unit == "g/ml{SUVbw}" ? CTS_PET_GML
                                                                               : CTS_PET_OTHER_UNITS;
    const double slope = cts_attribute_number_or_nan(map, DCM_RealWorldValueSlope),
                 intercept = cts_attribute_number_or_nan(map, DCM_RealWorldValueIntercept);
    if (units == CTS_PET_OTHER_UNITS || !(std::fabs(slope) > 0) || std::isnan(intercept))
        return CTS_PET_OTHER_UNITS;
    s->slope = slope;
    s->intercept = intercept;
    return units;
}

void read_corrections(CtsAttributes &item, CtsPet *p)
{
    bool attenuation = false, decay = false;
    const std::string_view list = cts_attribute_text(item, DCM_CorrectedImage);
    for (int i = 0; !cts_text_value(list, i).empty(); i++) {
        attenuation |= cts_text_value(list, i) == "ATTN";
        decay |= cts_text_value(list, i) == "DECY";
    }
    p->is_corrected = attenuation && decay;
    const std::string_view to = cts_attribute_text(item, DCM_DecayCorrection);
    p->decay = to == "START" ? CTS_PET_SCAN_START : to == "ADMIN" ? CTS_PET_INJECTION : CTS_PET_NO_DECAY_CORRECTION;
    if (p->is_enhanced && to.empty() && cts_attribute_text(item, DCM_DecayCorrected) == "YES") {
        p->decay = CTS_PET_REFERENCE_TIME;
        p->is_corrected = cts_attribute_text(item, DCM_AttenuationCorrected) != "NO";
    }
}

/* Number of the time slice or gate that ImageIndex counts (PS3.3 C.8.9.4.1.9). */
double time_slice(CtsAttributes &item)
{
    int n_slices = 0, index = 0;
    return cts_attribute_word(item, DCM_NumberOfSlices, &n_slices) && n_slices > 0 &&
                   cts_attribute_word(item, DCM_ImageIndex, &index)
               ? (index - 1) / n_slices
               : static_cast<double>(NAN);
}

} // namespace

double cts_seconds_of_day(std::string_view text)
{
    OFTime time;
    text = cts_text_value(text, 0);
    return DcmTime::getOFTimeFromString(text.data(), text.size(), time, OFTrue, 0.0).good() ? time.getTimeInSeconds()
                                                                                            : static_cast<double>(NAN);
}

void cts_dcm_read_pet(CtsAttributes &item, CtsSlice *s)
{
    CtsPet *const p = &s->pet;
    p->is_enhanced = item.is_frame;
    p->units = units_of(cts_attribute_text(item, DCM_Units));
    if (p->is_enhanced && cts_attribute_text(item, DCM_Units).empty())
        p->units = real_world_units(item, s);
    const std::string suv_type(cts_attribute_text(item, DCM_SUVType));
    p->is_suvbw = suv_type.empty() || suv_type == "BW";
    const std::string series_type(cts_attribute_text(item, DCM_SeriesType));
    const std::string_view kind = cts_text_value(series_type, 0);
    p->is_dynamic = kind == "DYNAMIC" || kind == "GATED" || p->is_enhanced;
    p->is_reprojection = cts_text_value(series_type, 1) == "REPROJECTION";
    read_corrections(item, p);
    read_times(item, p);
    read_dose(item, p);
    const double moment = date_time_of(item, cts_attribute_text(item, DCM_FrameReferenceDateTime));
    s->volume_number[CTS_FRAME_REFERENCE_TIME] = std::isnan(moment) ? p->value[CTS_PET_FRAME_REFERENCE_MS] : moment;
    s->volume_number[CTS_TIME_SLICE] = time_slice(item);
}
