/* The three parts of raw2ct: options (raw2ct.c), slices cut from the raw volume (raw2ct_slices.c), DICOM files
 * (raw2ct_dicom.cc). A test tool: errors go to stderr. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { MAX_NUMBERS = 4096 };

typedef struct Numbers {
    int n;
    double v[MAX_NUMBERS];
} Numbers;

typedef struct Options {
    int size[3];
    double spacing_mm[3];
    bool raw_unsigned; /* raw samples are uint16 */
    bool stored;       /* raw samples are stored values, not HU */
    bool flip[3];
    const char *orientation; /* a word, or six cosines */
    bool centred;
    double origin_lps[3];
    Numbers positions_mm, skip, slopes, intercepts, padding; /* padding: value, and maybe range limit */
    double tilt_deg, thickness_mm;                           /* thickness 0: the slice spacing */
    bool is_unsigned, junk, pad_circle;
    int bits_stored, high_bit, series_number, first_instance, acquisition;
    const char *syntax, *patient, *patient_id, *description, *image_type, *series_uid, *study, *prefix, *suffix;
    const char *raw, *folder;
} Options;

/* A stack of slices: its axes (columns, rows, slices) are raw axes, maybe backwards. */
typedef struct Stack {
    int n[3], axis[3];
    bool back[3];
    double spacing_mm[3];
    double direction[3][3]; /* unit vectors, LPS: along a row, down a column, direction of the table feed */
    double first_lps[3];    /* the first voxel of the first slice */
    int32_t *raw;           /* owned */
} Stack;

/* Comma-separated finite numbers; false when the text is anything else. */
bool parse_numbers(const char *text, Numbers *numbers);
/* List entry k, modulo the length of the list. */
double pick(const Numbers *list, int k);

/* Reads the raw file and lays the slices out; false after a message. Free with stack_free(). */
bool stack_make(const Options *o, Stack *stack);
void stack_free(Stack *stack);
void stack_position(const Options *o, const Stack *stack, int k, double lps[3]);
/* The stored 16-bit words of slice k; pixels has room for n[0] * n[1]. */
void stack_pixels(const Options *o, const Stack *stack, int k, uint16_t *pixels);

/* Writes one file for each slice; false after a message. */
bool write_series(const Options *o, const Stack *stack);

#ifdef __cplusplus
}
#endif
