#include "ctsplat/table.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "base/parallel.h"
#include "core/couch/table_removal.h"
#include "core/volume/threshold.h"
#include <math.h>
#include <stdatomic.h>
#include <string.h>

/* Resolution along the scanner's axis that shows tables, which run along it; thinner slices are joined. */
static const double SECTION_MM = 3.5;
/* Width of the margin kept around the body. */
static const double MARGIN_MM = 3;
/* Less than this outside the body is noise. */
static const double NOTHING_MM3 = 30;
/* Thin parts beyond this share of the body cause a warning. */
static const double UNCERTAIN_SHARE = 0.05;
/* Shells of tables, mattresses and holders that are denser than air are thinner than 20 mm: thicker removed parts cause
 * a warning, as they may be a limb, unless they are below this share of the body. */
static const double NO_SHELL_RADIUS_MM = 10, LOST_SHARE = 0.001;
/* Runs of dense voxels in a row: a body has few. More than one for so many voxels is noise, and memory would grow. */
enum { VOXELS_PER_RUN = 32, RUNS_ANYWAY = 1 << 16 };

static const char *const WHAT = "table removal";

typedef struct Removal {
    CtsSectionPlan plan;
    int n_threads;
    CtsMorphology *workers; /* one for each thread */
    CtsBits dense;          /* of the volume's voxels */
    uint64_t n_runs;
    CtsBits sections; /* has the words of `dense` where a section is a slice */
    CtsPlates plates_found;
    CtsBody body;
    CtsBits gone; /* of the sections: voxels that become air; in find_gone_sections() first those that stay */
    uint64_t n_dense_gone;
} Removal;

static void removal_free(Removal *r)
{
    cts_morphologies_free(&r->workers, r->n_threads);
    if (r->sections.words != r->dense.words)
        cts_bits_free(&r->sections);
    cts_bits_free(&r->dense);
    cts_plates_free(&r->plates_found);
    cts_body_free(&r->body);
    cts_bits_free(&r->gone);
}

static CtsStatus find_dense_sections(Removal *r, const CtsVolume *v, CtsError *err)
{
    const CtsStatus st = cts_bits_new(&r->dense, v->dims, err);
    if (!st)
        r->n_runs = cts_bits_threshold(&r->dense, v->grey, cts_dense_grey(v), r->n_threads);
    return st;
}

static CtsStatus find_sections(Removal *r, CtsError *err)
{
    if (r->plan.axis[2] != 2 || r->plan.n_slices > 1)
        return cts_sections_new(&r->plan, &r->dense, r->n_threads, &r->sections, err);
    r->sections = r->dense;
    return CTS_OK;
}

/* The extent of dense voxels along the volume's axes. */
static void find_dense_size(const Removal *r, const double spacing_mm[3], double size_mm[3])
{
    const int *const dims = r->dense.dims;
    int low[3] = {dims[0], dims[1], dims[2]}, high[3] = {-1, -1, -1};
    for (int k = 0; k < dims[2]; k++)
        for (int j = 0; j < dims[1]; j++) {
            const uint64_t *const row = cts_bits_row(&r->dense, j, k);
            for (int w = 0; w < (int)r->dense.row_words; w++) {
                if (!row[w])
                    continue;
                const int at[2][3] = {{64 * w + __builtin_ctzll(row[w]), j, k},
                                      {64 * w + 63 - __builtin_clzll(row[w]), j, k}};
                for (int a = 0; a < 3; a++) {
                    low[a] = at[0][a] < low[a] ? at[0][a] : low[a];
                    high[a] = at[1][a] > high[a] ? at[1][a] : high[a];
                }
            }
        }
    for (int a = 0; a < 3; a++)
        size_mm[a] = high[a] < low[a] ? 0 : (high[a] - low[a] + 1) * spacing_mm[a];
}

static bool is_specimen_volume(const Removal *r, const CtsVolume *v)
{
    double spacing_mm[3], size_mm[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++)
        spacing_mm[a] = cts_volume_spacing_mm(v, a);
    if (!cts_is_specimen(spacing_mm, size_mm)) /* by its voxels alone */
        return false;
    find_dense_size(r, spacing_mm, size_mm);
    return cts_is_specimen(spacing_mm, size_mm);
}

/* False, with the reason in the report, when there is nothing to work on. */
static bool is_usable(const Removal *r, const CtsVolume *v, CtsReport *report)
{
    if (!r->n_runs) {
        cts_report_skip(report, WHAT, "no voxel lies above %g HU", CTS_DENSE_HU);
        return false;
    }
    if (is_specimen_volume(r, v)) {
        cts_report_skip(report, WHAT,
                        "voxels and size are those of a specimen in a micro-CT, which no patient's table fits");
        return false;
    }
    if (r->n_runs <= cts_volume_n_voxels(v) / VOXELS_PER_RUN + RUNS_ANYWAY)
        return true;
    cts_report_skip(report, WHAT, "too noisy to distinguish a body from a table: %llu runs of voxels above %g HU",
                    (unsigned long long)r->n_runs, CTS_DENSE_HU);
    cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
                          "too noisy to distinguish a body from a table: nothing was removed (remove it by a crop)");
    return false;
}

/* Parameters of find_gone_sections(), and a section for each worker. */
typedef struct Leaving {
    Removal *removal;
    CtsReach margin;
    CtsBits near;
} Leaving;

/* Voxels beyond the margin of the body become air, and in the margin the soft edges of removed parts, except for the
 * voxels next to the body. The body of a section is that of its neighbours, too. */
static void find_gone_sections(void *context, int worker, size_t first, size_t end)
{
    const Leaving *const l = context;
    Removal *const r = l->removal;
    const CtsReach one = {.diamond = 1}, two = {.diamond = 1, .box = {1, 1}};
    const CtsBits *const whole = &r->body.whole;
    CtsBits near = cts_bits_slice(&l->near, worker);
    CtsMorphology *const m = &r->workers[worker];
    for (int k = (int)first; k < (int)end; k++) {
        CtsBits gone = cts_bits_slice(&r->gone, k), foreign = cts_bits_slice(&r->body.foreign, k);
        for (int from = k > 0 ? k - 1 : k; from <= k + 1 && from < whole->dims[2]; from++) {
            const CtsBits beside = cts_bits_slice(whole, from);
            cts_bits_combine(&gone, CTS_BITS_OR, &beside);
        }
        cts_dilate_section(m, gone.words, l->margin, gone.words);
        cts_bits_combine(&gone, CTS_BITS_NOT, &gone);
        if (!cts_bits_any(&foreign))
            continue;
        cts_bits_combine(&gone, CTS_BITS_OR, &foreign);
        cts_dilate_section(m, cts_bits_row(whole, 0, k), one, near.words);
        cts_dilate_section(m, foreign.words, two, foreign.words);
        cts_bits_combine(&foreign, CTS_BITS_AND_NOT, &near);
        cts_bits_combine(&gone, CTS_BITS_OR, &foreign);
    }
}

/* Finds r->gone; r->body.foreign is dilated. */
static CtsStatus find_gone(Removal *r, CtsError *err)
{
    CtsStatus st;
    Leaving l = {.removal = r, .margin = cts_reach_mm(MARGIN_MM, r->plan.spacing_mm)};
    for (int n = 0; n < 2; n++)
        l.margin.box[n] = l.margin.diamond + l.margin.box[n] < 2 ? 2 - l.margin.diamond : l.margin.box[n];
    if (!(st = cts_bits_new(&r->gone, r->plan.dims, err)) &&
        !(st = cts_bits_new_unset(&l.near, (const int[]){r->plan.dims[0], r->plan.dims[1], r->n_threads}, err)))
        cts_parallel(r->n_threads, (size_t)r->plan.dims[2], 1, find_gone_sections, &l);
    cts_bits_free(&l.near);
    return st;
}

/* Row (j, k) of the volume becomes air where it is gone; returns the number of its dense voxels. */
static uint64_t clear_row(const Removal *r, CtsVolume *v, int j, int k, const uint64_t *gone)
{
    uint16_t *grey = v->grey + ((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)v->dims[0];
    const uint64_t *dense = cts_bits_row(&r->dense, j, k);
    const int n_words = (int)r->dense.row_words;
    uint64_t n_dense = 0;
    int first = -1;
    for (int w = 0; w < n_words; w++) {
        if (gone[w] & dense[w])
            n_dense += (uint64_t)cts_popcount(gone[w] & dense[w]);
        uint64_t edges = gone[w] ^ (gone[w] << 1 | (w ? gone[w - 1] >> 63 : 0));
        for (; edges; edges &= edges - 1) {
            const int at = 64 * w + __builtin_ctzll(edges);
            if (first >= 0)
                memset(grey + first, 0, (size_t)(at - first) * sizeof *grey);
            first = first >= 0 ? -1 : at;
        }
    }
    return n_dense;
}

typedef struct Clearing {
    const Removal *removal;
    CtsVolume *volume;
    _Atomic uint64_t n_dense;
} Clearing;

static void clear_slices(void *context, int worker, size_t first, size_t end)
{
    Clearing *const c = context;
    const Removal *r = c->removal;
    uint64_t n_dense = 0;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++)
        for (int j = 0; j < c->volume->dims[1]; j++) {
            uint64_t gone[CTS_BITS_ROW_WORDS];
            cts_sections_row(&r->plan, &r->gone, c->volume->dims[0], j, k, gone);
            n_dense += clear_row(r, c->volume, j, k, gone);
        }
    atomic_fetch_add(&c->n_dense, n_dense);
}

static void clear(Removal *r, CtsVolume *v)
{
    Clearing clearing = {.removal = r, .volume = v};
    cts_parallel(r->n_threads, (size_t)v->dims[2], 0, clear_slices, &clearing);
    r->n_dense_gone = atomic_load(&clearing.n_dense);
}

/* The volume of removed parts that are thicker than tables. Overwrites the bits of gone. */
static double report_lost(Removal *r, CtsReport *report)
{
    cts_bits_combine(&r->gone, CTS_BITS_AND, &r->sections);
    cts_each_section(r->workers, r->n_threads, cts_open_section, &r->gone,
                     cts_reach_mm(NO_SHELL_RADIUS_MM, r->plan.spacing_mm), &r->gone);
    const double lost_mm3 = (double)cts_bits_count(&r->gone) * r->plan.voxel_mm3;
    if (lost_mm3 > LOST_SHARE * r->body.mm3)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
            "%.1f cm3 (%.1f %% of the body) of the removed voxels form parts thicker than tables, and "
            "may be patient (compare with `remove_table` off)",
            lost_mm3 / 1000, 100 * lost_mm3 / r->body.mm3);
    return lost_mm3;
}

/* Warns where room air and lungs cannot be distinguished: the table may stay. */
static void report_air(const Removal *r, CtsReport *report)
{
    if (r->body.air.is_unknown)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
                              "the air around the body is as dense as lungs and has no level of its own: the table may "
                              "stay in the picture (remove it by a crop)");
}

/* Warns about possible tables that are kept: thin parts, and plates along the scanner's axis. */
static void report_uncertain(const Removal *r, CtsReport *report)
{
    const uint64_t n_doubtful = cts_bits_count_common(&r->plates_found.doubtful, &r->body.dense, r->n_threads);
    const double plates_mm3 = (double)n_doubtful * r->plan.voxel_mm3;
    const double kept_mm3 = fmax(r->body.thin_mm3, plates_mm3);
    if (kept_mm3 > UNCERTAIN_SHARE * r->body.mm3)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
                              "%.1f cm3 (%.1f %% of the body) may be table or patient and stay in the picture (remove "
                              "them by a crop if they are table)",
                              kept_mm3 / 1000, 100 * kept_mm3 / r->body.mm3);
}

static CtsStatus remove_table(Removal *r, CtsModel *model, const CtsVolume *seen, bool finds_inside, CtsReport *report,
                              CtsError *err)
{
    CtsStatus st;
    if ((st = find_dense_sections(r, seen, err)) || !is_usable(r, seen, report) || (st = find_sections(r, err)) ||
        (st = cts_morphologies_new(&r->workers, &r->sections, r->n_threads, err)) ||
        (st = cts_plates_find(&r->plan, &r->sections, r->workers, r->n_threads, &r->plates_found, err)) ||
        (st = cts_body_find(&r->plan, seen, &r->sections, &r->plates_found.plates, r->workers, r->n_threads, &r->body,
                            err)) ||
        (st = find_gone(r, err)))
        return st;
    if (!finds_inside)
        cts_report_skip(report, "inside of the body", "only modes minip and average use it");
    else if ((st = cts_body_inside(&r->plan, &r->body.whole, r->workers, r->n_threads, &model->body, err)))
        return st;
    report_air(r, report);
    report_uncertain(r, report);
    if (report)
        report->table = (CtsTableFact){.known = true, .body_mm3 = r->body.mm3};
    const uint64_t n_gone = cts_bits_count_common(&r->sections, &r->gone, r->n_threads);
    if ((double)n_gone * r->plan.voxel_mm3 < NOTHING_MM3) {
        cts_report_skip(report, WHAT, "nothing above %g HU lies outside the body", CTS_DENSE_HU);
        return st;
    }
    clear(r, model->volume);
    cts_model_changed(model);
    const double gone_mm3 = (double)r->n_dense_gone * r->plan.voxel_mm3 / r->plan.n_slices;
    cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVED,
                          "table removal: %llu voxels above %g HU removed (%.1f cm3, %.1f %% of the body)",
                          (unsigned long long)r->n_dense_gone, CTS_DENSE_HU, gone_mm3 / 1000,
                          100 * gone_mm3 / r->body.mm3);
    const double thick_mm3 = report_lost(r, report);
    if (report)
        report->table = (CtsTableFact){true, r->body.mm3, gone_mm3, thick_mm3};
    return st;
}

CtsStatus cts_model_remove_table(CtsModel *model, const CtsVolume *seen, bool finds_inside, int n_threads,
                                 CtsReport *report, CtsError *err)
{
    const CtsVolume *const volume = model->volume;
    Removal r = {.n_threads = cts_threads(n_threads)};
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    if (!cts_section_plan(volume, SECTION_MM, &r.plan)) {
        cts_report_skip(report, WHAT, "the voxel steps do not span space");
        return CTS_OK;
    }
    const CtsStatus st = remove_table(&r, model, seen ? seen : volume, finds_inside, report, err);
    removal_free(&r);
    const uint64_t n = cts_volume_n_voxels(volume);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, n,
                     n * sizeof *volume->grey);
    return st;
}
