/* The key: from which tissue a grey level probably is, to whether a preset needs it. */
#include "ctsplat/mixture.h"

#include "base/mem.h"
#include "base/text.h"
#include <math.h>
#include <string.h>

enum { N_GREY = 65536 };

static const double MIN_PROBABILITY = 0.5, STEP = 0.01;
static const double LARGEST_LOSS = 1e-3;

/* Grey levels with their HU, how probably each is void, and how opaque the preset makes it. */
typedef struct KeyLevels {
    const uint64_t *count;
    double hu_offset, hu_step;
    double *probability, *opacity;
    double opacity_sum; /* over all voxels */
} KeyLevels;

static double hu_of_level(const KeyLevels *levels, int g)
{
    return levels->hu_offset + levels->hu_step * g;
}

/* True if the preset shows a tissue: only HU within a standard deviation of its mean count, as the tails of its
 * distribution are noise and partial volume. */
static bool shows_tissue(const KeyLevels *levels, const CtsTissue *t)
{
    const double low = (t->mean_hu - t->sd_hu - levels->hu_offset) / levels->hu_step;
    const double high = (t->mean_hu + t->sd_hu - levels->hu_offset) / levels->hu_step;
    const int first = (int)fmin(fmax(ceil(low), 0), N_GREY - 1), last = (int)fmin(fmax(floor(high), first), N_GREY - 1);
    for (int g = first; g <= last; g++)
        if (levels->opacity[g] > 0)
            return true;
    return false;
}

/* The share of all opacity that belongs to visible tissue, and is expected to be skipped with this key. */
static double loss(const KeyLevels *levels, double probability)
{
    double lost = 0;
    for (int g = 0; g < N_GREY; g++)
        if (levels->probability[g] >= probability)
            lost += (double)levels->count[g] * levels->opacity[g] * (1 - levels->probability[g]);
    return levels->opacity_sum > 0 ? lost / levels->opacity_sum : 0;
}

static double least_probability(const KeyLevels *levels)
{
    const int n_steps = (int)floor((1 - MIN_PROBABILITY) / STEP + 0.5);
    for (int i = 0; i < n_steps; i++)
        if (loss(levels, MIN_PROBABILITY + STEP * i) <= LARGEST_LOSS)
            return MIN_PROBABILITY + STEP * i;
    return 1;
}

static void find_key_ranges(const KeyLevels *levels, CtsVoidKey *key)
{
    bool drops = false;
    for (int g = 0; g < N_GREY; g++) {
        const bool drops_this = levels->probability[g] >= key->probability;
        if (drops_this == drops)
            continue;
        if (drops_this && key->n_ranges == CTS_MAX_KEY_RANGES)
            return;
        if (drops_this)
            key->range[key->n_ranges++] = (CtsKeyRange){g > 0 ? hu_of_level(levels, g) : -INFINITY, INFINITY};
        else
            key->range[key->n_ranges - 1].below_hu = hu_of_level(levels, g);
        drops = drops_this;
    }
}

static void count_loss(const KeyLevels *levels, CtsVoidKey *key)
{
    double dropped = 0;
    for (int g = 0; g < N_GREY; g++) {
        key->total += levels->count[g];
        if (!(levels->opacity[g] > 0))
            continue;
        key->visible += levels->count[g];
        if (!cts_void_key_drops(key, hu_of_level(levels, g)))
            continue;
        key->dropped += levels->count[g];
        dropped += levels->opacity[g] * (double)levels->count[g];
    }
    key->opacity_dropped = levels->opacity_sum > 0 ? dropped / levels->opacity_sum : 0;
}

CtsStatus cts_void_key_propose(const CtsMixture *mixture, const CtsPreset *preset, const uint64_t *count,
                               double hu_offset, double hu_step, CtsVoidKey *key, CtsError *err)
{
    KeyLevels levels = {.count = count, .hu_offset = hu_offset, .hu_step = hu_step};
    int n_void = 0;
    CtsStatus st;
    *key = (CtsVoidKey){.useful = false};
    if ((st = cts_alloc_array(&levels.probability, N_GREY, err)) ||
        (st = cts_alloc_array(&levels.opacity, N_GREY, err)))
        goto end;
    for (int g = 0; g < N_GREY; g++) {
        levels.opacity[g] = cts_preset_opacity(preset, hu_of_level(&levels, g));
        levels.opacity_sum += levels.opacity[g] * (double)count[g];
    }
    for (int i = 0; i < mixture->n; i++) {
        key->is_void[i] = !shows_tissue(&levels, &mixture->tissue[i]);
        n_void += key->is_void[i];
    }
    key->useful = n_void > 0 && n_void < mixture->n;
    if (key->useful) {
        for (int g = 0; g < N_GREY; g++)
            levels.probability[g] = cts_mixture_void(mixture, key->is_void, hu_of_level(&levels, g));
        key->probability = least_probability(&levels);
        find_key_ranges(&levels, key);
    }
    count_loss(&levels, key);
end:
    cts_free(&levels.probability);
    cts_free(&levels.opacity);
    return st;
}

bool cts_void_key_drops(const CtsVoidKey *key, double hu)
{
    for (int i = 0; i < key->n_ranges; i++)
        if (hu >= key->range[i].from_hu && hu < key->range[i].below_hu)
            return true;
    return false;
}

void cts_void_key_text(const CtsVoidKey *key, char text[CTS_KEY_TEXT])
{
    strcpy(text, key->n_ranges ? "" : "no HU");
    for (const CtsKeyRange *r = key->range; r < key->range + key->n_ranges; r++)
        if (isinf(r->from_hu) && isinf(r->below_hu))
            cts_text_append(text, CTS_KEY_TEXT, ", ", "all HU");
        else if (isinf(r->from_hu))
            cts_text_append(text, CTS_KEY_TEXT, ", ", "below %g HU", r->below_hu);
        else if (isinf(r->below_hu))
            cts_text_append(text, CTS_KEY_TEXT, ", ", "from %g HU on", r->from_hu);
        else
            cts_text_append(text, CTS_KEY_TEXT, ", ", "%g to %g HU", r->from_hu, r->below_hu);
}
