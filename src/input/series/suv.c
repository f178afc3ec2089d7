#include "input/series/series_check.h"

#include "base/text.h"
#include <math.h>

static const double DAY_S = 86400, HOUR_S = 3600, MINUTE_S = 60;
/* Half-lives after which a thousandth of the dose is left, too little for a picture. */
static const double MAX_HALF_LIVES = 10;
/* Least dose in Bq; below, it is in MBq, of which patients get up to a few thousand. */
static const double MIN_DOSE_BQ = 1e4;
/* Largest weight in kg; above, it is in g. */
static const double MAX_WEIGHT_KG = 1000;

static const char *const value_names[CTS_PET_N_SERIES_VALUES] = {
    [CTS_PET_WEIGHT_KG] = "PatientWeight (0010,1030)",
    [CTS_PET_DOSE_BQ] = "RadionuclideTotalDose (0018,1074)",
    [CTS_PET_HALF_LIFE_S] = "RadionuclideHalfLife (0018,1075)",
    [CTS_PET_INJECTION_S] = "RadiopharmaceuticalStartDateTime (0018,1078)",
    [CTS_PET_INJECTION_CLOCK_S] = "RadiopharmaceuticalStartTime (0018,1072)",
    [CTS_PET_N_DRUGS] = "RadiopharmaceuticalInformationSequence (0054,0016)",
    [CTS_PET_SERIES_S] = "SeriesTime (0008,0031)",
    [CTS_PET_GE_SCAN_S] = "the scan's time (0009,xx0D)",
    [CTS_PET_REFERENCE_S] = "DecayCorrectionDateTime (0018,9701)",
    [CTS_PET_PHILIPS_SUV] = "the SUV factor (7053,xx00)",
    [CTS_PET_PHILIPS_BQML] = "the activity factor (7053,xx09)",
};

/* The first value, or other attribute, in which slices differ. */
static const char *difference(const CtsSlice *const *slices, int n)
{
    const CtsPet *const a = &slices[0]->pet;
    for (int k = 1; k < n; k++) {
        const CtsPet *const b = &slices[k]->pet;
        if (a->is_suvbw != b->is_suvbw || a->is_corrected != b->is_corrected || a->decay != b->decay)
            return "SUVType (0054,1006), CorrectedImage (0028,0051) or DecayCorrection (0054,1102)";
        for (int v = 0; v < CTS_PET_N_SERIES_VALUES; v++)
            if (a->value[v] != b->value[v] && !(isnan(a->value[v]) && isnan(b->value[v])))
                return value_names[v];
    }
    return NULL;
}

/* The slice that was acquired first; NULL where a time is missing. */
static const CtsPet *first_acquired(const CtsSlice *const *slices, int n)
{
    const CtsPet *first = &slices[0]->pet;
    for (int k = 0; k < n; k++) {
        const CtsPet *const p = &slices[k]->pet;
        if (isnan(p->value[CTS_PET_ACQUISITION_S]))
            return NULL;
        if (p->value[CTS_PET_ACQUISITION_S] < first->value[CTS_PET_ACQUISITION_S])
            first = p;
    }
    return first;
}

/* Time between the beginning of a frame and the moment of its mean count rate. */
static double mean_decay_s(double duration_s, double half_life_s)
{
    const double rate = log(2) / half_life_s, decay = rate * duration_s;
    return log(decay / -expm1(-decay)) / rate;
}

/* The time to which decay was corrected; NaN with the reason. SeriesTime is the time of processing where it is later
 * than the acquisition. */
static double scan_time(const CtsSlice *const *slices, int n, CtsValueScale *scale)
{
    const CtsPet *const first = first_acquired(slices, n);
    const double *const v = slices[0]->pet.value;
    if (slices[0]->pet.decay == CTS_PET_REFERENCE_TIME) {
        if (isnan(v[CTS_PET_REFERENCE_S]))
            cts_text_append(scale->why, sizeof scale->why, ", ", "%s", value_names[CTS_PET_REFERENCE_S]);
        return v[CTS_PET_REFERENCE_S];
    }
    if (first && v[CTS_PET_SERIES_S] <= first->value[CTS_PET_ACQUISITION_S])
        return v[CTS_PET_SERIES_S];
    if (!isnan(v[CTS_PET_GE_SCAN_S]))
        return v[CTS_PET_GE_SCAN_S];
    if (!first)
        cts_text_append(scale->why, sizeof scale->why, ", ", "AcquisitionTime (0008,0032)");
    else if (!(first->value[CTS_PET_FRAME_REFERENCE_MS] > 0 && first->value[CTS_PET_FRAME_DURATION_MS] > 0))
        cts_text_append(scale->why, sizeof scale->why, ", ",
                        "FrameReferenceTime (0054,1300) and ActualFrameDuration (0018,1242), for a SeriesTime "
                        "(0008,0031) that is not the scan's");
    else
        return first->value[CTS_PET_ACQUISITION_S] - first->value[CTS_PET_FRAME_REFERENCE_MS] / 1000 +
               mean_decay_s(first->value[CTS_PET_FRAME_DURATION_MS] / 1000, v[CTS_PET_HALF_LIFE_S]);
    return NAN;
}

/* A time of the day without a date is the last one before the scan, unless it lies within the hour after it, as of a
 * dynamic scan or a clock that is wrong. */
static double injection_time(const CtsPet *p, double scan_s)
{
    const double *const v = p->value;
    if (p->has_date && !isnan(v[CTS_PET_INJECTION_S]))
        return v[CTS_PET_INJECTION_S];
    const double at = floor(scan_s / DAY_S) * DAY_S + v[CTS_PET_INJECTION_CLOCK_S];
    return at > scan_s + HOUR_S ? at - DAY_S : at <= scan_s + HOUR_S - DAY_S ? at + DAY_S : at;
}

/* From injection to the time of decay correction; NaN with the reason. */
static double decay_time(const CtsSlice *const *slices, int n, CtsValueScale *scale)
{
    const CtsPet *const p = &slices[0]->pet;
    const double half_life_s = p->value[CTS_PET_HALF_LIFE_S];
    if (p->decay == CTS_PET_INJECTION)
        return 0;
    if (!(half_life_s > 0)) {
        cts_text_append(scale->why, sizeof scale->why, ", ", "%s", value_names[CTS_PET_HALF_LIFE_S]);
        return NAN;
    }
    const double scan_s = scan_time(slices, n, scale), decay_s = scan_s - injection_time(p, scan_s);
    if (isnan(p->value[CTS_PET_INJECTION_CLOCK_S]))
        cts_text_append(scale->why, sizeof scale->why, ", ", "RadiopharmaceuticalStartDateTime (0018,1078)");
    else if (fabs(remainder(p->value[CTS_PET_INJECTION_S] - p->value[CTS_PET_INJECTION_CLOCK_S], DAY_S)) > MINUTE_S)
        cts_text_append(scale->why, sizeof scale->why, ", ", "one value, to the minute, of %s and %s",
                        value_names[CTS_PET_INJECTION_S], value_names[CTS_PET_INJECTION_CLOCK_S]);
    else if (decay_s < 0)
        cts_text_append(scale->why, sizeof scale->why, ", ", "an injection (0018,1078) before the scan");
    else if (decay_s > MAX_HALF_LIVES * half_life_s)
        cts_text_append(scale->why, sizeof scale->why, ", ",
                        "an injection (0018,1078) less than %g half-lives before the scan", MAX_HALF_LIVES);
    else
        return decay_s;
    return NAN;
}

static void find_suv(const CtsSlice *const *slices, int n, CtsValueScale *scale)
{
    const CtsPet *const p = &slices[0]->pet;
    const double weight_kg = p->value[CTS_PET_WEIGHT_KG], dose_bq = p->value[CTS_PET_DOSE_BQ];
    if (!p->is_corrected)
        cts_text_append(scale->why, sizeof scale->why, ", ", "ATTN and DECY in CorrectedImage (0028,0051)");
    if (p->decay == CTS_PET_NO_DECAY_CORRECTION)
        cts_text_append(scale->why, sizeof scale->why, ", ", "START or ADMIN in DecayCorrection (0054,1102)");
    if (!(weight_kg > 0 && weight_kg <= MAX_WEIGHT_KG))
        cts_text_append(scale->why, sizeof scale->why, ", ", "%s", value_names[CTS_PET_WEIGHT_KG]);
    if (!(dose_bq >= MIN_DOSE_BQ))
        cts_text_append(scale->why, sizeof scale->why, ", ", "%s in Bq", value_names[CTS_PET_DOSE_BQ]);
    if (p->value[CTS_PET_N_DRUGS] > 1)
        cts_text_append(scale->why, sizeof scale->why, ", ", "a single item of %s", value_names[CTS_PET_N_DRUGS]);
    const double decay_s = decay_time(slices, n, scale);
    if (scale->why[0])
        return;
    const double half_lives = p->decay == CTS_PET_INJECTION ? 0 : decay_s / p->value[CTS_PET_HALF_LIFE_S];
    scale->quantity = CTS_QUANTITY_SUVBW;
    scale->factor *= weight_kg * 1000 / (dose_bq * exp2(-half_lives));
}

/* Values of the unit CNTS by Philips' factors. */
static void convert_counts(const CtsPet *p, CtsValueScale *scale)
{
    if (p->is_corrected && p->value[CTS_PET_PHILIPS_SUV] > 0)
        *scale = (CtsValueScale){CTS_QUANTITY_SUVBW, p->value[CTS_PET_PHILIPS_SUV], ""};
    else if (p->value[CTS_PET_PHILIPS_BQML] > 0)
        *scale = (CtsValueScale){CTS_QUANTITY_BQML, p->value[CTS_PET_PHILIPS_BQML], ""};
    else
        cts_text_append(scale->why, sizeof scale->why, ", ", "factors (7053,xx00) or (7053,xx09) for its counts");
}

CtsValueScale cts_pet_scale(const CtsSlice *const *slices, int n)
{
    const CtsPet *const p = &slices[0]->pet;
    const char *const differing = difference(slices, n);
    CtsValueScale scale = {CTS_QUANTITY_STORED, 1, ""};
    if (p->units == CTS_PET_BQML)
        scale.quantity = CTS_QUANTITY_BQML;
    if (differing)
        cts_text_append(scale.why, sizeof scale.why, ", ", "one value of %s in all slices", differing);
    else if (p->units == CTS_PET_CNTS)
        convert_counts(p, &scale);
    else if (p->units == CTS_PET_GML && p->is_suvbw)
        scale.quantity = CTS_QUANTITY_SUVBW;
    else if (p->units != CTS_PET_BQML)
        cts_text_append(scale.why, sizeof scale.why, ", ",
                        p->units == CTS_PET_GML ? "SUVType (0054,1006) BW" : "Units (0054,1001) BQML, CNTS or GML");
    if (!differing && scale.quantity == CTS_QUANTITY_BQML)
        find_suv(slices, n, &scale);
    return scale;
}
