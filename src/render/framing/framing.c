#include "render/framing/framing.h"

#include "base/mem.h"
#include "base/vec3.h"
#include "core/scene/resolve.h"
#include "render/engines/engines.h"
#include <math.h>
#include <string.h>

/* The share of the picture's tighter side that the visible part fills. */
#define FILLED 0.9
/* Connected parts of less than this share of the visible area are specks. Each ray counts by its opacity, so that haze
 * of a tenth of a bone's opacity needs ten times a bone's area: an ear, or what is left of a head holder, is no part of
 * the frame of the skull. In modes without opacity it counts by its brightness. */
#define SPECK 0.001
/* HAZE: opacity from which a pixel counts as visible. If none reaches it, DARKEST is used, the least value of 8 bits;
 * and in minip and average, where no ray as a whole may be brighter than black, any value above 0. */
static const double HAZE = 1.0 / 16, DARKEST = 1.0 / 255;
/* LOOK: rays of a probe rendering along rows and columns. Ends have an error of half a ray's distance, below 1 % where
 * the visible part spans MIN_FOUND rays; otherwise a finer probe rendering follows. */
enum { LOOK = 128, MIN_FOUND = LOOK / 2, MAX_PROBES = 6 };
/* SURE: a part of fewer rays is too small to estimate its weight, and is probed by FINER rays for each, along rows and
 * columns. */
enum { SURE = 16, FINER = 4 };
/* COARSEST: rays of the first round lie so far apart; smaller holes in a visible part do not change its box. SQUARE:
 * rays are listed by squares, in which the engine recognises empty space. */
enum { COARSEST = 4, SQUARE = 8 };
/* Views of a rotation that are probed: between them, 7.5 degrees away at most, no extent is 1 % larger. */
enum { MAX_VIEWS = 24 };

enum { OPAQUE = 255 };

/* State shared by the probe renderings of a frame. */
typedef struct Probing {
    const CtsFramed *what;
    CtsLut *lut;
    double lut_scale; /* extinction_scale that it was made for */
} Probing;

/* A probe rendering: rays through the same volume in the same direction. */
typedef struct ProbeRendering {
    CtsSceneStore store;
    double least;              /* brighter is shown, or more opaque */
    uint8_t shown[LOOK][LOOK]; /* opacity or brightness, of OPAQUE; 0: not visible */
} ProbeRendering;

static uint8_t shown_by(float value, double least)
{
    return value > least ? (uint8_t)fmax(1, fmin(OPAQUE, floor(OPAQUE * (double)value + 0.5))) : 0;
}

/* Scene of n[0] x n[1] rays with spacing `apart`, in units of the probe rendering's, from this ray on. */
static CtsScene scene_of_rays(const ProbeRendering *l, const double from[2], double apart, const int n[2])
{
    CtsScene scene = l->store.scene;
    CtsView *const v = &scene.view;
    v->width = n[0];
    v->height = n[1];
    for (int a = 0; a < 3; a++) {
        v->centre_vox[a] += (from[0] + apart * (n[0] - 1) / 2 - (LOOK - 1) / 2.0) * v->right_vox[a] -
                            (from[1] + apart * (n[1] - 1) / 2 - (LOOK - 1) / 2.0) * v->up_vox[a];
        v->right_vox[a] *= apart;
        v->up_vox[a] *= apart;
    }
    return scene;
}

static CtsStatus render_every_ray(ProbeRendering *l, const CtsScene *scene, CtsError *err)
{
    CtsPicture *picture = NULL;
    const int width = scene->view.width, height = scene->view.height;
    CtsStatus st = cts_picture_new(&picture, width, height, 4, err);
    if (!st)
        st = cts_engine(cts_engine_for_probes())->render(scene, picture, NULL, NULL, err);
    const int channel = scene->preset->mode == CTS_MODE_COMPOSITE ? 3 : 0;
    for (int i = 0; i < width * height && !st; i++)
        l->shown[i / width][i % width] = shown_by(picture->pixels[4 * i + channel], l->least);
    cts_picture_free(&picture);
    return st;
}

/* Rays of a probe rendering that are marched at once, and those that are known. */
typedef struct ProbeRays {
    uint32_t place[LOOK * LOOK];
    float rgba[LOOK * LOOK][4], off[LOOK * LOOK];
    bool known[LOOK][LOOK];
} ProbeRays;

static CtsStatus march_unknown(ProbeRendering *l, const CtsScene *scene, int apart, ProbeRays *rays, CtsError *err)
{
    const CtsPicture whole = {.width = LOOK, .height = LOOK};
    size_t n = 0;
    const int side = SQUARE * apart, across = LOOK / side;
    for (int i = 0; i < LOOK * LOOK / (apart * apart); i++) {
        const int square = i / (SQUARE * SQUARE);
        const int x = square % across * side + i % SQUARE * apart;
        const int y = square / across * side + i / SQUARE % SQUARE * apart;
        if (!rays->known[y][x])
            rays->place[n++] = (uint32_t)(y * LOOK + x);
    }
    const CtsStatus st = cts_engine(cts_engine_for_probes())
                             ->render_pixels(scene, &whole, rays->place, n, cts_scene_requested_error(scene),
                                             rays->rgba, rays->off, err);
    for (size_t i = 0; i < n && !st; i++) {
        const uint32_t at = rays->place[i];
        rays->known[at / LOOK][at % LOOK] = true;
        l->shown[at / LOOK][at % LOOK] = shown_by(rays->rgba[i][3], l->least);
    }
    return st;
}

/* Fills squares whose corners are visible with their mean: what lies between them cannot change a part's box. */
static void fill_squares(ProbeRendering *l, int side, ProbeRays *rays)
{
    for (int y = 0; y + side < LOOK; y += side)
        for (int x = 0; x + side < LOOK; x += side) {
            const int corner[4] = {l->shown[y][x], l->shown[y][x + side], l->shown[y + side][x],
                                   l->shown[y + side][x + side]};
            if (!corner[0] || !corner[1] || !corner[2] || !corner[3])
                continue;
            for (int i = 0; i < (side + 1) * (side + 1); i++) {
                const int v = y + i / (side + 1), u = x + i % (side + 1);
                if (!rays->known[v][u])
                    l->shown[v][u] = (uint8_t)((corner[0] + corner[1] + corner[2] + corner[3] + 2) / 4);
                rays->known[v][u] = true;
            }
        }
}

/* Renders all rays but those that lie between visible ones. */
static CtsStatus render_outlines(ProbeRendering *l, const CtsScene *scene, CtsError *err)
{
    ProbeRays *rays = NULL;
    CtsStatus st = cts_alloc_zeroed(&rays, 1, err);
    for (int apart = COARSEST; apart >= 1 && !st; apart /= 2)
        if (!(st = march_unknown(l, scene, apart, rays, err)))
            fill_squares(l, apart, rays);
    cts_free(&rays);
    return st;
}

static CtsStatus render_rays(ProbeRendering *l, const double from[2], double apart, const int n[2], CtsError *err)
{
    const CtsScene scene = scene_of_rays(l, from, apart, n);
    memset(l->shown, 0, sizeof l->shown);
    return scene.preset->mode == CTS_MODE_COMPOSITE && n[0] == LOOK && n[1] == LOOK ? render_outlines(l, &scene, err)
                                                                                    : render_every_ray(l, &scene, err);
}

/* Rays of a probe rendering: from low to high, inclusive. */
typedef struct RayBox {
    int low[2], high[2];
} RayBox;

static void widen_box(RayBox *box, const RayBox *by)
{
    for (int i = 0; i < 2; i++) {
        box->low[i] = by->low[i] < box->low[i] ? by->low[i] : box->low[i];
        box->high[i] = by->high[i] > box->high[i] ? by->high[i] : box->high[i];
    }
}

/* An 8-connected part of the visible rays. */
typedef struct Part {
    RayBox box;
    int n_rays, weight; /* weight: sum of what the rays show */
} Part;

/* Removes the part of a visible ray from the probe rendering. */
static void cut_part(ProbeRendering *l, int x, int y, Part *part)
{
    uint16_t open[LOOK * LOOK];
    int n_open = 0;
    open[n_open++] = (uint16_t)(y * LOOK + x);
    *part = (Part){.box = {{x, y}, {x, y}}, .weight = l->shown[y][x]};
    l->shown[y][x] = 0;
    while (n_open > 0) {
        const int at = open[--n_open];
        const int px = at % LOOK, py = at / LOOK;
        widen_box(&part->box, &(RayBox){{px, py}, {px, py}});
        part->n_rays++;
        for (int j = py > 0 ? py - 1 : 0; j <= py + 1 && j < LOOK; j++)
            for (int i = px > 0 ? px - 1 : 0; i <= px + 1 && i < LOOK; i++)
                if (l->shown[j][i]) {
                    part->weight += l->shown[j][i];
                    l->shown[j][i] = 0;
                    open[n_open++] = (uint16_t)(j * LOOK + i);
                }
    }
}

static bool reaches_past(const RayBox *part, const RayBox *box)
{
    return part->low[0] < box->low[0] || part->low[1] < box->low[1] || part->high[0] > box->high[0] ||
           part->high[1] > box->high[1];
}

/* The weight of the heaviest part within a box extended by a ray, as if of the probe rendering's rays. */
static CtsStatus closer_weight(const ProbeRendering *l, const RayBox *box, double *weight, CtsError *err)
{
    const int n[2] = {(box->high[0] - box->low[0] + 3) * FINER, (box->high[1] - box->low[1] + 3) * FINER};
    const double from[2] = {box->low[0] - 1.5 + 0.5 / FINER, box->low[1] - 1.5 + 0.5 / FINER};
    ProbeRendering closer = *l;
    int most = 0;
    const CtsStatus st = render_rays(&closer, from, 1.0 / FINER, n, err);
    for (int i = 0; i < LOOK * LOOK && !st; i++) {
        Part part = {.weight = 0};
        if (closer.shown[i / LOOK][i % LOOK])
            cut_part(&closer, i % LOOK, i / LOOK, &part);
        most = part.weight > most ? part.weight : most;
    }
    *weight = (double)most / (FINER * FINER);
    return st;
}

/* The box of the visible rays without specks; high[0] < 0 if there are none. */
static CtsStatus take_box(ProbeRendering *l, RayBox *box, CtsError *err)
{
    RayBox unsure[LOOK * LOOK / 4]; /* parts are at least a ray apart */
    int all = 0, n_unsure = 0;
    CtsStatus st = CTS_OK;
    *box = (RayBox){{LOOK, LOOK}, {-1, -1}};
    for (int i = 0; i < LOOK * LOOK; i++)
        all += l->shown[i / LOOK][i % LOOK];
    for (int i = 0; i < LOOK * LOOK; i++) {
        Part part;
        if (!l->shown[i / LOOK][i % LOOK])
            continue;
        cut_part(l, i % LOOK, i / LOOK, &part);
        if (part.weight < SPECK * all)
            continue;
        if (part.n_rays >= SURE)
            widen_box(box, &part.box);
        else
            unsure[n_unsure++] = part.box;
    }
    for (int i = 0; i < n_unsure && !st; i++) {
        double weight = 0;
        if (reaches_past(&unsure[i], box) && !(st = closer_weight(l, &unsure[i], &weight, err)) &&
            weight >= SPECK * all)
            widen_box(box, &unsure[i]);
    }
    return st;
}

/* The visible range along a direction: dot products with points in patient coordinates. */
typedef struct Span {
    double low_mm, high_mm;
} Span;

static double middle_mm(Span span)
{
    return 0.5 * (span.low_mm + span.high_mm);
}

/* The ends of the volume's box, which no order of its voxels changes. */
static Span span_of_box(const CtsVolume *volume, const double direction_lps[3])
{
    double first = cts_dot3(volume->origin_lps, direction_lps);
    for (int axis = 0; axis < 3; axis++)
        first -= cts_dot3(volume->step_lps[axis], direction_lps) * volume->air_before[axis];
    Span span = {first, first};
    for (int axis = 0; axis < 3; axis++) {
        const double along = cts_dot3(volume->step_lps[axis], direction_lps) * (cts_volume_extent(volume, axis) - 1);
        *(along > 0 ? &span.high_mm : &span.low_mm) += along;
    }
    return span;
}

/* The intersection of a span with the volume, which may be thinner than a ray's spacing. */
static Span intersection(Span span, Span volume)
{
    return (Span){fmax(span.low_mm, volume.low_mm), fmin(span.high_mm, volume.high_mm)};
}

static double ray_mm(Span span)
{
    return (span.high_mm - span.low_mm) / (LOOK - 2);
}

/* Only with opacity by voxel does it depend on the view. */
static CtsStatus find_probe_lut(Probing *l, CtsScene *scene, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (!l->lut || l->lut_scale != scene->extinction_scale) {
        cts_lut_free(&l->lut);
        l->lut_scale = scene->extinction_scale;
        st = cts_lut_new(&l->lut, scene->preset, scene->volume, NULL, scene->extinction_scale, err);
    }
    scene->lut = l->lut;
    return st;
}

/* Probe rendering between the spans to the right and up, with separate spacings, so that a thin volume is not missed;
 * one more ray beyond either end. */
static CtsStatus render_probe(Probing *probing, const CtsRenderSettings *s, double least, const Span span[2],
                              RayBox *box, CtsError *err)
{
    ProbeRendering l = {.least = least};
    CtsRenderSettings small = *s;
    CtsViewAxes axes;
    small.width = small.height = LOOK;
    small.mm_per_pixel = 1;
    small.shade = CTS_OFF;
    small.centre_given = true;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int c = 0; c < 3; c++)
        small.centre_lps[c] = middle_mm(span[0]) * axes.right_lps[c] + middle_mm(span[1]) * axes.up_lps[c];
    CtsStatus st = cts_scene_init(&l.store, probing->what->model, probing->what->preset, &small, err);
    if (st)
        return st;
    CtsScene *const scene = &l.store.scene;
    scene->plan = (CtsPlan){.max_error = 255 * least / 2, .few_rays = true};
    scene->cache = probing->what->cache;
    scene->frame = probing->what->frame;
    if (scene->preset->mode == CTS_MODE_COMPOSITE && (st = find_probe_lut(probing, scene, err)))
        return st;
    for (int a = 0; a < 3; a++) {
        scene->view.right_vox[a] *= ray_mm(span[0]);
        scene->view.up_vox[a] *= ray_mm(span[1]);
    }
    st = render_rays(&l, (const double[]){0, 0}, 1, (const int[]){LOOK, LOOK}, err);
    return st ? st : take_box(&l, box, err);
}

/* The span between rays low and high, extended by `more` rays on either side. */
static Span narrowed(Span span, int low, int high, double more)
{
    const double mm = ray_mm(span), first_mm = middle_mm(span) - mm * LOOK / 2;
    return (Span){first_mm + mm * (low - more), first_mm + mm * (high + 1 + more)};
}

/* The visible spans to the right and up, in the settings' view; *found: anything is visible. */
static CtsStatus find_by(Probing *probing, const CtsRenderSettings *s, double least, Span span[2], bool *found,
                         CtsError *err)
{
    CtsViewAxes axes;
    CtsStatus st;
    RayBox box;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    const Span whole[2] = {span_of_box(probing->what->model->volume, axes.right_lps),
                           span_of_box(probing->what->model->volume, axes.up_lps)};
    memcpy(span, whole, sizeof whole);
    for (int n = 1; !(st = render_probe(probing, s, least, span, &box, err)) && box.high[0] >= 0; n++) {
        const int n_found[2] = {box.high[0] - box.low[0], box.high[1] - box.low[1]};
        const bool up = n_found[1] * ray_mm(span[1]) > n_found[0] * ray_mm(span[0]);
        *found = n == MAX_PROBES || n_found[up] >= MIN_FOUND;
        /* A finer probe rendering begins at the invisible rays. */
        const double more = *found ? 0 : 0.5;
        span[0] = intersection(narrowed(span[0], box.low[0], box.high[0], more), whole[0]);
        span[1] = intersection(narrowed(span[1], LOOK - 1 - box.high[1], LOOK - 1 - box.low[1], more), whole[1]);
        if (*found)
            break;
    }
    return st;
}

static CtsStatus find_spans(Probing *probing, const CtsRenderSettings *s, Span span[2], bool *found, CtsError *err)
{
    const bool composite = probing->what->preset->mode == CTS_MODE_COMPOSITE;
    CtsRenderSettings brightest = *s;
    *found = false;
    const CtsStatus st = find_by(probing, s, composite ? HAZE : DARKEST, span, found, err);
    if (st || *found)
        return st;
    if (!composite)
        brightest.mode = CTS_MODE_MIP;
    return find_by(probing, &brightest, DARKEST, span, found, err);
}

/* Raises half[0] and half[1] to the visible part's extent from the settings' centre in this view. */
static CtsStatus reach_from_centre(Probing *probing, const CtsRenderSettings *s, double half[2], CtsError *err)
{
    Span span[2];
    bool found;
    CtsViewAxes axes;
    const CtsStatus st = find_spans(probing, s, span, &found, err);
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int i = 0; i < 2 && !st && found; i++) {
        const double from_mm = cts_dot3(s->centre_lps, i ? axes.up_lps : axes.right_lps);
        half[i] = fmax(half[i], fmax(span[i].high_mm - from_mm, from_mm - span[i].low_mm));
    }
    return st;
}

/* The centre of a rotation lies on the head-foot axis through the middle of the visible part, from the front and from
 * the left. */
static CtsStatus frame_rotation(Probing *probing, CtsRenderSettings *s, double half[2], CtsError *err)
{
    CtsStatus st;
    CtsRenderSettings view = *s;
    Span front[2], left[2];
    bool found[2];
    view.slab_mm = view.slab_at_mm = view.elevation_deg = view.azimuth_deg = 0;
    if ((st = find_spans(probing, &view, front, &found[0], err)))
        return st;
    view.azimuth_deg = 90;
    if ((st = find_spans(probing, &view, left, &found[1], err)) || !found[0] || !found[1])
        return st;
    s->centre_lps[0] = middle_mm(front[0]);
    s->centre_lps[1] = middle_mm(left[0]);
    s->centre_lps[2] = middle_mm(front[1]);
    view = *s;
    const int n = s->rotation_frames < MAX_VIEWS ? s->rotation_frames : MAX_VIEWS;
    for (int i = 0; i < n && !st; i++) {
        view.azimuth_deg = s->azimuth_deg + 360.0 * i / n;
        st = reach_from_centre(probing, &view, half, err);
    }
    return st;
}

static CtsStatus frame_view(Probing *probing, CtsRenderSettings *s, double half[2], CtsError *err)
{
    CtsViewAxes axes;
    Span span[2];
    bool found;
    const CtsStatus st = find_spans(probing, s, span, &found, err);
    if (st || !found)
        return st;
    cts_view_axes(&axes, s->azimuth_deg, s->elevation_deg);
    for (int c = 0; c < 3; c++)
        s->centre_lps[c] = middle_mm(span[0]) * axes.right_lps[c] + middle_mm(span[1]) * axes.up_lps[c];
    for (int i = 0; i < 2; i++)
        half[i] = 0.5 * (span[i].high_mm - span[i].low_mm);
    return st;
}

CtsStatus cts_framing_find(const CtsFramed *what, CtsRenderSettings *settings, CtsError *err)
{
    double half[2] = {0, 0};
    CtsRenderSettings s = *settings;
    CtsPreset bright = *what->preset; /* an inverted window frames what the same window does that is not */
    bright.window_low_hu = fmin(what->preset->window_low_hu, what->preset->window_high_hu);
    bright.window_high_hu = fmax(what->preset->window_low_hu, what->preset->window_high_hu);
    CtsFramed framed = *what;
    framed.preset = &bright;
    Probing probing = {.what = &framed};
    const CtsStatus st = (s.rotation_frames > 1 ? frame_rotation : frame_view)(&probing, &s, half, err);
    cts_lut_free(&probing.lut);
    s.mm_per_pixel = fmax(2 * half[0] / (FILLED * s.width), 2 * half[1] / (FILLED * s.height));
    s.centre_given = true;
    if (!st && s.mm_per_pixel > 0 && isfinite(s.mm_per_pixel))
        *settings = s;
    return st;
}

CtsStatus cts_framing_settle(const CtsModel *model, const CtsPreset *preset, CtsRenderSettings *settings, CtsError *err)
{
    void *kept = NULL;
    const CtsPreset effective = cts_scene_preset(preset, settings);
    CtsModel prepared = *model;
    const CtsFramed what = {&prepared, &effective, &kept, 0};
    if (settings->fit != CTS_FIT_VISIBLE || settings->mm_per_pixel != 0)
        return CTS_OK;
    CtsStatus st = cts_model_prepare(&prepared, settings->n_threads, err);
    if (!st)
        st = cts_framing_find(&what, settings, err);
    cts_engine(cts_engine_for_probes())->free_cache(kept);
    if (!model->macrocells) /* nor labels, which are made behind them */
        cts_model_changed(&prepared);
    return st;
}
