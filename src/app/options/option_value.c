#include "app/options/options.h"

#include "base/did_you_mean.h"
#include "base/text.h"
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

bool cts_number(const char *text, double *value)
{
    /* strtod() also accepts blanks, hexadecimal numbers, nan and infinity, which are mistakes in an option. */
    if (!*text || text[strspn(text, "0123456789+-.eE")])
        return false;
    char *end;
    *value = strtod(text, &end);
    return end != text && !*end && isfinite(*value);
}

bool cts_integer(const char *text, int *value)
{
    if (!*text || text[strspn(text, "0123456789+-")])
        return false;
    char *end;
    errno = 0;
    const long n = strtol(text, &end, 10);
    if (end == text || *end || errno || n < INT_MIN || n > INT_MAX)
        return false;
    *value = (int)n;
    return true;
}

bool cts_numbers(const char *text, double *values, int n)
{
    for (int i = 0; i < n; i++) {
        char part[64];
        const size_t length = strcspn(text, ",");
        if (length >= sizeof part || (text[length] == ',') != (i < n - 1))
            return false;
        memcpy(part, text, length);
        part[length] = 0;
        if (!cts_number(part, &values[i]))
            return false;
        text += length + 1;
    }
    return true;
}

int cts_name_find(const char *option, const char *text, size_t length, const char *const *names, int n,
                  const char *more, CtsError *err)
{
    char list[CTS_VALUE_LISTS_MAX];
    size_t at = 0;
    for (int i = 0; i < n; i++)
        if (strlen(names[i]) == length && !strncmp(names[i], text, length))
            return i;
    for (int i = 0; i < n && at < sizeof list; i++)
        at += (size_t)snprintf(list + at, sizeof list - at, " %s", names[i]);
    cts_fail(err, CTS_ERR_USAGE, option ? "`%s` %s: not one of:%s%s%s" : "%s%s: not one of:%s%s%s",
             option ? option : "", text, list, more, cts_did_you_mean(text, length, names, n).text);
    return -1;
}

int cts_view_names(const char *names[CTS_NAMES_MAX])
{
    for (int i = 0; i < CTS_N_VIEWS; i++)
        names[i] = cts_views[i].name;
    return CTS_N_VIEWS;
}

int cts_format_names(const char *names[CTS_NAMES_MAX])
{
    int n = 0;
    for (; n < CTS_NAMES_MAX && cts_format((size_t)n); n++)
        names[n] = cts_format((size_t)n)->name;
    return n;
}

CtsStatus cts_view_of(const char *text, double *azimuth_deg, double *elevation_deg, CtsError *err)
{
    const char *names[CTS_NAMES_MAX];
    double angles[2];
    if (!cts_numbers(text, angles, 2)) {
        const int view = cts_name_find("view", text, strlen(text), names, cts_view_names(names),
                                       ", nor AZIMUTH,ELEVATION in degrees (such as -30,20)", err);
        if (view < 0)
            return CTS_ERR_USAGE;
        angles[0] = cts_views[view].azimuth_deg;
        angles[1] = cts_views[view].elevation_deg;
    }
    if (cts_setting_check(CTS_SETTING_AZIMUTH, angles[0], err) ||
        cts_setting_check(CTS_SETTING_ELEVATION, angles[1], err))
        return cts_context(err, "`view` %s", text);
    *azimuth_deg = angles[0];
    *elevation_deg = angles[1];
    return CTS_OK;
}

CtsStatus cts_format_of(const char *text, const CtsFormatInfo **format, CtsError *err)
{
    const char *names[CTS_NAMES_MAX];
    const int i = cts_name_find("format", text, strlen(text), names, cts_format_names(names), "", err);
    *format = i < 0 ? NULL : cts_format((size_t)i);
    return i < 0 ? CTS_ERR_USAGE : CTS_OK;
}

/* Two whole numbers with a sign between them. */
static bool pair(const char *text, char between, int value[2])
{
    char first[16];
    const char *sign = strchr(text, between);
    if (!sign || sign - text >= (ptrdiff_t)sizeof first)
        return false;
    snprintf(first, sizeof first, "%.*s", (int)(sign - text), text);
    return cts_integer(first, &value[0]) && cts_integer(sign + 1, &value[1]);
}

CtsStatus cts_parse_shard(CtsOptions *options, const char *text, CtsError *err)
{
    int of[2];
    if (!pair(text, '/', of) || of[1] < 1 || of[1] > 100000 || of[0] < 0 || of[0] >= of[1])
        return cts_fail(err, CTS_ERR_USAGE, "`shard` %s: not I/N with I from 0 to N - 1 (such as 0/8)", text);
    options->shard = (struct CtsShard){of[0], of[1]};
    return CTS_OK;
}

CtsStatus cts_parse_size(CtsOptions *options, const char *text, CtsError *err)
{
    int side[2];
    if (!pair(text, 'x', side) || cts_setting_check(CTS_SETTING_WIDTH, side[0], NULL) ||
        cts_setting_check(CTS_SETTING_HEIGHT, side[1], NULL))
        return cts_fail(err, CTS_ERR_USAGE, "`size` %s: not WxH in pixels, 1 to %d each (such as 1024x1024)", text,
                        CTS_MAX_SIDE);
    options->render.width = side[0];
    options->render.height = side[1];
    return CTS_OK;
}

CtsStatus cts_parse_smooth(CtsOptions *options, const char *text, CtsError *err)
{
    double mm = CTS_SMOOTH_AUTO;
    if (strcmp(text, "auto") && (!cts_number(text, &mm) || mm < 0 || mm > CTS_MAX_SMOOTH_MM))
        return cts_fail(err, CTS_ERR_USAGE, "`smooth` %s: neither auto nor a number from 0 to %d", text,
                        CTS_MAX_SMOOTH_MM);
    options->source.smooth_mm = mm;
    return CTS_OK;
}

CtsStatus cts_parse_kernel(CtsOptions *options, const char *text, CtsError *err)
{
    const size_t n = strcspn(text, ":");
    const int kernel = cts_name_find("kernel", text, n, cts_kernel_names, CTS_N_KERNELS, "", err);
    if (kernel < 0)
        return CTS_ERR_USAGE;
    options->render.kernel = (CtsKernelId)kernel;
    options->render.kernel_radius = 0;
    if (!text[n])
        return CTS_OK;
    if (!cts_number(text + n + 1, &options->render.kernel_radius) || options->render.kernel_radius == 0)
        return cts_fail(err, CTS_ERR_USAGE, "`kernel` %s: the radius is a number of voxels", text);
    return cts_setting_check(CTS_SETTING_KERNEL_RADIUS, options->render.kernel_radius, err)
               ? cts_context(err, "`kernel` %s", text)
               : CTS_OK;
}

CtsStatus cts_parse_background(CtsOptions *options, const char *text, CtsError *err)
{
    struct CtsBackground *const b = &options->background;
    *b = (struct CtsBackground){.given = true, .none = !strcmp(text, "none")};
    if (b->none)
        return CTS_OK;
    return cts_text_rgb(text, b->rgb) && !text[7]
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE, "`background` %s: neither #RRGGBB nor none (a # needs quotes in a shell)",
                          text);
}

CtsStatus cts_parse_crop(CtsOptions *options, const char *text, CtsError *err)
{
    double box[6];
    if (!cts_numbers(text, box, 6))
        return cts_fail(err, CTS_ERR_USAGE, "`crop` %s: not X0,X1,Y0,Y1,Z0,Z1 in millimetres (LPS)", text);
    for (int a = 0; a < 3; a++) {
        if (box[2 * a] > box[2 * a + 1])
            return cts_fail(err, CTS_ERR_USAGE, "`crop` %s: %c goes from %g down to %g (the smaller value comes first)",
                            text, "xyz"[a], box[2 * a], box[2 * a + 1]);
        options->source.crop.low_lps[a] = box[2 * a];
        options->source.crop.high_lps[a] = box[2 * a + 1];
    }
    options->source.crop.given = true;
    return CTS_OK;
}

/* Up to 1e6 mm, far beyond any position of a slice (1e5 mm). */
CtsStatus cts_parse_centre(CtsOptions *options, const char *text, CtsError *err)
{
    double *const centre = options->render.centre_lps;
    if (!cts_numbers(text, centre, 3) || fmax(fmax(fabs(centre[0]), fabs(centre[1])), fabs(centre[2])) > 1e6)
        return cts_fail(err, CTS_ERR_USAGE, "`centre` %s: not X,Y,Z in millimetres (LPS)", text);
    options->render.centre_given = true;
    return CTS_OK;
}

CtsStatus cts_parse_swivel(CtsOptions *options, const char *text, CtsError *err)
{
    const CtsBounds *frames = cts_setting_bounds(CTS_SETTING_FRAMES);
    double deg[2];
    if (!cts_numbers(text, deg, 2) || !(deg[1] > 0) || deg[0] > 360 || deg[0] < deg[1])
        return cts_fail(err, CTS_ERR_USAGE,
                        "`swivel` %s: not RANGE,STEP in degrees, the range at most 360 and no less "
                        "than the step",
                        text);
    const double n = 2 * round(deg[0] / deg[1]);
    if (n > frames->high)
        return cts_fail(err, CTS_ERR_USAGE, "`swivel` %s: more than %g pictures (a larger step)", text, frames->high);
    options->rotation = (int)n;
    options->swivel_step_deg = 2 * deg[0] / n;
    return CTS_OK;
}

CtsStatus cts_parse_slab(CtsOptions *options, const char *text, CtsError *err)
{
    static const double least = 1e-3, most = 1e5; /* mm; any position of a slice is within */
    char thickness[64];
    double mm, at_mm = 0;
    const size_t n = strcspn(text, "@");
    snprintf(thickness, sizeof thickness, "%.*s", (int)n, text);
    if (n >= sizeof thickness || !cts_number(thickness, &mm) || (text[n] && !cts_number(text + n + 1, &at_mm)) ||
        mm < least || mm > most || fabs(at_mm) > most)
        return cts_fail(err, CTS_ERR_USAGE,
                        "`slab` %s: not MM or MM@MM, a thickness from %g to %g and a distance from -%g to %g", text,
                        least, most, most, most);
    options->render.slab_mm = mm;
    options->render.slab_at_mm = at_mm;
    return CTS_OK;
}

CtsStatus cts_parse_fill(CtsOptions *options, const char *text, CtsError *err)
{
    static const double most = 131072; /* HU; twice the range of 16 bits, which no scanner's scale exceeds */
    double hu;
    if (!cts_number(text, &hu) || fabs(hu) > most)
        return cts_fail(err, CTS_ERR_USAGE, "`fill` %s: not a number of HU, such as 0", text);
    options->source.fill = (CtsFillValue){true, hu};
    return CTS_OK;
}

/* K, M, G and T are powers of 1024, and so are KiB to TiB; KB to TB too, as memory is counted so. 1 MiB to 1e15 bytes,
 * which no machine has. */
CtsStatus cts_parse_memory(CtsOptions *options, const char *text, CtsError *err)
{
    static const char units[] = "KMGTkmgt";
    char number[32];
    double size;
    const size_t n = strcspn(text, units);
    const char *const unit = text[n] ? strchr(units, text[n]) : NULL, *const rest = text + n + (unit != NULL);
    const double bytes = unit ? ldexp(1, 10 * (int)((unit - units) % 4 + 1)) : 1;
    const bool is_unit =
        !*rest || (unit && (!strcasecmp(rest, "B") || !strcasecmp(rest, "i") || !strcasecmp(rest, "iB")));
    snprintf(number, sizeof number, "%.*s", (int)(n < sizeof number ? n : 0), text);
    if (!is_unit || !cts_number(number, &size) || size * bytes < 1 << 20 || size * bytes > 1e15)
        return cts_fail(err, CTS_ERR_USAGE, "`memory` %s: not a size of 1M or more, such as 6G or 2GiB", text);
    options->memory_bytes = (uint64_t)(size * bytes);
    return CTS_OK;
}

/* Up to 1e6 HU, far beyond any volume's range. */
CtsStatus cts_parse_window(CtsOptions *options, const char *text, CtsError *err)
{
    double hu[2];
    if (!cts_numbers(text, hu, 2) || hu[0] == hu[1] || fabs(hu[0]) > 1e12 || fabs(hu[1]) > 1e12)
        return cts_fail(err, CTS_ERR_USAGE, "`window` %s: not LOW,HIGH, two different values", text);
    options->window = (struct CtsWindow){true, hu[0], hu[1]};
    return CTS_OK;
}

CtsStatus cts_parse_annotate(CtsOptions *options, const char *text, CtsError *err)
{
    static const char *const names[] = {"orientation", "scale", "labels", "captions"};
    enum { N_NAMES = sizeof names / sizeof *names };
    CtsMarks *const marks = &options->annotate;
    bool *const which_of[N_NAMES] = {&marks->orientation, &marks->scale, &marks->labels, &marks->captions};
    *marks = (CtsMarks){.orientation = false};
    if (!strcmp(text, "none"))
        return CTS_OK;
    for (const char *word = text;; word++) {
        const size_t n = strcspn(word, ",");
        const int which = cts_name_find("annotate", word, n, names, N_NAMES, " (or none)", err);
        if (which < 0)
            return CTS_ERR_USAGE;
        *which_of[which] = true;
        word += n;
        if (!*word)
            return CTS_OK;
    }
}
