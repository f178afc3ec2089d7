#include "core/couch/table_removal.h"

#include "base/compare.h"
#include "base/mem.h"
#include "core/volume/linear_layers.h"
#include "core/volume/threshold.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

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

/* A sampled voxel. */
typedef struct Sample {
    uint32_t part;
    int at[3];
    double hu;
} Sample;

/* The air of all sections. */
typedef struct Air {
    const CtsTableSearch *table;
    const CtsComponents *parts;
    const uint8_t *at_border; /* of each part: it reaches the border of its section */
    Sample *samples;
    size_t n_samples;
} Air;

double cts_section_hu(const CtsTableSearch *r, int i, int j, int k)
{
    const CtsSectionPlan *const plan = &r->plan;
    const CtsVolume *const v = r->volume;
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

static CtsStatus list_samples(Air *a, CtsError *err)
{
    const CtsComponents *const p = a->parts;
    for (int k = 0; k < p->dims[2]; k++)
        for (int j = 0; j < p->dims[1]; j += SAMPLE_ROWS) {
            const size_t row = (size_t)k * (size_t)p->dims[1] + (size_t)j;
            for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++) {
                const CtsRun *const run = &p->runs[r];
                uint32_t i = (run->first + SAMPLE_COLUMNS - 1) / SAMPLE_COLUMNS * SAMPLE_COLUMNS;
                for (; i < run->end; i += SAMPLE_COLUMNS) {
                    if (!in_view(p->dims, (int)i, j))
                        continue;
                    if (cts_grow(&a->samples, a->n_samples, err))
                        return CTS_ERR_MEMORY;
                    a->samples[a->n_samples++] =
                        (Sample){run->part, {(int)i, j, k}, cts_section_hu(a->table, (int)i, j, k)};
                }
            }
        }
    return CTS_OK;
}

/* Of samples at the border those as dense as a lung less the others: by part, and in all, where padding does not count.
 */
static int64_t weigh_lungs(const Air *a, double lung_hu, int32_t *of_part)
{
    int64_t all = 0;
    memset(of_part, 0, a->parts->n_parts * sizeof *of_part);
    for (size_t i = 0; i < a->n_samples; i++) {
        const Sample *const s = &a->samples[i];
        if (!a->at_border[s->part])
            continue;
        const bool is_lung = s->hu > lung_hu;
        of_part[s->part] += is_lung ? 1 : -1;
        all += is_lung ? 1 : -(s->hu > a->table->volume->hu_offset);
    }
    return all;
}

/* The mean of the voxels around a sample that are no padding. */
static double mean_around(const Air *a, const Sample *s)
{
    const CtsSectionPlan *const plan = &a->table->plan;
    int half[2], n = 0;
    double sum = 0;
    for (int c = 0; c < 2; c++)
        half[c] = (int)fmin(MEAN_MM / plan->spacing_mm[c], MEAN_MOST);
    for (int y = s->at[1] - half[1]; y <= s->at[1] + half[1]; y++)
        for (int x = s->at[0] - half[0]; x <= s->at[0] + half[0]; x++) {
            if (x < 0 || y < 0 || x >= plan->dims[0] || y >= plan->dims[1])
                continue;
            const double hu = cts_section_hu(a->table, x, y, s->at[2]);
            sum += hu > a->table->volume->hu_offset ? hu : 0;
            n += hu > a->table->volume->hu_offset;
        }
    return sum / n;
}

/* The middle of the darkest large peak of n sorted values, and its share of them; without a large peak, those of the
 * largest one. */
static double darkest_peak(const double *hu, size_t n, double *share)
{
    size_t most = 0, peak_first = 0;
    for (size_t first = 0, end = 0; first < n; first++) {
        if ((double)most >= PEAK_SHARE * (double)n && hu[first] > hu[peak_first] + AIR_TO_LUNG_HU)
            break;
        while (end < n && hu[end] <= hu[first] + AIR_TO_LUNG_HU)
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
static CtsStatus find_level(const Air *a, bool has_table, CtsBody *body, CtsError *err)
{
    double *hu[2] = {NULL, NULL}; /* of parts inside, and of those at the border */
    size_t n[2] = {0, 0}, n_darker = 0;
    double share;
    CtsStatus st;
    if ((st = cts_alloc_array(&hu[0], a->n_samples, err)) || (st = cts_alloc_array(&hu[1], a->n_samples, err)))
        goto end;
    for (size_t i = 0; i < a->n_samples; i++) {
        const Sample *const s = &a->samples[i];
        if (s->hu > a->table->volume->hu_offset && s->hu < CTS_DENSE_HU) { /* no padding, table or blanket */
            const bool at_border = a->at_border[s->part];
            hu[at_border][n[at_border]++] = mean_around(a, s);
        }
    }
    qsort(hu[1], n[1], sizeof *hu[1], cts_compare_double);
    const double air_hu = darkest_peak(hu[1], n[1], &share);
    for (size_t i = 0; i < n[0]; i++)
        n_darker += hu[0][i] < air_hu - AIR_TO_LUNG_HU;
    const bool is_darkest = (double)n_darker <= DARKER_SHARE * (double)(n[0] + n[1]);
    if (has_table ? share >= PEAK_SHARE : share >= SHARP_SHARE && is_darkest)
        body->lung_hu = fmax(LUNG_HU, air_hu + AIR_TO_LUNG_HU);
    else
        body->air_is_unknown = has_table;
end:
    cts_free(&hu[0]);
    cts_free(&hu[1]);
    return st;
}

CtsStatus cts_air_outside(CtsTableSearch *r, const CtsComponents *air, bool has_table, uint8_t *outside, CtsError *err)
{
    Air a = {.table = r, .parts = air, .at_border = outside};
    int32_t *of_part = NULL;
    CtsStatus st;
    for (uint32_t n = 0; n < air->n_parts; n++)
        outside[n] = cts_component_at_border(air, n, 2);
    if (r->volume->quantity != CTS_QUANTITY_HU)
        return CTS_OK;
    if ((st = cts_alloc_array(&of_part, air->n_parts, err)) || (st = list_samples(&a, err)))
        goto end;
    const bool is_known = r->body.lung_hu < 0;
    r->body.lung_hu = is_known ? r->body.lung_hu : LUNG_HU;
    if (weigh_lungs(&a, r->body.lung_hu, of_part) > 0 && !is_known && !(st = find_level(&a, has_table, &r->body, err)))
        weigh_lungs(&a, r->body.lung_hu, of_part);
    for (uint32_t n = 0; n < air->n_parts; n++)
        outside[n] &= of_part[n] <= 0;
end:
    cts_free(&of_part);
    free(a.samples);
    return st;
}
