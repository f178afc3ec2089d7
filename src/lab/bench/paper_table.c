/* The paper's tables on one series: each of its engines, and each without ctsplat's additions. */
#include "lab/bench/bench.h"

#include "base/clock.h"
#include "base/compare.h"
#include "base/cpu.h"
#include <stdlib.h>
#include <string.h>

enum { ROUNDS = CTS_PAPER_ROUNDS };

typedef struct PaperRow {
    const char *name;
    CtsEngineId engine;
    bool no_occlusion_culling, always_reuse_layers; /* as in CtsRenderSettings */
    const char *published; /* the paper's mean in per cent, and those of its data sets; "-": it has no such engine */
    double ms[ROUNDS];     /* of each round; wall, or with one thread CPU time, which others disturb less */
    bool differs;          /* the picture has not classic's bytes */
    CtsVoxelCounts voxels;
} PaperRow;

/* Times that the paper gives, in per cent of plain splatting: the means of its three data sets, and the sets'. */
static const PaperRow plan[] = {
    {"classic", CTS_ENGINE_CLASSIC, false, false, .published = "100.0\t100"},
    {"layers", CTS_ENGINE_LAYERS, false, true, .published = "69.1\t66.2, 63, 78"},
    {"void", CTS_ENGINE_VOID, true, false, .published = "50.9\tnot given"},
    {"combined", CTS_ENGINE_COMBINED, true, true, .published = "46.8\t38.3, 44, 58.1"},
    {"layers, reuse where it pays", CTS_ENGINE_LAYERS, false, false, .published = "-\t-"},
    {"void, stops behind opaque", CTS_ENGINE_VOID, false, false, .published = "-\t-"},
    {"combined, both", CTS_ENGINE_COMBINED, false, false, .published = "-\t-"},
};
enum { N_ROWS = sizeof plan / sizeof *plan };

static CtsRenderSettings settings_for(const CtsRenderSettings *asked, const PaperRow *row)
{
    CtsRenderSettings s = *asked;
    s.engine = row->engine;
    s.kernel = CTS_KERNEL_CONE_PAPER;
    s.samples = 1;
    s.shade = CTS_OFF;
    s.mode = CTS_MODE_COMPOSITE;
    s.fit = CTS_FIT_VOLUME;
    s.no_occlusion_culling = row->no_occlusion_culling;
    s.always_reuse_layers = row->always_reuse_layers;
    return s;
}

static double busy_ms(int n_threads)
{
    return n_threads == 1 ? cts_cpu_ms() : cts_wall_ms();
}

/* One picture by each row's settings; the first one's stays to be compared with. */
static CtsStatus run_rows(const CtsBenchSettings *settings, const CtsModel *quantised, int round, PaperRow *rows,
                          CtsError *err)
{
    const int n_threads = cts_threads(settings->render.n_threads);
    CtsPicture *expected = NULL;
    CtsStatus st = CTS_OK;
    for (int i = 0; i < N_ROWS && !st; i++) {
        PaperRow *row = &rows[i];
        const CtsRenderSettings s = settings_for(&settings->render, row);
        CtsPicture *picture = NULL;
        CtsReport report = {0};
        if (settings->progress)
            settings->progress(round * N_ROWS + i, ROUNDS * N_ROWS, row->name);
        const double start_ms = busy_ms(n_threads);
        st = cts_render(quantised, settings->preset, &s, &picture, &report, err);
        row->ms[round] = busy_ms(n_threads) - start_ms;
        row->voxels = report.voxels;
        cts_report_free(&report);
        if (!st && expected) {
            const size_t n = (size_t)picture->width * (size_t)picture->height * 4 * sizeof *picture->pixels;
            row->differs = row->differs || memcmp(picture->pixels, expected->pixels, n);
            cts_picture_free(&picture);
        } else {
            expected = picture;
        }
    }
    cts_picture_free(&expected);
    return st;
}

/* Medians; each round's time as a share of classic's in the same round, since slowdowns of the machine affect both,
 * with its quartiles. */
static void add_paper_row(CtsTable *table, const PaperRow *r, const PaperRow *classic)
{
    double ms[ROUNDS], percent[ROUNDS];
    memcpy(ms, r->ms, sizeof ms);
    for (int round = 0; round < ROUNDS; round++)
        percent[round] = 100 * r->ms[round] / classic->ms[round];
    qsort(ms, ROUNDS, sizeof *ms, cts_compare_double);
    qsort(percent, ROUNDS, sizeof *percent, cts_compare_double);
    cts_table_row(table, "%s\t%.1f\t%.1f\t%.1f to %.1f\t%s\t%.1f %%\t%s", r->name, ms[ROUNDS / 2], percent[ROUNDS / 2],
                  percent[ROUNDS / 4], percent[ROUNDS - 1 - ROUNDS / 4], r->published,
                  100 * (double)r->voxels.splatted / (double)r->voxels.total, r->differs ? "differs" : "same bytes");
}

CtsStatus cts_paper_table(const CtsBenchSettings *settings, CtsTable **table, CtsError *err)
{
    CtsModel quantised = {.volume = NULL};
    PaperRow rows[N_ROWS];
    memcpy(rows, plan, sizeof rows);
    const CtsPreset *preset = settings->preset;
    const int n_threads = cts_threads(settings->render.n_threads);
    CtsStatus st = cts_volume_quantise(settings->model->volume, CTS_PAPER_BITS, preset->window_low_hu,
                                       preset->window_high_hu, n_threads, &quantised.volume, err);
    if (!st)
        st = cts_model_prepare(&quantised, n_threads, err);
    for (int round = 0; round < ROUNDS && !st; round++)
        st = run_rows(settings, &quantised, round, rows, err);
    cts_model_free(&quantised);
    if (st)
        return st;
    *table = cts_table_new("engine\t>ms\t>% of classic\t>quartiles\t>paper's mean\t>its sets\t>splatted\tpicture");
    for (int i = 0; i < N_ROWS; i++)
        add_paper_row(*table, &rows[i], &rows[0]);
    return CTS_OK;
}
