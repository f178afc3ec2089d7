#include "ctsplat/table.h"

#include "base/clock.h"
#include "base/compare.h"
#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/couch/table_removal.h"
#include "core/volume/crop.h"
#include "core/volume/threshold.h"
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* Thickness of a section; thinner slices are joined. A table runs along the scanner's axis, so thick sections show it.
 * Measured: 3 to 3.7 mm pass the tests; with 2 mm more than 5 % of a skull is doubtful, with 4 mm 3 % more than the
 * table of a chest is removed. */
static const double SECTION_MM = 3.5;
/* Width of the margin kept around the body, which holds the soft edge of the skin. Measured:
 * nine of ten places reach air, to 50 HU, within 2.3 mm in a chest and 3.2 mm in a head of thick slices. */
static const double MARGIN_MM = 3;
/* Least volume outside the body that is removed: a cube of 3 mm. Measured: 0.001 to 1000 mm3 give the same. */
static const double NOTHING_MM3 = 30;
/* Share of the body from which doubtful parts cause a warning. Measured where the table is removed: thin parts are 3.2
 * % of a skull phantom, plates 2.1 % of a chest. */
static const double UNCERTAIN_SHARE = 0.05;
/* Half the thickness from which removed parts cause a warning, as they may be a limb: shells of tables, mattresses and
 * holders that are denser than air are thinner than 20 mm. Measured: no removed part is as thick as 12 mm. */
static const double NO_SHELL_RADIUS_MM = 10;
/* Share of the body that these parts and those denser than tables need for the warning: 12 cm3 of a chest. Measured: 0
 * in five series, and in a chest with noise of 60 to 200 HU. */
static const double LOST_SHARE = 0.001;
/* Least number of voxels for each run of dense voxels in a row. Measured: 170 to 330; noise of which half is dense
 * has 4. A CtsRun takes 12 bytes, so runs take less than a fifth of the memory of 16-bit voxels. */
enum { VOXELS_PER_RUN = 32 };
/* Number of runs that any volume may have, as small ones need more than that share: they take 0.8 MB. */
enum { RUNS_ANYWAY = 1 << 16 };

static const char *const WHAT = "table removal";

/* Frees everything except the results. */
static void free_all_but_results(CtsTableSearch *r)
{
    cts_morphologies_free(&r->workers, r->n_threads);
    if (r->sections.words != r->dense.words)
        cts_bits_free(&r->sections);
    r->sections = (CtsBits){0};
    cts_bits_free(&r->dense);
    cts_bits_free(&r->plates);
    cts_bits_free(&r->doubtful);
    cts_bits_free(&r->body.dense);
    cts_bits_free(&r->body.whole);
    cts_bits_free(&r->body.foreign);
}

void cts_table_search_free(CtsTableSearch **found)
{
    if (!*found)
        return;
    free_all_but_results(*found);
    cts_bits_free(&(*found)->gone);
    cts_body_mask_free(&(*found)->inside);
    free(*found);
    *found = NULL;
}

static CtsStatus find_dense_voxels(CtsTableSearch *r, CtsError *err)
{
    const uint16_t dense = cts_dense_grey(r->volume);
    const CtsStatus st = cts_bits_new(&r->dense, r->volume->dims, err);
    if (!st && r->plan.layers)
        return cts_bits_threshold_layers(&r->dense, r->plan.layers, dense, r->n_threads, &r->n_runs, err);
    if (!st)
        r->n_runs = cts_bits_threshold(&r->dense, r->volume->grey, dense, r->n_threads);
    return st;
}

/* And the scratch memory for them. */
static CtsStatus find_sections(CtsTableSearch *r, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (r->plan.axis[2] != 2 || r->plan.n_slices > 1)
        st = cts_sections_new(r, err);
    else
        r->sections = r->dense;
    return st ? st : cts_morphologies_new(&r->workers, &r->sections, r->n_threads, err);
}

static bool is_specimen_volume(const CtsTableSearch *r)
{
    double spacing_mm[3], size_mm[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++)
        spacing_mm[a] = cts_volume_spacing_mm(r->volume, a);
    if (!cts_is_specimen(spacing_mm, size_mm)) /* by its voxels alone */
        return false;
    const CtsVoxelBox box = cts_bits_box(&r->dense, false);
    for (int a = 0; a < 3; a++)
        size_mm[a] = box.hi[a] < 0 ? 0 : (box.hi[a] - box.lo[a] + 1) * spacing_mm[a];
    return cts_is_specimen(spacing_mm, size_mm);
}

/* False, with the reason in the report, when there is nothing to work on. */
static bool is_usable(const CtsTableSearch *r, CtsReport *report)
{
    if (!r->n_runs) {
        cts_report_skip(report, WHAT, "no voxel lies above %g HU", CTS_DENSE_HU);
        return false;
    }
    if (is_specimen_volume(r)) {
        cts_report_skip(report, WHAT,
                        "voxels and size are those of a specimen in a micro-CT, which no patient's table fits");
        return false;
    }
    if (r->n_runs <= cts_volume_n_voxels(r->volume) / VOXELS_PER_RUN + RUNS_ANYWAY)
        return true;
    cts_report_skip(report, WHAT, "too noisy to distinguish a body from a table: %llu runs of voxels above %g HU",
                    (unsigned long long)r->n_runs, CTS_DENSE_HU);
    cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
                          "too noisy to distinguish a body from a table: nothing was removed (remove it by a crop)");
    return false;
}

/* Parameters of find_gone_sections() and find_lost_sections(). */
typedef struct Leaving {
    CtsTableSearch *removal;
    CtsReach margin; /* or half the thickness of what is lost */
    CtsBits near;    /* a section for each worker */
    _Atomic uint64_t n_voxels;
} Leaving;

/* Voxels beyond the margin of the body become air, and in the margin the soft edges of removed parts, except for the
 * voxels next to the body. The body of a section is that of its neighbours, too. */
static void find_gone_sections(void *context, int worker, size_t first, size_t end)
{
    Leaving *const l = context;
    CtsTableSearch *const r = l->removal;
    const CtsReach one = {.diamond = 1}, two = {.diamond = 1, .box = {1, 1}};
    const CtsBits *const whole = &r->body.whole;
    CtsBits near = cts_bits_slice(&l->near, worker);
    CtsMorphology *const m = &r->workers[worker];
    uint64_t n_gone = 0;
    for (int k = (int)first; k < (int)end; k++) {
        const CtsBits section = cts_bits_slice(&r->sections, k);
        CtsBits gone = cts_bits_slice(&r->gone, k), foreign = cts_bits_slice(&r->body.foreign, k);
        memcpy(gone.words, cts_bits_row(whole, 0, k), m->n_words * sizeof *gone.words);
        for (int from = k > 0 ? k - 1 : k + 1; from <= k + 1 && from < whole->dims[2]; from += 2) {
            const CtsBits beside = cts_bits_slice(whole, from);
            cts_bits_combine(&gone, CTS_BITS_OR, &beside);
        }
        cts_dilate_section(m, gone.words, l->margin, gone.words);
        cts_bits_combine(&gone, CTS_BITS_NOT, &gone);
        if (cts_bits_any(&foreign)) {
            cts_bits_combine(&gone, CTS_BITS_OR, &foreign);
            cts_dilate_section(m, cts_bits_row(whole, 0, k), one, near.words);
            cts_dilate_section(m, foreign.words, two, foreign.words);
            cts_bits_combine(&foreign, CTS_BITS_AND_NOT, &near);
            cts_bits_combine(&gone, CTS_BITS_OR, &foreign);
        }
        n_gone += cts_bits_count_common(&section, &gone);
    }
    atomic_fetch_add(&l->n_voxels, n_gone);
}

/* Finds r->gone, in the memory of the plates, and the number of its dense bits; r->body.foreign is dilated. */
static CtsStatus find_gone(CtsTableSearch *r, uint64_t *n_gone, CtsError *err)
{
    Leaving l = {.removal = r, .margin = cts_reach_mm(MARGIN_MM, r->plan.spacing_mm)};
    /* At least two voxels: a soft edge is as wide, however large the voxels are. */
    for (int n = 0; n < 2; n++)
        l.margin.box[n] = l.margin.diamond + l.margin.box[n] < 2 ? 2 - l.margin.diamond : l.margin.box[n];
    const CtsStatus st =
        cts_bits_new_unset(&l.near, (const int[]){r->plan.dims[0], r->plan.dims[1], r->n_threads}, err);
    if (!st) {
        r->gone = r->plates;
        r->plates = (CtsBits){0};
        cts_parallel(r->n_threads, (size_t)r->plan.dims[2], 1, find_gone_sections, &l);
        *n_gone = atomic_load(&l.n_voxels);
    }
    cts_bits_free(&l.near);
    return st;
}

/* Number of dense voxels that become air. */
static uint64_t count_dense_gone(const CtsTableSearch *r)
{
    uint64_t n = 0;
    for (int k = 0; k < r->dense.dims[2]; k++)
        for (int j = 0; j < r->dense.dims[1]; j++) {
            uint64_t made[CTS_BITS_ROW_WORDS];
            const uint64_t *const gone = cts_gone_row(r, j, k, made), *const row = cts_bits_row(&r->dense, j, k);
            for (size_t w = 0; w < r->dense.row_words; w++)
                if (gone[w] & row[w]) /* few words have any */
                    n += (uint64_t)cts_popcount(gone[w] & row[w]);
        }
    return n;
}

/* Moves a row of n voxels to its own place or to one before it in memory; those that are gone become air. at: bit of
 * the row's first voxel in `gone`. */
static void move_kept_row(uint16_t *to, const uint16_t *from, int n, int at, const uint64_t *gone)
{
    bool is_gone = gone[at >> 6] >> (at & 63) & 1;
    int done = 0;
    for (int w = at >> 6; done < n; w++) {
        const bool is_last = w == (at + n - 1) >> 6;
        uint64_t edges = gone[w] ^ (gone[w] << 1 | (w ? gone[w - 1] >> 63 : 0));
        for (;; edges &= edges - 1) {
            const int edge = edges ? 64 * w + __builtin_ctzll(edges) - at : n, end = edge < n ? edge : n;
            if (!edges && !is_last)
                break;
            if (end <= done)
                continue;
            if (is_gone)
                memset(to + done, 0, (size_t)(end - done) * sizeof *to);
            else if (to != from)
                memmove(to + done, from + done, (size_t)(end - done) * sizeof *to);
            is_gone = !is_gone;
            done = end;
            if (done == n)
                return;
        }
    }
}

typedef struct Clearing {
    const CtsTableSearch *found;
    CtsVolume *volume;
    int at[3]; /* place of the volume in the one that was searched */
} Clearing;

static void clear_slices(void *context, int worker, size_t first, size_t end)
{
    const Clearing *const c = context;
    const CtsVolume *const v = c->volume;
    const int *const at = c->at;
    const size_t n = (size_t)v->dims[0];
    uint16_t *row = v->grey + first * (size_t)v->dims[1] * n;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++)
        for (int j = 0; j < v->dims[1]; j++, row += n) {
            uint64_t made[CTS_BITS_ROW_WORDS];
            const uint64_t *const gone = cts_gone_row(c->found, j + at[1], k + at[2], made);
            move_kept_row(row, row, v->dims[0], at[0], gone);
        }
}

/* Keeps of a section's bits those denser than tables. */
static void keep_denser(const CtsTableSearch *r, int k, CtsBits *section)
{
    for (size_t w = 0; w < cts_bits_n_words(section); w++)
        for (uint64_t bits = section->words[w]; bits; bits &= bits - 1) {
            const int i = (int)(w % section->row_words) * 64 + __builtin_ctzll(bits);
            if (cts_section_hu(r, i, (int)(w / section->row_words), k) <= CTS_TABLE_HU)
                section->words[w] &= ~(bits & -bits);
        }
}

/* Counts the removed voxels that form parts thicker than tables, or denser ones of 3 voxels and more across. */
static void find_lost_sections(void *context, int worker, size_t first, size_t end)
{
    Leaving *const l = context;
    const CtsTableSearch *const r = l->removal;
    uint64_t n_lost = 0;
    for (int k = (int)first; k < (int)end; k++) {
        const CtsBits gone = cts_bits_slice(&r->gone, k);
        CtsBits rest = cts_bits_slice(&r->sections, k), thick = cts_bits_slice(&r->doubtful, k);
        cts_bits_combine(&rest, CTS_BITS_AND, &gone);
        cts_open_section(&r->workers[worker], rest.words, l->margin, thick.words);
        cts_bits_combine(&rest, CTS_BITS_AND_NOT, &thick);
        keep_denser(r, k, &rest);
        cts_open_section(&r->workers[worker], rest.words, (CtsReach){.diamond = 1}, rest.words);
        n_lost += cts_bits_count(&thick) + cts_bits_count(&rest);
    }
    atomic_fetch_add(&l->n_voxels, n_lost);
}

/* The volume of removed parts that are thicker or denser than tables. Overwrites the sections and the doubtful bits. */
static double report_lost(CtsTableSearch *r, CtsReport *report)
{
    Leaving l = {.removal = r, .margin = cts_reach_mm(NO_SHELL_RADIUS_MM, r->plan.spacing_mm)};
    cts_parallel(r->n_threads, (size_t)r->plan.dims[2], 1, find_lost_sections, &l);
    const double lost_mm3 = (double)atomic_load(&l.n_voxels) * r->plan.voxel_mm3;
    if (lost_mm3 > LOST_SHARE * r->body.mm3)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
            "%.1f cm3 (%.1f %% of the body) of the removed voxels form parts thicker than tables, or are as dense as "
            "bone or metal, and may be patient (compare with `remove-table` off)",
            lost_mm3 / 1000, 100 * lost_mm3 / r->body.mm3);
    return lost_mm3;
}

/* Warns about possible tables that are kept: where room air and lungs cannot be distinguished, thin parts, and plates
 * along the scanner's axis. */
static void report_uncertain(const CtsTableSearch *r, CtsReport *report)
{
    if (r->body.air_is_unknown)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
                              "the air around the body is as dense as lungs and has no level of its own: the table may "
                              "stay in the picture (remove it by a crop)");
    const uint64_t n_doubtful = cts_bits_count_common(&r->doubtful, &r->body.dense);
    const double kept_mm3 = fmax(r->body.thin_mm3, (double)n_doubtful * r->plan.voxel_mm3);
    if (kept_mm3 > UNCERTAIN_SHARE * r->body.mm3)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN,
                              "%.1f cm3 (%.1f %% of the body) may be table or patient and stay in the picture (remove "
                              "them by a crop if they are table)",
                              kept_mm3 / 1000, 100 * kept_mm3 / r->body.mm3);
}

static CtsStatus search(CtsTableSearch *r, bool finds_inside, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    uint64_t n_gone;
    const bool is_hu = r->volume->quantity == CTS_QUANTITY_HU;
    if (!is_hu)
        cts_report_skip(report, WHAT, "only HU tell a table from the patient");
    if (!is_hu && !finds_inside)
        return CTS_OK;
    if ((st = find_dense_voxels(r, err)) || (is_hu && !is_usable(r, report)) || (st = find_sections(r, err)))
        return st;
    if (!is_hu) /* the body is what lies above air */
        return (st = cts_body_enclose(r, &r->sections, false, err)) ? st : cts_body_inside(r, err);
    if ((st = cts_plates_find(r, err)) || (st = cts_body_find(r, err)) || (st = find_gone(r, &n_gone, err)))
        return st;
    if (!finds_inside)
        cts_report_skip(report, "inside of the body", "only modes minip and average use it");
    else if ((st = cts_body_inside(r, err)))
        return st;
    report_uncertain(r, report);
    CtsTableFact fact = {.known = true, .body_mm3 = r->body.mm3};
    r->removes = (double)n_gone * r->plan.voxel_mm3 >= NOTHING_MM3;
    if (r->removes) {
        const uint64_t n_dense_gone = count_dense_gone(r);
        fact.removed_mm3 = (double)n_dense_gone * r->plan.voxel_mm3 / r->plan.n_slices;
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_TABLE_REMOVED,
                              "table removal: %llu voxels above %g HU removed (%.1f cm3, %.1f %% of the body)",
                              (unsigned long long)n_dense_gone, CTS_DENSE_HU, fact.removed_mm3 / 1000,
                              100 * fact.removed_mm3 / r->body.mm3);
        fact.thick_mm3 = report_lost(r, report);
    } else {
        cts_report_skip(report, WHAT, "nothing above %g HU lies outside the body", CTS_DENSE_HU);
    }
    if (report)
        report->table = fact;
    return CTS_OK;
}

CtsStatus cts_table_search(const CtsVolume *volume, const CtsLinearLayers *layers, bool finds_inside, int n_threads,
                           CtsTableSearch **found, CtsReport *report, CtsError *err)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    CtsTableSearch *const r = *found = calloc(1, sizeof *r);
    if (!r)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    r->n_threads = cts_threads(n_threads);
    memcpy(r->dims, volume->dims, sizeof r->dims);
    memcpy(r->air_before, volume->air_before, sizeof r->air_before);
    if (!cts_section_plan(volume, SECTION_MM, &r->plan)) {
        cts_report_skip(report, WHAT, "the voxel steps do not span space");
        return CTS_OK;
    }
    r->plan.layers = layers;
    r->volume = volume;
    const CtsStatus st = search(r, finds_inside, report, err);
    r->plan.layers = NULL;
    r->volume = NULL;
    free_all_but_results(r);
    if (st)
        cts_table_search_free(found);
    const uint64_t n = cts_volume_n_voxels(volume);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, n,
                     n * sizeof *volume->grey);
    return st;
}

void cts_table_kept_box(const CtsTableSearch *found, const CtsVolume *volume, int low[3], int high[3])
{
    const CtsVoxelBox box = found->removes ? cts_bits_box(&found->gone, true) : CTS_NO_VOXELS;
    const bool keeps_all = box.hi[0] < 0;
    for (int a = 0; a < 3; a++) {
        const int axis = found->plan.axis[a], n = a == 2 ? found->plan.n_slices : 1, last = found->dims[axis] - 1;
        low[axis] = keeps_all ? 0 : box.lo[a] * n;
        high[axis] = keeps_all ? last : cts_smaller_int(box.hi[a] * n + n - 1, last);
    }
    cts_volume_widen_box(volume, low, high);
}

/* Moves the inside of the body into the model. at: place of the model's volume in the one that was searched. */
static void give_inside(CtsTableSearch *found, CtsModel *model, const int at[3])
{
    if (!found->inside)
        return;
    cts_body_mask_free(&model->body);
    model->body = found->inside;
    found->inside = NULL;
    for (int axis = 0; axis < 3; axis++)
        model->body->first[axis] += at[axis];
}

void cts_table_clear(CtsTableSearch *found, CtsModel *model, CtsReport *report)
{
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    Clearing clearing = {.found = found, .volume = model->volume};
    for (int axis = 0; axis < 3; axis++)
        clearing.at[axis] = model->volume->air_before[axis] - found->air_before[axis];
    give_inside(found, model, clearing.at);
    if (!found->removes)
        return;
    cts_parallel(found->n_threads, (size_t)model->volume->dims[2], 0, clear_slices, &clearing);
    cts_model_changed(model);
    cts_report_stage(report, CTS_STAGE_CLASSIFY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms, 0, 0);
}

void cts_table_crop(CtsTableSearch *found, CtsModel *model)
{
    CtsVolume *const v = model->volume;
    const size_t nx = (size_t)v->dims[0], ny = (size_t)v->dims[1];
    int low[3], high[3];
    cts_table_kept_box(found, v, low, high);
    const int n = high[0] - low[0] + 1;
    uint16_t *to = v->grey;
    for (int k = low[2]; found->removes && k <= high[2]; k++)
        for (int j = low[1]; j <= high[1]; j++, to += n) {
            uint64_t made[CTS_BITS_ROW_WORDS];
            move_kept_row(to, v->grey + ((size_t)k * ny + (size_t)j) * nx + low[0], n, low[0],
                          cts_gone_row(found, j, k, made));
        }
    give_inside(found, model, low);
    cts_volume_become_air_box(v, low, high);
    cts_model_changed(model);
}

CtsStatus cts_model_remove_table(CtsModel *model, bool finds_inside, int n_threads, CtsReport *report, CtsError *err)
{
    CtsTableSearch *found;
    const CtsStatus st = cts_table_search(model->volume, NULL, finds_inside, n_threads, &found, report, err);
    if (!st)
        cts_table_clear(found, model, report);
    cts_table_search_free(&found);
    return st;
}
