#include "dicom/header/pixel_places.h"

#include "base/bytes.h"
#include "base/mem.h"
#include "dicom/header/header_reader.h"
#include <stdlib.h>
#include <string.h>

/* MAX_FRAGMENTS: 50 for each of 20000 frames; their offsets take 8 MB. ITEM_BYTES: tag and length. */
enum { MAX_FRAGMENTS = 1 << 20, ITEM_BYTES = 8 };

/* The items of an encapsulated value; the first, the offset table, apart. */
typedef struct Fragments {
    uint64_t *at; /* of each item; owned */
    int n;
    uint64_t end; /* of the last fragment */
    uint64_t table_at;
    uint32_t table_bytes;
} Fragments;

/* By their lengths, never by a search: the last one must be followed by the delimiter. */
static CtsStatus walk(const CtsFileBytes *file, uint64_t pos, Fragments *f, CtsError *err)
{
    for (int n = 0;; n++) {
        uint8_t item[ITEM_BYTES];
        if (file->n_bytes < ITEM_BYTES || pos > file->n_bytes - ITEM_BYTES ||
            cts_file_bytes_read(file, item, ITEM_BYTES, pos, NULL))
            return cts_fail(err, CTS_ERR_PIXELS, "truncated: its compressed pixels have no end");
        if (memcmp(item, "\xfe\xff\xdd\xe0", 4) == 0)
            break;
        const uint32_t length = cts_little32(item + 4);
        if (memcmp(item, "\xfe\xff\x00\xe0", 4) != 0 || length > file->n_bytes - pos - ITEM_BYTES)
            return cts_fail(err, CTS_ERR_PIXELS,
                            "truncated or damaged: a fragment of its compressed pixels does not fit");
        if (n > MAX_FRAGMENTS)
            return cts_fail(err, CTS_ERR_PIXELS, "its compressed pixels are in more than a million fragments");
        if (n == 0) {
            f->table_at = pos + ITEM_BYTES;
            f->table_bytes = length;
        } else if (cts_grow(&f->at, f->n, err)) {
            return CTS_ERR_MEMORY;
        } else {
            f->at[f->n++] = pos;
        }
        pos += ITEM_BYTES + length;
    }
    f->end = pos;
    return f->n ? CTS_OK : cts_fail(err, CTS_ERR_PIXELS, "its compressed pixels hold no fragment");
}

/* The fragments that begin frames, by the offset table: one entry a frame, rising, each the start of a fragment. */
static bool by_table(const CtsFileBytes *file, const Fragments *f, int *first, int n)
{
    uint8_t entry[4];
    int fragment = 0;
    if (f->table_bytes != 4u * (uint32_t)n)
        return false;
    for (int k = 0; k < n; k++) {
        if (cts_file_bytes_read(file, entry, 4, f->table_at + 4u * (uint64_t)k, NULL))
            return false;
        const uint64_t at = f->at[0] + cts_little32(entry);
        while (fragment < f->n && f->at[fragment] < at)
            fragment++;
        if (fragment == f->n || f->at[fragment] != at || (k > 0 && first[k - 1] == fragment) || (k == 0 && fragment))
            return false;
        first[k] = fragment;
    }
    return true;
}

/* By how a stream of the JPEG family begins. */
static bool by_start(const CtsFileBytes *file, const Fragments *f, int *first, int n)
{
    static const struct {
        uint8_t bytes[4];
        size_t n;
    } starts[] = {{{0xFF, 0xD8, 0xFF}, 3}, {{0xFF, 0x4F, 0xFF, 0x51}, 4}};
    int found = 0;
    for (int i = 0; i < f->n; i++) {
        uint8_t bytes[4] = {0};
        if (cts_file_bytes_read(file, bytes, sizeof bytes, f->at[i] + ITEM_BYTES, NULL))
            return false;
        bool begins = false;
        for (size_t s = 0; s < sizeof starts / sizeof *starts; s++)
            begins |= memcmp(bytes, starts[s].bytes, starts[s].n) == 0;
        if (!begins)
            continue;
        if (found == n || (found == 0 && i > 0))
            return false;
        first[found++] = i;
    }
    return found == n;
}

static bool find_firsts(const CtsFileBytes *file, const Fragments *f, int *first, int n)
{
    if (f->n == n || n == 1) {
        for (int k = 0; k < n; k++)
            first[k] = k;
        return true;
    }
    return by_table(file, f, first, n) || by_start(file, f, first, n);
}

CtsStatus cts_find_frames(const CtsFileBytes *file, uint64_t pixel_offset, int n, uint64_t **offset, CtsError *err)
{
    Fragments f = {0};
    int *first = NULL;
    *offset = NULL;
    CtsStatus st = walk(file, pixel_offset, &f, err);
    if (!st && (f.n < n || (!(st = cts_alloc_array(&first, (size_t)n, err)) && !find_firsts(file, &f, first, n))))
        st = cts_fail(err, CTS_ERR_PIXELS,
                      "its compressed frames cannot be separated: fragments, offset table and NumberOfFrames "
                      "(0028,0008) disagree");
    if (!st)
        st = cts_alloc_array(offset, (size_t)n + 1, err);
    for (int k = 0; !st && k <= n; k++)
        (*offset)[k] = k < n ? f.at[first[k]] : f.end;
    cts_free(&first);
    free(f.at);
    return st;
}

CtsStatus cts_place_fragments(const CtsFileBytes *file, CtsSlice *const *frames, int n, CtsError *err)
{
    CtsError why = {0};
    uint64_t *offset;
    const CtsStatus st = cts_find_frames(file, frames[0]->pixel_offset, n, &offset, &why);
    for (int k = 0; st == CTS_ERR_PIXELS && k < n; k++)
        cts_slice_fault(frames[k], st, "%s", why.text);
    for (int k = 0; !st && k < n; k++) {
        frames[k]->pixel_offset = offset[k];
        frames[k]->pixel_bytes = offset[k + 1] - offset[k];
    }
    cts_free(&offset);
    return st == CTS_ERR_MEMORY ? cts_fail(err, st, "%s", why.text) : CTS_OK;
}

static void place_native(const CtsFileBytes *file, CtsSlice *const *frames, int n)
{
    const CtsSlice *s = frames[0];
    const uint64_t frame = (uint64_t)s->columns * (uint64_t)(s->bits_allocated / 8) * (uint64_t)s->rows;
    const uint64_t have = s->pixel_bytes, need = frame * (uint64_t)n, start = s->pixel_offset;
    const uint64_t left = start > file->n_bytes ? 0 : file->n_bytes - start;
    const bool deflated = s->syntax->deflated;
    for (int k = 0; k < n; k++) {
        const uint64_t end = frame * (uint64_t)(k + 1);
        if (have < end)
            cts_slice_fault(frames[k], CTS_ERR_PIXELS, "PixelData needs %llu bytes, and holds %llu",
                            (unsigned long long)need, (unsigned long long)have);
        else if (n == 1 && have > need + 1 && have % frame == 0)
            cts_slice_fault(frames[k], CTS_ERR_PIXELS, "PixelData holds %llu frames, not one",
                            (unsigned long long)(have / frame));
        else if (have > need + 1) /* more than the byte that makes its length even */
            frames[k]->deviations |= CTS_DEVIATION_LONG_PIXELS;
        if (!deflated && left < end)
            cts_slice_fault(frames[k], CTS_ERR_PIXELS, "truncated: PixelData needs %llu bytes, %llu left",
                            (unsigned long long)need, (unsigned long long)left);
        else if (!deflated && n == 1 && have > left + 1) /* a missing padding byte is tolerated */
            cts_slice_fault(frames[k], CTS_ERR_PIXELS, "truncated: PixelData is %llu bytes long, and %llu are left",
                            (unsigned long long)have, (unsigned long long)left);
        frames[k]->pixel_offset = start + frame * (uint64_t)k;
        frames[k]->pixel_bytes = frame;
    }
}

static void check_pixels(const CtsHeaderFacts *f, CtsSlice *slice)
{
    const CtsSyntax *syntax = slice->syntax;
    slice->data_offset = f->data_offset;
    slice->pixel_offset = f->pixels.offset;
    slice->pixel_bytes = f->pixels.n_bytes;
    slice->pixel_words = f->pixels.are_words;
    if (syntax && (syntax->loss == CTS_LOSSY || (syntax->loss == CTS_MAYBE_LOSSY && !slice->declared_lossless)))
        slice->deviations |= CTS_DEVIATION_LOSSY;
    if (!syntax)
        cts_slice_fault(slice, CTS_ERR_SYNTAX, "transfer syntax %s is unknown (convert it with gdcmconv --raw)",
                        slice->syntax_uid);
    else if (syntax->codec >= CTS_CODEC_NONE)
        cts_slice_fault(
            slice, CTS_ERR_SYNTAX,
            "transfer syntax %s (%s): %s (fetch the series again as Explicit VR Little Endian, or export it so "
            "where it can be displayed)",
            syntax->uid, syntax->name,
            syntax->codec == CTS_CODEC_NONE ? "cannot be decoded by this build"
                                            : "its pixels are on a server, not in the file");
    if (slice->fault)
        return;
    if (f->pixels.float_tag)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "%sFloat Pixel Data (7FE0,%04X) is no pixel data of slices",
                        f->pixels.float_tag == 0x7FE00009 ? "Double " : "", f->pixels.float_tag & 0xFFFF);
    else if (!f->pixels.found)
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData (7FE0,0010) is missing");
    else if (f->pixels.encapsulated != cts_syntax_encapsulated(syntax))
        cts_slice_fault(slice, CTS_ERR_PIXELS, "PixelData is %scompressed, but its transfer syntax is %s",
                        f->pixels.encapsulated ? "" : "not ", syntax->name);
}

static CtsStatus place_frames(const CtsHeaderFacts *f, const CtsPendingHeader *pending, const CtsObject *object,
                              CtsError *err)
{
    CtsFileBytes file = {.n_bytes = pending->n_file};
    if (!f->pixels.encapsulated) {
        place_native(&file, object->slices, object->n_slices);
        return CTS_OK;
    }
    CtsStatus st = cts_slice_open(object->slices[0], &file, err);
    if (!st)
        st = cts_place_fragments(&file, object->slices, object->n_slices, err);
    cts_file_bytes_close(&file);
    return st;
}

CtsStatus cts_header_complete(const CtsHeaderFacts *f, const CtsPendingHeader *file, CtsStringPool *texts,
                              CtsObject *object, CtsError *err)
{
    bool usable = object->n_slices > 0;
    const char *syntax_uid = cts_string_pool_share(texts, f->syntax_uid, 64);
    const CtsSyntax *const syntax = cts_syntax_find(f->syntax_uid);
    object->class_name = cts_string_pool_share(texts, f->class_name, sizeof f->class_name);
    if (!syntax_uid || !object->class_name)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (int i = 0; i < object->n_slices; i++) {
        CtsSlice *s = object->slices[i];
        s->syntax = syntax;
        s->syntax_uid = syntax_uid;
        s->class_uid = object->class_uid;
        s->deviations |= f->deviations;
        s->memory = file->source->memory;
        s->path = file->source->path;
        s->file_bytes = file->n_file;
        s->mtime_ns = file->mtime_ns;
        /* Faults of a frame are its own; but without a size no frame's offset is known. */
        const bool sized = s->rows > 0 && s->columns > 0 && (s->bits_allocated == 8 || s->bits_allocated == 16);
        const bool sound = !s->fault || (s->n_frames && sized);
        check_pixels(f, s);
        usable &= sound && s->syntax && s->syntax->codec < CTS_CODEC_NONE && f->pixels.found &&
                  f->pixels.encapsulated == cts_syntax_encapsulated(s->syntax);
    }
    return usable ? place_frames(f, file, object, err) : CTS_OK;
}
