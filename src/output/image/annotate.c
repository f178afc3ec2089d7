#include "ctsplat/annotate.h"

#include "output/image/describe.h"
#include "output/image/letters.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static const double light = 242 / 255.0, dark = 13 / 255.0;

enum { MIN_FONT_PX = 10 };

/* A mark: a text, and below it a bar if bar_px is not 0. */
typedef struct Mark {
    CtsLetters text;
    int n_above, n_below; /* room for so many accents over and under it */
    double font_px, bar_px;
    double x, y; /* of the mark's box in the picture, 0..1: 0 left or top, 1 right or bottom */
    double margin_px;
    const double *rgb; /* NULL: light, or dark over a light background */
} Mark;

/* A mark's box in pixels: strokes and outline. pen: half the stroke width. */
typedef struct MarkBox {
    double text_width, text_height, above, below, bar_height, pen, rim; /* above, below: room for accents */
    int width, height;
} MarkBox;

static int advance_of(const CtsLetter *letter)
{
    return (letter->glyph ? letter->glyph->width : CTS_LETTER_GAP) + CTS_LETTER_GAP;
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

/* Distance from a point to the stroke path of a glyph at 0, in the glyph's units. */
static double to_glyph(const CtsGlyph *glyph, double x, double y)
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

/* Marks above or below a letter are stacked, each one height further than the marks before it at that place. */
static double to_letter(const CtsLetter *letter, double x, double y)
{
    double nearest = letter->glyph ? to_glyph(letter->glyph, x, y) : INFINITY;
    int n_above = 0, n_below = 0;
    for (int i = 0; i < 2 && letter->marks[i]; i++) {
        const CtsMark *const m = letter->marks[i];
        const double dx = (letter->glyph->width - m->glyph.width) / 2.0, step = CTS_MARK_HEIGHT + CTS_MARK_GAP;
        if (m->place == CTS_MARK_ABOVE)
            nearest = fmin(nearest, to_glyph(&m->glyph, x - dx, y + step * ++n_above));
        else
            nearest = fmin(nearest, to_glyph(&m->glyph, x - dx, y - CTS_CAPITAL - step * n_below++));
    }
    return nearest;
}

/* Of the letters' marks, in heights of one. */
static int marks_at(const CtsLetters *text, CtsMarkPlace place)
{
    int most = 0;
    for (int i = 0; i < text->n; i++) {
        int n = 0;
        for (int m = 0; m < 2 && text->items[i].marks[m]; m++)
            n += text->items[i].marks[m]->place == place;
        most = n > most ? n : most;
    }
    return most;
}

static double to_text(const CtsLetters *text, double x, double y)
{
    double nearest = INFINITY;
    for (int i = 0; i < text->n; i++) {
        nearest = fmin(nearest, to_letter(&text->items[i], x, y));
        x -= advance_of(&text->items[i]);
    }
    return nearest;
}

/* Negative inside. */
static double to_bar(double x, double y, double width, double height)
{
    const double dx = fabs(x - width / 2) - width / 2, dy = fabs(y - height / 2) - height / 2;
    return dx > 0 && dy > 0 ? hypot(dx, dy) : fmax(dx, dy);
}

static MarkBox measure_mark(const Mark *mark)
{
    MarkBox box = {.pen = mark->font_px / 18, .rim = fmax(1, mark->font_px / 10)};
    int advance = -CTS_LETTER_GAP;
    for (int i = 0; i < mark->text.n; i++)
        advance += advance_of(&mark->text.items[i]);
    box.text_height = 0.7 * mark->font_px;
    box.text_width = fmax(0, advance * box.text_height / CTS_CAPITAL);
    box.above = mark->n_above * (CTS_MARK_HEIGHT + CTS_MARK_GAP) * box.text_height / CTS_CAPITAL;
    box.below = mark->n_below * (CTS_MARK_HEIGHT + CTS_MARK_GAP) * box.text_height / CTS_CAPITAL;
    box.bar_height = mark->bar_px > 0 ? fmax(2, mark->font_px / 5) : 0;
    const double gap = mark->bar_px > 0 ? 3 * box.rim : 0;
    box.width = (int)ceil(fmax(box.text_width + 2 * box.pen, mark->bar_px) + 4 * box.rim) + 1;
    box.height =
        (int)ceil(box.above + box.text_height + box.below + 2 * box.pen + gap + box.bar_height + 4 * box.rim) + 1;
    return box;
}

/* Signed distance from the box's point to the mark's strokes; negative inside. */
static double to_ink(const Mark *mark, const MarkBox *box, double x, double y)
{
    const double unit = box->text_height / CTS_CAPITAL;
    const double left = (box->width - box->text_width) / 2, top = 2 * box->rim + box->pen + box->above;
    const double text = to_text(&mark->text, (x - left) / unit, (y - top) / unit) * unit - box->pen;
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

/* A mark and the position of its box in the whole picture. */
typedef struct Placed {
    Mark mark;
    MarkBox box;
    int left, top;
} Placed;

typedef struct MarkLayout {
    int width, height; /* of the whole picture */
    Placed placed[5];
    int n, n_left_out;
} MarkLayout;

static bool marks_overlap(const Placed *a, const Placed *b)
{
    return a->left < b->left + b->box.width && b->left < a->left + a->box.width && a->top < b->top + b->box.height &&
           b->top < a->top + a->box.height;
}

/* Skips marks that would overlap another one or leave the picture. */
static void place_mark(MarkLayout *layout, const Mark *mark)
{
    Placed *p = &layout->placed[layout->n];
    p->mark = *mark;
    p->box = measure_mark(mark);
    const double room_x = layout->width - p->box.width - 2 * mark->margin_px;
    const double room_y = layout->height - p->box.height - 2 * mark->margin_px;
    p->left = (int)floor(mark->margin_px + mark->x * room_x + 0.5);
    p->top = (int)floor(mark->margin_px + mark->y * room_y + 0.5);
    bool fits = room_x >= 0 && room_y >= 0;
    for (int i = 0; i < layout->n; i++)
        fits = fits && !marks_overlap(p, &layout->placed[i]);
    if (!fits) {
        layout->n_left_out++;
        return;
    }
    layout->n++;
}

/* Draws strokes with an outline over the picture; premultiplied, like the picture. */
static void draw_mark(CtsPicture *picture, const Placed *p)
{
    const double *const rgb = p->mark.rgb;
    const double own = rgb ? 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] : 0;
    const double ink = rgb                          ? own
                       : picture->info.light_behind ? dark
                                                    : light,
                 around = rgb ? (own > 0.4 ? dark : light) : light + dark - ink;
    const int channels = picture->n_channels, end = p->top + p->box.height - picture->first_row;
    const int first = p->top > picture->first_row ? p->top - picture->first_row : 0;
    for (int y = first; y < end && y < picture->height; y++)
        for (int x = p->left; x < p->left + p->box.width; x++) {
            const double out = to_ink(&p->mark, &p->box, x - p->left + 0.5, y + picture->first_row - p->top + 0.5);
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

static void place_letters(MarkLayout *layout, const CtsPictureInfo *info, double font_px, double margin_px)
{
    const struct {
        const double *direction_lps;
        double sign, x, y;
    } edges[] = {{info->right_lps, 1, 1, 0.5},
                 {info->right_lps, -1, 0, 0.5},
                 {info->up_lps, 1, 0.5, 0},
                 {info->up_lps, -1, 0.5, 1}};
    for (int i = 0; i < 4; i++) {
        const double *d = edges[i].direction_lps;
        const double direction[3] = {edges[i].sign * d[0], edges[i].sign * d[1], edges[i].sign * d[2]};
        Mark mark = {.font_px = font_px, .x = edges[i].x, .y = edges[i].y, .margin_px = margin_px};
        cts_letters_plain(cts_describe_direction(direction).text, &mark.text);
        place_mark(layout, &mark);
    }
}

static void place_scale(MarkLayout *layout, double mm_per_pixel, double font_px, double margin_px)
{
    const double length_mm = round_length_mm(0.2 * layout->width * mm_per_pixel);
    char text[84];
    snprintf(text, sizeof text, "%s mm", cts_describe_number(length_mm, 6).text);
    Mark mark = {.font_px = fmax(MIN_FONT_PX - 1, 0.8 * font_px),
                 .bar_px = length_mm / mm_per_pixel,
                 .y = 1,
                 .margin_px = margin_px};
    cts_letters_plain(text, &mark.text);
    place_mark(layout, &mark);
}

CtsStatus cts_annotate(CtsPicture *picture, bool orientation, bool scale, int *n_left_out, CtsError *err)
{
    const CtsPictureInfo *info = &picture->info;
    MarkLayout layout = {.width = picture->width, .height = picture->whole_height};
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
        draw_mark(picture, &layout.placed[i]);
    picture->info.annotated |= layout.n > 0;
    if (n_left_out)
        *n_left_out = layout.n_left_out;
    return CTS_OK;
}

/* A name, or, where it cannot be drawn completely, its number and as much of it as fits into room_px. */
static bool write_name(const CtsLegendEntry *entry, double room_px, Mark *mark)
{
    mark->text = (CtsLetters){.n = 0};
    cts_letters_add(entry->name, &mark->text);
    if (mark->text.n && !mark->text.lacks && measure_mark(mark).width <= room_px)
        return true;
    char number[16];
    snprintf(number, sizeof number, "%d ", entry->number);
    mark->text = (CtsLetters){.n = 0};
    cts_letters_add(number, &mark->text);
    const int n_number = mark->text.n;
    mark->text.items[mark->text.n++] = (CtsLetter){.glyph = NULL};
    cts_letters_add(entry->name, &mark->text);
    while (mark->text.n > n_number && measure_mark(mark).width > room_px)
        mark->text.n--;
    return false;
}

CtsStatus cts_annotate_legend(CtsPicture *picture, const CtsLegendEntry *entries, size_t n, int *n_in_part,
                              int *n_left_out, CtsError *err)
{
    enum { CORNERS = 3 }; /* the scale has the fourth */
    const int height = picture->whole_height, side = picture->width < height ? picture->width : height;
    const double font_px = fmax(MIN_FONT_PX, side / 60.0), margin_px = font_px / 2;
    Placed p = {.mark = {.font_px = font_px}};
    int n_partly = 0, n_out = 0;
    if (picture->width < 1)
        return cts_fail(err, CTS_ERR_INTERNAL, "a picture without pixels");
    /* All lines are as high as the one with most accents. */
    for (size_t i = 0; i < n; i++) {
        p.mark.text = (CtsLetters){.n = 0};
        cts_letters_add(entries[i].name ? entries[i].name : "", &p.mark.text);
        const int above = marks_at(&p.mark.text, CTS_MARK_ABOVE), below = marks_at(&p.mark.text, CTS_MARK_BELOW);
        p.mark.n_above = above > p.mark.n_above ? above : p.mark.n_above;
        p.mark.n_below = below > p.mark.n_below ? below : p.mark.n_below;
    }
    const double line = measure_mark(&p.mark).height;
    /* Leave room for the letters in the middle of the sides, and for names on the other side. */
    const int at_once = (int)fmax((0.45 * height - margin_px) / line, 0);
    const double room = n > (size_t)at_once ? picture->width / 2.0 - 1.5 * margin_px : picture->width - 2 * margin_px;
    for (size_t i = 0; i < n; i++) {
        const int corner = at_once ? (int)fmin((double)(i / (size_t)at_once), CORNERS) : CORNERS;
        const int in_corner = at_once ? (int)(i % (size_t)at_once) : 0;
        if (!entries[i].name)
            continue;
        const bool whole = write_name(&entries[i], room, &p.mark);
        p.mark.rgb = entries[i].rgb;
        p.box = measure_mark(&p.mark);
        const double from_top = margin_px + in_corner * line;
        p.left = (int)(corner > 0 ? picture->width - p.box.width - margin_px : margin_px);
        p.top = (int)(corner < 2 ? from_top : height - from_top - line);
        if (corner == CORNERS || p.box.width > room) {
            n_out++;
            continue;
        }
        n_partly += !whole;
        draw_mark(picture, &p);
        picture->info.annotated = true;
    }
    if (n_in_part)
        *n_in_part = n_partly;
    if (n_left_out)
        *n_left_out = n_out;
    return CTS_OK;
}
