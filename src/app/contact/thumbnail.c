#include "app/contact/contact_sheet.h"

#include "base/file.h"
#include "base/mem.h"
#include "output/image/samples.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <webp/encode.h>

/* LEVELS: 12 bits of display value are finer than an 8-bit thumbnail can show. QUALITY, TURN_QUALITY: WebP's, 0 to 100.
 * Measured: a head of 240 x 240 pixels takes 2 to 3 kB, its rotation of 36 frames 70 to 80 kB. */
enum { LEVELS = 4096, QUALITY = 80, TURN_QUALITY = 70 };

struct CtsThumbnail {
    char *stem;
    int source_width, source_height, n_channels;
    int width, height; /* of one frame */
    int n_frames, n_slots;
    int frame, row; /* the next ones to be added */
    float *sums;    /* of the current frame: linear light, premultiplied, and alpha; 4 per pixel */
    float *columns; /* one row of the picture, as wide as the thumbnail */
    uint8_t *strip; /* red, green, blue, alpha of all slots side by side */
    float linear[LEVELS];
};

void cts_thumbnail_discard(CtsThumbnail **thumb)
{
    CtsThumbnail *t = *thumb;
    if (!t)
        return;
    free(t->stem);
    cts_free(&t->sums);
    cts_free(&t->columns);
    cts_free(&t->strip);
    free(t);
    *thumb = NULL;
}

/* The longest side becomes `most` at most. */
static int scaled(int side, int longest, int most)
{
    const int size = longest > most ? (int)(((int64_t)side * most + longest / 2) / longest) : side;
    return size > 0 ? size : 1;
}

CtsStatus cts_thumbnail_begin(CtsThumbnail **thumb, const char *stem, int side, const CtsPicture *first, int n_frames,
                              CtsError *err)
{
    const int height = first->whole_height, longest = first->width > height ? first->width : height;
    CtsThumbnail *t = *thumb = calloc(1, sizeof *t);
    if (!t || !(t->stem = strdup(stem))) {
        cts_thumbnail_discard(thumb);
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", stem);
    }
    t->source_width = first->width;
    t->source_height = height;
    t->n_channels = first->n_channels;
    t->width = scaled(first->width, longest, side);
    t->height = scaled(height, longest, side);
    t->n_frames = n_frames;
    t->n_slots = n_frames < CTS_THUMBNAIL_FRAMES ? n_frames : CTS_THUMBNAIL_FRAMES;
    for (int i = 0; i < LEVELS; i++)
        t->linear[i] = (float)cts_srgb_to_linear(i / (LEVELS - 1.0));
    const size_t frame_values = (size_t)t->width * (size_t)t->height * 4;
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&t->sums, frame_values, err)) ||
        (st = cts_alloc_array(&t->columns, (size_t)t->width * 4, err)) ||
        (st = cts_alloc_array(&t->strip, frame_values * (size_t)t->n_slots, err)))
        cts_thumbnail_discard(thumb);
    return st;
}

static float to_linear(const CtsThumbnail *t, float display)
{
    return t->linear[display > 0 ? display < 1 ? (int)(display * (LEVELS - 1) + 0.5f) : LEVELS - 1 : 0];
}

/* sum += weight * the pixel, in linear light. */
static void add_pixel(const CtsThumbnail *t, const float *pixel, float weight, float sum[4])
{
    if (t->n_channels == 1) {
        const float grey = weight * to_linear(t, pixel[0]);
        for (int c = 0; c < 3; c++)
            sum[c] += grey;
        sum[3] += weight;
    } else if (pixel[3] > 0) {
        const float alpha = pixel[3] < 1 ? pixel[3] : 1;
        for (int c = 0; c < 3; c++)
            sum[c] += weight * alpha * to_linear(t, pixel[c] / alpha);
        sum[3] += weight * alpha;
    }
}

/* Overlap of [at, at + 1) / n_from and [into, into + 1) / n_into, in units of 1 / (n_from * n_into). */
static int64_t pixel_overlap(int at, int n_from, int into, int n_into)
{
    const int64_t low = (int64_t)at * n_into, low_into = (int64_t)into * n_from;
    const int64_t high = low + n_into, high_into = low_into + n_from;
    return (high < high_into ? high : high_into) - (low > low_into ? low : low_into);
}

static void reduce_row(CtsThumbnail *t, const float *pixels)
{
    for (int x = 0; x < t->width; x++) {
        float sum[4] = {0};
        for (int s = (int)((int64_t)x * t->source_width / t->width); s < t->source_width; s++) {
            const int64_t part = pixel_overlap(s, t->source_width, x, t->width);
            if (part <= 0)
                break;
            add_pixel(t, pixels + (size_t)s * (size_t)t->n_channels, (float)part / (float)t->source_width, sum);
        }
        memcpy(t->columns + 4 * (size_t)x, sum, sizeof sum);
    }
}

static void add_thumbnail_row(CtsThumbnail *t, const float *pixels)
{
    reduce_row(t, pixels);
    for (int y = (int)((int64_t)t->row * t->height / t->source_height); y < t->height; y++) {
        const int64_t part = pixel_overlap(t->row, t->source_height, y, t->height);
        if (part <= 0)
            break;
        const float weight = (float)part / (float)t->source_height;
        float *sums = t->sums + 4 * (size_t)y * (size_t)t->width;
        for (int i = 0; i < 4 * t->width; i++)
            sums[i] += weight * t->columns[i];
    }
}

/* The frame's sums become 8-bit display values in its slot. */
static void fill_slot(CtsThumbnail *t, int slot)
{
    for (int y = 0; y < t->height; y++)
        for (int x = 0; x < t->width; x++) {
            const float *sum = t->sums + 4 * ((size_t)y * (size_t)t->width + (size_t)x);
            const size_t column = (size_t)slot * (size_t)t->width + (size_t)x;
            uint8_t *out = t->strip + 4 * ((size_t)y * (size_t)t->width * (size_t)t->n_slots + column);
            out[3] = cts_round8(sum[3]);
            for (int c = 0; c < 3; c++)
                out[c] = out[3] ? cts_round8(cts_linear_to_srgb((double)sum[c] / (double)sum[3])) : 0;
        }
}

/* The slot of this frame, or -1. */
static int slot_of(const CtsThumbnail *t, int frame)
{
    const int slot = (int)(((int64_t)frame * t->n_slots + t->n_frames - 1) / t->n_frames);
    return slot < t->n_slots && (int64_t)slot * t->n_frames / t->n_slots == frame ? slot : -1;
}

CtsStatus cts_thumbnail_rows(CtsThumbnail *thumb, const CtsPicture *band, CtsError *err)
{
    CtsThumbnail *t = thumb;
    if (band->width != t->source_width || band->n_channels != t->n_channels || band->first_row != t->row ||
        t->frame >= t->n_frames || band->first_row + band->height > t->source_height)
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: a band of another picture", t->stem);
    const int slot = slot_of(t, t->frame);
    for (int y = 0; y < band->height; y++, t->row++)
        if (slot >= 0)
            add_thumbnail_row(t, band->pixels + (size_t)y * (size_t)band->width * (size_t)band->n_channels);
    if (t->row == t->source_height) {
        if (slot >= 0) {
            fill_slot(t, slot);
            memset(t->sums, 0, (size_t)t->width * (size_t)t->height * 4 * sizeof *t->sums);
        }
        t->row = 0;
        t->frame++;
    }
    return CTS_OK;
}

static CtsStatus write_thumbnail(const CtsThumbnail *t, CtsThumbnailFile *file, int quality, CtsError *err)
{
    const int width = file->n_frames * t->width, stride = 4 * t->width * t->n_slots;
    uint8_t *bytes = NULL, *pixels = t->strip;
    CtsTempFile *temp = NULL;
    char *path = NULL;
    CtsStatus st;
    /* For opaque pictures libwebp ignores the fourth byte, which is 255, and writes no alpha channel. */
    const size_t n = WebPEncodeRGBA(pixels, width, t->height, stride, (float)quality, &bytes);
    if (!n || asprintf(&path, "%s%s", t->stem, file->suffix) < 0)
        st = cts_fail(err, CTS_ERR_MEMORY, "%s%s: out of memory", t->stem, file->suffix);
    else if (!(st = cts_temp_open(&temp, path, err)) && !(st = cts_temp_write(temp, bytes, n, err))) {
        cts_temp_do_not_sync(temp);
        st = cts_temp_commit(&temp, true, &file->bytes, err);
    }
    cts_temp_discard(&temp);
    free(path);
    WebPFree(bytes);
    return st;
}

CtsStatus cts_thumbnail_end(CtsThumbnail **thumb, CtsThumbnailFile files[CTS_THUMBNAIL_FILES], int *n_files,
                            CtsError *err)
{
    const CtsThumbnail *t = *thumb;
    CtsStatus st = CTS_OK;
    *n_files = 0;
    if (t->frame != t->n_frames)
        st = cts_fail(err, CTS_ERR_INTERNAL, "%s: %d of %d frames came", t->stem, t->frame, t->n_frames);
    files[0] = (CtsThumbnailFile){.suffix = ".webp", .n_frames = 1, .width = t->width, .height = t->height};
    files[1] =
        (CtsThumbnailFile){.suffix = "-turn.webp", .n_frames = t->n_slots, .width = t->width, .height = t->height};
    if (!st && !(st = write_thumbnail(t, &files[0], QUALITY, err)))
        *n_files = 1;
    if (!st && t->n_slots > 1 && !(st = write_thumbnail(t, &files[1], TURN_QUALITY, err)))
        *n_files = 2;
    cts_thumbnail_discard(thumb);
    return st;
}
