/* DICOM Segmentations (PS3.3 A.51, A.93, C.8.20): frames of one segment each, or of all their numbers. */
#include "base/mem.h"
#include "base/vec3.h"
#include "dicom/codec/pixels.h"
#include "dicom/header/pixel_places.h"
#include "input/labels/label_reading.h"
#include <math.h>
#include <string.h>

enum {
    FRAME_UID = 0x00200052,
    POSITION = 0x00200032,
    ORIENTATION = 0x00200037,
    PLANE_POSITION = 0x00209113,
    PLANE_ORIENTATION = 0x00209116,
    PHOTOMETRIC = 0x00280004,
    N_FRAMES = 0x00280008,
    ROWS = 0x00280010,
    COLUMNS = 0x00280011,
    PIXEL_SPACING = 0x00280030,
    PIXEL_MEASURES = 0x00289110,
    SLICE_SPACING = 0x00180088,
    BITS_ALLOCATED = 0x00280100,
    BITS_STORED = 0x00280101,
    PADDING = 0x00280120,
    PALETTE_DESCRIPTOR = 0x00281101, /* red; green and blue follow */
    PALETTE_DATA = 0x00281201,
    TYPE = 0x00620001,
    SEGMENTS = 0x00620002,
    SEGMENT_NUMBER = 0x00620004,
    SEGMENT_LABEL = 0x00620005,
    IDENTIFICATION = 0x0062000A,
    DISPLAY_LAB = 0x0062000D,
    REFERENCED_SEGMENT = 0x0062000B,
    MAXIMUM = 0x0062000E,
    SHARED_GROUPS = 0x52009229,
    FRAME_GROUPS = 0x52009230,
    MAX_FRAMES = 1000000, /* 50 segments in each of 20000 slices; their positions take 24 MB */
    MAX_NUMBERS = 65536   /* of 16 bits */
};

typedef enum Type { BINARY, FRACTIONAL, LABELMAP } Type;

typedef struct Seg {
    const CtsLabelReading *reading;
    const CtsLabelDicom *object;
    Type type;
    int n_frames, rows, columns, bits_allocated, bits_stored, maximum, padding; /* padding -1: none */
    double step_lps[2][3], gap_mm;
    double (*position_lps)[3]; /* of each frame */
    int32_t *segment;          /* of each frame: which of the labels; LABELMAP: 0 */
    int32_t *label_of;         /* label index by number of a segment or pixel; -1: none */
    uint64_t *offset;          /* of encapsulated frames */
    uint64_t *first_bit;       /* of other frames */
    uint16_t *values, *shares; /* of one frame, shares where it is FRACTIONAL; and its bytes: */
    uint8_t *bytes;
    CtsSandbox decoder;
    const int *planes; /* of the frames of a mask that is placed: which each is; NULL: all frames */
    bool has_unlisted_values;
    bool crops;      /* a volume, in a presentation state */
    double held_mm3; /* by labels, in the file */
} Seg;

/* A macro of a frame's own groups, else of the shared ones. */
static CtsElements macro(CtsElements own, CtsElements shared, uint32_t sequence)
{
    const CtsElements item = cts_elements_item(own, sequence);
    return item.at < item.end ? item : cts_elements_item(shared, sequence);
}

/* One channel of the palette (PS3.3 C.7.6.3.1.5, C.7.6.3.1.6), for a pixel's value; 0 to 1. Entries of 8 bits are
 * bytes, or, from some writers, words. */
static bool palette_channel(CtsElements e, uint32_t channel, int value, double *shade)
{
    int about[3];
    CtsElement data;
    if (!cts_elements_shorts(e, PALETTE_DESCRIPTOR + channel, about, 3) || (about[2] != 8 && about[2] != 16) ||
        !cts_elements_get(e, PALETTE_DATA + channel, &data) || data.kind == CTS_VALUE_TEXT)
        return false;
    const uint8_t *const at = data.value.at;
    const ptrdiff_t n_bytes = data.value.end - at;
    const int n = about[0] ? about[0] : 1 << 16;
    const int nearest = value < about[1] ? 0 : value - about[1] < n ? value - about[1] : n - 1;
    const int size = data.kind == CTS_VALUE_NUMBERS ? (int)sizeof(double) : n_bytes >= 2 * (ptrdiff_t)n ? 2 : 1;
    double entry;
    if (n_bytes < size * (ptrdiff_t)n || (about[2] == 16 && size == 1))
        return false;
    if (size == 1)
        entry = at[nearest];
    else if (size == 2)
        entry = at[2 * nearest] | at[2 * nearest + 1] << 8;
    else
        memcpy(&entry, at + (size_t)nearest * sizeof entry, sizeof entry);
    *shade = fmin(fmax(entry / (about[2] == 8 ? 255.0 : 65535.0), 0), 1);
    return true;
}

static bool palette_colour(CtsElements e, int value, double rgb[3])
{
    char photometric[17];
    bool is_known =
        cts_elements_text(e, PHOTOMETRIC, photometric, sizeof photometric) && !strcmp(photometric, "PALETTE COLOR");
    for (uint32_t c = 0; c < 3 && is_known; c++)
        is_known = palette_channel(e, c, value, &rgb[c]);
    return is_known;
}

static CtsStatus read_segments(Seg *s, CtsError *err)
{
    CtsElements sequence = cts_elements_find(s->object->head.elements, SEGMENTS), item;
    CtsLabels *const labels = s->reading->labels;
    while (cts_items_next(&sequence, &item)) {
        int number;
        char name[512];
        if (!cts_elements_integer(item, SEGMENT_NUMBER, &number) || number < 0 || number >= MAX_NUMBERS)
            return cts_fail(err, CTS_ERR_READ, "a segment has no number");
        if (s->label_of[number] >= 0)
            return cts_fail(err, CTS_ERR_READ, "two segments have the number %d", number);
        if (number == 0 && s->type == LABELMAP)
            continue; /* the background */
        cts_label_dicom_text(s->object, item, SEGMENT_LABEL, name, sizeof name);
        const CtsStatus st = cts_labels_add(labels, s->reading->file, number, name, CTS_LABEL_SEG, err);
        if (st)
            return st;
        labels->items[labels->n - 1].object = s->crops ? labels->n_objects + 1 : 0;
        int lab[3];
        if (cts_elements_shorts(item, DISPLAY_LAB, lab, 3))
            cts_label_take_lab(&labels->items[labels->n - 1], lab);
        else if (s->type == LABELMAP)
            labels->items[labels->n - 1].coloured =
                palette_colour(s->object->head.elements, number, labels->items[labels->n - 1].rgb);
        s->label_of[number] = (int32_t)labels->n - 1;
    }
    return CTS_OK;
}

static CtsStatus read_type(Seg *s, CtsError *err)
{
    char type[17];
    const CtsElements e = s->object->head.elements;
    cts_elements_text(e, TYPE, type, sizeof type);
    s->type = !strcmp(type, "BINARY") ? BINARY : !strcmp(type, "FRACTIONAL") ? FRACTIONAL : LABELMAP;
    if (s->type == LABELMAP && strcmp(type, "LABELMAP"))
        return cts_fail(err, CTS_ERR_READ, "its SegmentationType is \"%s\", not BINARY, FRACTIONAL or LABELMAP", type);
    if (s->type == FRACTIONAL && (!cts_elements_integer(e, MAXIMUM, &s->maximum) || s->maximum < 1))
        return cts_fail(err, CTS_ERR_READ, "is FRACTIONAL without MaximumFractionalValue (0062,000E)");
    if (!cts_elements_integer(e, PADDING, &s->padding))
        s->padding = -1;
    return CTS_OK;
}

static CtsStatus read_seg_shape(Seg *s, CtsError *err)
{
    const CtsElements e = s->object->head.elements;
    if (!cts_elements_integer(e, N_FRAMES, &s->n_frames) || !cts_elements_integer(e, ROWS, &s->rows) ||
        !cts_elements_integer(e, COLUMNS, &s->columns) || !cts_elements_integer(e, BITS_ALLOCATED, &s->bits_allocated))
        return cts_fail(err, CTS_ERR_READ, "lacks NumberOfFrames, Rows, Columns or BitsAllocated");
    if (!cts_elements_integer(e, BITS_STORED, &s->bits_stored))
        s->bits_stored = s->bits_allocated;
    if (s->n_frames < 1 || s->n_frames > MAX_FRAMES || s->rows < 1 || s->columns < 1)
        return cts_fail(err, CTS_ERR_READ, "%d frames of %d x %d pixels cannot be read", s->n_frames, s->columns,
                        s->rows);
    if (s->bits_allocated != 8 && s->bits_allocated != (s->type == LABELMAP ? 16 : 1))
        return cts_fail(err, CTS_ERR_READ,
                        "%d bits are allocated for a pixel, which its SegmentationType does not have",
                        s->bits_allocated);
    return CTS_OK;
}

/* Rows, columns and the distance of planes, which all frames share. Limits as of a slice's orientation: 0.01 for the
 * length of a direction, 0.001 for deviations from the first frame. */
static CtsStatus take_geometry(Seg *s, CtsElements own, CtsElements shared, int frame, CtsError *err)
{
    double cosines[6], spacing_mm[2], step[2][3];
    const CtsElements measures = macro(own, shared, PIXEL_MEASURES);
    if (!cts_elements_decimals(macro(own, shared, PLANE_ORIENTATION), ORIENTATION, cosines, 6) ||
        !cts_elements_decimals(measures, PIXEL_SPACING, spacing_mm, 2) ||
        !cts_elements_decimals(macro(own, shared, PLANE_POSITION), POSITION, s->position_lps[frame], 3))
        return cts_fail(err, CTS_ERR_GEOMETRY, "frame %d has no position, orientation or pixel spacing", frame + 1);
    if (!(spacing_mm[0] > 0 && spacing_mm[1] > 0))
        return cts_fail(err, CTS_ERR_GEOMETRY, "frame %d has a pixel spacing of %g x %g mm", frame + 1, spacing_mm[0],
                        spacing_mm[1]);
    for (int axis = 0; axis < 2; axis++) {
        const double length = cts_norm3(cosines + 3 * axis);
        if (!(fabs(length - 1) < 0.01))
            return cts_fail(err, CTS_ERR_GEOMETRY, "frame %d has no orientation of unit length", frame + 1);
        for (int c = 0; c < 3; c++)
            step[axis][c] = cosines[3 * axis + c] / length * spacing_mm[1 - axis];
    }
    for (int axis = 0; axis < 2 && frame > 0; axis++)
        for (int c = 0; c < 3; c++)
            if (fabs(step[axis][c] - s->step_lps[axis][c]) > 1e-3 * spacing_mm[1 - axis])
                return cts_fail(err, CTS_ERR_GEOMETRY, "frame %d lies or is spaced unlike the first", frame + 1);
    if (frame == 0) {
        memcpy(s->step_lps, step, sizeof step);
        if (!cts_elements_decimals(measures, SLICE_SPACING, &s->gap_mm, 1) || !(s->gap_mm > 0))
            s->gap_mm = 0;
    }
    return CTS_OK;
}

static CtsStatus read_frames(Seg *s, CtsError *err)
{
    const CtsElements shared = cts_elements_item(s->object->head.elements, SHARED_GROUPS);
    CtsElements frames = cts_elements_find(s->object->head.elements, FRAME_GROUPS), own;
    CtsStatus st = cts_alloc_array(&s->position_lps, (size_t)s->n_frames, err);
    if (!st)
        st = cts_alloc_zeroed(&s->segment, (size_t)s->n_frames, err);
    for (int f = 0; !st && f < s->n_frames; f++) {
        int number = 0;
        if (!cts_items_next(&frames, &own))
            return cts_fail(err, CTS_ERR_READ, "describes %d of its %d frames", f, s->n_frames);
        if ((st = take_geometry(s, own, shared, f, err)) || s->type == LABELMAP)
            continue;
        if (!cts_elements_integer(macro(own, shared, IDENTIFICATION), REFERENCED_SEGMENT, &number) || number < 0 ||
            number >= MAX_NUMBERS || s->label_of[number] < 0)
            return cts_fail(err, CTS_ERR_READ, "frame %d refers to no segment of its own", f + 1);
        s->segment[f] = s->label_of[number];
    }
    return st;
}

static uint64_t frame_bits(const Seg *s)
{
    return (uint64_t)s->rows * (uint64_t)s->columns * (uint64_t)s->bits_allocated;
}

/* Of a frame that begins at a byte. */
static size_t frame_bytes(const Seg *s)
{
    return (size_t)(frame_bits(s) + 7) / 8;
}

/* A frame may begin within a byte. *shift: at which bit. Words of 16 bits are
 * read whole where a big-endian file swaps their bytes. */
static CtsStatus read_native(Seg *s, int frame, int *shift, CtsError *err)
{
    const CtsLabelDicom *const o = s->object;
    const bool swapped = o->head.syntax->big_endian && (s->bits_allocated == 16 || o->pixels.are_words);
    const uint64_t first = s->first_bit[frame], from = first / 8 - (swapped ? first / 8 % 2 : 0);
    uint64_t end = (first + frame_bits(s) + 7) / 8;
    end += swapped && end % 2 && end < o->pixels.n_bytes;
    *shift = (int)(first - 8 * from);
    const CtsStatus st = cts_file_bytes_read(&o->source, s->bytes, (size_t)(end - from), o->pixels.offset + from, err);
    for (uint64_t i = 0; !st && swapped && i + 1 < end - from; i += 2) {
        const uint8_t low = s->bytes[i + 1];
        s->bytes[i + 1] = s->bytes[i];
        s->bytes[i] = low;
    }
    return st;
}

/* Layouts of frames of bits. PACKED, one after the other, is the standard's (PS3.5 8.1.1); some writers begin each
 * frame, or each segment, at a byte. */
typedef enum Layout { PACKED, BY_FRAME, BY_SEGMENT } Layout;

/* Sets the first bit of each frame; true if the frames then take as many bytes as there are, with or without padding to
 * an even number, or if the layouts are one. */
static bool lay_out(const Seg *s, Layout layout, uint64_t *first_bit)
{
    const uint64_t bits = frame_bits(s), there = s->object->pixels.n_bytes;
    uint64_t at = 0;
    for (int f = 0; f < s->n_frames; f++) {
        if (f && (layout == BY_FRAME || (layout == BY_SEGMENT && s->segment[f] != s->segment[f - 1])))
            at = (at + 7) / 8 * 8;
        first_bit[f] = at;
        at += bits;
    }
    const uint64_t n = (at + 7) / 8;
    return bits % 8 == 0 || s->n_frames == 1 || n == there || n + n % 2 == there;
}

static CtsStatus find_layout(Seg *s, CtsError *err)
{
    const size_t n = (size_t)s->n_frames;
    uint64_t *by_segment = NULL;
    CtsStatus st = cts_alloc_array(&s->first_bit, n, err);
    if (st || lay_out(s, PACKED, s->first_bit) || (st = cts_alloc_array(&by_segment, n, err)))
        return st;
    const bool frames = lay_out(s, BY_FRAME, s->first_bit), segments = lay_out(s, BY_SEGMENT, by_segment);
    if (frames == segments && (!frames || memcmp(s->first_bit, by_segment, n * sizeof *by_segment)))
        st = cts_fail(
            err, CTS_ERR_READ,
            "the starts of its frames are ambiguous: %d frames of %llu bits in %llu bytes of pixel data (store "
            "them without gaps, PS3.5 8.1.1)",
            s->n_frames, (unsigned long long)frame_bits(s), (unsigned long long)s->object->pixels.n_bytes);
    if (segments)
        memcpy(s->first_bit, by_segment, n * sizeof *by_segment);
    cts_free(&by_segment);
    return st;
}

static bool is_jpeg2000(const Seg *s)
{
    return s->object->head.syntax->codec == CTS_CODEC_JPEG_2000;
}

/* A frame of bits is one row of bytes for codecs, except for JPEG 2000, which decodes it to pixels. */
static CtsFrameFormat frame_format_of(const Seg *s)
{
    const bool pixels = is_jpeg2000(s);
    CtsFrameFormat f = {.syntax = s->object->head.syntax,
                        .columns = s->columns,
                        .rows = s->rows,
                        .bits_allocated = s->bits_allocated,
                        .bits_stored = s->bits_stored,
                        .high_bit = s->bits_stored - 1,
                        .padding_word = -1};
    if (s->bits_allocated == 1) {
        f.bits_allocated = f.bits_stored = 8;
        f.high_bit = 7;
        f.columns = pixels ? s->columns : (int)frame_bytes(s);
        f.rows = pixels ? s->rows : 1;
    }
    return f;
}

static CtsStatus decode_seg_frame(Seg *s, int frame, const void **pixels, CtsError *err)
{
    const CtsFrameFormat format = frame_format_of(s);
    const CtsStatus st =
        cts_codec_submit(&s->decoder, &format, &s->object->source, s->offset[frame], s->offset[frame + 1], err);
    return st ? st : cts_sandbox_take(&s->decoder, pixels, err);
}

static void spread_bits(const uint8_t *bytes, int shift, size_t n, uint16_t value, uint16_t *values)
{
    size_t i = 0;
    for (; i < n; i++) {
        const size_t bit = (size_t)shift + i;
        if (bit % 8 == 0 && i + 8 <= n && bytes[bit / 8] == 0) {
            memset(values + i, 0, 8 * sizeof *values);
            i += 7;
            continue;
        }
        values[i] = bytes[bit / 8] >> (bit % 8) & 1 ? value : 0;
    }
}

static CtsStatus take_pixels(Seg *s, const uint8_t *bytes, size_t n, int frame, CtsError *err)
{
    const uint16_t value = (uint16_t)(s->segment[frame] + 1);
    for (size_t i = 0; i < n; i++) {
        const int v = s->bits_allocated == 16 ? bytes[2 * i] | bytes[2 * i + 1] << 8 : bytes[i];
        if (s->type == FRACTIONAL && v > s->maximum)
            return cts_fail(err, CTS_ERR_PIXELS, "frame %d holds %d, more than MaximumFractionalValue %d", frame + 1, v,
                            s->maximum);
        s->values[i] = s->type == LABELMAP     ? (v == s->padding ? 0 : (uint16_t)v)
                       : s->type == FRACTIONAL ? (2 * v >= s->maximum ? value : 0)
                                               : (v ? value : 0);
        if (s->type == FRACTIONAL)
            s->shares[i] = (uint16_t)lround((double)v * CTS_WHOLE_SHARE / s->maximum);
        s->has_unlisted_values |= s->type == LABELMAP && s->values[i] && s->label_of[v] < 0;
    }
    return CTS_OK;
}

/* Values are numbers of pixels in a LABELMAP, else 1 + which of the labels. */
static CtsStatus read_plane(void *context, int number, CtsMaskPlane *plane, CtsError *err)
{
    Seg *const s = context;
    const size_t n = (size_t)s->rows * (size_t)s->columns;
    const int frame = s->planes ? s->planes[number] : number;
    int shift = 0;
    const void *pixels = NULL;
    CtsStatus st = s->offset ? decode_seg_frame(s, frame, &pixels, err) : read_native(s, frame, &shift, err);
    if (!s->offset)
        pixels = s->bytes + shift / 8;
    *plane = (CtsMaskPlane){s->values, s->shares, (uint16_t)(s->segment[frame] + 1)};
    if (st)
        return cts_context(err, "frame %d", frame + 1);
    if (s->bits_allocated > 1 || (s->offset && is_jpeg2000(s)))
        return take_pixels(s, pixels, n, frame, err);
    spread_bits(pixels, shift % 8, n, plane->shared_value, s->values);
    return CTS_OK;
}

static CtsMask mask_of(Seg *s, int n_planes, double (*position_lps)[3], const int32_t *label_of)
{
    CtsMask mask = {.columns = s->columns,
                    .rows = s->rows,
                    .n_planes = n_planes,
                    .position_lps = position_lps,
                    .gap_mm = s->gap_mm,
                    .plane = read_plane,
                    .context = s,
                    .label_of = label_of};
    memcpy(mask.step_lps, s->step_lps, sizeof mask.step_lps);
    return mask;
}

/* Segments one after the other, as two of them may lie in one place. */
static CtsStatus place_each(Seg *s, const int32_t *label_of, CtsError *err)
{
    int *planes = NULL;
    double(*position_lps)[3] = NULL;
    CtsStatus st = cts_alloc_array(&planes, (size_t)s->n_frames, err);
    if (!st)
        st = cts_alloc_array(&position_lps, (size_t)s->n_frames, err);
    s->planes = planes;
    for (size_t l = 0; !st && l < s->reading->labels->n; l++) {
        int n = 0;
        for (int f = 0; f < s->n_frames; f++)
            if (s->segment[f] == (int32_t)l) {
                memcpy(position_lps[n], s->position_lps[f], sizeof *position_lps);
                planes[n++] = f;
            }
        const CtsMask mask = mask_of(s, n, position_lps, label_of);
        if (n)
            st = cts_mask_place(&mask, s->reading, NULL, &s->held_mm3, err);
    }
    s->planes = NULL;
    cts_free(&planes);
    cts_free(&position_lps);
    return st;
}

static CtsStatus place_all(Seg *s, CtsError *err)
{
    int32_t *by_value = NULL;
    bool at_once = true;
    CtsStatus st = cts_alloc_array(&by_value, CTS_MASK_VALUES, err);
    for (int v = 0; !st && v < CTS_MASK_VALUES; v++)
        by_value[v] = s->type == LABELMAP ? s->label_of[v] : v - 1 < (int)s->reading->labels->n ? v - 1 : -1;
    const CtsMask mask = mask_of(s, s->n_frames, s->position_lps, by_value);
    if (!st)
        st = cts_mask_place(&mask, s->reading, s->type == LABELMAP ? NULL : &at_once, &s->held_mm3, err);
    if (!st && !at_once)
        st = place_each(s, by_value, err);
    if (!st)
        st = cts_label_check_meets(s->reading, s->held_mm3, err);
    if (!st && s->has_unlisted_values)
        cts_report_diagnostic(s->reading->report, CTS_DIAGNOSTIC_LABEL_WITHOUT_SEGMENT,
                              "label file %d: some pixels have a number that no segment has", s->reading->file);
    cts_free(&by_value);
    return st;
}

static CtsStatus check_seg_pixels(Seg *s, CtsError *err)
{
    const CtsLabelDicom *const o = s->object;
    const uint64_t need = (frame_bits(s) * (uint64_t)s->n_frames + 7) / 8;
    if (!o->pixels.found)
        return cts_fail(err, CTS_ERR_READ, "has no pixels");
    if (o->pixels.encapsulated != cts_syntax_encapsulated(o->head.syntax))
        return cts_fail(err, CTS_ERR_READ, "its pixels are not stored as its transfer syntax says");
    if (o->pixels.encapsulated)
        return cts_find_frames(&o->source, o->pixels.offset, s->n_frames, &s->offset, err);
    return need <= o->pixels.n_bytes
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "cut short: %d frames need %llu bytes, %llu are there", s->n_frames,
                          (unsigned long long)need, (unsigned long long)o->pixels.n_bytes);
}

static CtsStatus read_seg(Seg *s, CtsError *err)
{
    CtsStatus st;
    const size_t n = (size_t)s->rows * (size_t)s->columns;
    if ((st = read_segments(s, err)) || (st = check_seg_pixels(s, err)) || (st = read_frames(s, err)) ||
        (!s->offset && (st = find_layout(s, err))) || (st = cts_alloc_array(&s->values, n, err)) ||
        (st = cts_alloc_array(&s->bytes, frame_bytes(s) + 4, err)) ||
        (s->type == FRACTIONAL && (st = cts_alloc_array(&s->shares, n, err))))
        return st;
    return place_all(s, err);
}

CtsStatus cts_label_read_seg(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err)
{
    Seg s = {.reading = reading, .object = object, .decoder = cts_codec_make()};
    char frame_uid[65];
    cts_elements_text(object->head.elements, FRAME_UID, frame_uid, sizeof frame_uid);
    CtsStatus st = cts_label_check_space(reading, object, frame_uid, err);
    if (!st)
        st = cts_alloc_array(&s.label_of, MAX_NUMBERS, err);
    if (!st && !(st = read_type(&s, err)) && !(st = read_seg_shape(&s, err))) {
        memset(s.label_of, -1, MAX_NUMBERS * sizeof *s.label_of);
        s.crops = s.type == BINARY && cts_label_shares_space(frame_uid, reading->series);
        st = read_seg(&s, err);
    }
    cts_sandbox_stop(&s.decoder);
    cts_free(&s.label_of);
    cts_free(&s.position_lps);
    cts_free(&s.segment);
    cts_free(&s.offset);
    cts_free(&s.first_bit);
    cts_free(&s.values);
    cts_free(&s.shares);
    cts_free(&s.bytes);
    return st;
}
