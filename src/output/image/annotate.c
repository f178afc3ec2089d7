#include "ctsplat/annotate.h"

#include "output/image/describe.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double light = 242 / 255.0, dark = 13 / 255.0;

enum { MIN_FONT_PX = 10 };

/* What is drawn: a text, and below it a bar if bar_px is not 0. */
typedef struct Mark {
    const char *text;
    double font_px, bar_px;
    double x, y; /* of the mark's box in the picture, 0..1: 0 left or top, 1 right or bottom */
    double margin_px;
    const double *rgb; /* NULL: light, or dark over a light background */
} Mark;

/* A mark's box in pixels: ink and rim. pen: half the width of a letter's strokes. */
typedef struct Box {
    double text_width, text_height, bar_height, pen, rim;
    int width, height;
} Box;

/* Letters as a pen draws them: a pair of hexadecimal-like digits (0 to 9, a to g) is a point, right and down, and a
 * blank lifts the pen. Capitals are 16 high. */
typedef struct Glyph {
    char letter;
    int width;
    const char *strokes;
} Glyph;

enum { CAPITAL = 16, GAP = 6 };

static const Glyph glyphs[] = {
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
};

static const Glyph *glyph_of(char letter)
{
    for (size_t i = 0; i < sizeof glyphs / sizeof *glyphs; i++)
        if (glyphs[i].letter == letter)
            return &glyphs[i];
    return NULL;
}

static int advance_of(const Glyph *glyph)
{
    return (glyph ? glyph->width : GAP) + GAP;
}

static int digit(char c)
{
    return c <= '9' ? c - '0' : c - 'a' + 10;
}

static double to_segment(double x, double y, const double a[2], const double b[2])
{
    const double dx = b[0] - a[0], dy = b[1] - a[1], length = dx * dx + dy * dy;
    const double along = length > 0 ? ((x - a[0]) * dx + (y - a[1]) * dy) / length : 0;
    const double t = fmin(1, fmax(0, along));
    return hypot(x - a[0] - t * dx, y - a[1] - t * dy);
}

/* From a point to the pen's way through a letter that stands at 0, in its own units. */
static double to_glyph(const Glyph *glyph, double x, double y)
{
    double nearest = INFINITY, before[2] = {0};
    bool down = false;
    for (const char *s = glyph->strokes; *s; s += *s == ' ' ? 1 : 2) {
        if (*s != ' ') {
            const double point[2] = {digit(s[0]), digit(s[1])};
            nearest = down ? fmin(nearest, to_segment(x, y, before, point)) : nearest;
            memcpy(before, point, sizeof before);
        }
        down = *s != ' ';
    }
    return nearest;
}

static double to_text(const char *text, double x, double y)
{
    double nearest = INFINITY;
    for (; *text; text++) {
        const Glyph *glyph = glyph_of(*text);
        if (glyph)
            nearest = fmin(nearest, to_glyph(glyph, x, y));
        x -= advance_of(glyph);
    }
    return nearest;
}

/* Negative inside. */
static double to_bar(double x, double y, double width, double height)
{
    const double dx = fabs(x - width / 2) - width / 2, dy = fabs(y - height / 2) - height / 2;
    return dx > 0 && dy > 0 ? hypot(dx, dy) : fmax(dx, dy);
}

static Box measure(const Mark *mark)
{
    Box box = {.pen = mark->font_px / 18, .rim = fmax(1, mark->font_px / 10)};
    int advance = -GAP;
    for (const char *c = mark->text; *c; c++)
        advance += advance_of(glyph_of(*c));
    box.text_height = 0.7 * mark->font_px;
    box.text_width = fmax(0, advance * box.text_height / CAPITAL);
    box.bar_height = mark->bar_px > 0 ? fmax(2, mark->font_px / 5) : 0;
    const double gap = mark->bar_px > 0 ? 3 * box.rim : 0;
    box.width = (int)ceil(fmax(box.text_width + 2 * box.pen, mark->bar_px) + 4 * box.rim) + 1;
    box.height = (int)ceil(box.text_height + 2 * box.pen + gap + box.bar_height + 4 * box.rim) + 1;
    return box;
}

/* How far the box's point lies from the mark's ink; negative inside. */
static double to_ink(const Mark *mark, const Box *box, double x, double y)
{
    const double unit = box->text_height / CAPITAL;
    const double left = (box->width - box->text_width) / 2, top = 2 * box->rim + box->pen;
    const double text = to_text(mark->text, (x - left) / unit, (y - top) / unit) * unit - box->pen;
    return mark->bar_px > 0
               ? fmin(text, to_bar(x - (box->width - mark->bar_px) / 2,
                                   y - (box->height - 2 * box->rim - box->bar_height), mark->bar_px, box->bar_height))
               : text;
}

/* Of a pixel whose centre lies so far outside an edge. */
static double covered(double distance_px)
{
    return fmin(1, fmax(0, 0.5 - distance_px));
}

/* A mark and where its box stands in the whole picture. */
typedef struct Placed {
    Mark mark; /* but for its text, which is this: */
    char text[48];
    Box box;
    int left, top;
} Placed;

typedef struct Layout {
    int width, height; /* of the whole picture */
    Placed placed[5];
    int n, n_left_out;
} Layout;

static bool overlap(const Placed *a, const Placed *b)
{
    return a->left < b->left + b->box.width && b->left < a->left + a->box.width && a->top < b->top + b->box.height &&
           b->top < a->top + a->box.height;
}

/* Marks that would cover another one, or leave the picture, help nobody. */
static void place(Layout *layout, const Mark *mark)
{
    Placed *p = &layout->placed[layout->n];
    p->mark = *mark;
    p->box = measure(mark);
    const double room_x = layout->width - p->box.width - 2 * mark->margin_px;
    const double room_y = layout->height - p->box.height - 2 * mark->margin_px;
    p->left = (int)floor(mark->margin_px + mark->x * room_x + 0.5);
    p->top = (int)floor(mark->margin_px + mark->y * room_y + 0.5);
    bool fits = room_x >= 0 && room_y >= 0;
    for (int i = 0; i < layout->n; i++)
        fits = fits && !overlap(p, &layout->placed[i]);
    if (!fits) {
        layout->n_left_out++;
        return;
    }
    snprintf(p->text, sizeof p->text, "%s", mark->text);
    layout->n++;
}

/* Ink within a rim, over the picture; premultiplied, as the picture is. */
static void put(CtsPicture *picture, const Placed *p)
{
    const double *const rgb = p->mark.rgb;
    const double own = rgb ? 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] : 0;
    const double ink = rgb                          ? own
                       : picture->info.light_behind ? dark
                                                    : light,
                 around = rgb ? (own > 0.4 ? dark : light) : light + dark - ink;
    const int channels = picture->n_channels, end = p->top + p->box.height - picture->first_row;
    const int first = p->top > picture->first_row ? p->top - picture->first_row : 0;
    Mark mark = p->mark;
    mark.text = p->text;
    for (int y = first; y < end && y < picture->height; y++)
        for (int x = p->left; x < p->left + p->box.width; x++) {
            const double out = to_ink(&mark, &p->box, x - p->left + 0.5, y + picture->first_row - p->top + 0.5);
            const double alpha = covered(out - p->box.rim), inner = covered(out);
            if (alpha <= 0 || x < 0 || x >= picture->width)
                continue;
            float *v = picture->pixels + ((size_t)y * picture->width + x) * channels;
            for (int c = 0; c < channels; c++) {
                const double shown = inner * (rgb && channels > 2 && c < 3 ? rgb[c] : ink) + (alpha - inner) * around;
                v[c] = (float)((c == 3 ? alpha : shown) + (1 - alpha) * v[c]);
            }
        }
}

/* The 1, 2 or 5 times a power of ten nearest to length_mm by ratio. */
static double round_length_mm(double length_mm)
{
    const double power = pow(10, floor(log10(length_mm)));
    double best = power;
    for (int i = 0; i < 4; i++) {
        static const double steps[] = {1, 2, 5, 10};
        if (fabs(log(steps[i] * power / length_mm)) < fabs(log(best / length_mm)))
            best = steps[i] * power;
    }
    return best;
}

static void place_letters(Layout *layout, const CtsPictureInfo *info, double font_px, double margin_px)
{
    const struct {
        const double *direction_lps;
        double sign, x, y;
    } edges[] = {{info->right_lps, 1, 1, 0.5},
                 {info->right_lps, -1, 0, 0.5},
                 {info->up_lps, 1, 0.5, 0},
                 {info->up_lps, -1, 0.5, 1}};
    for (int i = 0; i < 4; i++) {
        char letters[4];
        const double *d = edges[i].direction_lps;
        cts_describe_direction((const double[3]){edges[i].sign * d[0], edges[i].sign * d[1], edges[i].sign * d[2]},
                               letters);
        const Mark mark = {letters, font_px, 0, edges[i].x, edges[i].y, margin_px, NULL};
        place(layout, &mark);
    }
}

static void place_scale(Layout *layout, double mm_per_pixel, double font_px, double margin_px)
{
    const double length_mm = round_length_mm(0.2 * layout->width * mm_per_pixel);
    char number[32], text[48];
    cts_describe_number(length_mm, 6, number, sizeof number);
    snprintf(text, sizeof text, "%s mm", number);
    const Mark mark = {text, fmax(MIN_FONT_PX - 1, 0.8 * font_px), length_mm / mm_per_pixel, 0, 1, margin_px, NULL};
    place(layout, &mark);
}

CtsStatus cts_annotate(CtsPicture *picture, bool orientation, bool scale, int *n_left_out, CtsError *err)
{
    const CtsPictureInfo *info = &picture->info;
    Layout layout = {.width = picture->width, .height = picture->whole_height};
    const int side = layout.width < layout.height ? layout.width : layout.height;
    const double font_px = fmax(MIN_FONT_PX, side / 30.0), margin_px = font_px / 4;
    const double mm_per_pixel = info->mm_per_pixel;
    if (scale && !(mm_per_pixel > 0 && isfinite(mm_per_pixel)))
        return cts_fail(err, CTS_ERR_USAGE, "a scale cannot be drawn: the picture's mm per pixel are not known");
    if (orientation)
        place_letters(&layout, info, font_px, margin_px);
    if (scale)
        place_scale(&layout, mm_per_pixel, font_px, margin_px);
    for (int i = 0; i < layout.n; i++)
        put(picture, &layout.placed[i]);
    picture->info.annotated |= layout.n > 0;
    if (n_left_out)
        *n_left_out = layout.n_left_out;
    return CTS_OK;
}

/* Capitals alone are drawn. */
static void capitals(const char *name, char text[48])
{
    snprintf(text, 48, "%s", name);
    for (char *c = text; *c; c++)
        *c = *c >= 'a' && *c <= 'z' ? (char)(*c - 'a' + 'A') : *c;
}

CtsStatus cts_annotate_legend(CtsPicture *picture, const CtsLegendEntry *entries, size_t n, int *n_left_out,
                              CtsError *err)
{
    enum { CORNERS = 3 }; /* the scale has the fourth */
    const int height = picture->whole_height, side = picture->width < height ? picture->width : height;
    const double font_px = fmax(MIN_FONT_PX, side / 60.0), margin_px = font_px / 2;
    const Box line = measure(&(Mark){.text = "", .font_px = font_px});
    /* The letters in the middle of the sides keep their room. */
    const int at_once = (int)fmax((0.45 * height - margin_px) / line.height, 0);
    if (n_left_out)
        *n_left_out = 0;
    if (picture->width < 1)
        return cts_fail(err, CTS_ERR_INTERNAL, "a picture without pixels");
    for (size_t i = 0; i < n; i++) {
        const int corner = at_once ? (int)fmin((double)(i / (size_t)at_once), CORNERS) : CORNERS;
        const int in_corner = at_once ? (int)(i % (size_t)at_once) : 0;
        Placed p = {.mark = {.font_px = font_px, .rgb = entries[i].rgb}};
        capitals(entries[i].name, p.text);
        p.mark.text = p.text;
        p.box = measure(&p.mark);
        const double from_top = margin_px + in_corner * line.height;
        p.left = (int)(corner > 0 ? picture->width - p.box.width - margin_px : margin_px);
        p.top = (int)(corner < 2 ? from_top : height - from_top - line.height);
        if (corner == CORNERS || p.box.width + 2 * margin_px > picture->width) {
            if (n_left_out)
                ++*n_left_out;
            continue;
        }
        put(picture, &p);
        picture->info.annotated = true;
    }
    return CTS_OK;
}
