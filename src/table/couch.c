#include "ctsplat/couch.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/vec3.h"
#include "table/couch_body.h"
#include "table/couch_rim.h"
#include "volume/crop.h"
#include <math.h>
#include <string.h>

/* Below fat and skin, above foam, paper and most cloth. */
static const double BODY_HU = -350;
/* Less than this outside the body is noise. */
static const double NOTHING_MM3 = 30;
/* One run for so many voxels is noise, not anatomy; it bounds the memory. */
enum { VOXELS_PER_RUN = 32, RUNS_ANYWAY = 1 << 16 };

static const char *const WHAT = "table removal";

/* The state of one removal. */
typedef struct Couch {
    CouchScene scene;
    CouchGrid grid; /* the whole volume */
    CouchBody body;
    CtsBits cells, inside; /* cells that hold body; those and what they enclose */
    bool has_outside;
    CtsReport *report;
} Couch;

static void couch_free(Couch *c)
{
    couch_body_free(&c->body);
    cts_bits_free(&c->cells);
    cts_bits_free(&c->inside);
}

static bool scene_init(CouchScene *scene, const CtsVolume *volume, int n_threads)
{
    double inverse[3][3], area[3], best = -1;
    if (!cts_volume_inverse(volume, inverse))
        return false;
    *scene = (CouchScene){.volume = volume, .n_threads = cts_threads(n_threads)};
    for (int axis = 0; axis < 3; axis++) {
        scene->spacing_mm[axis] = cts_volume_spacing_mm(volume, axis);
        const double along_z = fabs(volume->step_lps[axis][2]) / scene->spacing_mm[axis];
        if (along_z > best) {
            best = along_z;
            scene->head_axis = axis;
        }
    }
    cts_cross3(volume->step_lps[0], volume->step_lps[1], area);
    scene->voxel_mm3 = fabs(cts_dot3(area, volume->step_lps[2]));
    return true;
}

static uint16_t threshold_grey(const CtsVolume *v)
{
    const double grey = ceil((BODY_HU - v->hu_offset) / v->hu_step);
    return (uint16_t)fmin(fmax(grey, 1), UINT16_MAX);
}

/* False, with the reason in the report, when the mask is nothing to work on. */
static bool mask_is_usable(Couch *c)
{
    const uint64_t n_runs = c->body.parts.n_runs;
    const uint64_t most = cts_volume_n_voxels(c->scene.volume) / VOXELS_PER_RUN + RUNS_ANYWAY;
    if (!n_runs)
        cts_report_skip(c->report, WHAT, "no voxel lies above %g HU", BODY_HU);
    else if (n_runs > most)
        cts_report_skip(c->report, WHAT, "too noisy to tell a body from a table: %llu runs of voxels above %g HU",
                        (unsigned long long)n_runs, BODY_HU);
    return n_runs && n_runs <= most;
}

/* Cells of the body and what it encloses, which becomes body too. */
static CtsStatus enclose(Couch *c, CtsError *err)
{
    CtsStatus st;
    CouchBody *b = &c->body;
    uint8_t *before = NULL;
    bool grew;
    if ((st = cts_alloc_array(&before, b->parts.n_parts, err)))
        return st;
    memcpy(before, b->verdict.body, b->parts.n_parts);
    if ((st = couch_body_cells(&c->scene, &c->grid, b, err)) || (st = cts_bits_copy(&c->cells, &b->any, err)) ||
        (st = couch_inside(&c->scene, &c->grid, &c->cells, &c->inside, &c->has_outside, err)) ||
        (st = couch_adopt(&c->scene, &c->grid, &b->parts, &c->cells, &c->inside, &b->verdict, &grew, err)))
        goto end;
    if (grew)
        st = couch_more_cells(&c->scene, &c->grid, &b->parts, b->verdict.body, before, &b->any, &b->solid, err);
end:
    cts_free(&before);
    return st;
}

/* What may be table, yet stays. */
static CtsStatus report_kept(Couch *c, CtsError *err)
{
    double slab_mm3;
    const CtsStatus st = couch_find_slab(&c->scene, &c->grid, &c->body, &slab_mm3, err);
    if (st)
        return st;
    const double body_mm3 = c->body.verdict.body_mm3, limit_mm3 = COUCH_UNCERTAIN_SHARE * body_mm3;
    const double thin_mm3 = fmax(c->body.attached_mm3, slab_mm3 > limit_mm3 ? slab_mm3 : 0);
    const double kept_mm3 = thin_mm3 + c->body.verdict.disputed_mm3;
    if (kept_mm3 > limit_mm3)
        cts_report_finding(c->report, "table_removal_uncertain", CTS_WARNING,
                           "%.1f cm3 (%.1f %% of the body) may be table or patient and stay in the picture (take them "
                           "out with --crop if they are table)",
                           kept_mm3 / 1000, 100 * kept_mm3 / body_mm3);
    else if (kept_mm3 > 0)
        cts_report_finding(c->report, "table_removal_partial", CTS_NOTE,
                           "%.1f cm3 (%.1f %% of the body) of thin parts hang on the body without a clean cut and stay",
                           kept_mm3 / 1000, 100 * kept_mm3 / body_mm3);
    return CTS_OK;
}

/* Everything above the threshold that is not body is foreign: the other parts, and the seam that no part has any more.
 * The mask is split between the two; whichever has few voxels is painted, and what it has leaves the mask. Only as far
 * as the rim around the wanted slices needs them, but all foreign ones are counted. */
typedef struct Split {
    CtsBits painted;
    uint8_t *flags; /* of the parts to paint */
    const CtsBits *body;
    const CtsBits *foreign;
} Split;

static CtsStatus split_new(Split *split, CouchBody *b, CtsError *err)
{
    CtsStatus st;
    *split = (Split){.body = b->is_cut ? &split->painted : &b->mask, .foreign = b->is_cut ? &b->mask : &split->painted};
    if ((st = cts_bits_new(&split->painted, b->mask.dims, err)) ||
        (st = cts_alloc_array(&split->flags, b->parts.n_parts, err)))
        return st;
    for (uint32_t n = 0; n < b->parts.n_parts; n++)
        split->flags[n] = b->is_cut ? b->verdict.body[n] : !b->verdict.body[n];
    return CTS_OK;
}

static void split_free(Split *split)
{
    cts_bits_free(&split->painted);
    cts_free(&split->flags);
}

static uint64_t tell_foreign(Couch *c, Split *split)
{
    CtsBits *const mask = &c->body.mask;
    const CtsParts *parts = &c->body.parts;
    const int first = couch_rim_first(&c->scene), end = couch_rim_end(&c->scene);
    uint64_t n_foreign = 0;
#pragma omp parallel for schedule(static) num_threads(c->scene.n_threads) reduction(+ : n_foreign)
    for (int k = 0; k < mask->dims[2]; k++) {
        const uint64_t n_painted = cts_parts_count_slice(parts, split->flags, k);
        n_foreign += c->body.is_cut ? cts_bits_count_slice(mask, k) - n_painted : n_painted;
        if (k < first || k >= end)
            continue;
        cts_parts_paint_slice(parts, split->flags, &split->painted, k);
        cts_bits_take_slice(mask, &split->painted, k);
    }
    return n_foreign;
}

static CtsStatus clear(Couch *c, CtsVolume *volume, CtsError *err)
{
    CtsStatus st;
    Split split;
    const uint64_t slice = (uint64_t)volume->dims[0] * (uint64_t)volume->dims[1];
    const uint64_t n_seen = slice * (uint64_t)(c->scene.end_slice - c->scene.first_slice);
    uint64_t n_cleared;
    if ((st = split_new(&split, &c->body, err)))
        goto end;
    const uint64_t n_foreign = tell_foreign(c, &split);
    const double foreign_mm3 = (double)n_foreign * c->scene.voxel_mm3;
    if (foreign_mm3 < NOTHING_MM3) {
        cts_report_skip(c->report, WHAT, "nothing above %g HU lies outside the body", BODY_HU);
        goto end;
    }
    if ((st = couch_clear(&c->scene, volume, split.body, split.foreign, &c->grid, &c->cells, &c->inside, &n_cleared,
                          err)))
        goto end;
    cts_report_finding(
        c->report, "table_removed", CTS_NOTE,
        "table removal: %llu voxels above %g HU went (%.1f cm3, %.1f %% of the body), %.1f cm3 of them cut "
        "from the body; %llu of %llu voxels are air now",
        (unsigned long long)n_foreign, BODY_HU, foreign_mm3 / 1000, 100 * foreign_mm3 / c->body.verdict.body_mm3,
        c->body.cut_mm3 / 1000, (unsigned long long)n_cleared, (unsigned long long)n_seen);
end:
    split_free(&split);
    return st;
}

static CtsStatus remove_table(Couch *c, CtsVolume *volume, CtsError *err)
{
    CtsStatus st;
    if ((st = cts_bits_new(&c->body.mask, volume->dims, err)))
        return st;
    CtsParts *const parts = &c->body.parts;
    if ((st = cts_parts_begin(parts, volume->dims, err)))
        return st;
    cts_bits_threshold(&c->body.mask, volume->grey, volume->blocks, threshold_grey(volume), parts->row_start + 1,
                       c->scene.n_threads);
    cts_parts_counted(parts);
    if (!mask_is_usable(c))
        return st;
    if ((st = couch_body_find(&c->scene, &c->body, NULL, err)) ||
        (st = couch_separate(&c->scene, &c->grid, &c->body, err)) || (st = enclose(c, err)))
        return st;
    if (!c->has_outside) {
        cts_report_skip(c->report, WHAT, "the slices show no air around the body");
        return st;
    }
    if (!(st = report_kept(c, err)))
        st = clear(c, volume, err);
    return st;
}

static CtsStatus remove_in_slices(CtsVolume *volume, int first, int end, int n_threads, CtsReport *report,
                                  CtsError *err)
{
    Couch c = {.report = report};
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    if (!scene_init(&c.scene, volume, n_threads)) {
        cts_report_skip(report, WHAT, "the voxel steps do not span space");
        return CTS_OK;
    }
    c.scene.first_slice = first;
    c.scene.end_slice = end;
    c.grid = couch_grid_whole(&c.scene);
    const CtsStatus st = remove_table(&c, volume, err);
    couch_free(&c);
    const uint64_t n = cts_volume_n_voxels(volume);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, n,
                     n * sizeof *volume->grey);
    return st;
}

CtsStatus cts_volume_remove_table(CtsVolume *volume, int n_threads, CtsReport *report, CtsError *err)
{
    return remove_in_slices(volume, 0, volume->dims[2], n_threads, report, err);
}

CtsStatus cts_volume_remove_table_within(CtsVolume *volume, const double lo_lps[3], const double hi_lps[3],
                                         int n_threads, CtsReport *report, CtsError *err)
{
    int first, end;
    cts_crop_slices(volume, lo_lps, hi_lps, &first, &end);
    return remove_in_slices(volume, first, end, n_threads, report, err);
}
