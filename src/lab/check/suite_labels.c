/* Hidden or coloured labels: pixels of rays that cross boundaries of labels within cells. */
#include "lab/check/suite.h"

#include "ctsplat/labels.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NX = 13, NY = 12, NZ = 10, MAX_LABELS = 3 };

/* Labels by formula. */
typedef struct LabelScene {
    int n_labels;
    bool (*holds)(int label, int i, int j, int k);
    double (*share)(int label, int i, int j, int k); /* fraction of a voxel that a label fills in part; NULL: none */
    const char *show, *hide, *appearances[MAX_LABELS];
    const char *colours[MAX_LABELS + 1]; /* for the truth: of each label, and of unlabelled voxels; NULL: hidden */
    int layers;                          /* to a slice distance; 0: 1 */
    bool lit;
    double azimuth_deg, elevation_deg;
    double bound[CHECK_N_FAMILIES];
} LabelScene;

typedef struct Labels {
    CtsLabels set;
    CtsLabel items[MAX_LABELS];
    CtsLabelRun runs[MAX_LABELS][NX * NY * NZ];
    CtsLabelShare shares[MAX_LABELS][NX * NY * NZ];
    double position_lps[NZ][3];
} Labels;

/* Rounded as stored. */
static double rounded_share_of(const LabelScene *s, int label, int i, int j, int k)
{
    const double share = s->share ? fmin(fmax(s->share(label, i, j, k), 0), 1) : s->holds(label, i, j, k);
    return rint(share * CTS_WHOLE_SHARE) / CTS_WHOLE_SHARE;
}

static void fill_scene_labels(Labels *l, const LabelScene *s, const CtsVolume *v, int layers)
{
    static char names[MAX_LABELS][2] = {"a", "b", "c"};
    l->set = (CtsLabels){.items = l->items, .n = (size_t)s->n_labels, .counted = true};
    l->set.grid = (CtsLabelGrid){.columns = NX, .rows = NY, .n_slices = NZ, .position_lps = l->position_lps};
    for (int k = 0; k < NZ; k++)
        for (int c = 0; c < 3; c++)
            l->position_lps[k][c] = v->origin_lps[c] + k * layers * v->step_lps[2][c];
    for (int n = 0; n < s->n_labels; n++) {
        CtsLabel *const label = &l->items[n];
        *label = (CtsLabel){
            .fact = {.file = 1, .number = n + 1, .name = names[n]}, .runs = l->runs[n], .shares = l->shares[n]};
        for (int at = 0; at < NX * NY * NZ; at++) {
            const int i = at % NX, row = at / NX;
            const double share = rounded_share_of(s, n, i, row % NY, row / NY);
            if (share > 0 && share < 1)
                label->shares[label->n_shares++] =
                    (CtsLabelShare){(uint32_t)row, (uint16_t)i, (uint16_t)lround(share * CTS_WHOLE_SHARE)};
            if (share < 0.5)
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

typedef struct Truth {
    const LabelScene *scene;
    const CtsVolume *volume;
    CtsPreset appearances[MAX_LABELS + 1];
    int layers;
    uint64_t voxels[MAX_LABELS];
} Truth;

/* A scanned voxel's contribution to the fields: labels take their fractions, from the smallest label on, as far as a
 * remainder is left. */
static void add_true_voxel(const Truth *t, int i, int j, int k, double weight, double field[MAX_LABELS + 1])
{
    const int n_labels = t->scene->n_labels;
    double left = 1;
    unsigned added = 0;
    for (int turn = 0; turn < n_labels; turn++) {
        int next = -1;
        for (int n = 0; n < n_labels; n++)
            if (!(added >> n & 1) && (next < 0 || t->voxels[n] < t->voxels[next]))
                next = n;
        const double share = fmin(rounded_share_of(t->scene, next, i, j, k), left);
        field[next] += weight * share;
        left -= share;
        added |= 1u << next;
    }
    field[n_labels] += weight * left;
}

/* The label of a point: from all eight voxels of its cell of layers, linear between slices. */
static int label_at(const Truth *t, const double vox[3])
{
    double field[MAX_LABELS + 1] = {0};
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
        add_true_voxel(t, at[0], at[1], slice, weight * (1 - behind), field);
        if (rest > 0)
            add_true_voxel(t, at[0], at[1], slice + 1, weight * behind, field);
    }
    for (int n = 1; n <= t->scene->n_labels; n++)
        most = field[n] > field[most] + 1e-12 ? n : most;
    return most;
}

static int label_on(const Truth *t, const CtsTruthRay *ray, double t_mm)
{
    double vox[3];
    cts_truth_ray_voxel(t->volume, ray, t_mm, vox);
    return label_at(t, vox);
}

/* Steps far shorter than a cell; between two points of different labels, the position of the boundary. */
static void labels_truth(const CtsTruthRay *ray, const void *data, double rgba[4])
{
    enum { STEPS = 3000, HALVINGS = 34 };
    const Truth *const t = data;
    CtsTruthSum light = {{0}, 0};
    const double step = (ray->to_mm - ray->from_mm) / STEPS, hu = cts_volume_hu(t->volume, t->volume->grey[0]);
    double from = ray->from_mm;
    int voxel_label = label_on(t, ray, from + 1e-9);
    for (int i = 1; i <= STEPS; i++) {
        const double at = ray->from_mm + i * step - (i == STEPS ? 1e-9 : 0);
        const int next = label_on(t, ray, at);
        if (next == voxel_label && i < STEPS)
            continue;
        double low = at - step, high = at;
        for (int h = 0; h < HALVINGS && next != voxel_label; h++) {
            const double middle = 0.5 * (low + high);
            *(label_on(t, ray, middle) == voxel_label ? &low : &high) = middle;
        }
        if (t->scene->colours[voxel_label])
            cts_truth_add(&t->appearances[voxel_label], 1, &(CtsTruthInterval){hu, hu, high - from, -1}, &light);
        from = high;
        voxel_label = next;
    }
    cts_truth_pixel(&light, rgba);
}

static CtsPreset preset_of_colour(const char *colour)
{
    const unsigned long rgb = colour ? strtoul(colour, NULL, 16) : 0;
    return cts_check_even_preset(0.2, (double)(rgb >> 16) / 255, (double)(rgb >> 8 & 255) / 255,
                                 (double)(rgb & 255) / 255);
}

static const CtsCheckPoint shown[] = {{-500, 0, {0.2, 0.5, 0.9}}, {0, 0.1, {0.9, 0.5, 0.2}}};

static CtsStatus make_scene(const CtsCheckRun *run, const LabelScene *s, CtsRenderedScene *m, CtsError *err)
{
    const int layers = s->layers ? s->layers : 1;
    const CtsFormulaScene scene = {.dims = {NX, NY, (NZ - 1) * layers + 1},
                                   .spacing_mm = {1, 1.2, 2.0 / layers},
                                   .layers = layers,
                                   .hu = {300},
                                   POINTS(shown),
                                   PIXELS(23, 23),
                                   VIEW(s->azimuth_deg, s->elevation_deg)};
    return cts_check_make(run, &scene, m, err);
}

static CtsStatus make_labelled(const CtsCheckRun *run, const LabelScene *s, CtsRenderedScene *m, Labels **labels,
                               CtsError *err)
{
    const CtsLabelChoice choice = {.show = s->show,
                                   .hide = s->hide,
                                   .appearances = s->appearances,
                                   .n_appearances = s->appearances[0] ? s->n_labels : 0};
    const CtsStatus st = make_scene(run, s, m, err);
    if (st)
        return st;
    if (!(*labels = calloc(1, sizeof **labels)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    fill_scene_labels(*labels, s, m->model.volume, m->model.volume->slice_layers);
    return cts_model_take_labels(&m->model, &(*labels)->set, &choice, 1, NULL, err);
}

static CtsStatus edges(CtsCheckRun *run, const void *data, CtsError *err)
{
    const LabelScene *const s = data;
    CtsRenderedScene m;
    Labels *labels = NULL;
    CtsStatus st = make_labelled(run, s, &m, &labels, err);
    if (!st) {
        m.preset = preset_of_colour(s->colours[s->n_labels] ? s->colours[s->n_labels] : "c08040");
        Truth t = {.scene = s, .volume = m.model.volume, .layers = m.model.volume->slice_layers};
        for (int n = 0; n < s->n_labels; n++)
            t.voxels[n] = labels->items[n].fact.voxels;
        for (int n = 0; n <= s->n_labels; n++)
            t.appearances[n] = preset_of_colour(s->colours[n]);
        st = cts_check_picture(run, &m, labels_truth, &t, s->bound[cts_check_family(run->engine)], err);
    }
    cts_model_free(&m.model);
    free(labels);
    return st;
}

/* For engines without label boundaries a hidden voxel is air. */
static CtsStatus air(CtsCheckRun *run, const void *data, CtsError *err)
{
    const LabelScene *const s = data;
    CtsRenderedScene hidden, cut = {.model = {.volume = NULL}};
    CtsPicture *a = NULL, *b = NULL;
    Labels *labels = NULL;
    CtsStatus st = make_labelled(run, s, &hidden, &labels, err);
    if (!st && !(st = make_scene(run, s, &cut, err)))
        for (int at = 0; at < NX * NY * NZ; at++)
            if (s->holds(0, at % NX, at / NX % NY, at / NX / NY))
                cut.model.volume->grey[at] = 0;
    if (!st && !(st = cts_check_render(run, &hidden.model, &hidden.preset, &hidden.settings, &a, err)) &&
        !(st = cts_check_render(run, &cut.model, &cut.preset, &cut.settings, &b, err)))
        cts_check_value(run, 0, cts_check_differing(a, b), 0);
    cts_picture_free(&a);
    cts_picture_free(&b);
    cts_model_free(&hidden.model);
    cts_model_free(&cut.model);
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

static bool in_ball(int label, int i, int j, int k)
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

/* A plane that lies anywhere between voxels. */
static double part_plane(int label, int i, int j, int k)
{
    (void)label;
    return 0.5 + (6.3 - i - 0.4 * j - 0.3 * k + 3) / 2;
}

/* A ball of probability, within another one and beside it. */
static double part_balls(int label, int i, int j, int k)
{
    const double x = i - 6 - 1.5 * label, y = j - 5.3, z = k - 4.7, r = sqrt(x * x + y * y + 2 * z * z);
    return 0.5 + ((label ? 2.4 : 4.6) - r) / 3;
}

/* Of engines with label boundaries. */
#define EDGES(NAME, ...)                                                                                               \
    ROW(NAME, CHECK_OF_FIELDS, edges, LabelScene, .bound = {CHECK_NONE, CHECK_PROMISED, 1e-6}, __VA_ARGS__)
#define HIDDEN .hide = "a", .colours = {NULL, "c08040"}
#define SHOWN .show = "a", .colours = {"c08040", NULL}
#define TWO_COLOURS .appearances = {"a=#4080ff", "b=#ff2000"}, .colours = {"4080ff", "ff2000", "c08040"}

static const CtsCheckCase cases[] = {
    EDGES("labels: hidden half", .n_labels = 1, .holds = half_space, HIDDEN, VIEW(0, 0)),
    EDGES("labels: hidden half, oblique", .n_labels = 1, .holds = half_space, HIDDEN, VIEW(50, 20)),
    EDGES("labels: hidden diagonal", .n_labels = 1, .holds = diagonal, HIDDEN, VIEW(-35, 25)),
    EDGES("labels: shown ball", .n_labels = 1, .holds = in_ball, SHOWN, VIEW(15, -30)),
    EDGES("labels: one voxel thin", .n_labels = 1, .holds = thin, SHOWN, VIEW(25, 40)),
    EDGES("labels: one in another", .n_labels = 2, .holds = one_in_another, TWO_COLOURS, VIEW(10, 70)),
    EDGES("labels: one in another, hidden", .n_labels = 2, .holds = one_in_another, .show = "b", .hide = "a",
          .colours = {NULL, "c08040", NULL}, VIEW(100, 10)),
    EDGES("labels: three meet", .n_labels = 3, .holds = three_meet,
          .appearances = {"a=#4080ff", "b=#ff2000", "c=#20ff60"}, .colours = {"4080ff", "ff2000", "20ff60", "c08040"},
          VIEW(30, 35)),
    EDGES("labels: three layers to a slice", .n_labels = 3, .holds = three_meet, .hide = "b",
          .appearances = {"a=#4080ff", "b=#ff2000", "c=#20ff60"}, .colours = {"4080ff", NULL, "20ff60", "c08040"},
          .layers = 3, VIEW(-60, 35)),
    EDGES("labels: fractions, a plane", .n_labels = 1, .share = part_plane, HIDDEN, VIEW(40, 25)),
    EDGES("labels: fractions, two balls", .n_labels = 2, .share = part_balls, TWO_COLOURS, VIEW(20, 30)),
    EDGES("labels: fractions, three layers to a slice", .n_labels = 2, .share = part_balls, .show = "a", .hide = "b",
          .colours = {"c08040", NULL, NULL}, .layers = 3, VIEW(-70, 35)),
    ROW("labels: hidden voxels are air", CHECK_OF_ALL & ~CHECK_OF_FIELDS, air, LabelScene, 1, in_ball, .hide = "a",
        VIEW(15, -30), .bound = {0, 0, 0}),
};

const CtsCheckTable cts_check_labels = {cases, sizeof cases / sizeof *cases};
