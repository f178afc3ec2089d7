/* Secondary captures: contents of the object. The attributes are in dicom/objects. */
#include "output/export/format.h"

#include "base/hash.h"
#include "base/mem.h"
#include "dicom/objects/objects.h"
#include "output/export/sc_texts.h"
#include "output/image/describe.h"
#include "output/image/samples.h"
#include <string.h>
#include <unistd.h>

/* Lengths are 32 bits in DICOM, and the largest value means "undefined". */
static const uint64_t max_pixel_bytes = 0xfffffffe;

/* NULL: Explicit VR Little Endian, pixels as they are. */
static const char *const syntax_uids[] = {
    [CTS_SC_NONE] = NULL, [CTS_SC_RLE] = "1.2.840.10008.1.2.5", [CTS_SC_JPEG_LOSSLESS] = "1.2.840.10008.1.2.4.70"};
enum { COMPRESSION_MEMORY = 4 }; /* to compress a frame, in bytes per byte of it */
static const char native_uid[] = "1.2.840.10008.1.2.1";

typedef struct ScWriter {
    CtsScSpool spool;
    CtsHash *hash;                       /* of the frames' views and pixels */
    uint16_t *row;                       /* samples for the spool; 8-bit ones as bytes */
    double *azimuth_deg, *elevation_deg; /* of each frame */
    int n_frames;                        /* begun */
} ScWriter;

/* The user's series description must fit its attribute (LO), in any character set of the source. */
static CtsStatus check_description(const char *path, const char *text, CtsError *err)
{
    enum { MAX = 64 };
    for (const char *c = text; *c; c++)
        if ((unsigned char)*c < 0x20 || (unsigned char)*c > 0x7e || *c == '\\')
            return cts_fail(err, CTS_ERR_USAGE, "%s: a series description is ASCII without backslash", path);
    return strlen(text) <= MAX
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE, "%s: a series description has at most %d characters", path, MAX);
}

static CtsStatus check(const char *path, const CtsExportSettings *settings, CtsError *err)
{
    const CtsSeries *source = settings->source;
    if (settings->series_description) {
        const CtsStatus st = check_description(path, settings->series_description, err);
        if (st)
            return st;
    }
    if (!source) /* not known yet: outputs are checked before the input is read */
        return CTS_OK;
    if (source->n_slices < 1)
        return cts_fail(err, CTS_ERR_USAGE, "%s: the series it is made of has no slices", path);
    for (int i = 0; settings->deidentify && i < source->n_slices; i++)
        if (source->slices[i]->deviations & CTS_DEVIATION_BURNED_IN)
            return cts_fail(err, CTS_ERR_PIXELS,
                            "%s: BurnedInAnnotation (0028,0301) says that text stands in the slices' pixels, where "
                            "`deidentify` cannot reach it",
                            path);
    if (source->no_patient)
        return cts_fail(err, CTS_ERR_PIXELS,
                        "%s: a NIfTI file has no patient and no study for a DICOM object (write .png or .exr, or "
                        "render the DICOM series)",
                        path);
    const char *first = source->slices[0]->path;
    const bool in_memory = source->slices[0]->memory != NULL; /* out of an archive */
    if (!first || (!in_memory && access(first, R_OK)))
        return cts_fail(err, CTS_ERR_READ, "%s: can no longer be read, and a secondary capture needs its header",
                        first ? first : path);
    return CTS_OK;
}

static const CtsSlice *lossy_slice(const CtsSeries *source)
{
    for (int i = 0; i < source->n_slices; i++)
        if (source->slices[i]->deviations & CTS_DEVIATION_LOSSY)
            return source->slices[i];
    return NULL;
}

static size_t row_bytes_of(int width, bool grey)
{
    return (size_t)width * (grey ? 2 : 3);
}

static CtsStatus check_size(const char *path, int width, int height, int n_frames, bool grey,
                            const CtsExportSettings *settings, CtsError *err)
{
    const uint64_t frame_bytes = (uint64_t)row_bytes_of(width, grey) * (uint64_t)height;
    const uint64_t memory = cts_memory_available(), needed = frame_bytes * COMPRESSION_MEMORY;
    const bool is_compressed = settings->compression != CTS_SC_NONE;
    if (!is_compressed && frame_bytes * (uint64_t)n_frames > max_pixel_bytes)
        return cts_fail(err, CTS_ERR_USAGE,
                        "%s: %d pictures of %dx%d are more than a DICOM object can hold, 4 GiB (fewer views, a smaller "
                        "picture, or `compress`)",
                        path, n_frames, width, height);
    if (is_compressed && memory > 0 && needed > memory)
        return cts_fail(err, CTS_ERR_USAGE,
                        "%s: to compress a picture of %dx%d takes %.1f GB of memory, more than there is (`compress` "
                        "none needs little)",
                        path, width, height, (double)needed / 1e9);
    return CTS_OK;
}

static CtsStatus begin(CtsExportJob *job, CtsError *err)
{
    const CtsExportHead *head = &job->head;
    CtsStatus st;
    if (!job->settings.source)
        return cts_fail(err, CTS_ERR_USAGE, "%s: a secondary capture needs the series it was made of", job->path);
    ScWriter *w = job->state;
    const CtsScFrame frame = {.width = head->width, .height = head->height, .grey = head->grey};
    if ((st = cts_alloc_bytes((void **)&w->row, row_bytes_of(head->width, head->grey), 1, err)) ||
        (st = cts_alloc_array(&w->azimuth_deg, (size_t)head->n_frames, err)) ||
        (st = cts_alloc_array(&w->elevation_deg, (size_t)head->n_frames, err)))
        return st;
    w->hash = cts_hash_start(NULL);
    return cts_sc_spool_open(&w->spool, job->path, syntax_uids[job->settings.compression], &frame, head->n_frames, err);
}

static CtsStatus add_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err)
{
    ScWriter *w = job->state;
    const size_t row_bytes = row_bytes_of(job->head.width, job->head.grey);
    CtsStatus st = CTS_OK;
    if (band->first_row == 0) {
        cts_hash_text(w->hash, cts_describe_view(&band->info).text);
        w->azimuth_deg[w->n_frames] = band->info.azimuth_deg;
        w->elevation_deg[w->n_frames] = band->info.elevation_deg;
        w->n_frames++;
    }
    for (int y = 0; y < band->height && !st; y++) {
        if (job->head.grey)
            cts_samples_row16(band, y, 1, w->row);
        else
            cts_samples_row8(band, y, 3, (uint8_t *)w->row);
        cts_hash_bytes(w->hash, w->row, row_bytes);
        st = cts_sc_spool_write(&w->spool, w->row, row_bytes, err);
    }
    return st;
}

/* Attributes of the object beside the copied ones. */
static CtsScObject object_of(const CtsExportJob *job, const CtsScTexts *texts, const CtsScNames *names)
{
    const ScWriter *w = job->state;
    const CtsExportHead *head = &job->head;
    const CtsSeries *source = job->settings.source;
    CtsScObject object = {
        .texts = texts,
        .names = names,
        .width = head->width,
        .height = head->height,
        .n_frames = head->n_frames,
        .grey = head->grey,
        .syntax_uid = w->spool.syntax_uid ? w->spool.syntax_uid : native_uid,
        .azimuth_deg = w->azimuth_deg,
        .elevation_deg = w->elevation_deg,
        .mm_per_pixel = head->info.mm_per_pixel,
        .burned_in = (source->slices[0]->deviations & CTS_DEVIATION_BURNED_IN) || head->info.annotated,
        .recognizable = head->info.shows_skin,
        .source = source,
        .labels = job->settings.labels,
        .lossy = lossy_slice(source),
    };
    if (!job->settings.deidentify)
        cts_date_texts(object.date, object.time);
    return object;
}

static CtsStatus finish(CtsExportJob *job, CtsError *err)
{
    ScWriter *w = job->state;
    CtsScTexts texts;
    CtsScNames names;
    uint8_t pixels[CTS_DIGEST_BYTES];
    CtsStatus st;
    cts_sc_texts(job, &texts);
    if ((st = cts_hash_finish(&w->hash, pixels, err)) || (st = cts_sc_names(job, &texts, pixels, &names, err)))
        return st;
    const CtsScObject object = object_of(job, &texts, &names);
    if (object.recognizable && job->settings.deidentify)
        cts_report_diagnostic(job->report, CTS_DIAGNOSTIC_RECOGNIZABLE_FEATURES,
                              "skin may be visible: a face can identify the patient, whatever the header says");
    st = cts_dcm_sc_write(&object, job->temp, err);
    return st ? st : cts_sc_spool_copy(&w->spool, job->temp, err);
}

static void release(CtsExportJob *job)
{
    ScWriter *w = job->state;
    uint8_t digest[CTS_DIGEST_BYTES];
    if (w->hash)
        cts_hash_finish(&w->hash, digest, NULL);
    cts_sc_spool_close(&w->spool);
    cts_free(&w->row);
    cts_free(&w->azimuth_deg);
    cts_free(&w->elevation_deg);
}

static CtsStatus read_back(const char *path, CtsPicture **picture, CtsError *err)
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

const CtsFormat cts_format_dcm = {
    .info = {"dcm", "DICOM secondary capture", "application/dicom", .many_frames = true, .is_object = true,
             .read_back = true},
    .magic_offset = 128,
    .magic = "DICM",
    .check = check,
    .check_size = check_size,
    CTS_FORMAT_STEPS(ScWriter),
    .read = read_back,
};
