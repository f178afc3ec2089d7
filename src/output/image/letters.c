/* Letters as a pen draws them: capitals of Latin and Greek, with their accents, digits and signs. */
#include "output/image/letters.h"

#include "base/text.h"
#include <stddef.h>
#include <string.h>

/* A pair of hexadecimal-like digits (0 to 9, a to g) is a point, right and down, and a blank lifts the pen. */
static const CtsGlyph glyphs[] = {
    {'0', 10, "307092a5ab9e7g3g1e0b051230"},
    {'1', 5, "03505g"},
    {'2', 10, "0411307091a3a5970gag"},
    {'3', 10, "13307091a3a5977838 7899abad9f7g3g0e"},
    {'4', 10, "8g800bab"},
    {'5', 10, "901008366698abac9f7g3g0e"},
    {'6', 10, "92704012060b1e3g7g9eacab987636180b"},
    {'7', 10, "00a04g"},
    {'8', 10, "3816123070929678380a0d2g8gadaa78"},
    {'9', 10, "1e3g6g9eaaa5927030120405183a7a98a5"},
    {'.', 1, "0g0g"},
    {'-', 10, "1a9a"},
    {'+', 10, "1a9a 565e"},
    {'e', 10, "0baba98626090d2g7g9f"},
    {'m', 14, "060g 092656787g 7896c6e8eg"},
    {'_', 10, "0gag"},
    {'A', 11, "0g50ag 2b8b"},
    {'B', 10, "0g0060819396876808 689aad8f6g0g"},
    {'C', 10, "a391703012040c1e3g7g9fad"},
    {'D', 10, "000g5g8faca4815000"},
    {'E', 9, "90000g9g 0878"},
    {'F', 9, "90000g 0878"},
    {'G', 10, "a391703012040c1e3g7g9fada969"},
    {'H', 10, "000g a0ag 08a8"},
    {'I', 1, "000g"},
    {'J', 8, "808c7e5g3g1e0c"},
    {'K', 10, "000g a009 45ag"},
    {'L', 9, "000g9g"},
    {'M', 12, "0g006ac0cg"},
    {'N', 10, "0g00aga0"},
    {'O', 10, "307092a4ac9e7g3g1e0c041230"},
    {'P', 9, "0g0060819396886909"},
    {'Q', 10, "307092a4ac9e7g3g1e0c041230 6bag"},
    {'R', 10, "0g0060819396886909 599g"},
    {'S', 10, "a3917030120416889aac9e7g3g1e0d"},
    {'T', 10, "00a0 505g"},
    {'U', 10, "000c1e3g7g9eaca0"},
    {'V', 10, "005ga0"},
    {'W', 14, "003g72bge0"},
    {'X', 10, "00ag a00g"},
    {'Y', 10, "0057a0 575g"},
    {'Z', 10, "00a00gag"},
    {',', 3, "2e0g"},
    {':', 1, "0606 0e0e"},
    {';', 3, "2626 2e0g"},
    {'(', 4, "4022242c2e4g"},
    {')', 4, "0022242c2e0g"},
    {'[', 4, "40000g4g"},
    {']', 4, "00404g0g"},
    {'{', 5, "50302126082a2f3g5g"},
    {'}', 5, "00203136583a3f2g0g"},
    {'/', 8, "0g80"},
    {'\\', 8, "008g"},
    {'|', 1, "000g"},
    {'=', 9, "0696 0b9b"},
    {'<', 8, "83088d"},
    {'>', 8, "03880d"},
    {'*', 8, "4149 0387 0783"},
    {'\'', 1, "0004"},
    {'"', 4, "0004 4044"},
    {'`', 3, "0034"},
    {'!', 1, "000a 0g0g"},
    {'?', 8, "031130608284484a 4g4g"},
    {'#', 10, "302g 807g 05a5 0bab"},
    {'&', 11, "bg242240607274190c1f3g6gbb"},
    {'$', 10, "a3917030120416889aac9e7g3g1e0d 505g"},
    {'^', 8, "044084"},
    {'%', 12, "103042443616040210 9abaccbebg9g8e8c9a 1gb0"},
    {'@', 13, "967556495b7b9996 99abcbd8d4a15022060b3f8gbf"},
    {'~', 10, "0927476989a7"},
    {0xB0, 4, "103041433414030110"}, /* degree */
    {0xB7, 1, "0808"},               /* middle dot */
    {0x393, 9, "0g0090"},            /* Greek letters that Latin has not */
    {0x394, 12, "600gcg60"},
    {0x398, 10, "307092a4ac9e7g3g1e0c041230 3878"},
    {0x39B, 11, "0g50ag"},
    {0x39E, 9, "0090 1888 0g9g"},
    {0x3A0, 10, "0g00a0ag"},
    {0x3A3, 9, "9000580g9g"},
    {0x3A6, 11, "3383a6aa8d3d0a0633 505g"},
    {0x3A8, 10, "0005295a89a5a0 505g"},
    {0x3A9, 12, "0g3g3c08043090c4c89c9gcg"},
};

/* Diacritics, drawn like letters, and the capitals of Latin-1, Latin Extended-A and Romanian, and Greek letters, that
 * have them, from the canonical decompositions of Unicode: each composed letter precedes its base. */
static const struct {
    uint16_t combining; /* the character that puts it on the letter before */
    CtsMark mark;
    const char *composed;
} accents[] = {
    {0x300, {{0, 6, "1054"}, CTS_MARK_ABOVE}, "ÀAÈEÌIÒOÙU"},
    {0x301,
     {{0, 6, "5014"}, CTS_MARK_ABOVE},
     "ÁAÉEÍIÓOÚUÝYĆCĹLŃNŔRŚSŹZ"
     "ΆΑΈΕΉΗΊΙΌΟΎΥΏΩάΑέΕήΗίΙόΟύΥώΩΐϊΰϋ"},
    {0x302, {{0, 6, "043064"}, CTS_MARK_ABOVE}, "ÂAÊEÎIÔOÛUĈCĜGĤHĴJŜSŴWŶY"},
    {0x303, {{0, 9, "0321537190"}, CTS_MARK_ABOVE}, "ÃAÑNÕOĨIŨU"},
    {0x304, {{0, 8, "0282"}, CTS_MARK_ABOVE}, "ĀAĒEĪIŌOŪU"},
    {0x306, {{0, 8, "0023446380"}, CTS_MARK_ABOVE}, "ĂAĔEĞGĬIŎOŬU"},
    {0x307, {{0, 1, "0203"}, CTS_MARK_ABOVE}, "ĊCĖEĠGİIŻZ"},
    {0x308, {{0, 7, "0203 7273"}, CTS_MARK_ABOVE}, "ÄAËEÏIÖOÜUŸYΪΙΫΥϊΙϋΥ"},
    {0x30A, {{0, 4, "103041433414030110"}, CTS_MARK_ABOVE}, "ÅAŮU"},
    {0x30B, {{0, 8, "3004 8054"}, CTS_MARK_ABOVE}, "ŐOŰU"},
    {0x30C, {{0, 6, "003460"}, CTS_MARK_ABOVE}, "ČCĎDĚEĽLŇNŘRŠSŤTŽZ"},
    {0x326, {{0, 2, "2204"}, CTS_MARK_BELOW}, "ȘSȚT"},
    {0x327, {{0, 4, "2022434414"}, CTS_MARK_BELOW}, "ÇCĢGĶKĻLŅNŖRŞSŢT"},
    {0x328, {{0, 4, "3012132444"}, CTS_MARK_BELOW}, "ĄAĘEĮIŲU"},
};

/* Characters that ASCII has others for. */
static const struct {
    uint16_t letter;
    const char *written;
} written_as[] = {
    {0xA0, " "}, {0xDF, "SS"}, {0x2010, "-"}, {0x2013, "-"}, {0x2018, "'"}, {0x2019, "'"},
};

/* Greek from 0x391 to 0x3A9 as Latin capitals of the same shape; a blank: drawn by a glyph of its own. */
static const char greek_capitals[] = "AB  EZH IK MN O P  TY X  ";
enum { ALPHA = 0x391, OMEGA = 0x3A9, SMALL_ALPHA = 0x3B1, FINAL_SIGMA = 0x3C2, SMALL_OMEGA = 0x3C9 };

#define N_OF(table) (sizeof(table) / sizeof *(table))

/* Of a letter without accents; Greek ones are capitals. */
static const CtsGlyph *glyph_of(uint32_t letter)
{
    if (letter >= SMALL_ALPHA && letter <= SMALL_OMEGA)
        letter -= SMALL_ALPHA - ALPHA - (letter == FINAL_SIGMA);
    if (letter >= ALPHA && letter <= OMEGA && greek_capitals[letter - ALPHA] != ' ')
        letter = (unsigned char)greek_capitals[letter - ALPHA];
    for (size_t i = 0; i < N_OF(glyphs); i++)
        if (glyphs[i].letter == letter)
            return &glyphs[i];
    return NULL;
}

/* The next code point of UTF-8; an invalid byte gives a code point without a glyph. */
static uint32_t next_code_point(const char **text)
{
    unsigned code = 0xFFFD;
    const size_t n = cts_text_code(*text, strnlen(*text, 4), &code);
    *text += n ? n : 1;
    return n ? code : 0xFFFD;
}

/* A letter whose parts are in the table. */
static bool find_capital(uint32_t capital, CtsLetter *letter)
{
    *letter = (CtsLetter){.glyph = glyph_of(capital)};
    for (size_t row = 0; !letter->glyph && row < N_OF(accents); row++)
        for (const char *p = accents[row].composed; *p && !letter->glyph;) {
            const bool is_it = next_code_point(&p) == capital;
            const uint32_t base = next_code_point(&p);
            if (is_it && find_capital(base, letter))
                letter->marks[letter->marks[0] ? 1 : 0] = &accents[row].mark;
        }
    return letter->glyph;
}

/* As a capital. In Unicode small letters follow their capitals, at a distance of 1 or, up to 0xFE, of 32. */
static bool find_letter(uint32_t code, CtsLetter *letter)
{
    enum { SMALL_FIRST = 0xE0, SMALL_LAST = 0xFE, APART = 32 };
    const uint32_t capital = code >= 'a' && code <= 'z' ? code - APART : code == 0xFF ? 0x178 : code;
    return find_capital(capital, letter) || (code > 0xFF && find_capital(code - 1, letter)) ||
           (code >= SMALL_FIRST && code <= SMALL_LAST && find_capital(code - APART, letter));
}

static const CtsMark *combining(uint32_t code)
{
    for (size_t i = 0; i < N_OF(accents); i++)
        if (accents[i].combining == code)
            return &accents[i].mark;
    return NULL;
}

static void add_letter(CtsLetters *letters, const CtsLetter *letter)
{
    if (letters->n < CTS_MAX_LETTERS)
        letters->items[letters->n++] = *letter;
    else
        letters->lacks = true;
}

/* On the letter before, which has room for two. */
static bool add_mark(CtsLetters *letters, const CtsMark *mark)
{
    CtsLetter *const last = letters->n ? &letters->items[letters->n - 1] : NULL;
    if (!last || !last->glyph || last->marks[1])
        return false;
    last->marks[last->marks[0] ? 1 : 0] = mark;
    return true;
}

void cts_letters_plain(const char *text, CtsLetters *letters)
{
    *letters = (CtsLetters){.n = 0};
    for (; *text; text++)
        add_letter(letters, &(CtsLetter){.glyph = glyph_of((unsigned char)*text)});
}

static void add_blank(CtsLetters *letters)
{
    if (letters->n && letters->items[letters->n - 1].glyph)
        add_letter(letters, &(CtsLetter){.glyph = NULL});
}

void cts_letters_add(const char *text, CtsLetters *letters)
{
    while (*text) {
        const uint32_t code = next_code_point(&text);
        const CtsMark *const mark = combining(code);
        const char *written = NULL;
        CtsLetter letter;
        for (size_t i = 0; i < N_OF(written_as); i++)
            if (written_as[i].letter == code)
                written = written_as[i].written;
        if (code == ' ' || (written && *written == ' '))
            add_blank(letters);
        else if (written)
            for (; *written; written++)
                add_letter(letters, &(CtsLetter){.glyph = glyph_of((unsigned char)*written)});
        else if (mark)
            letters->lacks |= !add_mark(letters, mark);
        else if (find_letter(code, &letter))
            add_letter(letters, &letter);
        else
            letters->lacks = true;
    }
    while (letters->n && !letters->items[letters->n - 1].glyph)
        letters->n--;
}
