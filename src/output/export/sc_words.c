#include "output/export/sc_words.h"

#include "base/by_id.h"
#include "output/image/describe.h"
#include <stdio.h>
#include <string.h>

/* How each mode is called: value 3 of ImageType, the series' name, and a code of CID 7203. */
typedef struct ModeTerms {
    const char *image_type, *short_name, *long_name, *code, *meaning;
} ModeTerms;

static CTS_BY_ID(
    ModeTerms, mode_terms,
    CTS_N_MODES, [CTS_MODE_COMPOSITE] = {"VOLUME_RENDER", "VR", "Volume rendering", "113074", "Volume rendering"},
    [CTS_MODE_MIP] = {"MAX_IP", "MIP", "Maximum intensity projection", "113078", "Maximum intensity projection"},
    [CTS_MODE_MINIP] = {"MIN_IP", "MinIP", "Minimum intensity projection", "113079", "Minimum intensity projection"},
    [CTS_MODE_AVERAGE] = {"AVERAGE_IP", "Average", "Average intensity projection", "113074", "Volume rendering"});

/* The side that is looked at, of SNOMED CT; the last for all others. */
static const struct {
    const char *view;
    CtsScCode code;
} view_codes[] = {
    {"anterior", {"255549009", "SCT", "Anterior"}}, {"posterior", {"255551008", "SCT", "Posterior"}},
    {"left", {"7771000", "SCT", "Left"}},           {"right", {"24028007", "SCT", "Right"}},
    {"head", {"264217000", "SCT", "Superior"}},     {"feet", {"261089000", "SCT", "Inferior"}},
    {"", {"399182000", "SCT", "Oblique"}},
};

/* Own texts stay ASCII, whatever character set the source's attributes have, and a backslash would part values. */
static void ascii_copy(char *to, size_t size, const char *from)
{
    size_t n = 0;
    for (; *from && n + 1 < size; from++)
        if ((*from & 0xc0) != 0x80) /* one mark for a UTF-8 character, not one a byte */
            to[n++] = (unsigned char)*from < 0x20 || (unsigned char)*from > 0x7e || *from == '\\' ? '_' : *from;
    to[n] = 0;
}

/* What is known of the picture's error at this time. */
static void describe_error(const CtsExportJob *job, char *text, size_t size)
{
    const CtsVerified *v = job->report ? &job->report->verified : NULL;
    char rmse[32], largest[32];
    *text = 0;
    if (!v || v->pixels == 0)
        return;
    cts_describe_number(v->rmse, 3, rmse, sizeof rmse);
    cts_describe_number(v->max, 3, largest, sizeof largest);
    snprintf(text, size, ", error measured at %llu pixels: rmse %s, largest %s of 1", (unsigned long long)v->pixels,
             rmse, largest);
}

void cts_sc_words(const CtsExportJob *job, CtsScWords *words)
{
    const CtsPictureInfo *info = &job->head.info;
    const int n_frames = job->head.n_frames;
    char preset[sizeof info->preset], engine[sizeof info->engine], view[80], scale[32], angles[2][32], step[100] = "",
                                                                                                       error[120];
    memset(words, 0, sizeof *words);
    words->image_type = mode_terms[info->mode].image_type;
    words->mode = (CtsScCode){mode_terms[info->mode].code, "DCM", mode_terms[info->mode].meaning};
    ascii_copy(preset, sizeof preset, info->preset);
    ascii_copy(engine, sizeof engine, info->engine);
    cts_describe_view(info, view, sizeof view);
    cts_describe_number(info->mm_per_pixel, 6, scale, sizeof scale);
    cts_describe_number(info->azimuth_deg, 9, angles[0], sizeof angles[0]);
    cts_describe_number(info->elevation_deg, 9, angles[1], sizeof angles[1]);
    describe_error(job, error, sizeof error);
    if (n_frames > 1) {
        char degrees[32];
        cts_describe_number(360.0 / n_frames, 6, degrees, sizeof degrees);
        snprintf(step, sizeof step, "%d views %s degrees apart from ", n_frames, degrees);
    }
    if (job->settings.series_description)
        ascii_copy(words->series_description, sizeof words->series_description, job->settings.series_description);
    else
        snprintf(words->series_description, sizeof words->series_description, "%.8s %.40s%s",
                 mode_terms[info->mode].short_name, preset, n_frames > 1 ? ", rotation" : "");
    snprintf(words->description, sizeof words->description, "%.8s %.20s %.20s", mode_terms[info->mode].short_name,
             preset, view);
    snprintf(
        words->derivation, sizeof words->derivation,
        "%s by engine %s, preset %s, orthographic, %sview %s (azimuth %s, elevation %s degrees), %s mm per pixel%s, "
        "ctsplat %s, not for diagnostic use",
        mode_terms[info->mode].long_name, engine, preset, step, view, angles[0], angles[1], scale, error, CTS_VERSION);
    size_t i = 0;
    while (*view_codes[i].view && strcmp(view, view_codes[i].view) != 0)
        i++;
    words->view = view_codes[i].code;
    if (n_frames == 1) {
        char right[4], down[4];
        const double to_feet[3] = {-info->up_lps[0], -info->up_lps[1], -info->up_lps[2]};
        cts_describe_direction(info->right_lps, right);
        cts_describe_direction(to_feet, down);
        snprintf(words->patient_orientation, sizeof words->patient_orientation, "%s\\%s", right, down);
    }
}
