#include "core/couch/table_removal.h"

#include "base/mem.h"
#include "core/volume/linear_layers.h"
#include "core/volume/threshold.h"
#include <math.h>
#include <stdlib.h>

/* Air is -1000 HU in a calibrated scanner; a lung, even an emphysematous one, is mostly denser than this. Measured:
 * -980 to -850 HU give the same. */
static const double LUNG_HU = -930;
/* Difference from air to the least dense lung, LUNG_HU + 1000, whatever the scanner's level of air is. */
static const double AIR_TO_LUNG_HU = 70;
/* Distances between sampled voxels, along rows and across: 512 samples of a section of 512 x 512 voxels. Measured: 8 to
 * 128 columns and 4 to 64 rows give the same. */
enum { SAMPLE_COLUMNS = 32, SAMPLE_ROWS = 16 };
/* Half size of the window whose mean reduces noise: 5 x 5 voxels of 0.9 mm leave 10 of 50 HU, less than half of
 * AIR_TO_LUNG_HU. Measured: 0.5 to 4 mm pass the tests. */
static const double MEAN_MM = 2;
/* Largest half size in voxels: 9 x 9 leave a ninth of the noise, and more take time. */
enum { MEAN_MOST = 4 };
/* Least share of the air around a patient in a large peak of its histogram, within half of AIR_TO_LUNG_HU of a level.
 * Foam and edges are the rest. Measured: a fifth takes lungs for room air, 0.45 passes the tests. */
static const double PEAK_SHARE = 1 / 3.0;
/* Least share in a sharp peak, which is room air: lungs that the field of view cuts have a flatter one. Measured: room
 * air 65 to 86 %, lungs 52 to 60 %; 0.58 to 0.75 pass the tests. */
static const double SHARP_SHARE = 2 / 3.0;
/* Largest share of all air that is noise where it does not reach the border and is darker than a peak by
 * AIR_TO_LUNG_HU: more of it is the windpipe or gas of the bowel, so the peak is a lung's. Measured: 0 to 0.01 pass the
 * tests. */
static const double DARKER_SHARE = 0.001;

/* Counts of one connected part of the air: sampled voxels, and those as dense as a lung. */
typedef struct Sample {
    uint32_t n, n_lung;
} Sample;

/* The air of all sections, while it is sampled. */
typedef struct Air {
    const CtsSectionPlan *plan;
    const CtsVolume *volume;
    const CtsComponents *parts;
    const uint8_t *at_border; /* of each part: it reaches the border of its section */
} Air;

/* Callback for a sampled voxel of a part. */
typedef void (*Visit)(void *context, const Air *air, uint32_t part, int i, int j, int k);

double cts_section_hu(const CtsSectionPlan *plan, const CtsVolume *v, int i, int j, int k)
{
    const size_t layer_voxels = (size_t)v->dims[0] * (size_t)v->dims[1];
    size_t at[3];
    at[plan->axis[0]] = (size_t)i;
    at[plan->axis[1]] = (size_t)j;
    at[plan->axis[2]] = (size_t)k * (size_t)plan->n_slices;
    const size_t in_layer = at[1] * (size_t)v->dims[0] + at[0];
    if (!plan->layers)
        return cts_volume_hu(v, v->grey[at[2] * layer_voxels + in_layer]);
    uint16_t made;
    const CtsLinearLayer layer = cts_linear_layer(plan->layers, layer_voxels, (int)at[2]);
    return cts_volume_hu(v, *cts_linear_layer_row(&layer, in_layer, 1, &made));
}

/* True within the round field of view; padding lies outside it. */
static bool in_view(const int dims[3], int i, int j)
{
    const double x = (2.0 * i + 1) / dims[0] - 1, y = (2.0 * j + 1) / dims[1] - 1;
    return x * x + y * y < 1;
}

static void visit_samples(const Air *a, Visit visit, void *context)
{
    const CtsComponents *const p = a->parts;
    for (int k = 0; k < p->dims[2]; k++)
        for (int j = 0; j < p->dims[1]; j += SAMPLE_ROWS) {
            const size_t row = (size_t)k * (size_t)p->dims[1] + (size_t)j;
            for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++) {
                const CtsRun *const run = &p->runs[r];
                for (uint32_t i = (run->first + SAMPLE_COLUMNS - 1) / SAMPLE_COLUMNS * SAMPLE_COLUMNS; i < run->end;
                     i += SAMPLE_COLUMNS)
                    if (in_view(p->dims, (int)i, j))
                        visit(context, a, run->part, (int)i, j, k);
            }
        }
}

/* Numbers of samples as dense as a lung, by part. */
typedef struct LungCount {
    double lung_hu;
    Sample *of_part;
    uint64_t n, n_lung; /* of all parts at the border, without padding */
} LungCount;

static void count_lung(void *context, const Air *a, uint32_t part, int i, int j, int k)
{
    LungCount *const c = context;
    if (!a->at_border[part])
        return;
    const double hu = cts_section_hu(a->plan, a->volume, i, j, k);
    const bool is_lung = hu > c->lung_hu;
    c->of_part[part].n++;
    c->of_part[part].n_lung += is_lung;
    c->n += hu > a->volume->hu_offset;
    c->n_lung += is_lung;
}

/* True for a voxel that is not padding, table or blanket. */
static bool is_air(const Air *a, int i, int j, int k)
{
    const double hu = cts_section_hu(a->plan, a->volume, i, j, k);
    return hu > a->volume->hu_offset && hu < CTS_DENSE_HU;
}

/* Histograms of sampled HU, for parts that reach the border and for others. */
typedef struct Levels {
    float *of[2];
    size_t n[2];
} Levels;

static void count_sample(void *context, const Air *a, uint32_t part, int i, int j, int k)
{
    Levels *const l = context;
    l->n[a->at_border[part]] += is_air(a, i, j, k);
}

/* The mean of the voxels around a sample that are no padding. */
static void add_sample(void *context, const Air *a, uint32_t part, int i, int j, int k)
{
    Levels *const l = context;
    const int *const dims = a->plan->dims;
    int half[2], n = 0;
    double sum = 0;
    if (!is_air(a, i, j, k))
        return;
    for (int c = 0; c < 2; c++)
        half[c] = (int)fmin(MEAN_MM / a->plan->spacing_mm[c], MEAN_MOST);
    for (int y = j - half[1]; y <= j + half[1]; y++)
        for (int x = i - half[0]; x <= i + half[0]; x++) {
            if (x < 0 || y < 0 || x >= dims[0] || y >= dims[1])
                continue;
            const double hu = cts_section_hu(a->plan, a->volume, x, y, k);
            sum += hu > a->volume->hu_offset ? hu : 0;
            n += hu > a->volume->hu_offset;
        }
    const bool at_border = a->at_border[part];
    l->of[at_border][l->n[at_border]++] = (float)(sum / n);
}

static int by_float(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* The middle of the darkest large peak of n sorted values, and its share of them; without a large peak, those of the
 * largest one. */
static double darkest_peak(const float *hu, size_t n, double *share)
{
    size_t most = 0, peak_first = 0;
    for (size_t first = 0, end = 0; first < n; first++) {
        if ((double)most >= PEAK_SHARE * (double)n && hu[first] > hu[peak_first] + (float)AIR_TO_LUNG_HU)
            break;
        while (end < n && hu[end] <= hu[first] + (float)AIR_TO_LUNG_HU)
            end++;
        if (end - first > most) {
            most = end - first;
            peak_first = first;
        }
    }
    *share = n ? (double)most / (double)n : 0;
    return n ? hu[peak_first + most / 2] : 0;
}

/* For volumes where most of the air at the border is denser than LUNG_HU: either room air of a scanner not calibrated
 * to -1000 HU, such as a cone beam's, or lungs cut by the field of view. If a table stands in it, it is room air.
 * Otherwise room air is recognised by one sharp level that is also the darkest. */
static CtsStatus find_level(const Air *a, bool has_table, CtsAirLevel *level, CtsError *err)
{
    Levels l = {0};
    CtsStatus st = CTS_OK;
    visit_samples(a, count_sample, &l);
    for (int b = 0; !st && b < 2; b++) {
        st = cts_alloc_array(&l.of[b], l.n[b], err);
        l.n[b] = 0;
    }
    if (!st) {
        double share;
        size_t n_darker = 0;
        visit_samples(a, add_sample, &l);
        qsort(l.of[1], l.n[1], sizeof *l.of[1], by_float);
        const double air_hu = darkest_peak(l.of[1], l.n[1], &share);
        for (size_t i = 0; i < l.n[0]; i++)
            n_darker += l.of[0][i] < air_hu - AIR_TO_LUNG_HU;
        const bool is_darkest = (double)n_darker <= DARKER_SHARE * (double)(l.n[0] + l.n[1]);
        if (has_table ? share >= PEAK_SHARE : share >= SHARP_SHARE && is_darkest)
            level->lung_hu = fmax(LUNG_HU, air_hu + AIR_TO_LUNG_HU);
        else
            level->is_unknown = has_table;
    }
    cts_free(&l.of[0]);
    cts_free(&l.of[1]);
    return st;
}

CtsStatus cts_air_outside(const CtsSectionPlan *plan, const CtsVolume *v, const CtsComponents *parts, bool has_table,
                          CtsAirLevel *level, uint8_t *outside, CtsError *err)
{
    const Air a = {plan, v, parts, outside};
    const bool is_known = level->lung_hu < 0;
    LungCount count = {.lung_hu = is_known ? level->lung_hu : LUNG_HU};
    CtsStatus st = cts_alloc_zeroed(&count.of_part, parts->n_parts, err);
    if (st)
        return st;
    for (uint32_t n = 0; n < parts->n_parts; n++)
        outside[n] = cts_component_at_border(parts, n, 2);
    visit_samples(&a, count_lung, &count);
    if (!is_known) {
        level->lung_hu = LUNG_HU;
        if (2 * count.n_lung > count.n)
            st = find_level(&a, has_table, level, err);
        if (!st && level->lung_hu > LUNG_HU) {
            for (uint32_t n = 0; n < parts->n_parts; n++)
                count.of_part[n] = (Sample){0};
            count.lung_hu = level->lung_hu;
            visit_samples(&a, count_lung, &count);
        }
    }
    for (uint32_t n = 0; n < parts->n_parts; n++)
        if (2 * count.of_part[n].n_lung > count.of_part[n].n)
            outside[n] = 0;
    cts_free(&count.of_part);
    return st;
}
