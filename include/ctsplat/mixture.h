/* Tissue classes of a histogram, and grey levels that probably belong to tissue without visibility in a preset. */
#pragma once

#include "ctsplat/preset.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stdint.h>

CTS_API_BEGIN

enum { CTS_MAX_TISSUES = 7, CTS_MAX_KEY_RANGES = 16 };

/* Pure tissue has HU of a normal distribution. A voxel on the border to the next tissue mixes the two: any share is
 * as likely as any other, and the narrower of the two distributions is the noise on top. */
typedef struct CtsTissue {
    const char *name;      /* static text: air, lung, fat, soft, spongy bone, compact bone, enamel or metal */
    double weight;         /* share of all voxels, 0..1 */
    double mean_hu, sd_hu; /* sd at least 1 HU and one grey level */
    double mixed_weight;   /* share of all voxels that mix this tissue with the next one; 0 for the last */
} CtsTissue;

/* Plain data. Tissues in order of their means; weights and mixed weights add up to 1. */
typedef struct CtsMixture {
    int n;
    CtsTissue tissue[CTS_MAX_TISSUES];
    uint64_t n_voxels;
    int n_levels; /* grey levels that occur, 0 left out */
    bool converged;
} CtsMixture;

/* Expectation maximisation from fixed initial values at the usual HU of each tissue, whose mean stays within its range.
 * count: voxels by grey level, 65536 of them; HU = hu_offset + hu_step * grey. Grey 0 is air or padding: it counts as
 * air, but does not contribute to the air's mean. Tissues of less than a millionth of the voxels are dropped. Sums have
 * a fixed order, so equal counts give the same mixture to the bit. CTS_ERR_USAGE when there are no voxels. */
CtsStatus cts_mixture_fit(const uint64_t *count, double hu_offset, double hu_step, CtsMixture *mixture, CtsError *err);

/* True if blood contains contrast agent: the voxels as dense as spongy bone or enhanced blood are more than a tenth of
 * those of soft tissue. A few vessels in much soft tissue are not detected. */
bool cts_mixture_has_contrast(const CtsMixture *mixture);

/* The probability that a voxel of this HU is void tissue, as marked in is_void. Between two means a voxel is of one of
 * the two tissues or mixes them, and mixed voxels contribute by their shares; beyond the first and the last mean it is
 * constant. */
double cts_mixture_void(const CtsMixture *mixture, const bool is_void[CTS_MAX_TISSUES], double hu);

/* HU from from_hu up to, not including, below_hu. Ranges that begin or end with the grey levels are open there:
 * -INFINITY, INFINITY. */
typedef struct CtsKeyRange {
    double from_hu, below_hu;
} CtsKeyRange;

/* The HU that count as void for a preset, and the resulting loss. Plain data. */
typedef struct CtsVoidKey {
    bool useful;                   /* false: every tissue is visible, or none; nothing is dropped then */
    bool is_void[CTS_MAX_TISSUES]; /* the preset has no opacity within a standard deviation of the tissue's mean */
    double probability;            /* the key: levels that are void with this probability or more are skipped */
    int n_ranges;
    CtsKeyRange range[CTS_MAX_KEY_RANGES]; /* the corresponding HU */
    uint64_t total, visible, dropped;      /* voxels: all, of opacity above 0, and those of them that count as void */
    double opacity_dropped;                /* share of the summed opacity of all voxels */
} CtsVoidKey;

/* The key that a mixture proposes for a preset: the least probability from 0.5 to 1, in steps of 0.01, at which the
 * expected loss is at most a thousandth of the opacity of visible tissue. count, hu_offset and hu_step as for the
 * mixture. */
CtsStatus cts_void_key_propose(const CtsMixture *mixture, const CtsPreset *preset, const uint64_t *count,
                               double hu_offset, double hu_step, CtsVoidKey *key, CtsError *err);
bool cts_void_key_drops(const CtsVoidKey *key, double hu);

/* The ranges in words, as "below 187 HU". */
enum { CTS_KEY_TEXT = 160 };
void cts_void_key_text(const CtsVoidKey *key, char text[CTS_KEY_TEXT]);

CTS_API_END
