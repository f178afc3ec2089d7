#include "raw2ct.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int32_t *read_raw(const Options *o)
{
    const size_t n = (size_t)o->size[0] * (size_t)o->size[1] * (size_t)o->size[2];
    FILE *f = fopen(o->raw, "rb");
    uint8_t *bytes = malloc(2 * n + 1);
    int32_t *samples = malloc(n * sizeof *samples);
    const size_t got = f && bytes && samples ? fread(bytes, 1, 2 * n + 1, f) : 0;
    if (got == 2 * n) {
        for (size_t i = 0; i < n; i++) {
            const int32_t v = bytes[2 * i] | bytes[2 * i + 1] << 8;
            samples[i] = o->raw_unsigned || v < 32768 ? v : v - 65536;
        }
    } else {
        fprintf(stderr, "raw2ct: %s: cannot be read, or is not the %zu bytes of its size\n", o->raw, 2 * n);
        free(samples);
        samples = NULL;
    }
    free(bytes);
    if (f)
        fclose(f);
    return samples;
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
}

static bool normalise(double v[3])
{
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int c = 0; c < 3; c++)
        v[c] /= length;
    return length > 0;
}

/* Orientation of the stack in the raw volume, and of the raw axes in the patient. */
static bool orient(const char *orientation, Stack *s, double frame[3][3])
{
    static const struct {
        const char *name;
        int axis[3];
        bool back[3];
    } cuts[] = {
        {"axial", {0, 1, 2}, {false, false, false}},
        {"coronal", {0, 2, 1}, {false, true, false}},
        {"sagittal", {1, 2, 0}, {false, true, true}},
    };
    static Numbers cosines;
    for (int a = 0; a < 3; a++) {
        s->axis[a] = a;
        frame[a][a] = 1;
    }
    for (size_t i = 0; i < sizeof cuts / sizeof *cuts; i++)
        if (!strcmp(cuts[i].name, orientation)) {
            memcpy(s->axis, cuts[i].axis, sizeof s->axis);
            memcpy(s->back, cuts[i].back, sizeof s->back);
            return true;
        }
    if (!parse_numbers(orientation, &cosines) || cosines.n != 6)
        return false;
    memcpy(frame[0], cosines.v, sizeof frame[0]);
    memcpy(frame[1], cosines.v + 3, sizeof frame[1]);
    cross(frame[0], frame[1], frame[2]);
    return normalise(frame[0]) && normalise(frame[1]) && normalise(frame[2]);
}

bool stack_make(const Options *o, Stack *s)
{
    double frame[3][3] = {{0}};
    if (!orient(o->orientation, s, frame)) {
        fprintf(stderr, "raw2ct: --orientation %s: axial, coronal, sagittal or six cosines\n", o->orientation);
        return false;
    }
    for (int a = 0; a < 3; a++) {
        s->n[a] = o->size[s->axis[a]];
        s->spacing_mm[a] = o->spacing_mm[s->axis[a]];
        for (int c = 0; c < 3; c++)
            s->direction[a][c] = (s->back[a] ? -1 : 1) * frame[s->axis[a]][c];
    }
    const double tilt = o->tilt_deg * (M_PI / 180);
    for (int c = 0; c < 3; c++)
        s->direction[1][c] = s->direction[1][c] * cos(tilt) + s->direction[2][c] * sin(tilt);
    for (int c = 0; c < 3; c++) {
        s->first_lps[c] = o->centred ? 0 : o->origin_lps[c];
        for (int a = 0; a < 3; a++) {
            const double way = (s->n[a] - 1) * s->spacing_mm[a] * s->direction[a][c];
            if (o->centred)
                s->first_lps[c] -= 0.5 * way;
            else if (s->back[a]) /* the origin is that of the raw volume, at the far end of this axis */
                s->first_lps[c] -= way;
        }
    }
    if (o->positions_mm.n && o->positions_mm.n != s->n[2]) {
        fprintf(stderr, "raw2ct: --positions: %d numbers for %d slices\n", o->positions_mm.n, s->n[2]);
        return false;
    }
    s->raw = read_raw(o);
    return s->raw != NULL;
}

void stack_free(Stack *s)
{
    free(s->raw);
    s->raw = NULL;
}

void stack_position(const Options *o, const Stack *s, int k, double lps[3])
{
    const double way = o->positions_mm.n ? o->positions_mm.v[k] : k * s->spacing_mm[2];
    for (int c = 0; c < 3; c++)
        lps[c] = s->first_lps[c] + way * s->direction[2][c];
}

static int32_t sample(const Options *o, const Stack *s, int i, int j, int k)
{
    const int at[3] = {i, j, k};
    size_t index[3];
    for (int a = 0; a < 3; a++) {
        const int raw = s->axis[a];
        index[raw] = (size_t)(s->back[a] != o->flip[raw] ? s->n[a] - 1 - at[a] : at[a]);
    }
    return s->raw[(index[2] * (size_t)o->size[1] + index[1]) * (size_t)o->size[0] + index[0]];
}

/* The stored value, clamped to what the bits hold. */
static int32_t stored_value(const Options *o, const Stack *s, int i, int j, int k)
{
    const int32_t lo = o->is_unsigned ? 0 : -(1 << (o->bits_stored - 1));
    const int32_t hi = o->is_unsigned ? (1 << o->bits_stored) - 1 : (1 << (o->bits_stored - 1)) - 1;
    const double u = (i + 0.5) / s->n[0] * 2 - 1, w = (j + 0.5) / s->n[1] * 2 - 1;
    int32_t v = sample(o, s, i, j, k);
    if (!o->stored)
        v = (int32_t)floor((v - pick(&o->intercepts, k)) / pick(&o->slopes, k) + 0.5);
    if (o->pad_circle && u * u + w * w > 1)
        v = (int32_t)o->padding.v[0];
    return v < lo ? lo : v > hi ? hi : v;
}

void stack_pixels(const Options *o, const Stack *s, int k, uint16_t *pixels)
{
    const uint32_t mask = (1u << o->bits_stored) - 1;
    const int shift = o->high_bit + 1 - o->bits_stored;
    const uint32_t unused = 0xffffu & ~(mask << shift), above = 0xffffu & ~((2u << o->high_bit) - 1);
    for (int j = 0; j < s->n[1]; j++)
        for (int i = 0; i < s->n[0]; i++) {
            const int32_t v = stored_value(o, s, i, j, k);
            uint32_t word = ((uint32_t)v & mask) << shift;
            if (o->junk)
                word |= ((uint32_t)(i * 37 + j * 101 + k * 53) * 2654435761u >> 16) & unused;
            else if (v < 0)
                word |= above; /* sign-extended, as most scanners write it */
            *pixels++ = (uint16_t)word;
        }
}
