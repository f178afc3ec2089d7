#include "output/export/sc_texts.h"

#include "base/enum_table.h"
#include "ctsplat/preset.h"
#include "output/image/describe.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

enum { UUID_BYTES = 16, MAX_DECIMALS = 40 };

/* The first bytes as a UUID (RFC 9562), printed as one decimal number. Version 8, of a digest, is reproducible and
 * without information on the hashed data; version 4 is random. */
static void format_uuid(const uint8_t bytes[UUID_BYTES], unsigned version, char uid[65])
{
    uint8_t uuid[UUID_BYTES];
    memcpy(uuid, bytes, sizeof uuid);
    uuid[6] = (uint8_t)((uuid[6] & 0x0f) | version << 4);
    uuid[8] = (uint8_t)((uuid[8] & 0x3f) | 0x80);
    unsigned __int128 number = 0;
    for (int i = 0; i < UUID_BYTES; i++)
        number = number << 8 | uuid[i];
    char digits[MAX_DECIMALS + 1] = "";
    char *p = digits + MAX_DECIMALS;
    for (*p = 0; number > 0; number /= 10)
        *--p = (char)('0' + (int)(number % 10));
    snprintf(uid, 65, "2.25.%s", p);
}

CtsStatus cts_uid_keyed(const CtsKey *key, const char *purpose, const char *uid, char keyed[65], CtsError *err)
{
    CtsHash *hash = cts_hash_start(key);
    cts_hash_text(hash, "ctsplat");
    cts_hash_text(hash, purpose);
    cts_hash_text(hash, uid);
    return cts_sc_hash_finish(&hash, keyed, err);
}

static CtsStatus uid_random(char uid[65], CtsError *err)
{
    uint8_t bytes[UUID_BYTES];
    if (TEMP_FAILURE_RETRY(getrandom(bytes, sizeof bytes, 0)) != UUID_BYTES)
        return cts_fail(err, CTS_ERR_INTERNAL, "the system gave no random numbers for a UID");
    format_uuid(bytes, 4, uid);
    return CTS_OK;
}

/* Terms for each mode: value 3 of ImageType, the series description, and a code of CID 7203. */
typedef struct ModeTerms {
    const char *image_type, *short_name, *long_name, *code, *meaning;
} ModeTerms;

static CTS_ENUM_TABLE(
    ModeTerms, mode_terms,
    CTS_N_MODES, [CTS_MODE_COMPOSITE] = {"VOLUME_RENDER", "VR", "Volume rendering", "113074", "Volume rendering"},
    [CTS_MODE_MIP] = {"MAX_IP", "MIP", "Maximum intensity projection", "113078", "Maximum intensity projection"},
    [CTS_MODE_MINIP] = {"MIN_IP", "MinIP", "Minimum intensity projection", "113079", "Minimum intensity projection"},
    [CTS_MODE_AVERAGE] = {"AVERAGE_IP", "Average", "Average intensity projection", "113074", "Volume rendering"});

static const ModeTerms section_terms = {"MPR", "MPR", "Multiplanar reformatting", "113072", "Multiplanar reformatting"};

/* The side that faces the camera, in SNOMED CT, in the order of a preset's views in its series; the last row for all
 * others. */
static const struct {
    const char *view;
    CtsScCode code;
} view_codes[] = {
    {"anterior", {"255549009", "SCT", "Anterior"}},
    {"left", {"7771000", "SCT", "Left"}},
    {"posterior", {"255551008", "SCT", "Posterior"}},
    {"right", {"24028007", "SCT", "Right"}},
    {"head", {"264217000", "SCT", "Superior"}},
    {"feet", {"261089000", "SCT", "Inferior"}},
    {"", {"399182000", "SCT", "Oblique"}},
};

static int place_of_view(const CtsPictureInfo *info)
{
    const CtsPhrase view = cts_describe_view(info);
    int i = 0;
    while (*view_codes[i].view && strcmp(view.text, view_codes[i].view) != 0)
        i++;
    return i;
}

/* Own texts are ASCII, valid in every character set of the source; a backslash would separate values. */
static void ascii_copy(char *to, size_t size, const char *from)
{
    size_t n = 0;
    for (; *from && n + 1 < size; from++)
        if ((*from & 0xc0) != 0x80) /* one mark for a UTF-8 character, not one a byte */
            to[n++] = (unsigned char)*from < 0x20 || (unsigned char)*from > 0x7e || *from == '\\' ? '_' : *from;
    to[n] = 0;
}

/* The picture's error as known when the object is written: estimated, and measured. */
static void describe_errors(const CtsExportJob *job, char *text, size_t size)
{
    const CtsVerified *v = job->report ? &job->report->verified : NULL;
    char estimate[CTS_ERROR_TEXT], rmse[CTS_ERROR_TEXT];
    int n = 0;
    *text = 0;
    if (job->rmse >= 0) {
        cts_describe_error(job->rmse, estimate);
        n = snprintf(text, size, ", error estimate %s", estimate);
    }
    if (!v || v->pixels == 0)
        return;
    cts_describe_error(v->rmse, rmse);
    snprintf(text + n, size - (size_t)n, ", error measured at %llu pixels: %s, largest %s/255",
             (unsigned long long)v->pixels, rmse, cts_describe_number(255 * v->max, 3).text);
}

void cts_sc_texts(const CtsExportJob *job, CtsScTexts *texts)
{
    const CtsPictureInfo *info = &job->head.info;
    const ModeTerms *const terms = info->is_section ? &section_terms : &mode_terms[info->mode];
    const int n_frames = job->head.n_frames;
    char preset[sizeof info->preset], engine[sizeof info->engine], tiles[sizeof info->tiles];
    char step[128] = "", error[160];
    const CtsPhrase view = cts_describe_view(info);
    memset(texts, 0, sizeof *texts);
    texts->image_type = terms->image_type;
    texts->mode = (CtsScCode){terms->code, "DCM", terms->meaning};
    ascii_copy(preset, sizeof preset, info->preset);
    ascii_copy(engine, sizeof engine, info->engine);
    describe_errors(job, error, sizeof error);
    if (n_frames > 1)
        snprintf(step, sizeof step, "%d views %s degrees apart from ", n_frames,
                 cts_describe_number(360.0 / n_frames, 6).text);
    if (job->settings.series_description)
        ascii_copy(texts->series_description, sizeof texts->series_description, job->settings.series_description);
    else
        snprintf(texts->series_description, sizeof texts->series_description, "%.8s %.40s%s", terms->short_name, preset,
                 n_frames > 1 ? ", rotation" : "");
    snprintf(texts->description, sizeof texts->description, "%.8s %.20s %.20s", terms->short_name, preset, view.text);
    texts->view = view_codes[place_of_view(info)].code;
    if (*info->tiles) {
        texts->view = (CtsScCode){0};
        ascii_copy(tiles, sizeof tiles, info->tiles);
        snprintf(texts->derivation, sizeof texts->derivation,
                 "Montage of %s, orthographic%s, ctsplat %s, not for diagnostic use", tiles, error, CTS_VERSION);
        return;
    }
    snprintf(texts->derivation, sizeof texts->derivation,
             "%s by engine %s, preset %s%s%s, orthographic, %sview %s (azimuth %s, elevation %s degrees), %s mm per "
             "pixel%s, "
             "ctsplat %s, not for diagnostic use",
             terms->long_name, engine, preset, info->occlusion > 0 ? ", occlusion " : "",
             info->occlusion > 0 ? cts_describe_number(info->occlusion, 6).text : "", step, view.text,
             cts_describe_number(info->azimuth_deg, 9).text, cts_describe_number(info->elevation_deg, 9).text,
             cts_describe_number(info->mm_per_pixel, 6).text, error, CTS_VERSION);
    if (n_frames == 1) {
        const double to_feet[3] = {-info->up_lps[0], -info->up_lps[1], -info->up_lps[2]};
        snprintf(texts->patient_orientation, sizeof texts->patient_orientation, "%.3s\\%.3s",
                 cts_describe_direction(info->right_lps).text, cts_describe_direction(to_feet).text);
    }
}

CtsHash *cts_sc_hash_start(const CtsKey *key, const char *purpose, const CtsSeries *source)
{
    CtsHash *const hash = cts_hash_start(key);
    cts_hash_text(hash, "ctsplat");
    cts_hash_text(hash, purpose);
    cts_hash_text(hash, source ? source->uid : "");
    for (int i = 0; source && i < source->n_slices; i++)
        cts_hash_text(hash, source->slices[i]->sop_uid);
    return hash;
}

CtsStatus cts_sc_hash_finish(CtsHash **hash, char uid[65], CtsError *err)
{
    uint8_t digest[CTS_DIGEST_BYTES];
    const CtsStatus st = cts_hash_finish(hash, digest, err);
    if (!st)
        format_uuid(digest, 8, uid);
    return st;
}

/* The study of the picture: the source's, or with de-identification a pseudonymous one for all pictures of the
 * study. */
static CtsStatus name_study(const CtsExportJob *job, const CtsKey *key, CtsScNames *names, CtsError *err)
{
    const char *const study_uid = job->settings.source->slices[0]->identity[CTS_STUDY_UID];
    CtsHash *hash;
    uint8_t digest[CTS_DIGEST_BYTES];
    const bool known = *study_uid;
    snprintf(names->study_uid, sizeof names->study_uid, "%s", study_uid);
    if (known && !job->settings.deidentify)
        return CTS_OK;
    CtsStatus st;
    hash = cts_sc_hash_start(key, "study", known ? NULL : job->settings.source);
    cts_hash_text(hash, study_uid);
    if ((st = cts_sc_hash_finish(&hash, names->study_uid, err)) || !job->settings.deidentify)
        return st;
    hash = cts_sc_hash_start(key, "patient", NULL);
    cts_hash_text(hash, names->study_uid);
    if ((st = cts_hash_finish(&hash, digest, err)))
        return st;
    snprintf(names->pseudonym, sizeof names->pseudonym, "ANON-");
    for (int i = 0; i < 8; i++)
        snprintf(names->pseudonym + 5 + 2 * i, 3, "%02X", digest[i]);
    return CTS_OK;
}

/* The source's number, then three digits: a hundred for each mode, 400 more for rotations, and the preset's own number.
 * Presets that are not built in share 81 to 99. */
static CtsStatus number_series(const CtsExportJob *job, CtsScNames *names, CtsError *err)
{
    enum { FIRST_OTHER = 81, N_OTHER = 19 };
    const CtsPictureInfo *info = &job->head.info;
    CtsHash *hash = cts_sc_hash_start(NULL, "series number", NULL);
    uint8_t digest[CTS_DIGEST_BYTES];
    int preset = cts_preset_number(info->preset);
    CtsStatus st;
    cts_hash_text(hash, info->preset);
    if ((st = cts_hash_finish(&hash, digest, err)))
        return st;
    if (!preset)
        preset = FIRST_OTHER + digest[0] % N_OTHER;
    names->series_number =
        cts_sc_series_number(job->settings.source, 100 * (int)info->mode + 400 * (job->head.n_frames > 1) + preset);
    if (job->settings.series_number > 0)
        names->series_number = job->settings.series_number;
    return CTS_OK;
}

int cts_sc_series_number(const CtsSeries *source, int own)
{
    const int most = INT32_MAX / 1000 - 1, number = source->series_number < 0 ? 0 : source->series_number;
    return (number > most ? number % 1000000 : number) * 1000 + own;
}

/* Views of a preset share its series, and have an order of their own. */
static int instance_number(const CtsExportJob *job)
{
    const CtsPictureInfo *info = &job->head.info;
    const int place = place_of_view(info);
    if (*view_codes[place].view)
        return place + 1;
    double azimuth_deg = fmod(info->azimuth_deg, 360);
    if (azimuth_deg < 0)
        azimuth_deg += 360;
    return 10 + (int)((info->elevation_deg + 90) * 10 + 0.5) * 3600 + (int)(azimuth_deg * 10 + 0.5);
}

/* UIDs from all inputs of the object: equal inputs give equal UIDs, different pictures different ones. */
static CtsStatus name_series_and_instance(const CtsExportJob *job, const CtsKey *key, const CtsScTexts *texts,
                                          const uint8_t pixels[CTS_DIGEST_BYTES], CtsScNames *names, CtsError *err)
{
    const CtsExportHead *head = &job->head;
    CtsHash *hash;
    CtsStatus st;
    char text[160];
    if (job->settings.new_uids)
        return (st = uid_random(names->series_uid, err)) ? st : uid_random(names->sop_uid, err);
    hash = cts_sc_hash_start(key, "series", job->settings.source);
    snprintf(text, sizeof text, "%d %d", job->settings.deidentify, names->series_number);
    cts_hash_text(hash, text);
    cts_hash_text(hash, texts->series_description);
    cts_hash_text(hash, CTS_VERSION);
    if ((st = cts_sc_hash_finish(&hash, names->series_uid, err)))
        return st;
    hash = cts_sc_hash_start(key, "instance", job->settings.source);
    cts_hash_text(hash, names->series_uid);
    cts_hash_text(hash, texts->derivation);
    snprintf(text, sizeof text, "%dx%d %d", head->width, head->height, head->grey);
    cts_hash_text(hash, text);
    cts_hash_bytes(hash, pixels, CTS_DIGEST_BYTES);
    return cts_sc_hash_finish(&hash, names->sop_uid, err);
}

CtsStatus cts_sc_names(const CtsExportJob *job, const CtsScTexts *texts, const uint8_t pixels[CTS_DIGEST_BYTES],
                       CtsScNames *names, CtsError *err)
{
    CtsStatus st;
    CtsKey site;
    const CtsKey *const key = job->settings.deidentify ? &site : NULL;
    memset(names, 0, sizeof *names);
    names->instance_number = instance_number(job);
    if ((key && (st = cts_key_load(job->settings.key, true, &site, err))) || (st = name_study(job, key, names, err)) ||
        (st = number_series(job, names, err)))
        return st;
    return name_series_and_instance(job, key, texts, pixels, names, err);
}
