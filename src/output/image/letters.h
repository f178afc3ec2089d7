/* A stroke font for text in pictures. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

/* In units in which a capital is CTS_CAPITAL high; 0, 0 is its upper left corner. */
enum { CTS_CAPITAL = 16, CTS_LETTER_GAP = 6, CTS_MARK_HEIGHT = 4, CTS_MARK_GAP = 3 };

typedef struct CtsGlyph {
    uint32_t letter; /* its code point */
    int width;
    const char *strokes;
} CtsGlyph;

typedef enum CtsMarkPlace { CTS_MARK_ABOVE, CTS_MARK_BELOW } CtsMarkPlace;

/* An accent: up to CTS_MARK_HEIGHT high. */
typedef struct CtsMark {
    CtsGlyph glyph;
    CtsMarkPlace place;
} CtsMark;

typedef struct CtsLetter {
    const CtsGlyph *glyph;   /* NULL: a blank */
    const CtsMark *marks[2]; /* diacritics from the letter outwards; NULL: none */
} CtsLetter;

enum { CTS_MAX_LETTERS = 128 };
typedef struct CtsLetters {
    CtsLetter items[CTS_MAX_LETTERS];
    int n;
    bool lacks; /* some of the text cannot be drawn */
} CtsLetters;

/* ASCII without conversion: capitals, digits, and the small letters of units. */
void cts_letters_plain(const char *text, CtsLetters *letters);
/* Adds a text in UTF-8 in capitals; skips letters without a glyph, and joins several blanks to one. */
void cts_letters_add(const char *text, CtsLetters *letters);
