#include "base/text.h"
#include "core/labels/label_set.h"
#include "core/model/voxel_labels.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Okabe and Ito 2008, without black: distinguishable with any kind of colour vision. */
static const uint8_t colours[][3] = {{230, 159, 0}, {86, 180, 233}, {0, 158, 115},  {240, 228, 66},
                                     {0, 114, 178}, {213, 94, 0},   {204, 121, 167}};
enum { N_COLOURS = sizeof colours / sizeof *colours };

/* Repeated cycles are paler, then darker. */
void cts_label_colour(size_t n, double rgb[3])
{
    const size_t round = n / N_COLOURS % 3;
    for (int c = 0; c < 3; c++) {
        const double full = colours[n % N_COLOURS][c] / 255.0;
        rgb[c] = round == 0 ? full : round == 1 ? 0.5 + full / 2 : full / 2;
    }
}

/* The value whose CIE function is t. */
static double uncie(double t)
{
    return t > 6.0 / 29 ? t * t * t : 3 * (6.0 / 29) * (6.0 / 29) * (t - 4.0 / 29);
}

static double srgb(double linear)
{
    const double v = fmin(fmax(linear, 0), 1);
    return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

/* CIELab to XYZ and sRGB (IEC 61966-2-1; Lindbloom's matrix), both under D65. PS3.3 C.10.7.1.1 specifies D50, but
 * DCMTK, highdicom and dcmjs, which write nearly all files, and the viewers use D65. */
void cts_label_take_lab(CtsLabel *l, const int lab[3])
{
    static const double white[3] = {0.95047, 1, 1.08883};
    static const double to_rgb[3][3] = {
        {3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
    const double y = (lab[0] * 100 / 65535.0 + 16) / 116;
    const double t[3] = {y + (lab[1] * 255 / 65535.0 - 128) / 500, y, y - (lab[2] * 255 / 65535.0 - 128) / 200};
    double linear[3] = {0};
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < 3; i++)
            linear[c] += to_rgb[c][i] * white[i] * uncie(t[i]);
    for (int c = 0; c < 3; c++)
        l->rgb[c] = srgb(linear[c]);
    l->coloured = true;
}

static CtsStatus load_preset(const char *name, CtsAppearance *appearance, CtsError *err)
{
    appearance->preset = calloc(1, sizeof *appearance->preset);
    if (!appearance->preset)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsStatus st = cts_preset_load(name, appearance->preset, err);
    if (st) {
        free(appearance->preset);
        appearance->preset = NULL;
    }
    return st;
}

CtsStatus cts_label_appearance_parse(const char *text, CtsAppearance *appearance, CtsError *err)
{
    *appearance = (CtsAppearance){.opacity = -1};
    if (text[0] != '#')
        return load_preset(text, appearance, err);
    const char *const end = text + 7;
    char *last = NULL;
    bool right = cts_text_rgb(text, appearance->rgb) && (!*end || *end == ':');
    if (right && *end) {
        appearance->opacity = strtod(end + 1, &last);
        right = last != end + 1 && !*last && end[1 + strspn(end + 1, "0123456789.eE-+")] == 0 &&
                appearance->opacity >= 0 && appearance->opacity <= 1;
    }
    if (!right)
        return cts_fail(err, CTS_ERR_USAGE,
                        "%s: not a preset, #RRGGBB nor #RRGGBB:OPACITY with an opacity per mm of 0 "
                        "to 1 (a # needs quotes in a shell)",
                        text);
    appearance->tinted = true;
    return CTS_OK;
}
