/* Labels that are hidden or have a colour of their own: what a ray shows where its owner changes within cells. */
#include "lab/check/suite.h"

#include "ctsplat/labels.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NX = 13, NY = 12, NZ = 10, MOST_LABELS = 3 };

/* Labels by formula. */
typedef struct Scene {
    int n_labels;
    bool (*holds)(int label, int i, int j, int k);
    const char *show, *hide, *looks[MOST_LABELS];
    const char *colours[MOST_LABELS + 1]; /* as the truth has them: of each label, and of the rest; NULL: hidden */
    int layers;                           /* to a slice distance; 0: 1 */
    bool lit;
    double azimuth_deg, elevation_deg;
    double bound[CHECK_N_FAMILIES];
} Scene;

typedef struct Labels {
    CtsLabels set;
    CtsLabel items[MOST_LABELS];
    CtsLabelRun runs[MOST_LABELS][NX * NY * NZ];
    double position_lps[NZ][3];
} Labels;

static void fill(Labels *l, const Scene *s, const CtsVolume *v, int layers)
{
    static char names[MOST_LABELS][2] = {"a", "b", "c"};
    l->set = (CtsLabels){.items = l->items, .n = (size_t)s->n_labels, .counted = true};
    l->set.grid = (CtsLabelGrid){.columns = NX, .rows = NY, .n_slices = NZ, .position_lps = l->position_lps};
    for (int k = 0; k < NZ; k++)
        for (int c = 0; c < 3; c++)
            l->position_lps[k][c] = v->origin_lps[c] + k * layers * v->step_lps[2][c];
    for (int n = 0; n < s->n_labels; n++) {
        CtsLabel *const label = &l->items[n];
        *label = (CtsLabel){.fact = {.file = 1, .number = n + 1, .name = names[n]}, .runs = l->runs[n]};
        for (int at = 0; at < NX * NY * NZ; at++) {
            const int i = at % NX, row = at / NX;
            if (!s->holds(n, i, row % NY, row / NY))
                continue;
            label->fact.voxels++;
            CtsLabelRun *const last = label->n_runs ? &label->runs[label->n_runs - 1] : NULL;
            if (last && last->row == (uint32_t)row && last->end == i)
                last->end++;
            else
                label->runs[label->n_runs++] = (CtsLabelRun){(uint32_t)row, (uint16_t)i, (uint16_t)(i + 1)};
        }
    }
}

/* Whose a scanned voxel is: the smallest label's that holds it, or the rest's. */
typedef struct Truth {
    const Scene *scene;
    const CtsVolume *volume;
    CtsPreset looks[MOST_LABELS + 1];
    int layers;
    uint64_t voxels[MOST_LABELS];
} Truth;

static int owner_of(const Truth *t, int i, int j, int k)
{
    int owner = t->scene->n_labels;
    for (int n = 0; n < t->scene->n_labels; n++)
        if (t->scene->holds(n, i, j, k) && (owner == t->scene->n_labels || t->voxels[n] < t->voxels[owner]))
            owner = n;
    return owner;
}

/* Who owns a point: all eight corners of its cell of layers, straight lines between slices. */
static int owner_at(const Truth *t, const double vox[3])
{
    double field[MOST_LABELS + 1] = {0};
    int cell[3], most = 0;
    for (int a = 0; a < 3; a++)
        cell[a] = (int)fmin(fmax(floor(vox[a]), 0), t->volume->dims[a] - 2);
    for (int m = 0; m < 8; m++) {
        double weight = 1;
        int at[3];
        for (int a = 0; a < 3; a++) {
            const double within = vox[a] - cell[a];
            at[a] = cell[a] + (m >> a & 1);
            weight *= m >> a & 1 ? within : 1 - within;
        }
        const int slice = at[2] / t->layers, rest = at[2] % t->layers;
        const double behind = (double)rest / t->layers;
        field[owner_of(t, at[0], at[1], slice)] += weight * (1 - behind);
        if (rest > 0)
            field[owner_of(t, at[0], at[1], slice + 1)] += weight * behind;
    }
    for (int n = 1; n <= t->scene->n_labels; n++)
        most = field[n] > field[most] + 1e-12 ? n : most;
    return most;
}

static int owner_on(const Truth *t, const CtsTruthRay *ray, double t_mm)
{
    double point[3], vox[3];
    cts_truth_ray_point(ray, t_mm, point);
    cts_truth_voxel(t->volume, point, vox);
    return owner_at(t, vox);
}

/* Steps far shorter than a cell, and between two of different owners the place where they meet. */
static void truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { STEPS = 3000, HALVINGS = 34 };
    const Truth *const t = data;
    CtsTruthLight light = {{0}, 0};
    if (!ray)
        return;
    const double step = (ray->to_mm - ray->from_mm) / STEPS, hu = cts_volume_hu(t->volume, t->volume->grey[0]);
    double from = ray->from_mm;
    int owner = owner_on(t, ray, from + 1e-9);
    for (int i = 1; i <= STEPS; i++) {
        const double at = ray->from_mm + i * step - (i == STEPS ? 1e-9 : 0);
        const int next = owner_on(t, ray, at);
        if (next == owner && i < STEPS)
            continue;
        double low = at - step, high = at;
        for (int h = 0; h < HALVINGS && next != owner; h++) {
            const double middle = 0.5 * (low + high);
            *(owner_on(t, ray, middle) == owner ? &low : &high) = middle;
        }
        if (t->scene->colours[owner])
            cts_truth_add(&t->looks[owner], 1, &(CtsTruthStretch){hu, hu, high - from, -1}, &light);
        from = high;
        owner = next;
    }
    cts_truth_seen(&light, rgba);
}

static CtsPreset look_of(const char *colour)
{
    const unsigned long rgb = colour ? strtoul(colour, NULL, 16) : 0;
    return cts_check_even_preset(0.2, (double)(rgb >> 16) / 255, (double)(rgb >> 8 & 255) / 255,
                                 (double)(rgb & 255) / 255);
}

static CtsStatus make_volume(const Scene *s, CtsVolume **volume, Labels *labels, CtsError *err)
{
    const double hu = 300;
    const int layers = s->layers ? s->layers : 1;
    const int dims[3] = {NX, NY, (NZ - 1) * layers + 1};
    const double spacing[3] = {1, 1.2, 2.0 / layers};
    const CtsLabelChoice choice = {
        .show = s->show, .hide = s->hide, .looks = s->looks, .n_looks = s->looks[0] ? s->n_labels : 0};
    const CtsStatus st = cts_check_volume(volume, dims, spacing, 1, cts_hu_constant, &hu, err);
    if (st)
        return st;
    (*volume)->slice_layers = layers;
    fill(labels, s, *volume, layers);
    return cts_volume_take_labels(*volume, &labels->set, &choice, 1, NULL, err);
}

static CtsStatus edges(CtsCheckRun *run, const void *data, CtsError *err)
{
    const Scene *const s = data;
    CtsVolume *volume = NULL;
    Labels *const labels = calloc(1, sizeof *labels);
    CtsStatus st = labels ? make_volume(s, &volume, labels, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st) {
        const CtsPreset preset = look_of(s->colours[s->n_labels] ? s->colours[s->n_labels] : "c08040");
        CtsRenderSettings settings = cts_check_settings(run, 23, 23);
        settings.azimuth_deg = s->azimuth_deg;
        settings.elevation_deg = s->elevation_deg;
        Truth t = {.scene = s, .volume = volume, .layers = s->layers ? s->layers : 1};
        for (int n = 0; n < s->n_labels; n++)
            t.voxels[n] = labels->items[n].fact.voxels;
        for (int n = 0; n <= s->n_labels; n++)
            t.looks[n] = look_of(s->colours[n]);
        st = cts_check_picture(run, &(CtsCheckPicture){volume, &preset, &settings, truth, &t},
                               s->bound[cts_check_family(run->engine)], err);
    }
    cts_volume_free(&volume);
    free(labels);
    return st;
}

/* For engines that know no edges a hidden voxel is one of air. */
static CtsStatus air(CtsCheckRun *run, const void *data, CtsError *err)
{
    const Scene *const s = data;
    CtsVolume *hidden = NULL, *cut = NULL;
    CtsPicture *a = NULL, *b = NULL;
    Labels *const labels = calloc(1, sizeof *labels);
    const CtsCheckPoint points[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.1, {0.9, 0.5, 0.2}}};
    const CtsPreset preset = cts_check_preset(points, 2);
    CtsRenderSettings settings = cts_check_settings(run, 23, 23);
    settings.azimuth_deg = s->azimuth_deg;
    settings.elevation_deg = s->elevation_deg;
    CtsStatus st = labels ? make_volume(s, &hidden, labels, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st && !(st = cts_check_volume(&cut, hidden->dims, (const double[]){1, 1.2, 2}, 1, cts_hu_constant,
                                       &(const double){300}, err)))
        for (int at = 0; at < NX * NY * NZ; at++)
            if (s->holds(0, at % NX, at / NX % NY, at / NX / NY))
                cut->grey[at] = 0;
    if (!st && !(st = cts_check_render(run, hidden, &preset, &settings, &a, err)) &&
        !(st = cts_check_render(run, cut, &preset, &settings, &b, err)))
        cts_check_value(run, 0, cts_check_differing(a, b), 0);
    cts_picture_free(&a);
    cts_picture_free(&b);
    cts_volume_free(&hidden);
    cts_volume_free(&cut);
    free(labels);
    return st;
}

static bool half_space(int label, int i, int j, int k)
{
    (void)label, (void)j, (void)k;
    return i < 6;
}

static bool diagonal(int label, int i, int j, int k)
{
    (void)label;
    return i + j + k < 16;
}

static bool ball(int label, int i, int j, int k)
{
    (void)label;
    return (i - 6) * (i - 6) + (j - 5) * (j - 5) + 2 * (k - 5) * (k - 5) < 20;
}

static bool thin(int label, int i, int j, int k)
{
    (void)label, (void)i, (void)k;
    return j == 5;
}

static bool one_in_another(int label, int i, int j, int k)
{
    return label == 0 ? i > 4 && j > 3 && k > 3 && i < 8 && j < 8 && k < 6
                      : i > 1 && j > 1 && k > 1 && i < 11 && j < 10 && k < 8;
}

static bool three_meet(int label, int i, int j, int k)
{
    return k < 8 && (label == 0 ? i < 5 && j < 7 : label == 1 ? i >= 5 && j < 5 + i / 5 : j >= 7 && i < 9);
}

#define SCENE(NAME, RUN, ENGINES, ...)                                                                                 \
    {                                                                                                                  \
        NAME, ENGINES, RUN, &(const Scene)                                                                             \
        {                                                                                                              \
            __VA_ARGS__                                                                                                \
        }                                                                                                              \
    }
#define VIEW(AZ, EL) .azimuth_deg = AZ, .elevation_deg = EL
#define BY_EDGES CHECK_OF_LABELS
#define BOUND .bound = {CHECK_NONE, CHECK_PROMISED, 1e-6}

static const CtsCheckCase cases[] = {
    SCENE("labels: hidden half", edges, BY_EDGES, 1, half_space, .hide = "a", .colours = {NULL, "c08040"}, VIEW(0, 0),
          BOUND),
    SCENE("labels: hidden half, oblique", edges, BY_EDGES, 1, half_space, .hide = "a", .colours = {NULL, "c08040"},
          VIEW(50, 20), BOUND),
    SCENE("labels: hidden diagonal", edges, BY_EDGES, 1, diagonal, .hide = "a", .colours = {NULL, "c08040"},
          VIEW(-35, 25), BOUND),
    SCENE("labels: shown ball", edges, BY_EDGES, 1, ball, .show = "a", .colours = {"c08040", NULL}, VIEW(15, -30),
          BOUND),
    SCENE("labels: one voxel thin", edges, BY_EDGES, 1, thin, .show = "a", .colours = {"c08040", NULL}, VIEW(25, 40),
          BOUND),
    SCENE("labels: one in another", edges, BY_EDGES, 2, one_in_another, .looks = {"a=#4080ff", "b=#ff2000"},
          .colours = {"4080ff", "ff2000", "c08040"}, VIEW(10, 70), BOUND),
    SCENE("labels: one in another, hidden", edges, BY_EDGES, 2, one_in_another, .show = "b", .hide = "a",
          .colours = {NULL, "c08040", NULL}, VIEW(100, 10), BOUND),
    SCENE("labels: three meet", edges, BY_EDGES, 3, three_meet, .looks = {"a=#4080ff", "b=#ff2000", "c=#20ff60"},
          .colours = {"4080ff", "ff2000", "20ff60", "c08040"}, VIEW(30, 35), BOUND),
    SCENE("labels: three layers to a slice", edges, BY_EDGES, 3, three_meet, .hide = "b",
          .looks = {"a=#4080ff", "b=#ff2000", "c=#20ff60"}, .colours = {"4080ff", NULL, "20ff60", "c08040"},
          .layers = 3, VIEW(-60, 35), BOUND),
    SCENE("labels: hidden voxels are air", air, CHECK_OF_ALL & ~CHECK_OF_LABELS, 1, ball, .hide = "a", VIEW(15, -30),
          .bound = {0, 0, 0}),
};

const CtsCheckTable cts_check_labels = {cases, sizeof cases / sizeof *cases};
