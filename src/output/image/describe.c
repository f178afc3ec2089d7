#include "output/image/describe.h"

#include "base/vec3.h"
#include "ctsplat/render.h"
#include <locale.h>
#include <math.h>
#include <stdio.h>

CtsPhrase cts_describe_number(double value, int n_digits)
{
    CtsPhrase number;
    const locale_t plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    const locale_t before = plain ? uselocale(plain) : (locale_t)0;
    snprintf(number.text, sizeof number.text, "%.*g", n_digits, value + 0.0); /* + 0.0: no "-0" */
    if (plain) {
        uselocale(before);
        freelocale(plain);
    }
    return number;
}

static CtsPhrase number_pair(double a, double b)
{
    CtsPhrase pair;
    snprintf(pair.text, sizeof pair.text, "%.30s,%.30s", cts_describe_number(a, 9).text,
             cts_describe_number(b, 9).text);
    return pair;
}

CtsPhrase cts_describe_view(const CtsPictureInfo *info)
{
    CtsPhrase view = number_pair(info->azimuth_deg, info->elevation_deg);
    if (*info->tiles)
        return (CtsPhrase){"several"};
    for (int i = 0; i < CTS_N_VIEWS; i++)
        if (fmod(info->azimuth_deg - cts_views[i].azimuth_deg, 360) == 0 &&
            info->elevation_deg == cts_views[i].elevation_deg)
            snprintf(view.text, sizeof view.text, "%s", cts_views[i].name);
    return view;
}

void cts_describe_picture(const CtsPictureInfo *info, char text[CTS_DESCRIPTION])
{
    if (*info->tiles)
        snprintf(text, CTS_DESCRIPTION, "ctsplat %s, %s; not for diagnostic use", CTS_VERSION, info->tiles);
    else
        snprintf(text, CTS_DESCRIPTION, "ctsplat %s, preset %s, view %s; not for diagnostic use", CTS_VERSION,
                 info->preset, cts_describe_view(info).text);
}

CtsPhrase cts_describe_direction(const double direction_lps[3])
{
    static const char letters[3][2] = {{'L', 'R'}, {'P', 'A'}, {'H', 'F'}}; /* towards +, towards - */
    static const double sin_15_deg = 0.25881904510252074;
    const double length = cts_norm3(direction_lps);
    bool used[3] = {false, false, false};
    CtsPhrase direction = {""};
    int n = 0;
    for (; n < 3 && length > 0; n++) {
        int best = -1;
        for (int a = 0; a < 3; a++)
            if (!used[a] && (best < 0 || fabs(direction_lps[a]) > fabs(direction_lps[best])))
                best = a;
        if (fabs(direction_lps[best]) <= sin_15_deg * length)
            break;
        used[best] = true;
        direction.text[n] = letters[best][direction_lps[best] < 0];
    }
    return direction;
}

void cts_describe_error(double rmse, char text[CTS_ERROR_TEXT])
{
    snprintf(text, CTS_ERROR_TEXT, "%.11s/255 rms", cts_describe_number(255 * rmse, 3).text);
}

CtsPhrase cts_describe_window(const CtsPictureInfo *info)
{
    const bool has_none = info->mode == CTS_MODE_COMPOSITE || info->window_high_hu == info->window_low_hu;
    return has_none ? (CtsPhrase){""} : number_pair(info->window_low_hu, info->window_high_hu);
}
