#include "dicom/header/header_answer.h"

#include "base/vec3.h"
#include <math.h>
#include <string.h>

/* Fields of a slice that the reader fills: one, or neighbours of one type. */
typedef enum FieldKind { TEXT, FLAG, INTEGER, REAL, REAL_OR_NAN } FieldKind;
typedef struct Field {
    size_t at, end;
    FieldKind kind;
    double low, high; /* of numbers, inclusive; of texts, high is the greatest length */
} Field;

static const uint64_t MAX_OFFSET = (uint64_t)1 << 48; /* sums of offsets and sizes do not overflow */

#define FIELDS(first, last) offsetof(CtsSlice, first), offsetof(CtsSlice, last) + sizeof((CtsSlice *)NULL)->last
#define FIELD(name) FIELDS(name, name)

static const Field fields[] = {
    {FIELD(deviations), INTEGER, 0, 2 * CTS_DEVIATION_MAY_NAME - 1},
    {FIELDS(sop_uid, series_uid), TEXT, 0, 64},
    {FIELD(identity), TEXT, 0, CTS_MAX_TEXT},
    {FIELD(modality), TEXT, 0, 16},
    {FIELDS(scanner, study_date), TEXT, 0, CTS_MAX_TEXT},
    {FIELD(series_number), INTEGER, INT32_MIN, INT32_MAX},
    {FIELD(has_instance), FLAG, 0, 1},
    {FIELD(instance_number), INTEGER, INT32_MIN, INT32_MAX},
    {FIELD(kernel), TEXT, 0, 64},
    {FIELD(thickness_mm), REAL, -INFINITY, INFINITY},
    {FIELD(declared_lossless), FLAG, 0, 1},
    {FIELDS(lossy_ratio, lossy_method), TEXT, 0, CTS_MAX_TEXT},
    {FIELD(volume_number), REAL_OR_NAN, -INFINITY, INFINITY},
    {FIELD(volume_word), TEXT, 0, 64},
    {FIELD(pet.units), INTEGER, 0, CTS_PET_GML},
    {FIELD(pet.decay), INTEGER, 0, CTS_PET_REFERENCE_TIME},
    {FIELDS(pet.is_suvbw, pet.is_reprojection), FLAG, 0, 1},
    {FIELD(pet.value), REAL_OR_NAN, -INFINITY, INFINITY},
    {FIELDS(localizer, contrast), FLAG, 0, 1},
    {FIELD(image_type), TEXT, 0, 64},
    {FIELD(is_report), FLAG, 0, 1},
    {FIELD(frame), INTEGER, 0, CTS_MAX_FRAMES - 1},
    {FIELD(n_frames), INTEGER, 0, CTS_MAX_FRAMES},
    {FIELD(stack_id), TEXT, 0, 16},
    {FIELD(concatenation), TEXT, 0, 64},
    {FIELDS(part_number, n_parts), INTEGER, 0, UINT16_MAX},
    {FIELDS(rows, high_bit), INTEGER, 0, UINT16_MAX},
    {FIELD(is_signed), FLAG, 0, 1},
    {FIELDS(padding_low, padding_high), INTEGER, INT16_MIN, UINT16_MAX},
    {FIELD(padding_word), INTEGER, -1, UINT16_MAX},
    {FIELDS(slope, intercept), REAL, -INFINITY, INFINITY},
    {FIELD(rescale_type), TEXT, 0, 16},
    {FIELDS(row_lps, normal_lps), REAL, -2, 2},
    {FIELDS(position_lps, row_spacing_mm), REAL, -INFINITY, INFINITY},
    {FIELD(fault), INTEGER, CTS_OK, CTS_ERR_INTERRUPTED},
};
enum { N_FIELDS = sizeof fields / sizeof *fields };

static size_t field_size(FieldKind kind)
{
    return kind == FLAG ? sizeof(bool) : kind == INTEGER ? sizeof(int) : kind == TEXT ? sizeof(char *) : 8;
}

CtsSlice cts_slice_unknown(void)
{
    CtsSlice s = {.syntax_uid = "",
                  .class_uid = "",
                  .series_number = -1,
                  .thickness_mm = -1,
                  .first_frame = -1,
                  .padding_low = 1,
                  .padding_word = -1};
    const char *const none = "";
    for (int i = 0; i < N_FIELDS; i++)
        for (size_t at = fields[i].at; fields[i].kind == TEXT && at < fields[i].end; at += sizeof none)
            memcpy((char *)&s + at, &none, sizeof none);
    for (int i = 0; i < CTS_N_VOLUME_NUMBERS; i++)
        s.volume_number[i] = NAN;
    return s;
}

/* Texts are stored behind the slices, as their offset there. */
typedef struct PackedTexts {
    uint8_t *bytes;
    size_t n, used;
} PackedTexts;

static const char *pack_text(PackedTexts *w, const char *text)
{
    const size_t n = strlen(text) + 1, at = w->used;
    if (w->used <= w->n && n <= w->n - w->used)
        memcpy(w->bytes + at, text, n);
    w->used += n;
    return (const char *)at;
}

static void pack_slice(PackedTexts *w, const CtsSlice *s, CtsSlice *packed)
{
    *packed = *s;
    for (int i = 0; i < N_FIELDS; i++)
        for (size_t at = fields[i].at; fields[i].kind == TEXT && at < fields[i].end; at += sizeof(char *)) {
            const char *text;
            memcpy(&text, (const char *)s + at, sizeof text);
            text = pack_text(w, text);
            memcpy((char *)packed + at, &text, sizeof text);
        }
}

size_t cts_header_pack(const CtsObject *object, CtsHeaderAnswer *answer, uint8_t *bytes, size_t n)
{
    const size_t n_slices = (size_t)object->n_slices, n_records = n_slices * sizeof(CtsSlice);
    CtsSlice packed;
    PackedTexts w = {bytes, n, n_records};
    for (size_t k = 0; k < n_slices; k++) {
        pack_slice(&w, object->slices[k], &packed);
        if (n_records <= n)
            memcpy(bytes + k * sizeof packed, &packed, sizeof packed);
    }
    answer->object = *object;
    answer->object.slices = NULL;
    answer->object.class_uid = pack_text(&w, object->class_uid);
    answer->object.study_uid = pack_text(&w, object->study_uid);
    answer->n = w.used;
    return w.used;
}

/* The bytes of an answer, whose last one is 0. */
typedef struct PackedAnswer {
    const char *bytes;
    size_t texts, n;
    CtsStringPool *pool;
} PackedAnswer;

/* The text of an offset, in the pool. */
static bool unpack_text(const PackedAnswer *r, const char *offset, size_t longest, const char **text)
{
    const size_t at = (size_t)offset;
    if (at < r->texts || at >= r->n)
        return false;
    const size_t n = strlen(r->bytes + at);
    return n <= longest && (*text = cts_string_pool_share(r->pool, r->bytes + at, n)) != NULL;
}

static bool is_flag(const uint8_t *flag)
{
    return *flag <= 1;
}

static bool is_in_range(const Field *f, const void *value)
{
    int integer;
    double real;
    switch (f->kind) {
    case FLAG:
        return is_flag(value);
    case INTEGER:
        memcpy(&integer, value, sizeof integer);
        return integer >= f->low && integer <= f->high;
    default:
        memcpy(&real, value, sizeof real);
        return isnan(real) ? f->kind == REAL_OR_NAN : isfinite(real) && real >= f->low && real <= f->high;
    }
}

static bool unpack_field(const PackedAnswer *r, const Field *f, const CtsSlice *packed, CtsSlice *s)
{
    for (size_t at = f->at; at < f->end; at += field_size(f->kind)) {
        const char *const from = (const char *)packed + at;
        if (f->kind == TEXT) {
            const char *offset, *text;
            memcpy(&offset, from, sizeof offset);
            if (!unpack_text(r, offset, (size_t)f->high, &text))
                return false;
            memcpy((char *)s + at, &text, sizeof text);
        } else if (is_in_range(f, from)) {
            memcpy((char *)s + at, from, field_size(f->kind));
        } else {
            return false;
        }
    }
    return true;
}

CtsStatus cts_header_no_sense(CtsError *err)
{
    return cts_fail(err, CTS_ERR_READ, "the reader of its header gave an answer without sense");
}

static CtsStatus fail_to_unpack(const PackedAnswer *r, CtsError *err)
{
    return r->pool->no_memory ? cts_fail(err, CTS_ERR_MEMORY, "out of memory") : cts_header_no_sense(err);
}

/* Ranges that the readers of pixels and the volume rely on, of a slice without a fault. */
static bool has_sound_ranges(const CtsSlice *s)
{
    return s->rows >= 1 && s->rows <= 4096 && s->columns >= 1 && s->columns <= 4096 &&
           (s->bits_allocated == 8 || s->bits_allocated == 16) && s->bits_stored >= 1 &&
           s->bits_stored <= s->bits_allocated && s->high_bit >= s->bits_stored - 1 &&
           s->high_bit < s->bits_allocated && cts_slice_has_scale(s) && fabs(cts_norm3(s->row_lps) - 1) < 1e-6 &&
           fabs(cts_norm3(s->column_lps) - 1) < 1e-6 && fabs(cts_dot3(s->row_lps, s->column_lps)) < 1e-6 &&
           s->row_spacing_mm > 0 && s->row_spacing_mm <= 10 && s->column_spacing_mm > 0 && s->column_spacing_mm <= 10;
}

static CtsStatus unpack_slice(const PackedAnswer *r, const CtsObject *object, int k, CtsSlice *s, CtsError *err)
{
    CtsSlice packed;
    memcpy(&packed, r->bytes + (size_t)k * sizeof packed, sizeof packed);
    bool sound = packed.first_frame >= -1 && packed.first_frame <= UINT32_MAX;
    for (int i = 0; sound && i < N_FIELDS; i++)
        sound = unpack_field(r, &fields[i], &packed, s);
    sound = sound && (s->n_frames ? s->n_frames == object->n_slices && s->frame == k : object->n_slices == 1) &&
            memchr(packed.fault_text, 0, sizeof packed.fault_text) && !s->fault == !packed.fault_text[0] &&
            (s->fault || has_sound_ranges(s));
    if (!sound)
        return fail_to_unpack(r, err);
    s->first_frame = packed.first_frame;
    memcpy(s->fault_text, packed.fault_text, sizeof s->fault_text);
    return CTS_OK;
}

/* Safe in messages, and ended by a 0. */
static bool is_plain_text(const char *text, size_t size)
{
    for (size_t i = 0; i < size; i++)
        if (text[i] < ' ' || text[i] > '~')
            return !text[i];
    return false;
}

bool cts_header_facts_hold(const CtsHeaderFacts *f, uint64_t n_file)
{
    return is_flag((const uint8_t *)&f->pixels.found) && is_flag((const uint8_t *)&f->pixels.are_words) &&
           is_flag((const uint8_t *)&f->pixels.encapsulated) && memchr(f->syntax_uid, 0, sizeof f->syntax_uid) &&
           is_plain_text(f->class_name, sizeof f->class_name) && f->deviations < 2 * CTS_DEVIATION_MAY_NAME &&
           f->data_offset <= n_file && f->header_bytes < MAX_OFFSET && f->pixels.offset < MAX_OFFSET &&
           f->pixels.n_bytes < MAX_OFFSET;
}

static bool is_sound_answer(const CtsHeaderAnswer *a, const uint8_t *bytes, size_t n)
{
    const CtsObject *o = &a->object;
    const bool is_image = o->kind == CTS_OBJECT_IMAGE;
    const bool has_slices = o->kind == CTS_OBJECT_SLICE || o->kind == CTS_OBJECT_FRAMES || is_image;
    return ((unsigned)o->kind <= CTS_OBJECT_LABELS || is_image) && (unsigned)o->modality_id < CTS_N_MODALITIES &&
           o->n_slices >= 0 && o->n_slices <= CTS_MAX_FRAMES && (o->n_slices > 0) == has_slices &&
           n > (size_t)o->n_slices * sizeof(CtsSlice) && !bytes[n - 1] && is_flag((const uint8_t *)&o->has_number);
}

CtsStatus cts_header_unpack(const CtsHeaderAnswer *answer, const uint8_t *bytes, size_t n, CtsStringPool *texts,
                            CtsObject *object, CtsError *err)
{
    const CtsObject *const o = &answer->object;
    const PackedAnswer r = {(const char *)bytes, (size_t)o->n_slices * sizeof(CtsSlice), n, texts};
    if (!is_sound_answer(answer, bytes, n))
        return cts_header_no_sense(err);
    *object = (CtsObject){.kind = o->kind,
                          .modality_id = o->modality_id,
                          .has_number = o->has_number,
                          .instance_number = o->instance_number};
    if (!unpack_text(&r, o->class_uid, 64, &object->class_uid) ||
        !unpack_text(&r, o->study_uid, 64, &object->study_uid))
        return fail_to_unpack(&r, err);
    CtsStatus st = CTS_OK;
    for (int k = 0; !st && k < o->n_slices; k++) {
        CtsSlice *const slice = cts_object_add_slice(object, NULL);
        st = slice ? unpack_slice(&r, o, k, slice, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    return st;
}
