#include "cli/values.h"

#include "cli/words.h"
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool cli_number(const char *text, double *value)
{
    /* strtod also takes blanks, hexadecimal, nan and infinity: none of these is meant on a command line. */
    if (!*text || text[strspn(text, "0123456789+-.eE")])
        return false;
    char *end;
    *value = strtod(text, &end);
    return end != text && !*end && isfinite(*value);
}

bool cli_integer(const char *text, int *value)
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

bool cli_numbers(const char *text, double *values, int n)
{
    for (int i = 0; i < n; i++) {
        char part[64];
        const size_t length = strcspn(text, ",");
        if (length >= sizeof part || (text[length] == ',') != (i < n - 1))
            return false;
        memcpy(part, text, length);
        part[length] = 0;
        if (!cli_number(part, &values[i]))
            return false;
        text += length + 1;
    }
    return true;
}

/* The place of the first length bytes of text among names, or -1. */
static int find_name(const char *text, size_t length, const char *const *names, int n)
{
    for (int i = 0; i < n; i++)
        if (strlen(names[i]) == length && !strncmp(names[i], text, length))
            return i;
    return -1;
}

static CtsStatus parse_on_off(const char *option, const char *text, CtsSwitch *value, CtsError *err)
{
    if (!strcmp(text, "on"))
        *value = CTS_ON;
    else if (!strcmp(text, "off"))
        *value = CTS_OFF;
    else
        return cts_fail(err, CTS_ERR_USAGE, "%s %s: not one of: on off", option, text);
    return CTS_OK;
}

CtsStatus cli_parse_shard(CliOptions *options, const char *text, CtsError *err)
{
    char shard[16];
    const size_t n = strcspn(text, "/");
    int i, n_shards;
    snprintf(shard, sizeof shard, "%.*s", n < sizeof shard ? (int)n : 0, text);
    if (!text[n] || !cli_integer(shard, &i) || !cli_integer(text + n + 1, &n_shards) || n_shards < 1 ||
        n_shards > 100000 || i < 0 || i >= n_shards)
        return cts_fail(err, CTS_ERR_USAGE, "--shard %s: not I/N with I from 0 to N - 1 (such as 0/8)", text);
    options->shard = i;
    options->n_shards = n_shards;
    return CTS_OK;
}

CtsStatus cli_parse_view(CliOptions *options, const char *text, CtsError *err)
{
    for (int i = 0; i < CTS_N_VIEWS; i++)
        if (!strcmp(text, cts_views[i].name)) {
            options->render.azimuth_deg = cts_views[i].azimuth_deg;
            options->render.elevation_deg = cts_views[i].elevation_deg;
            return CTS_OK;
        }
    double angles[2];
    char names[CLI_WORDS_MAX];
    if (!cli_numbers(text, angles, 2))
        return cts_fail(err, CTS_ERR_USAGE,
                        "--view %s: not one of: %s, nor AZIMUTH,ELEVATION in degrees (such as -30,20)", text,
                        cli_words("{views}", names));
    const CtsBounds *azimuth = cts_setting_bounds(CTS_SETTING_AZIMUTH);
    const CtsBounds *elevation = cts_setting_bounds(CTS_SETTING_ELEVATION);
    if (cts_setting_check(CTS_SETTING_AZIMUTH, angles[0], NULL) ||
        cts_setting_check(CTS_SETTING_ELEVATION, angles[1], NULL))
        return cts_fail(err, CTS_ERR_USAGE, "--view %s: the azimuth goes from %g to %g, the elevation from %g to %g",
                        text, azimuth->low, azimuth->high, elevation->low, elevation->high);
    options->render.azimuth_deg = angles[0];
    options->render.elevation_deg = angles[1];
    return CTS_OK;
}

CtsStatus cli_parse_size(CliOptions *options, const char *text, CtsError *err)
{
    char width[16];
    const size_t n = strcspn(text, "x");
    int w, h;
    if (n >= sizeof width || text[n] != 'x')
        goto bad;
    memcpy(width, text, n);
    width[n] = 0;
    if (!cli_integer(width, &w) || !cli_integer(text + n + 1, &h) || cts_setting_check(CTS_SETTING_WIDTH, w, NULL) ||
        cts_setting_check(CTS_SETTING_HEIGHT, h, NULL))
        goto bad;
    options->render.width = w;
    options->render.height = h;
    return CTS_OK;
bad:
    return cts_fail(err, CTS_ERR_USAGE, "--size %s: not WxH in pixels, 1 to %d each (such as 1024x1024)", text,
                    CTS_MAX_SIDE);
}

void cli_print_size(const CliOptions *options, FILE *file)
{
    fprintf(file, "%dx%d", options->render.width, options->render.height);
}

CtsStatus cli_parse_kernel(CliOptions *options, const char *text, CtsError *err)
{
    const size_t n = strcspn(text, ":");
    char names[CLI_WORDS_MAX];
    const int kernel = find_name(text, n, cts_kernel_names, CTS_N_KERNELS);
    if (kernel < 0)
        return cts_fail(err, CTS_ERR_USAGE, "--kernel %s: not one of: %s", text, cli_words("{kernels}", names));
    options->render.kernel = (CtsKernelId)kernel;
    options->render.kernel_radius = 0;
    if (!text[n])
        return CTS_OK;
    double radius;
    const CtsBounds *b = cts_setting_bounds(CTS_SETTING_KERNEL_RADIUS);
    if (!cli_number(text + n + 1, &radius) || radius < b->low || radius > b->high)
        return cts_fail(err, CTS_ERR_USAGE, "--kernel %s: the radius is a number of voxels, %g to %g", text, b->low,
                        b->high);
    options->render.kernel_radius = radius;
    return CTS_OK;
}

void cli_print_kernel(const CliOptions *options, FILE *file)
{
    fprintf(file, "%s:%.17g", cts_kernel_names[options->render.kernel], options->render.kernel_radius);
}

CtsStatus cli_parse_void(CliOptions *options, const char *text, CtsError *err)
{
    if (strcmp(text, "strict") && strcmp(text, "key"))
        return cts_fail(err, CTS_ERR_USAGE, "--void %s: not one of: strict key", text);
    options->render.void_key = !strcmp(text, "key");
    return CTS_OK;
}

void cli_print_void(const CliOptions *options, FILE *file)
{
    fprintf(file, "%d", options->render.void_key);
}

CtsStatus cli_parse_unit(CliOptions *options, const char *text, CtsError *err)
{
    if (strcmp(text, "mm") && strcmp(text, "voxel"))
        return cts_fail(err, CTS_ERR_USAGE, "--opacity-unit %s: not one of: mm voxel", text);
    options->render.opacity_per_voxel = !strcmp(text, "voxel");
    return CTS_OK;
}

void cli_print_unit(const CliOptions *options, FILE *file)
{
    fprintf(file, "%d", options->render.opacity_per_voxel);
}

CtsStatus cli_parse_shade(CliOptions *options, const char *text, CtsError *err)
{
    return parse_on_off("--shade", text, &options->render.shade, err);
}

CtsStatus cli_parse_table(CliOptions *options, const char *text, CtsError *err)
{
    return parse_on_off("--remove-table", text, &options->remove_table, err);
}

CtsStatus cli_parse_background(CliOptions *options, const char *text, CtsError *err)
{
    options->background_given = true;
    options->background_none = !strcmp(text, "none");
    if (options->background_none)
        return CTS_OK;
    if (text[0] != '#' || strlen(text) != 7 || text[1 + strspn(text + 1, "0123456789abcdefABCDEF")])
        return cts_fail(err, CTS_ERR_USAGE, "--background %s: neither #RRGGBB nor none (a # needs quotes in a shell)",
                        text);
    const unsigned long rgb = strtoul(text + 1, NULL, 16);
    for (int c = 0; c < 3; c++)
        options->background[c] = (double)(rgb >> (16 - 8 * c) & 255) / 255;
    return CTS_OK;
}

CtsStatus cli_parse_crop(CliOptions *options, const char *text, CtsError *err)
{
    double box[6];
    if (!cli_numbers(text, box, 6))
        return cts_fail(err, CTS_ERR_USAGE, "--crop %s: not X0,X1,Y0,Y1,Z0,Z1 in millimetres (LPS)", text);
    for (int a = 0; a < 3; a++) {
        if (box[2 * a] > box[2 * a + 1])
            return cts_fail(err, CTS_ERR_USAGE, "--crop %s: %c goes from %g down to %g (the smaller value comes first)",
                            text, "xyz"[a], box[2 * a], box[2 * a + 1]);
        options->crop_low_lps[a] = box[2 * a];
        options->crop_high_lps[a] = box[2 * a + 1];
    }
    options->crop_given = true;
    return CTS_OK;
}

void cli_print_crop(const CliOptions *options, FILE *file)
{
    for (int a = 0; a < 3 && options->crop_given; a++)
        fprintf(file, "%.17g,%.17g,", options->crop_low_lps[a], options->crop_high_lps[a]);
}

CtsStatus cli_parse_smooth(CliOptions *options, const char *text, CtsError *err)
{
    if (!cli_number(text, &options->smooth_mm) || !(options->smooth_mm >= 0 && options->smooth_mm <= CTS_MAX_SMOOTH_MM))
        return cts_fail(err, CTS_ERR_USAGE, "--smooth %s: not a standard deviation of 0 to %d mm", text,
                        CTS_MAX_SMOOTH_MM);
    return CTS_OK;
}

void cli_print_smooth(const CliOptions *options, FILE *file)
{
    fprintf(file, "%.17g", options->smooth_mm);
}

CtsStatus cli_parse_window(CliOptions *options, const char *text, CtsError *err)
{
    double window[2];
    if (!cli_numbers(text, window, 2) || !(window[0] < window[1]) || fabs(window[0]) > 1e6 || fabs(window[1]) > 1e6)
        return cts_fail(err, CTS_ERR_USAGE, "--window %s: not LOW,HIGH in HU, the lower first", text);
    options->window_given = true;
    options->window_low_hu = window[0];
    options->window_high_hu = window[1];
    return CTS_OK;
}

CtsStatus cli_parse_annotate(CliOptions *options, const char *text, CtsError *err)
{
    static const char *const names[] = {"orientation", "scale"};
    options->annotate_orientation = options->annotate_scale = false;
    if (!strcmp(text, "none"))
        return CTS_OK;
    for (const char *word = text;; word++) {
        const size_t n = strcspn(word, ",");
        const int which = find_name(word, n, names, 2);
        if (which < 0)
            return cts_fail(err, CTS_ERR_USAGE, "--annotate %s: not a list of: orientation scale (or none)", text);
        *(which ? &options->annotate_scale : &options->annotate_orientation) = true;
        word += n;
        if (!*word)
            return CTS_OK;
    }
}

void cli_print_annotate(const CliOptions *options, FILE *file)
{
    fprintf(file, "%d,%d", options->annotate_orientation, options->annotate_scale);
}

CtsStatus cli_parse_output(CliOptions *options, const char *text, CtsError *err)
{
    if (!*text)
        return cts_fail(err, CTS_ERR_USAGE, "-o: an empty file name");
    options->outputs[options->n_outputs++] = text;
    return CTS_OK;
}

CtsStatus cli_parse_format(CliOptions *options, const char *text, CtsError *err)
{
    const CtsFormatInfo *format;
    char names[128] = "";
    for (size_t i = 0; (format = cts_format(i)); i++) {
        if (!strcmp(text, format->name)) {
            options->format = format;
            return CTS_OK;
        }
        strncat(names, " ", sizeof names - strlen(names) - 1);
        strncat(names, format->name, sizeof names - strlen(names) - 1);
    }
    return cts_fail(err, CTS_ERR_USAGE, "--format %s: not one of:%s", text, names);
}

CtsStatus cli_parse_send(CliOptions *options, const char *text, CtsError *err)
{
    options->send_given = true;
    return cts_peer_parse(text, &options->send, err) ? cts_context(err, "--send") : CTS_OK;
}

CtsStatus cli_parse_from(CliOptions *options, const char *text, CtsError *err)
{
    options->from_given = true;
    return cts_peer_parse(text, &options->from, err) ? cts_context(err, "--from") : CTS_OK;
}
