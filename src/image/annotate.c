#include "ctsplat/annotate.h"

#include "image/describe.h"
#include <cairo.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/* cairo's own stroke font: no font file, no cache of fonts on disk, the same pixels on every machine. */
static const char *const font_family = "@cairo:";
static const double light = 242 / 255.0, dark = 13 / 255.0; /* as the overlay's 8 bits hold them */

enum { MIN_FONT_PX = 10 };

/* What is drawn: a text, and below it a bar if bar_px is not 0. */
typedef struct Mark {
    const char *text;
    double font_px, bar_px;
    double x, y; /* of the mark's box in the picture, 0..1: 0 left or top, 1 right or bottom */
    double margin_px;
} Mark;

/* A mark's box in pixels: ink and rim. */
typedef struct Box {
    double text_width, text_height, bar_height, rim;
    int width, height;
} Box;

static void set_font(cairo_t *cr, double font_px)
{
    cairo_font_options_t *options = cairo_font_options_create();
    cairo_font_options_set_hint_style(options, CAIRO_HINT_STYLE_NONE);
    cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
    cairo_set_font_options(cr, options);
    cairo_font_options_destroy(options);
    cairo_select_font_face(cr, font_family, CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_BOLD);
    cairo_set_font_size(cr, font_px);
}

static void rim_and_fill(cairo_t *cr, double rim, double ink)
{
    const double around = light + dark - ink;
    cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
    cairo_set_line_width(cr, 2 * rim);
    cairo_set_source_rgb(cr, around, around, around);
    cairo_stroke_preserve(cr);
    cairo_set_source_rgb(cr, ink, ink, ink);
    cairo_fill(cr);
}

static Box measure(const Mark *mark)
{
    Box box = {.rim = fmax(1, mark->font_px / 10)};
    cairo_surface_t *none = cairo_recording_surface_create(CAIRO_CONTENT_ALPHA, NULL);
    cairo_t *cr = cairo_create(none);
    cairo_text_extents_t extents;
    set_font(cr, mark->font_px);
    cairo_text_extents(cr, mark->text, &extents);
    cairo_destroy(cr);
    cairo_surface_destroy(none);
    box.text_width = extents.x_advance;
    box.text_height = 0.8 * mark->font_px; /* one height for all letters, so that edges line up */
    box.bar_height = mark->bar_px > 0 ? fmax(2, mark->font_px / 5) : 0;
    const double gap = mark->bar_px > 0 ? 3 * box.rim : 0;
    box.width = (int)ceil(fmax(box.text_width, mark->bar_px) + 4 * box.rim) + 1;
    box.height = (int)ceil(box.text_height + gap + box.bar_height + 4 * box.rim) + 1;
    return box;
}

static void draw(cairo_surface_t *surface, const Mark *mark, const Box *box, double ink)
{
    cairo_t *cr = cairo_create(surface);
    set_font(cr, mark->font_px);
    cairo_move_to(cr, (box->width - box->text_width) / 2, 2 * box->rim + box->text_height);
    cairo_text_path(cr, mark->text);
    rim_and_fill(cr, box->rim, ink);
    if (mark->bar_px > 0) {
        cairo_rectangle(cr, (box->width - mark->bar_px) / 2, box->height - 2 * box->rim - box->bar_height, mark->bar_px,
                        box->bar_height);
        rim_and_fill(cr, box->rim, ink);
    }
    cairo_destroy(cr);
    cairo_surface_flush(surface);
}

/* The overlay's grey and alpha over the picture; premultiplied, as both are. */
static void blend(CtsPicture *picture, cairo_surface_t *overlay, int left, int top)
{
    const int width = cairo_image_surface_get_width(overlay), height = cairo_image_surface_get_height(overlay);
    const unsigned char *bytes = cairo_image_surface_get_data(overlay);
    const int stride = cairo_image_surface_get_stride(overlay), channels = picture->n_channels;
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            const int x = left + i, y = top + j - picture->first_row;
            uint32_t argb;
            memcpy(&argb, bytes + (size_t)j * stride + 4 * (size_t)i, sizeof argb);
            const float alpha = (float)(argb >> 24) / 255, grey = (float)(argb & 255) / 255;
            if (alpha <= 0 || x < 0 || y < 0 || x >= picture->width || y >= picture->height)
                continue;
            float *p = picture->pixels + ((size_t)y * picture->width + x) * channels;
            for (int c = 0; c < channels; c++)
                p[c] = (c == 3 ? alpha : grey) + (1 - alpha) * p[c];
        }
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

static CtsStatus put(CtsPicture *picture, const Placed *p, CtsError *err)
{
    Mark mark = p->mark;
    CtsStatus st = CTS_OK;
    mark.text = p->text;
    if (p->top >= picture->first_row + picture->height || p->top + p->box.height <= picture->first_row)
        return CTS_OK;
    cairo_surface_t *overlay = cairo_image_surface_create(CAIRO_FORMAT_ARGB32, p->box.width, p->box.height);
    draw(overlay, &mark, &p->box, picture->info.light_behind ? dark : light);
    if (cairo_surface_status(overlay) == CAIRO_STATUS_SUCCESS)
        blend(picture, overlay, p->left, p->top);
    else
        st = cts_fail(err, CTS_ERR_MEMORY, "the annotation cannot be drawn: %s",
                      cairo_status_to_string(cairo_surface_status(overlay)));
    cairo_surface_destroy(overlay);
    return st;
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
        const Mark mark = {letters, font_px, 0, edges[i].x, edges[i].y, margin_px};
        place(layout, &mark);
    }
}

static void place_scale(Layout *layout, double mm_per_pixel, double font_px, double margin_px)
{
    const double length_mm = round_length_mm(0.2 * layout->width * mm_per_pixel);
    char number[32], text[48];
    cts_describe_number(length_mm, 6, number, sizeof number);
    snprintf(text, sizeof text, "%s mm", number);
    const Mark mark = {text, fmax(MIN_FONT_PX - 1, 0.8 * font_px), length_mm / mm_per_pixel, 0, 1, margin_px};
    place(layout, &mark);
}

CtsStatus cts_annotate(CtsPicture *picture, bool orientation, bool scale, int *n_left_out, CtsError *err)
{
    const CtsPictureInfo *info = &picture->info;
    Layout layout = {.width = picture->width, .height = picture->whole_height};
    const int side = layout.width < layout.height ? layout.width : layout.height;
    const double font_px = fmax(MIN_FONT_PX, side / 30.0), margin_px = font_px / 4;
    const double mm_per_pixel = info->mm_per_pixel;
    CtsStatus st = CTS_OK;
    if (scale && !(mm_per_pixel > 0 && isfinite(mm_per_pixel)))
        return cts_fail(err, CTS_ERR_USAGE, "a scale cannot be drawn: the picture's mm per pixel are not known");
    if (orientation)
        place_letters(&layout, info, font_px, margin_px);
    if (scale)
        place_scale(&layout, mm_per_pixel, font_px, margin_px);
    for (int i = 0; i < layout.n && !st; i++)
        st = put(picture, &layout.placed[i], err);
    picture->info.annotated |= layout.n > 0;
    if (n_left_out)
        *n_left_out = layout.n_left_out;
    return st;
}
