/* Copies of slices: the same voxels twice, as the files have them or in another encoding. */
#include "input/series/series_check.h"

#include "base/bytes.h"
#include "base/file_bytes.h"
#include "base/mem.h"
#include "base/sandbox.h"
#include "dicom/codec/pixels.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* HU of air, as which lower HU and padding are shown. */
#define MIN_HU (-1024.0)
/* Share of a slope: half a step is the rounding error, and a little for the decimals of slope and intercept. */
#define ROUNDING 0.500001

/* A hash of a few bytes of the pixels, or of a deflated file, from the middle, which distinguishes most slices without
 * reading them whole; 0 when they cannot be read. */
static uint64_t sample_of(const CtsSlice *s)
{
    uint8_t bytes[4096];
    CtsFileBytes file = {.fd = -1};
    const bool whole = s->syntax->deflated;
    const uint64_t size = whole ? s->file_bytes : s->pixel_bytes;
    const size_t n = size < sizeof bytes ? (size_t)size : sizeof bytes;
    const uint64_t offset = (whole ? 0 : s->pixel_offset) + (size - n) / 2;
    const bool read = !cts_slice_open(s, &file, NULL) && !cts_file_bytes_read(&file, bytes, n, offset, NULL);
    const uint64_t hash = read ? cts_fnv(CTS_FNV, bytes, n) : 0;
    cts_file_bytes_close(&file);
    return hash;
}

/* Headers that give the same words the same HU. */
static bool same_encoding(const CtsSlice *a, const CtsSlice *b)
{
    return a->syntax == b->syntax && a->bits_allocated == b->bits_allocated && cts_slice_same_values(a, b);
}

/* Buffers and counts for the comparisons of one set. */
typedef struct Copies {
    uint64_t *samples;     /* of each slice; 0: not read yet */
    CtsSandbox *decoder;   /* started when the first compressed slice comes */
    int n_equal, n_differ; /* pairs whose pixels were decoded */
} Copies;

static void keep_words(void *context, const uint16_t *at, size_t first, size_t end)
{
    uint16_t *const to = (uint16_t *)context + first;
    if (at != to)
        memcpy(to, at, (end - first) * sizeof *to);
}

static double hu_of_word(const CtsSlice *s, const CtsStored *stored, uint16_t word)
{
    const int32_t value = cts_stored_value(word, stored);
    return cts_stored_is_padding(word, value, stored) ? MIN_HU : fmax(s->slope * value + s->intercept, MIN_HU);
}

static bool read_words(Copies *c, const CtsSlice *s, uint16_t *words)
{
    return !cts_slice_read_pixels(s, &c->decoder, words, keep_words, words, NULL);
}

/* The same HU, to the rounding of the coarser encoding. Of two that cannot be read either may go. */
static bool same_hu(Copies *c, const CtsSlice *a, const CtsSlice *b)
{
    const size_t n = (size_t)a->rows * (size_t)a->columns;
    const CtsStored of_a = cts_slice_stored(a), of_b = cts_slice_stored(b);
    const double most = ROUNDING * fmax(fabs(a->slope), fabs(b->slope));
    uint16_t *words = malloc(2 * n * sizeof *words);
    const bool has_a = words && read_words(c, a, words), has_b = words && read_words(c, b, words + n);
    bool same = words && has_a == has_b;
    for (size_t i = 0; same && has_a && i < n; i++)
        same = fabs(hu_of_word(a, &of_a, words[i]) - hu_of_word(b, &of_b, words[n + i])) <= most;
    free(words);
    return same;
}

/* True for slices of one acquisition: the attributes that separate acquisitions are the same in all encodings of a
 * slice. */
static bool same_acquisition(const CtsSlice *a, const CtsSlice *b)
{
    for (int i = 0; i < CTS_N_VOLUME_NUMBERS; i++) {
        const double x = a->volume_number[i], y = b->volume_number[i];
        if (i != CTS_CONTENT_TIME && x != y && !(isnan(x) && isnan(y)))
            return false;
    }
    return !strcmp(a->kernel, b->kernel);
}

/* True for one encoding whose samples are equal. Frames of a deflated file lie in one stream. */
static bool look_alike(const Copies *c, const CtsSliceSet *set, int j, int i)
{
    const CtsSlice *a = set->items[j], *b = set->items[i];
    if (!same_encoding(a, b) || (a->syntax->deflated && a->path == b->path))
        return false;
    for (int k = j; k <= i; k += i - j)
        c->samples[k] = c->samples[k] ? c->samples[k] : sample_of(set->items[k]);
    return c->samples[i] == c->samples[j];
}

/* Two slices of one place that give the same voxels. Decoding takes as long as loading, so compressed phases of one
 * encoding are decoded once, to see that they differ, and those of several only a few times. */
static bool same_picture(Copies *c, const CtsSliceSet *set, int j, int i)
{
    enum { FEW = 16 }; /* pairs that differ: 32 decoded slices, fewer than a usual series has */
    const CtsSlice *a = set->items[j], *b = set->items[i];
    if (a->rows != b->rows || a->columns != b->columns)
        return false;
    if (look_alike(c, set, j, i) && same_hu(c, a, b))
        return true;
    const bool same = same_encoding(a, b);
    if (!same_acquisition(a, b) || (same && !cts_slice_is_compressed(a)) || c->n_differ > c->n_equal + (same ? 0 : FEW))
        return false;
    const bool equal = same_hu(c, a, b);
    ++*(equal ? &c->n_equal : &c->n_differ);
    return equal;
}

/* Of two, the one of the smaller UID stays, so that the order of files changes nothing. It owns the other. */
static void drop_one(CtsSliceSet *set, int j, int i)
{
    const bool first = strcmp(set->items[j]->sop_uid, set->items[i]->sop_uid) <= 0;
    const int stays = first ? j : i, goes = first ? i : j;
    CtsSlice *last = set->items[goes];
    while (last->copy)
        last = last->copy;
    last->copy = set->items[stays]->copy;
    set->items[stays]->copy = set->items[goes];
    set->items[goes] = NULL;
}

CtsStatus cts_slice_set_drop_copies(CtsSliceSet *set, double same_mm, int *n_dropped, CtsError *err)
{
    Copies copies = {0};
    const int n = set->n;
    CtsStatus st = cts_alloc_zeroed(&copies.samples, (size_t)n, err);
    for (int i = 0; !st && i < n; i++)
        for (int j = i - 1; set->items[i] && j >= 0; j--) {
            if (set->items[j] && !cts_slice_same_place(set->items[j], set->items[i], same_mm))
                break;
            if (set->items[j] && same_picture(&copies, set, j, i))
                drop_one(set, j, i);
        }
    set->n = 0;
    for (int i = 0; i < n; i++)
        if (set->items[i])
            set->items[set->n++] = set->items[i];
    *n_dropped = n - set->n;
    cts_sandbox_free(&copies.decoder);
    cts_free(&copies.samples);
    return st;
}
