#include "engine/tiled/slab.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <string.h>

enum { MAX_PER_GREY = 32, TARGET_ENTRIES = 8192 /* what a second-level cache holds beside the volume's rows */ };

typedef struct Steps {
    const CtsPreset *preset;
    double extinction_scale, low_hu, width_hu;
    const double *knots; /* HU at which the preset's lines meet, rising */
    int n_knots;
    double (*integral)[4], (*change)[2];
    float (*here)[4]; /* the table's */
} Steps;

static double extinction_at(const Steps *s, double hu)
{
    return cts_preset_extinction_per_mm(s->preset, hu) * s->extinction_scale;
}

/* From a to b, between which no knot lies: Gauss-Legendre with 3 points. The ends are taken a hair inside, where a jump
 * at them does not count. */
static void add_smooth(const Steps *s, double a, double b, double integral[4], double change[2])
{
    static const double node[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
    static const double weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double rgb[3], first[3], last[3];
    for (int i = 0; i < 3; i++) {
        const double at = a + node[i] * (b - a), t = weight[i] * (b - a) / s->width_hu * extinction_at(s, at);
        cts_preset_colour(s->preset, at, rgb);
        for (int c = 0; c < 3; c++)
            integral[c] += t * rgb[c];
        integral[3] += t;
    }
    const double hair = 1e-6 * (b - a), in = extinction_at(s, a + hair), out = extinction_at(s, b - hair);
    change[0] += fabs(out - in);
    if (in <= 0 && out <= 0)
        return;
    cts_preset_colour(s->preset, a + hair, first);
    cts_preset_colour(s->preset, b - hair, last);
    double most = 0;
    for (int c = 0; c < 3; c++)
        most = fmax(most, fabs(last[c] - first[c]));
    change[1] += most;
}

/* What happens at a knot itself. */
static void add_jump(const Steps *s, double at, double change[2])
{
    const double before = nextafter(at, -INFINITY);
    double first[3], last[3], most = 0;
    change[0] += fabs(extinction_at(s, at) - extinction_at(s, before));
    cts_preset_colour(s->preset, before, first);
    cts_preset_colour(s->preset, at, last);
    for (int c = 0; c < 3; c++)
        most = fmax(most, fabs(last[c] - first[c]));
    change[1] += most;
}

static void take_steps(void *context, int worker, size_t first, size_t end)
{
    const Steps *const s = context;
    int k = 0;
    (void)worker;
    for (size_t i = first; i < end; i++) {
        const double low = s->low_hu + (double)i * s->width_hu, high = low + s->width_hu, t = extinction_at(s, low);
        double from = low, rgb[3];
        cts_preset_colour(s->preset, low, rgb);
        for (int c = 0; c < 4; c++)
            s->here[i][c] = (float)(c < 3 ? t * rgb[c] : t);
        while (k < s->n_knots && s->knots[k] < low)
            k++;
        for (; k < s->n_knots && s->knots[k] < high; k++) {
            if (s->knots[k] > from)
                add_smooth(s, from, s->knots[k], s->integral[i], s->change[i]);
            add_jump(s, s->knots[k], s->change[i]);
            from = s->knots[k];
        }
        add_smooth(s, from, high, s->integral[i], s->change[i]);
    }
}

static int find_knots(const CtsPreset *p, double *knots)
{
    int n = 0;
    for (int i = 0; i < p->n_opacity; i++)
        knots[n++] = p->opacity[i].hu;
    for (int i = 0; i < p->n_colour; i++)
        knots[n++] = p->colour[i].hu;
    for (int i = 1; i < n; i++)
        for (int k = i; k > 0 && knots[k] < knots[k - 1]; k--) {
            const double swap = knots[k];
            knots[k] = knots[k - 1];
            knots[k - 1] = swap;
        }
    int kept = 0;
    for (int i = 0; i < n; i++)
        if (kept == 0 || knots[i] > knots[kept - 1])
            knots[kept++] = knots[i];
    return kept;
}

static void find_colours(CtsSlabTable *table)
{
    float low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    bool any = false;
    for (int i = 0; i < table->n; i++) {
        const float *step = table->here[i];
        for (int c = 0; c < 3 && step[3] > 0; c++) {
            const float shown = step[c] / step[3];
            if (!any)
                table->first_rgb[c] = shown;
            low[c] = shown < low[c] ? shown : low[c];
            high[c] = shown > high[c] ? shown : high[c];
        }
        any = any || step[3] > 0;
    }
    for (int c = 0; c < 3; c++)
        table->colour_range = fmaxf(table->colour_range, high[c] - low[c]);
}

static void sum_up(CtsSlabTable *table, double (*integral)[4], double (*change)[2])
{
    const int n = table->n;
    double sum[4] = {0, 0, 0, 0}, changed[2] = {0, 0};
    for (int i = 0; i <= n; i++) {
        memcpy(table->sum[i], sum, sizeof sum);
        for (int c = 0; c < 2; c++)
            table->change[i][c] = (float)changed[c];
        for (int c = 0; c < 4 && i < n; c++)
            sum[c] += integral[i][c];
        for (int c = 0; c < 2 && i < n; c++) {
            changed[c] += change[i][c];
            table->steepest[c] = fmaxf(table->steepest[c], (float)change[i][c] * table->per_grey);
        }
    }
}

CtsStatus cts_slab_table_init(CtsSlabTable *table, const CtsScene *scene, CtsRange range, CtsError *err)
{
    CtsStatus st;
    double knots[2 * CTS_MAX_POINTS], (*integral)[4] = NULL, (*change)[2] = NULL;
    int low, high;
    cts_lut_visible_levels(scene->lut, &low, &high);
    *table = (CtsSlabTable){0};
    table->quiet_low = (float)(low > 0 ? low : -1);
    table->quiet_high = high < CTS_N_GREY - 1 ? (float)high : INFINITY;
    low = low > range.low ? low : range.low;
    high = high < range.high ? high : range.high;
    if (high <= low)
        high = low + 1;
    int per_grey = MAX_PER_GREY;
    while (per_grey > 1 && (high - low) * per_grey > TARGET_ENTRIES)
        per_grey /= 2;
    table->n = (high - low) * per_grey + 1;
    table->grey_low = (float)low;
    table->per_grey = (float)per_grey;
    if ((st = cts_alloc_array(&table->sum, (size_t)table->n + 1, err)) ||
        (st = cts_alloc_zeroed(&table->here, (size_t)table->n + 1, err)) ||
        (st = cts_alloc_array(&table->change, (size_t)table->n + 1, err)) ||
        (st = cts_alloc_zeroed(&integral, (size_t)table->n, err)) ||
        (st = cts_alloc_zeroed(&change, (size_t)table->n, err)))
        goto end;
    Steps steps = {.preset = scene->preset,
                   .extinction_scale = scene->extinction_scale,
                   .low_hu = scene->volume->hu_offset + scene->volume->hu_step * low,
                   .width_hu = scene->volume->hu_step / per_grey,
                   .knots = knots,
                   .n_knots = find_knots(scene->preset, knots),
                   .integral = integral,
                   .here = table->here,
                   .change = change};
    cts_parallel(scene->settings->n_threads, (size_t)table->n, 0, take_steps, &steps);
    memcpy(table->here[table->n], table->here[table->n - 1], sizeof *table->here);
    sum_up(table, integral, change);
    find_colours(table);
end:
    cts_free(&integral);
    cts_free(&change);
    if (st)
        cts_slab_table_free(table);
    return st;
}

void cts_slab_table_free(CtsSlabTable *table)
{
    cts_free(&table->sum);
    cts_free(&table->here);
    cts_free(&table->change);
}
