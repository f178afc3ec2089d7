#include "tiled/slab.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

enum { MAX_PER_GREY = 32, TARGET_ENTRIES = 8192 /* about what a first-level cache holds */ };

/* Integrals over one step of the table, from hu to hu + width: Gauss-Legendre with 3 points, exact enough between
 * knots; a knot inside a step costs no more than the step's own width. */
static void step_integral(const CtsPreset *preset, double extinction_scale, double hu, double width, double out[4])
{
    static const double node[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
    static const double weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    out[0] = out[1] = out[2] = out[3] = 0;
    for (int i = 0; i < 3; i++) {
        double rgb[3];
        const double at = hu + node[i] * width;
        const double t = weight[i] * cts_preset_extinction_per_mm(preset, at) * extinction_scale;
        cts_preset_colour(preset, at, rgb);
        for (int c = 0; c < 3; c++)
            out[c] += t * rgb[c];
        out[3] += t;
    }
}

typedef struct Steps {
    const CtsScene *scene;
    double low_hu, width_hu;
    double (*integral)[4];
} Steps;

static void integrate_steps(void *context, int worker, size_t first, size_t end)
{
    const Steps *const s = context;
    (void)worker;
    for (size_t i = first; i < end; i++)
        step_integral(s->scene->preset, s->scene->extinction_scale, s->low_hu + (int)i * s->width_hu, s->width_hu,
                      s->integral[i]);
}

CtsStatus cts_slab_table_init(CtsSlabTable *table, const CtsScene *scene, CtsRange range, CtsError *err)
{
    const CtsLut *lut = scene->lut;
    CtsStatus st;
    double(*step)[4] = NULL;
    int first = 0, last = CTS_N_GREY - 1;
    while (first < CTS_N_GREY - 1 && !cts_lut_visible(lut, (uint16_t)first, (uint16_t)first))
        first++;
    while (last > first && !cts_lut_visible(lut, (uint16_t)last, (uint16_t)last))
        last--;
    *table = (CtsSlabTable){0};
    /* The table starts where visibility may start between two levels, or where the data does, and ends alike. */
    int low = first > 0 ? first - 1 : 0, high = last < CTS_N_GREY - 1 ? last + 1 : last;
    if (low < range.low)
        low = range.low;
    if (high > range.high)
        high = range.high;
    if (high <= low)
        high = low + 1;
    int per_grey = MAX_PER_GREY;
    while (per_grey > 1 && (high - low) * per_grey > TARGET_ENTRIES)
        per_grey /= 2;
    table->n = (high - low) * per_grey + 1;
    table->grey_low = (float)low;
    table->per_grey = (float)per_grey;
    table->quiet_low = (float)(first > 0 ? first - 1 : -1);
    table->quiet_high = last < CTS_N_GREY - 1 ? (float)(last + 1) : INFINITY;
    if ((st = cts_alloc_array(&table->sum, (size_t)table->n + 1, err)) ||
        (st = cts_alloc_zeroed(&table->step, (size_t)table->n + 1, err)) ||
        (st = cts_alloc_array(&step, (size_t)table->n, err)))
        goto end;
    const double width_hu = scene->volume->hu_step / per_grey;
    Steps steps = {scene, scene->volume->hu_offset + scene->volume->hu_step * low, width_hu, step};
    cts_parallel(scene->settings->n_threads, (size_t)table->n, 0, integrate_steps, &steps);
    double total[4] = {0, 0, 0, 0};
    for (int i = 0; i < table->n; i++)
        for (int c = 0; c < 4; c++)
            total[c] += step[i][c];
    /* One scale for the colours and one for the depth; sums stay below 2^30 even with rounding. */
    const double most = fmax(total[0], fmax(total[1], total[2])), top = 1 << 30;
    const double colour_unit = most > 0 ? most / top : 1, depth_unit = total[3] > 0 ? total[3] / top : 1;
    double sum[4] = {0, 0, 0, 0};
    for (int i = 0; i <= table->n; i++) {
        for (int c = 0; c < 4; c++) {
            const double unit = c < 3 ? colour_unit : depth_unit;
            table->sum[i][c] = (int32_t)nearbyint(sum[c] / unit);
            if (i == table->n)
                continue;
            sum[c] += step[i][c];
            const float alone = (float)(step[i][c] / unit);
            memcpy(&table->step[i + 1][c], &alone, sizeof alone);
        }
    }
    table->depth_scale = (float)depth_unit;
    table->halving_scale = (float)(depth_unit / log(2));
    table->colour_per_depth = (float)(colour_unit / depth_unit);
end:
    cts_free(&step);
    if (st)
        cts_slab_table_free(table);
    return st;
}

void cts_slab_table_free(CtsSlabTable *table)
{
    cts_free(&table->sum);
    cts_free(&table->step);
}
