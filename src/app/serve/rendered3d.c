/* Translation of the parameters of PS3.18 8.3.5 to ctsplat's options. */
#include "app/options/options.h"
#include "app/serve/server.h"
#include "base/vec3.h"
#include <fnmatch.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The standard's parameters; with a presentation state only those of camera, size and media type are allowed, of a
 * thumbnail only the last two. */
static const struct Parameter {
    const char *name;
    bool of_thumbnail, goes_with_state, is_word; /* a parameter with the same name as a ctsplat option */
    const char *not_here;                        /* why not; NULL: it is */
} parameters[] = {
    {"renderingmethod", false, false, false, NULL},
    {"orientation", false, true, false, NULL},
    {"viewpointposition", false, true, false, NULL},
    {"viewpointlookat", false, true, false, NULL},
    {"viewpointup", false, true, false, NULL},
    {"swivelrange", false, false, false, NULL},
    {"animationrate", false, false, false, NULL},
    {"animationstepsize", false, false, false, NULL},
    {"renderedvolumetricmetadata", false, false, false, NULL},
    {"accept", true, true, false, NULL},
    {"charset", true, true, false, NULL},
    {"viewport", true, true, false, NULL},
    {"window", false, false, false, NULL},
    {"quality", false, true, true, NULL},
    {"volumeinputreference", false, false, false, "not supported (a volume is a whole series)"},
    {"match", false, false, false, "not supported (a volume is a whole series)"},
    {"volumetriccurvepoint", false, false, false,
     "not supported (no flights along curves; swivelrange turns the volume)"},
    {"mprslab", false, false, false, "belongs to renderedMPR, which is not supported"},
    {"annotation", false, false, false,
     "not supported (annotate=orientation,scale draws marks without the patient's name)"},
    {"iccprofile", false, false, false, "not supported (pictures are sRGB)"},
};

static const struct Parameter *parameter(const char *name)
{
    for (size_t i = 0; i < sizeof parameters / sizeof *parameters; i++)
        if (!strcmp(parameters[i].name, name))
            return &parameters[i];
    return NULL;
}

/* Parameters that remain are ctsplat's own options. */
static CtsStatus sort_out_parameters(const CtsQuery *from, const CtsRenderQuery *of, CtsQuery *words, CtsError *err)
{
    for (int i = 0; i < from->n; i++) {
        const char *name = from->parts[i].name;
        const struct Parameter *const p = parameter(name);
        if (of->thumbnail && !(p && p->of_thumbnail))
            return cts_fail(err, CTS_ERR_USAGE, "%.60s: a thumbnail takes viewport, accept and charset alone", name);
        if (of->state_path && !(p && p->goes_with_state))
            return cts_fail(err, CTS_ERR_USAGE, "%.60s: cannot be combined with a presentation state, which sets it",
                            name);
        if (p && p->not_here)
            return cts_fail(err, CTS_ERR_USAGE, "%s: %s", name, p->not_here);
        for (int k = 0; k < i; k++)
            if (p && !p->is_word && !strcmp(from->parts[k].name, name))
                return cts_fail(err, CTS_ERR_USAGE, "%s: given twice", name);
        if (!p || p->is_word)
            cts_query_add(words, name, from->parts[i].value);
    }
    return CTS_OK;
}

static CtsStatus take_method(const CtsQuery *from, CtsQuery *words, CtsError *err)
{
    static const CtsQuery modes = {.n = 4,
                                   .parts = {{"volume_rendered", "composite"},
                                             {"maximum_ip", "mip"},
                                             {"minimum_ip", "minip"},
                                             {"average_ip", "average"}}};
    const char *const method = cts_query_value(from, "renderingmethod");
    const char *const mode = method ? cts_query_value(&modes, method) : NULL;
    if (mode)
        cts_query_add(words, "mode", mode);
    return mode || !method
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE,
                          "renderingmethod %.40s: not one of: volume_rendered maximum_ip minimum_ip average_ip",
                          method);
}

/* From above the standard has the patient's front at the top, where ctsplat's `head` has the back. */
static CtsStatus take_orientation(const char *orientation, CtsQuery *words, CtsError *err)
{
    static const CtsQuery views = {
        .n = 6,
        .parts = {{"a", "0,0"}, {"p", "180,0"}, {"r", "270,0"}, {"l", "90,0"}, {"h", "180,90"}, {"f", "0,-90"}}};
    const char *const view = cts_query_value(&views, orientation);
    if (!view)
        return cts_fail(err, CTS_ERR_USAGE, "orientation %.40s: not one of: a p r l h f", orientation);
    cts_query_add(words, "view", view);
    return CTS_OK;
}

typedef struct Camera {
    double position_lps[3], look_at_lps[3], up_lps[3];
    const char *position, *look_at, *up; /* NULL: not given */
} Camera;

static CtsStatus read_vector(const CtsQuery *from, const char *name, const char **text, double value[3], CtsError *err)
{
    *text = cts_query_value(from, name);
    if (*text && !cts_numbers(*text, value, 3))
        return cts_fail(err, CTS_ERR_USAGE, "%s %.60s: not three numbers with commas between them", name, *text);
    return CTS_OK;
}

/* The camera's angles. If it looks straight up or down, up to 1e-9 of rounding, only `up` determines the azimuth. */
static void angles_of(const Camera *c, double deg[2])
{
    const double degree = 180 / acos(-1);
    double back[3];
    for (int i = 0; i < 3; i++)
        back[i] = c->position_lps[i] - c->look_at_lps[i];
    const double across = hypot(back[0], back[1]), length = hypot(across, back[2]);
    deg[1] = degree * atan2(back[2], across);
    deg[0] = degree * atan2(back[0], -back[1]);
    if (across > 1e-9 * length)
        return;
    deg[1] = back[2] > 0 ? 90 : -90;
    deg[0] = !c->up ? (back[2] > 0 ? 180 : 0)
                    : degree * (back[2] > 0 ? atan2(-c->up_lps[0], c->up_lps[1]) : atan2(c->up_lps[0], -c->up_lps[1]));
}

/* True if `up` is the camera's own up vector, so that the picture has no roll; a roll of 1e-3 moves the
 * edge of 1000 pixels by half a pixel. */
static bool is_upright(const Camera *c, const double deg[2])
{
    const double degree = 180 / acos(-1), a = deg[0] / degree, e = deg[1] / degree;
    const double right[3] = {cos(a), sin(a), 0}, up[3] = {-sin(e) * sin(a), sin(e) * cos(a), cos(e)};
    const double v = cts_dot3(c->up_lps, up);
    return v > 0 && fabs(cts_dot3(c->up_lps, right)) <= 1e-3 * v;
}

static CtsStatus take_camera(const CtsQuery *from, CtsQuery *words, CtsError *err)
{
    Camera c = {.up = NULL};
    CtsStatus st;
    double deg[2] = {0, 0};
    if ((st = read_vector(from, "viewpointposition", &c.position, c.position_lps, err)) ||
        (st = read_vector(from, "viewpointlookat", &c.look_at, c.look_at_lps, err)) ||
        (st = read_vector(from, "viewpointup", &c.up, c.up_lps, err)))
        return st;
    const char *orientation = cts_query_value(from, "orientation");
    const bool any = c.position || c.look_at || c.up;
    if (orientation && any)
        return cts_fail(err, CTS_ERR_USAGE, "orientation: viewpoint parameters are given too (one or the other)");
    if (orientation)
        return take_orientation(orientation, words, err);
    if (!any)
        return CTS_OK;
    if (!c.position || !c.look_at)
        return cts_fail(err, CTS_ERR_USAGE, "viewpointposition and viewpointlookat must be given together");
    if (!memcmp(c.position_lps, c.look_at_lps, sizeof c.position_lps))
        return cts_fail(err, CTS_ERR_USAGE, "viewpointposition: equals viewpointlookat");
    angles_of(&c, deg);
    if (c.up && !is_upright(&c, deg))
        return cts_fail(err, CTS_ERR_USAGE,
                        "viewpointup %.60s: not supported, as the camera would roll (up is towards the head; any "
                        "vector when the camera looks along the head-foot axis)",
                        c.up);
    cts_query_make(words, "view", "%.17g,%.17g", deg[0], deg[1]);
    cts_query_add(words, "centre", c.look_at);
    return CTS_OK;
}

/* Number of pictures in each direction of a swivel where no step is given, as many as of a thumbnail's rotation. */
enum { SWEEP_FRAMES = 36 };

static CtsStatus positive(const CtsQuery *from, const char *name, double *value, CtsError *err)
{
    const char *text = cts_query_value(from, name);
    return !text || (cts_number(text, value) && *value > 0)
               ? CTS_OK
               : cts_fail(err, CTS_ERR_USAGE, "%s %.40s: not a number greater than zero", name, text);
}

static CtsStatus take_swivel(CtsRenderQuery *render_query, const CtsQuery *from, CtsError *err)
{
    CtsStatus st;
    if ((st = positive(from, "swivelrange", &render_query->swivel_range_deg, err)) ||
        (st = positive(from, "animationstepsize", &render_query->swivel_step_deg, err)) ||
        (st = positive(from, "animationrate", &render_query->rate, err)))
        return st;
    if (render_query->swivel_range_deg == 0)
        return render_query->swivel_step_deg == 0 && render_query->rate == 0
                   ? CTS_OK
                   : cts_fail(err, CTS_ERR_USAGE, "animationstepsize and animationrate: need swivelrange");
    if (render_query->swivel_step_deg == 0)
        render_query->swivel_step_deg = render_query->swivel_range_deg / SWEEP_FRAMES;
    if (render_query->rate == 0)
        render_query->rate = 10; /* a second: a swivel of SWEEP_FRAMES, there and back, takes 7.2 s */
    cts_query_make(&render_query->query, "swivel", "%.17g,%.17g", render_query->swivel_range_deg,
                   render_query->swivel_step_deg);
    cts_query_make(&render_query->query, "frame-rate", "%.17g", render_query->rate);
    return CTS_OK;
}

/* Centre, width and function (PS3.3 C.11.2.1.2, C.11.2.1.3). A linear window of width 1 is a step, which has no width
 * left; 1.001 and 1e-6 leave some. */
static CtsStatus take_window(const CtsQuery *from, CtsQuery *words, CtsError *err)
{
    const char *window = cts_query_value(from, "window"), *function = window ? strrchr(window, ',') : NULL;
    char start[64];
    double v[2];
    if (!window)
        return CTS_OK;
    snprintf(start, sizeof start, "%.*s", function ? (int)(function - window) : 0, window);
    const bool exact = function && !strcmp(function, ",linear-exact");
    if (!function || (!exact && strcmp(function, ",linear")) || !cts_numbers(start, v, 2) ||
        v[1] < (exact ? 1e-6 : 1.001))
        return cts_fail(err, CTS_ERR_USAGE, "window %.60s: not CENTRE,WIDTH,linear or CENTRE,WIDTH,linear-exact in HU",
                        window);
    const double middle = exact ? v[0] : v[0] - 0.5, half = (exact ? v[1] : v[1] - 1) / 2;
    cts_query_make(words, "window", "%.17g,%.17g", middle - half, middle + half);
    return CTS_OK;
}

enum { MAX_THUMBNAIL = 1024 };

static CtsStatus take_viewport(const CtsQuery *from, bool thumbnail, CtsQuery *words, CtsError *err)
{
    const char *given = cts_query_value(from, "viewport"), *viewport = given || !thumbnail ? given : "256,256";
    double v[2];
    if (!viewport)
        return CTS_OK;
    if (!cts_numbers(viewport, v, 2))
        return cts_fail(err, CTS_ERR_USAGE,
                        "viewport %.60s: not WIDTH,HEIGHT in pixels (a part of the picture is not "
                        "supported)",
                        viewport);
    if (thumbnail && (v[0] > MAX_THUMBNAIL || v[1] > MAX_THUMBNAIL))
        return cts_fail(err, CTS_ERR_USAGE, "viewport %.60s: a thumbnail has at most %d pixels a side", viewport,
                        MAX_THUMBNAIL);
    cts_query_make(words, "size", "%.17gx%.17g", v[0], v[1]);
    return CTS_OK;
}

/* The q value of a type, from the most specific range that matches it, such as image/png;q=0.5, image with a star, or
 * two stars; 1 where a range has none. */
static double liking(const char *list, const char *type)
{
    int best = 0;
    double liked = 0;
    for (; *list; list += strspn(list, ", \t")) {
        char range[200];
        snprintf(range, sizeof range, "%.*s", (int)strcspn(list, ","), list);
        list += strcspn(list, ",");
        char *parameter = range, *const name = strsep(&parameter, "; \t");
        const int how = fnmatch(name, type, FNM_CASEFOLD) ? 0 : name[0] == '*' ? 1 : strchr(name, '*') ? 2 : 3;
        if (how <= best)
            continue;
        best = how;
        liked = 1;
        for (char *one; (one = strsep(&parameter, "; \t"));)
            liked = strncasecmp(one, "q=", 2) ? liked : strtod(one + 2, NULL);
    }
    return liked;
}

/* The index of the preferred media type among n for an Accept header, or the parameter `accept` in its place (PS3.18
 * 8.3.3.1); the first among equals; -1 where none is acceptable. An empty list, or NULL, accepts all. */
static int accept_best(const char *list, const char *const *media_types, int n)
{
    int best = -1;
    double most = 0;
    if (!list || !*list)
        return 0;
    for (int i = 0; i < n; i++) {
        const double liked = liking(list, media_types[i]);
        if (liked > most) {
            most = liked;
            best = i;
        }
    }
    return best;
}

static const CtsFormatInfo *choose_format(CtsRenderQuery *render_query, const char *accept)
{
    static const char *const metadata[] = {"application/dicom+json", "application/json"};
    static const char *const files[] = {"a.jpg", "a.png", "a.webp", "a.dcm"};
    const char *types[4];
    const CtsFormatInfo *formats[4];
    int n = 0;
    for (int i = 0; i < (render_query->thumbnail ? 3 : 4); i++) {
        formats[n] = cts_export_format(files[i]);
        types[n] = formats[n]->media_type;
        n += formats[n]->many_frames || render_query->swivel_range_deg == 0;
    }
    const int best = render_query->metadata ? accept_best(accept, metadata, 2) : accept_best(accept, types, n);
    return best < 0 ? NULL : formats[render_query->metadata ? 0 : best];
}

CtsStatus cts_render_query_rendered3d(CtsRenderQuery *render_query, const char *accept, const CtsFormatInfo **format,
                                      CtsError *err)
{
    CtsQuery from = render_query->query;
    CtsQuery *const words = &render_query->query;
    *words = (CtsQuery){.too_many = from.too_many};
    const char *metadata = cts_query_value(&from, "renderedvolumetricmetadata");
    const char *wanted = cts_query_value(&from, "accept");
    CtsStatus st = CTS_OK;
    if (metadata && strcmp(metadata, "yes"))
        st = cts_fail(err, CTS_ERR_USAGE, "renderedvolumetricmetadata %.40s: not yes", metadata);
    render_query->metadata = metadata;
    if (!st && !(st = sort_out_parameters(&from, render_query, words, err)) && !(st = take_method(&from, words, err)) &&
        !(st = take_camera(&from, words, err)) && !(st = take_swivel(render_query, &from, err)) &&
        !(st = take_window(&from, words, err)))
        st = take_viewport(&from, render_query->thumbnail, words, err);
    if (!st)
        *format = choose_format(render_query, wanted ? wanted : accept);
    return st;
}
