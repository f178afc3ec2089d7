/* Expectation maximisation on the occupied bins of a histogram.
 *
 * A mixed voxel contains little information on its tissues, so means and deviations are estimated from pure voxels
 * alone; the mixed classes follow their neighbours and have weights of their own. */
#include "ctsplat/mixture.h"

#include "base/clamp.h"
#include "base/mem.h"
#include <math.h>
#include <string.h>

enum { N_GREY = 65536, MAX_ROUNDS = 200, DROP_EVERY = 8, MAX_PARTS = 2 * CTS_MAX_TISSUES };

static const double MIN_WEIGHT = 1e-6;
/* Per voxel, of the log likelihood from round to round: on bins of several HU, where most rounds are done, and then on
 * single grey levels. */
static const double CONVERGED_COARSE = 1e-6, CONVERGED = 1e-5;
static const double COARSE_HU = 8;
/* Further out than this many deviations a density counts as 0. */
static const double REACH = 9;

/* Initial means of tissues and their ranges: those of radiology's tables, with gaps so that no two means meet. Without
 * a peak of its own, the lung's range would be that of skin and airway walls, which mix with air. */
typedef struct Start {
    const char *name;
    double mean_hu, lowest_hu, highest_hu, sd_hu, largest_sd_hu;
    double weight; /* of the starting values: as of a share of all voxels */
    bool needs_peak;
} Start;

static const Start starts[CTS_MAX_TISSUES] = {
    {"air", -1000, -1024, -960, 15, 60, 0.004, false},
    {"lung", -800, -900, -600, 70, 150, 0.004, true},
    {"fat", -100, -140, -60, 20, 80, 0.004, false},
    {"soft", 40, -10, 120, 20, 100, 0.004, false},
    {"spongy bone", 300, 220, 450, 70, 120, 0.004, false},
    {"compact bone", 900, 600, 1300, 250, 350, 0.004, false},
    {"enamel or metal", 3000, 2000, INFINITY, 300, 20000, 1e-5, false},
};

typedef struct Bin {
    double hu, count;
} Bin;

typedef struct Fit {
    const Bin *bins;
    int n_bins;
    double n_voxels, n_clipped; /* all, and those of grey 0 */
    double least_sd_hu;
    CtsMixture *mixture;
    const Start *start[CTS_MAX_TISSUES]; /* of each tissue that is left */
} Fit;

/* Sums of one iteration: parts 2 i is pure tissue i, 2 i + 1 its mixture with the next. */
typedef struct Sums {
    double weight[MAX_PARTS];
    double first[CTS_MAX_TISSUES], second[CTS_MAX_TISSUES]; /* moments about the old mean */
    double log_likelihood;
} Sums;

static double normal_below(double z)
{
    return 0.5 * erfc(-z * M_SQRT1_2);
}

static double pure_density(const CtsTissue *t, double hu)
{
    const double z = (hu - t->mean_hu) / t->sd_hu;
    return fabs(z) > REACH ? 0 : exp(-0.5 * z * z) / (t->sd_hu * sqrt(2 * M_PI));
}

/* Density of voxels that mix two tissues a and b, every share of b from 0 to 1 equally likely, with noise on top. */
static double mixed_density(const CtsTissue *a, const CtsTissue *b, double hu)
{
    const double sd = fmin(a->sd_hu, b->sd_hu), from_a = (hu - a->mean_hu) / sd, from_b = (hu - b->mean_hu) / sd;
    if (from_a < -REACH || from_b > REACH)
        return 0;
    const double above_a = from_a > REACH ? 1 : normal_below(from_a);
    const double above_b = from_b < -REACH ? 0 : normal_below(from_b);
    return (above_a - above_b) / (b->mean_hu - a->mean_hu);
}

/* Weighted densities of all parts; returns their sum. Where all underflow, the nearest pure tissue gets everything, as
 * in the limit, and the sum is 0. */
static double densities(const CtsMixture *m, double hu, double part[MAX_PARTS])
{
    double sum = 0, nearest = INFINITY;
    int near = 0;
    for (int i = 0; i < m->n; i++) {
        const CtsTissue *t = &m->tissue[i];
        part[2 * i] = t->weight > 0 ? t->weight * pure_density(t, hu) : 0;
        part[2 * i + 1] = t->mixed_weight > 0 ? t->mixed_weight * mixed_density(t, t + 1, hu) : 0;
        sum += part[2 * i] + part[2 * i + 1];
        const double z = fabs(hu - t->mean_hu) / t->sd_hu;
        if (z < nearest) {
            nearest = z;
            near = i;
        }
    }
    if (!(sum > 0))
        part[2 * near] = 1;
    return sum;
}

static void expect(const Fit *f, Sums *s)
{
    const CtsMixture *m = f->mixture;
    double part[MAX_PARTS];
    *s = (Sums){.log_likelihood = 0};
    for (int b = 0; b < f->n_bins; b++) {
        const Bin *bin = &f->bins[b];
        const double sum = densities(m, bin->hu, part);
        const double scale = bin->count / (sum > 0 ? sum : 1);
        s->log_likelihood += bin->count * log(sum > 0 ? sum : 1e-40);
        for (int i = 0; i < 2 * m->n; i++)
            s->weight[i] += scale * part[i];
        for (int i = 0; i < m->n; i++) {
            const double pure = scale * part[2 * i], off = bin->hu - m->tissue[i].mean_hu;
            s->first[i] += pure * off;
            s->second[i] += pure * off * off;
        }
    }
}

static void maximise(const Fit *f, const Sums *s)
{
    for (int i = 0; i < f->mixture->n; i++) {
        CtsTissue *t = &f->mixture->tissue[i];
        const Start *start = f->start[i];
        const double n = s->weight[2 * i];
        const bool is_air = start == &starts[0];
        const double clipped = is_air ? f->n_clipped : 0;
        const double at_start = start->weight * (f->n_voxels - f->n_clipped) + clipped;
        const double to_start = start->mean_hu - t->mean_hu;
        const double mean_hu = cts_clamp(t->mean_hu + (s->first[i] + at_start * to_start) / (n + at_start),
                                         start->lowest_hu, start->highest_hu);
        const double moved = mean_hu - t->mean_hu;
        const double squares = s->second[i] - 2 * moved * s->first[i] + n * moved * moved;
        const double variance = (squares + at_start * start->sd_hu * start->sd_hu) / (n + at_start);
        t->mean_hu = mean_hu;
        t->sd_hu = cts_clamp(sqrt(fmax(variance, 0)), f->least_sd_hu, fmax(start->largest_sd_hu, f->least_sd_hu));
        t->weight = (n + clipped) / f->n_voxels;
        /* A weight of 0 would stay so, even when the neighbour is another later on. */
        t->mixed_weight = i < f->mixture->n - 1 ? fmax(s->weight[2 * i + 1] / f->n_voxels, MIN_WEIGHT) : 0;
    }
}

/* True for an absent tissue: its peak is no higher than the mixture of its two neighbours would be without it. */
static bool lacks_peak(const CtsMixture *m, int i)
{
    const CtsTissue *t = &m->tissue[i];
    double beside = 0;
    if (i > 0)
        beside += t[-1].mixed_weight / (t->mean_hu - t[-1].mean_hu);
    if (i < m->n - 1)
        beside += t->mixed_weight / (t[1].mean_hu - t->mean_hu);
    return t->weight * pure_density(t, t->mean_hu) < 0.5 * beside;
}

static void drop_component(Fit *f, int i)
{
    CtsMixture *m = f->mixture;
    CtsTissue *t = m->tissue;
    const double weight = t[i].weight + t[i].mixed_weight;
    const int after = m->n - 1 - i;
    memmove(t + i, t + i + 1, (size_t)after * sizeof *t);
    memmove(f->start + i, f->start + i + 1, (size_t)after * sizeof *f->start);
    m->n--;
    /* The voxels of a dropped tissue go to the mixture of its neighbours, or to the last tissue; the next iteration
     * redistributes them. */
    if (i == 0) {
        t[0].weight += weight;
    } else if (i < m->n) {
        t[i - 1].mixed_weight += weight;
    } else {
        t[i - 1].weight += t[i - 1].mixed_weight + weight;
        t[i - 1].mixed_weight = 0;
    }
}

static bool drop_any(Fit *f, bool peaks)
{
    CtsMixture *m = f->mixture;
    bool any = false;
    for (int i = m->n - 1; i >= 0 && m->n > 1; i--)
        if (m->tissue[i].weight < MIN_WEIGHT || (peaks && f->start[i]->needs_peak && lacks_peak(m, i))) {
            drop_component(f, i);
            any = true;
        }
    return any;
}

static void begin_fit(Fit *f)
{
    CtsMixture *m = f->mixture;
    m->n = CTS_MAX_TISSUES;
    for (int i = 0; i < m->n; i++) {
        f->start[i] = &starts[i];
        m->tissue[i] = (CtsTissue){.name = starts[i].name,
                                   .weight = 1.0 / CTS_MAX_TISSUES,
                                   .mean_hu = starts[i].mean_hu,
                                   .sd_hu = fmax(starts[i].sd_hu, f->least_sd_hu),
                                   .mixed_weight = i < m->n - 1 ? 0.3 / CTS_MAX_TISSUES : 0};
    }
}

static void iterate(Fit *f, double converged)
{
    CtsMixture *m = f->mixture;
    double before = -INFINITY;
    int n_still = 0;
    Sums sums;
    m->converged = false;
    for (int round = 1; round <= MAX_ROUNDS && !m->converged; round++) {
        expect(f, &sums);
        maximise(f, &sums);
        /* The prior of the initial values can keep the likelihood constant for an iteration, so convergence needs
         * three. */
        n_still = fabs(sums.log_likelihood - before) <= converged * f->n_voxels ? n_still + 1 : 0;
        const bool still = n_still == 3;
        before = sums.log_likelihood;
        if ((still || round % DROP_EVERY == 0) && drop_any(f, still))
            n_still = 0;
        else
            m->converged = still;
    }
}

/* Bins of a few HU, each at the mean of its grey levels. */
static void run_coarse(Fit *f, Bin *coarse)
{
    const Bin *bins = f->bins;
    const int n_bins = f->n_bins;
    int n = 0;
    for (int b = 0; b < n_bins; n++) {
        const double end_hu = bins[b].hu + COARSE_HU;
        Bin sum = {0, 0};
        for (; b < n_bins && bins[b].hu < end_hu; b++) {
            sum.count += bins[b].count;
            sum.hu += bins[b].count * bins[b].hu;
        }
        coarse[n] = (Bin){sum.hu / sum.count, sum.count};
    }
    f->bins = coarse;
    f->n_bins = n;
    iterate(f, CONVERGED_COARSE);
    f->bins = bins;
    f->n_bins = n_bins;
}

/* Scales the weights to a sum of 1, which truncated iterations and dropped tissues change. */
static void normalise(CtsMixture *m)
{
    double sum = 0;
    for (int i = 0; i < m->n; i++) {
        if (m->tissue[i].mixed_weight <= MIN_WEIGHT)
            m->tissue[i].mixed_weight = 0;
        sum += m->tissue[i].weight + m->tissue[i].mixed_weight;
    }
    for (int i = 0; i < m->n && sum > 0; i++) {
        m->tissue[i].weight /= sum;
        m->tissue[i].mixed_weight /= sum;
    }
}

CtsStatus cts_mixture_fit(const uint64_t *count, double hu_offset, double hu_step, CtsMixture *mixture, CtsError *err)
{
    Fit f = {.mixture = mixture, .least_sd_hu = fmax(1, hu_step)};
    CtsStatus st;
    *mixture = (CtsMixture){.n = 0};
    for (int g = 0; g < N_GREY; g++) {
        mixture->n_voxels += count[g];
        mixture->n_levels += g > 0 && count[g] > 0;
    }
    if (mixture->n_voxels == 0)
        return cts_fail(err, CTS_ERR_USAGE, "a histogram of no voxels");
    Bin *bins = NULL, *coarse = NULL;
    if ((st = cts_alloc_array(&bins, (size_t)mixture->n_levels, err)) ||
        (st = cts_alloc_array(&coarse, (size_t)mixture->n_levels, err)))
        goto end;
    for (int g = 1; g < N_GREY; g++)
        if (count[g] > 0)
            bins[f.n_bins++] = (Bin){hu_offset + hu_step * g, (double)count[g]};
    f.bins = bins;
    f.n_voxels = (double)mixture->n_voxels;
    f.n_clipped = (double)count[0];
    begin_fit(&f);
    run_coarse(&f, coarse);
    iterate(&f, CONVERGED);
    normalise(mixture);
end:
    cts_free(&bins);
    cts_free(&coarse);
    return st;
}

double cts_mixture_void(const CtsMixture *m, const bool is_void[CTS_MAX_TISSUES], double hu)
{
    if (m->n < 2)
        return m->n == 1 && is_void[0];
    const double at = cts_clamp(hu, m->tissue[0].mean_hu, m->tissue[m->n - 1].mean_hu);
    int i = 0;
    while (i < m->n - 2 && at >= m->tissue[i + 1].mean_hu)
        i++;
    /* Between the means of two neighbours it is one of them, or mixes them: the tail of a broad distribution from
     * further off is an artefact of its shape. */
    const CtsTissue *a = &m->tissue[i], *b = a + 1;
    const double share = (at - a->mean_hu) / (b->mean_hu - a->mean_hu);
    const double below = a->weight * pure_density(a, at), above = b->weight * pure_density(b, at);
    const double mixed = a->mixed_weight > 0 ? a->mixed_weight * mixed_density(a, b, at) : 0;
    const double sum = below + mixed + above;
    if (is_void[i] == is_void[i + 1])
        return is_void[i];
    /* If the densities of both tissues are 0, the position between their means decides. */
    const double of_a = sum > 0 ? (below + mixed * (1 - share)) / sum : 1 - share;
    return is_void[i] ? of_a : 1 - of_a;
}

static double weight_of(const CtsMixture *m, const char *name)
{
    for (int i = 0; i < m->n; i++)
        if (!strcmp(m->tissue[i].name, name))
            return m->tissue[i].weight;
    return 0;
}

/* Spongy bone alone is some 4 % of soft tissue, 7 % where thick slices mix compact bone into it; in an enhanced chest
 * it is 29 % with the blood. */
bool cts_mixture_has_contrast(const CtsMixture *m)
{
    return weight_of(m, "spongy bone") > 0.1 * weight_of(m, "soft");
}
