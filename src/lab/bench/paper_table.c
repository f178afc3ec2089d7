/* The paper's tables on one series: each of its engines, and each without ctsplat's additions. */
#include "lab/bench/paper_table.h"

#include "base/clock.h"
#include "base/compare.h"
#include "base/cpu.h"
#include <stdlib.h>
#include <string.h>

/* Times that the paper gives, in per cent of plain splatting: the means of its three data sets, and the sets'. */
#define ROW(called, id, hidden, always, mean, sets)                                                                    \
    {                                                                                                                  \
        .name = called, .engine = CTS_ENGINE_##id, .no_occlusion_culling = hidden, .always_reuse_layers = always,      \
        .paper_percent = mean, .paper_sets = sets                                                                      \
    }
static const CtsPaperRow plan[] = {
    ROW("classic", CLASSIC, false, false, 100, "100"),
    ROW("layers", LAYERS, false, true, 69.1, "66.2, 63, 78"),
    ROW("void", VOID, true, false, 50.9, "not given"),
    ROW("combined", COMBINED, true, true, 46.8, "38.3, 44, 58.1"),
    ROW("layers, reuse where it pays", LAYERS, false, false, 0, NULL),
    ROW("void, stops behind opaque", VOID, false, false, 0, NULL),
    ROW("combined, both", COMBINED, false, false, 0, NULL),
};
enum { N_ROWS = sizeof plan / sizeof *plan };
_Static_assert((int)N_ROWS == (int)CTS_PAPER_ROWS, "a place for each row");

static CtsRenderSettings settings_for(const CtsRenderSettings *asked, const CtsPaperRow *row)
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
static CtsStatus run_rows(const CtsPaperSettings *settings, const CtsModel *levels, int round, CtsPaperTable *table,
                          CtsError *err)
{
    CtsPicture *expected = NULL;
    CtsStatus st = CTS_OK;
    for (int i = 0; i < N_ROWS && !st; i++) {
        CtsPaperRow *row = &table->rows[i];
        const CtsRenderSettings s = settings_for(&settings->render, row);
        CtsPicture *picture = NULL;
        CtsReport report = {0};
        if (settings->progress)
            settings->progress(round * N_ROWS + i, CTS_PAPER_ROUNDS * N_ROWS, row->name);
        const double start_ms = busy_ms(table->n_threads);
        st = cts_render(levels, settings->preset, &s, &picture, &report, err);
        row->ms[round] = busy_ms(table->n_threads) - start_ms;
        row->voxels = report.voxels;
        cts_report_free(&report);
        if (!st && expected) {
            const size_t n = (size_t)picture->width * (size_t)picture->height * 4 * sizeof *picture->pixels;
            row->same = row->same && !memcmp(picture->pixels, expected->pixels, n);
            cts_picture_free(&picture);
        } else {
            expected = picture;
        }
    }
    cts_picture_free(&expected);
    return st;
}

/* Each round's time as a share of classic's in the same round, since slowdowns of the machine affect both. */
static void sum_up(CtsPaperTable *table)
{
    double share[CTS_PAPER_ROUNDS];
    for (int i = N_ROWS - 1; i >= 0; i--) {
        CtsPaperRow *row = &table->rows[i];
        for (int round = 0; round < CTS_PAPER_ROUNDS; round++)
            share[round] = 100 * row->ms[round] / table->rows[0].ms[round];
        qsort(share, CTS_PAPER_ROUNDS, sizeof *share, cts_compare_double);
        row->percent = share[CTS_PAPER_ROUNDS / 2];
        row->percent_low = share[CTS_PAPER_ROUNDS / 4];
        row->percent_high = share[CTS_PAPER_ROUNDS - 1 - CTS_PAPER_ROUNDS / 4];
        qsort(row->ms, CTS_PAPER_ROUNDS, sizeof *row->ms, cts_compare_double);
        row->median_ms = row->ms[CTS_PAPER_ROUNDS / 2];
    }
}

CtsStatus cts_paper_table(const CtsPaperSettings *settings, CtsPaperTable *table, CtsError *err)
{
    CtsModel levels = {.volume = NULL};
    *table = (CtsPaperTable){.n_threads = cts_threads(settings->render.n_threads)};
    for (int i = 0; i < N_ROWS; i++) {
        table->rows[i] = plan[i];
        table->rows[i].same = true;
    }
    const CtsPreset *preset = settings->preset;
    CtsStatus st = cts_volume_quantise(settings->volume, CTS_PAPER_BITS, preset->window_low_hu, preset->window_high_hu,
                                       table->n_threads, &levels.volume, err);
    if (!st)
        st = cts_model_prepare(&levels, table->n_threads, err);
    for (int round = 0; round < CTS_PAPER_ROUNDS && !st; round++)
        st = run_rows(settings, &levels, round, table, err);
    cts_model_free(&levels);
    if (!st)
        sum_up(table);
    return st;
}
