#include "core/labels/label_choice.h"
#include "core/volume/owners.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Okabe and Ito 2008, but for black: told apart whatever kind of colour vision one has. */
static const uint8_t colours[][3] = {{230, 159, 0}, {86, 180, 233}, {0, 158, 115},  {240, 228, 66},
                                     {0, 114, 178}, {213, 94, 0},   {204, 121, 167}};
enum { N_COLOURS = sizeof colours / sizeof *colours };

/* Where they come round again they are paler, and then darker. */
void cts_label_colour(size_t n, double rgb[3])
{
    const size_t round = n / N_COLOURS % 3;
    for (int c = 0; c < 3; c++) {
        const double full = colours[n % N_COLOURS][c] / 255.0;
        rgb[c] = round == 0 ? full : round == 1 ? 0.5 + full / 2 : full / 2;
    }
}

static CtsStatus load(const char *name, CtsOwnerLook *look, CtsError *err)
{
    look->preset = calloc(1, sizeof *look->preset);
    if (!look->preset)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsStatus st = cts_preset_load(name, look->preset, err);
    if (st) {
        free(look->preset);
        look->preset = NULL;
    }
    return st;
}

CtsStatus cts_label_look(const char *text, CtsOwnerLook *look, CtsError *err)
{
    *look = (CtsOwnerLook){.opacity = -1};
    if (text[0] != '#')
        return load(text, look, err);
    const char *const end = text + 7;
    char *last = NULL;
    bool right = strspn(text + 1, "0123456789abcdefABCDEF") == 6 && (!*end || *end == ':');
    if (right && *end) {
        look->opacity = strtod(end + 1, &last);
        right = last != end + 1 && !*last && end[1 + strspn(end + 1, "0123456789.eE-+")] == 0 && look->opacity >= 0 &&
                look->opacity <= 1;
    }
    if (!right)
        return cts_fail(err, CTS_ERR_USAGE,
                        "%s: not a preset, #RRGGBB nor #RRGGBB:OPACITY with an opacity per mm of 0 "
                        "to 1 (a # needs quotes in a shell)",
                        text);
    const unsigned long rgb = strtoul(text + 1, NULL, 16);
    look->tinted = true;
    for (int c = 0; c < 3; c++)
        look->rgb[c] = (double)(rgb >> (16 - 8 * c) & 255) / 255;
    return CTS_OK;
}
