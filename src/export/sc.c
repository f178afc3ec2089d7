/* Secondary captures: what the object says of itself. The encoding is dicom/dcm_sc's. */
#include "export/format.h"

#include "base/cpu.h"
#include "base/hash.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "dicom/dcm_sc.h"
#include "export/date.h"
#include "export/uid.h"
#include "image/describe.h"
#include "image/samples.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Lengths are 32 bits in DICOM, and the largest value means "undefined". */
static const uint64_t max_pixel_bytes = 0xfffffffe;

/* How each mode is called: value 3 of ImageType, the series' name, and a code of CID 7203. */
static const struct {
    const char *image_type, *short_name, *long_name, *code, *meaning;
} mode_terms[CTS_N_MODES] = {
    [CTS_MODE_COMPOSITE] = {"VOLUME_RENDER", "VR", "Volume rendering by splatting", "113074", "Volume rendering"},
    [CTS_MODE_MIP] = {"MAX_IP", "MIP", "Maximum intensity projection", "113078", "Maximum intensity projection"},
    [CTS_MODE_MINIP] = {"MIN_IP", "MinIP", "Minimum intensity projection", "113079", "Minimum intensity projection"},
    [CTS_MODE_AVERAGE] = {"AVERAGE_IP", "Average", "Average intensity projection", "113074", "Volume rendering"},
};

static const char *const syntax_uids[] = {
    [CTS_SC_NONE] = "1.2.840.10008.1.2.1",
    [CTS_SC_RLE] = "1.2.840.10008.1.2.5",
    [CTS_SC_JPEG_LOSSLESS] = "1.2.840.10008.1.2.4.70",
};

/* Pixels wait in a file of their own until the last has come: what the header says depends on them. */
typedef struct ScWriter {
    CtsScSource facts;
    CtsTempFile *pixels; /* frame after frame, as the object will hold them */
    uint64_t pixel_bytes;
    CtsHash *hash; /* of the frames' views and pixels */
    uint8_t *rows; /* samples on their way to the file */
    int max_rows;  /* that rows has room for */
} ScWriter;

/* The texts and names that the object points to. */
typedef struct ScTexts {
    char study_uid[65], series_uid[65], sop_uid[65], pseudonym[65];
    char date[9], time[7];
    char series_description[65], derivation[400], patient_orientation[17];
} ScTexts;

CtsStatus cts_sc_check(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    const CtsSeries *source = settings->source;
    if (!source) /* not known yet: outputs are checked before the input is read */
        return CTS_OK;
    if (source->n_slices < 1)
        return cts_fail(err, CTS_ERR_USAGE, "%s: the series it is made of has no slices", path);
    const char *first = source->slices[0].path;
    const bool in_memory = source->slices[0].memory != NULL; /* out of an archive */
    if (!first || (!in_memory && access(first, R_OK)))
        return cts_fail(err, CTS_ERR_READ, "%s: cannot be read any more, and a secondary capture needs its header",
                        first ? first : path);
    return CTS_OK;
}

/* Own texts stay ASCII, whatever character set the source's attributes have, and a backslash would part values. */
static void ascii_copy(char *to, size_t size, const char *from)
{
    size_t n = 0;
    for (; *from && n + 1 < size; from++)
        if ((*from & 0xc0) != 0x80) /* one mark for a UTF-8 character, not one a byte */
            to[n++] = (unsigned char)*from < 0x20 || (unsigned char)*from > 0x7e || *from == '\\' ? '_' : *from;
    to[n] = 0;
}

static void describe(const CtsExportJob *job, ScTexts *texts)
{
    const CtsPictureInfo *info = &job->head.info;
    char preset[sizeof info->preset], view[80], scale[32], step[80] = "";
    ascii_copy(preset, sizeof preset, info->preset);
    cts_describe_view(info, view, sizeof view);
    cts_describe_number(info->mm_per_pixel, 6, scale, sizeof scale);
    if (job->head.n_frames > 1) {
        char degrees[32];
        cts_describe_number(360.0 / job->head.n_frames, 6, degrees, sizeof degrees);
        snprintf(step, sizeof step, "%d views %s degrees apart from ", job->head.n_frames, degrees);
    }
    snprintf(texts->series_description, sizeof texts->series_description, "%s %.40s (ctsplat)",
             mode_terms[info->mode].short_name, preset);
    snprintf(texts->derivation, sizeof texts->derivation,
             "%s, preset %s, orthographic, %sview %s, %s mm per pixel, ctsplat %s, not for diagnostic use",
             mode_terms[info->mode].long_name, preset, step, view, scale, CTS_VERSION);
    if (job->head.n_frames == 1) {
        char right[4], down[4];
        const double to_feet[3] = {-info->up_lps[0], -info->up_lps[1], -info->up_lps[2]};
        cts_describe_direction(info->right_lps, right);
        cts_describe_direction(to_feet, down);
        snprintf(texts->patient_orientation, sizeof texts->patient_orientation, "%s\\%s", right, down);
    }
}

/* Views of one preset share a series, in an order that does not depend on which of them are made. */
static int instance_number(const CtsExportJob *job)
{
    static const char *const names[] = {"anterior", "left", "posterior", "right", "head", "feet"};
    const CtsPictureInfo *info = &job->head.info;
    char view[80];
    cts_describe_view(info, view, sizeof view);
    for (int i = 0; i < 6; i++)
        if (strcmp(view, names[i]) == 0)
            return i + 1;
    double azimuth_deg = fmod(info->azimuth_deg, 360);
    if (azimuth_deg < 0)
        azimuth_deg += 360;
    return 10 + (int)((info->elevation_deg + 90) * 10 + 0.5) * 3600 + (int)(azimuth_deg * 10 + 0.5);
}

static CtsStatus start_hash(CtsHash **hash, const char *purpose, const CtsSeries *source, CtsError *err)
{
    const CtsStatus st = cts_hash_start(hash, err);
    if (st)
        return st;
    cts_hash_text(*hash, "ctsplat");
    cts_hash_text(*hash, purpose);
    cts_hash_text(*hash, source ? source->uid : "");
    for (int i = 0; source && i < source->n_slices; i++)
        cts_hash_text(*hash, source->slices[i].sop_uid);
    return CTS_OK;
}

static CtsStatus finish_uid(CtsHash **hash, char uid[65], CtsError *err)
{
    uint8_t digest[CTS_DIGEST_BYTES];
    const CtsStatus st = cts_hash_finish(hash, digest, err);
    if (!st)
        cts_uid_from_digest(digest, uid);
    return st;
}

/* The study the picture joins: the source's, or another one for all pictures of that study when identity goes. */
static CtsStatus choose_study(const CtsExportJob *job, const CtsScSource *facts, ScTexts *texts, CtsError *err)
{
    CtsHash *hash;
    uint8_t digest[CTS_DIGEST_BYTES];
    const bool known = facts->study_uid[0];
    snprintf(texts->study_uid, sizeof texts->study_uid, "%s", facts->study_uid);
    if (known && !job->settings.deidentify)
        return CTS_OK;
    CtsStatus st = start_hash(&hash, "study", known ? NULL : job->settings.source, err);
    if (st)
        return st;
    cts_hash_text(hash, facts->study_uid);
    if ((st = finish_uid(&hash, texts->study_uid, err)) || !job->settings.deidentify ||
        (st = start_hash(&hash, "patient", NULL, err)))
        return st;
    cts_hash_text(hash, texts->study_uid);
    if ((st = cts_hash_finish(&hash, digest, err)))
        return st;
    snprintf(texts->pseudonym, sizeof texts->pseudonym, "ANON-");
    for (int i = 0; i < 8; i++)
        snprintf(texts->pseudonym + 5 + 2 * i, 3, "%02X", digest[i]);
    return CTS_OK;
}

/* UIDs from all that makes the object what it is: the same input gives the same UIDs, another picture another one. */
static CtsStatus choose_uids(CtsExportJob *job, const CtsScObject *object, ScTexts *texts, CtsError *err)
{
    ScWriter *w = job->state;
    CtsHash *hash;
    char text[160];
    uint8_t digest[CTS_DIGEST_BYTES];
    CtsStatus st = cts_hash_finish(&w->hash, digest, err);
    if (st)
        return st;
    if (job->settings.new_uids)
        return (st = cts_uid_random(texts->series_uid, err)) ? st : cts_uid_random(texts->sop_uid, err);
    if ((st = start_hash(&hash, "series", job->settings.source, err)))
        return st;
    snprintf(text, sizeof text, "%d %d", job->settings.deidentify, job->head.n_frames);
    cts_hash_text(hash, text);
    cts_hash_text(hash, texts->series_description);
    cts_hash_text(hash, CTS_VERSION);
    if ((st = finish_uid(&hash, texts->series_uid, err)) ||
        (st = start_hash(&hash, "instance", job->settings.source, err)))
        return st;
    cts_hash_text(hash, texts->series_uid);
    cts_hash_text(hash, texts->derivation);
    snprintf(text, sizeof text, "%dx%d %d", object->width, object->height, object->grey);
    cts_hash_text(hash, text);
    cts_hash_bytes(hash, digest, sizeof digest);
    return finish_uid(&hash, texts->sop_uid, err);
}

static const CtsSlice *lossy_slice(const CtsSeries *source)
{
    for (int i = 0; i < source->n_slices; i++)
        if (source->slices[i].odd & CTS_ODD_LOSSY)
            return &source->slices[i];
    return NULL;
}

static void warn(const CtsExportJob *job, const CtsScSource *facts, bool recognizable)
{
    if (facts->burned_in)
        cts_report_finding(job->report, "burned_in_annotation", CTS_WARNING,
                           "the source says that text is burned into its pixels; it may show in the picture");
    if (recognizable && job->settings.deidentify)
        cts_report_finding(job->report, "recognizable_features", CTS_WARNING,
                           "the preset shows skin: a face can tell who this is, whatever the header says");
}

static CtsStatus sink(void *context, const void *bytes, size_t n, CtsError *err)
{
    return cts_temp_write(context, bytes, n, err);
}

static size_t row_bytes_of(int width, bool grey)
{
    return (size_t)width * (grey ? 2 : 3);
}

CtsStatus cts_sc_check_size(const char *path, int width, int height, int n_frames, bool grey,
                            const CtsExportSettings *settings, CtsError *err)
{
    const uint64_t bytes = (uint64_t)row_bytes_of(width, grey) * (uint64_t)height * (uint64_t)n_frames;
    if (bytes > max_pixel_bytes)
        return cts_fail(err, CTS_ERR_USAGE,
                        "%s: %d pictures of %dx%d are more than a DICOM object can hold, 4 GiB (fewer views or a "
                        "smaller --size)",
                        path, n_frames, width, height);
    /* DCMTK encodes in memory, all frames at a time: what goes in, what comes out, and as much again at times. */
    const uint64_t memory = cts_memory_available();
    if (settings->compression != CTS_SC_NONE && memory > 0 && 3 * bytes > memory)
        return cts_fail(err, CTS_ERR_USAGE,
                        "%s: to compress %d pictures of %dx%d takes %.1f GB of memory, more than there is (--compress "
                        "none needs little)",
                        path, n_frames, width, height, 3 * (double)bytes / 1e9);
    return CTS_OK;
}

CtsStatus cts_sc_begin(CtsExportJob *job, CtsError *err)
{
    enum { ROWS_BYTES = 4 << 20 };
    const CtsExportHead *head = &job->head;
    const size_t row_bytes = row_bytes_of(head->width, head->grey);
    CtsStatus st;
    if (!job->settings.source)
        return cts_fail(err, CTS_ERR_USAGE, "%s: a secondary capture needs the series it was made of", job->path);
    ScWriter *w = job->state = calloc(1, sizeof *w);
    if (!w)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", job->path);
    w->max_rows = ROWS_BYTES / row_bytes > 0 ? (int)(ROWS_BYTES / row_bytes) : 1;
    if ((st = cts_dcm_sc_source(&job->settings.source->slices[0], &w->facts, err)) ||
        (st = cts_alloc_array(&w->rows, (size_t)w->max_rows * row_bytes, err)) ||
        (st = start_hash(&w->hash, "pixels", NULL, err)))
        return st;
    return cts_temp_open(&w->pixels, job->path, err);
}

typedef struct Samples {
    const CtsPicture *band;
    int first_row; /* of the band */
    bool grey;
    uint8_t *rows;
    size_t row_bytes;
} Samples;

static void sample_rows(void *context, int worker, size_t first, size_t end)
{
    const Samples *const s = context;
    (void)worker;
    for (size_t i = first; i < end; i++) {
        uint8_t *to = s->rows + i * s->row_bytes;
        if (s->grey)
            cts_samples_row16(s->band, s->first_row + (int)i, 1, (uint16_t *)(void *)to);
        else
            cts_samples_row8(s->band, s->first_row + (int)i, to);
    }
}

CtsStatus cts_sc_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    ScWriter *w = job->state;
    const bool grey = job->head.grey;
    const size_t row_bytes = row_bytes_of(job->head.width, job->head.grey);
    CtsStatus st = CTS_OK;
    if (band->first_row == 0) {
        char view[80];
        cts_describe_view(&band->info, view, sizeof view);
        cts_hash_text(w->hash, view);
    }
    for (int y = 0; y < band->height && !st; y += w->max_rows) {
        const int left = band->height - y, n = left < w->max_rows ? left : w->max_rows;
        Samples samples = {band, y, grey, w->rows, row_bytes};
        cts_parallel(cts_threads(job->settings.n_threads), (size_t)n, 0, sample_rows, &samples);
        cts_hash_bytes(w->hash, w->rows, (size_t)n * row_bytes);
        st = cts_temp_write(w->pixels, w->rows, (size_t)n * row_bytes, err);
        w->pixel_bytes += (uint64_t)n * row_bytes;
    }
    return st;
}

/* Values are of even length. */
static CtsStatus pad(ScWriter *w, CtsError *err)
{
    const CtsStatus st = w->pixel_bytes % 2 ? cts_temp_write(w->pixels, "", 1, err) : CTS_OK;
    w->pixel_bytes += w->pixel_bytes % 2;
    return st;
}

CtsStatus cts_sc_finish(CtsExportJob *job, CtsError *err)
{
    ScWriter *w = job->state;
    const CtsExportHead *head = &job->head;
    const CtsSeries *source = job->settings.source;
    const CtsMode mode = head->info.mode;
    ScTexts texts = {0};
    struct tm date;
    CtsStatus st = pad(w, err);
    if (st)
        return st;
    CtsScObject object = {.width = head->width, .height = head->height, .n_frames = head->n_frames, .grey = head->grey};
    object.pixel_path = cts_temp_path(w->pixels);
    object.pixel_bytes = w->pixel_bytes;
    describe(job, &texts);
    if ((st = choose_study(job, &w->facts, &texts, err)) || (st = choose_uids(job, &object, &texts, err)))
        return st;
    cts_date_now(&date);
    strftime(texts.date, sizeof texts.date, "%Y%m%d", &date);
    strftime(texts.time, sizeof texts.time, "%H%M%S", &date);
    object.syntax_uid = syntax_uids[job->settings.compression];
    object.study_uid = texts.study_uid;
    object.series_uid = texts.series_uid;
    object.sop_uid = texts.sop_uid;
    object.series_number =
        w->facts.series_number > 0 && w->facts.series_number < 1000000 ? 9000 + w->facts.series_number : 9000;
    object.instance_number = job->head.n_frames > 1 ? 1 : instance_number(job);
    object.date = texts.date;
    object.time = texts.time;
    object.version = CTS_VERSION;
    object.image_type = mode_terms[mode].image_type;
    object.series_description = texts.series_description;
    object.derivation = texts.derivation;
    object.derivation_code = mode_terms[mode].code;
    object.derivation_meaning = mode_terms[mode].meaning;
    object.patient_orientation = texts.patient_orientation;
    object.burned_in = w->facts.burned_in;
    object.recognizable = job->head.info.shows_skin;
    object.source = source;
    object.source_class_uid = w->facts.sop_class_uid;
    object.lossy = lossy_slice(source);
    object.pseudonym = texts.pseudonym[0] ? texts.pseudonym : NULL;
    warn(job, &w->facts, object.recognizable);
    return cts_dcm_sc_write(&object, sink, job->temp, err);
}

void cts_sc_close(CtsExportJob *job)
{
    ScWriter *w = job->state;
    uint8_t digest[CTS_DIGEST_BYTES];
    if (!w)
        return;
    if (w->hash)
        cts_hash_finish(&w->hash, digest, NULL);
    cts_temp_discard(&w->pixels);
    cts_free(&w->rows);
    free(w);
}

CtsStatus cts_sc_read(const char *path, CtsPicture **picture, CtsError *err)
{
    CtsScPixels pixels = {0};
    *picture = NULL;
    CtsStatus st = cts_dcm_sc_read(path, &pixels, err);
    if (st || (st = cts_picture_new(picture, pixels.width, pixels.height, pixels.n_samples == 1 ? 1 : 4, err)))
        goto end;
    CtsPicture *p = *picture;
    const size_t n = (size_t)p->width * p->height;
    p->has_alpha = false;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < p->n_channels; c++)
            p->pixels[i * p->n_channels + c] =
                c == 3 ? 1 : (float)((double)pixels.samples[i * pixels.n_samples + c] / pixels.largest);
end:
    cts_free(&pixels.samples);
    return st;
}
