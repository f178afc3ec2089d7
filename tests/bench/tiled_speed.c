/* Profile of the tiled engine: tiled_speed FOLDER [ROUNDS]
 *
 * Renders a CT series with the presets bone and skin, lit and unlit, from the front and from 30,20, with one thread and
 * with all, rounds interleaved with the classic engine. Prints medians: time relative to classic; ns per sample of the
 * field, and per visible sample in total; the bytes of potentially visible macro-cells relative to the volume's, those
 * read by samples (often repeatedly) relative to these, and the time relative to one pass over them at this machine's
 * memory bandwidth; the share of each stage. Never a timed test. */
#include "bench_series.h"

#include "base/clock.h"
#include "base/cpu.h"
#include <math.h>
#include <stdio.h>

typedef struct Row {
    const char *preset;
    double azimuth_deg, elevation_deg;
    CtsSwitch shade;
} Row;

static const Row rows[] = {
    {"bone", 0, 0, CTS_OFF}, {"skin", 0, 0, CTS_OFF}, {"bone", 30, 20, CTS_OFF}, {"skin", 30, 20, CTS_OFF},
    {"bone", 0, 0, CTS_ON},  {"skin", 0, 0, CTS_ON},  {"bone", 30, 20, CTS_ON},  {"skin", 90, 0, CTS_ON},
};
enum { N_ROWS = sizeof rows / sizeof *rows };

static int fail(const CtsError *err)
{
    fprintf(stderr, "tiled_speed: %s\n", err->text);
    return 1;
}

/* Best of a few passes over the volume's bytes by one thread, bytes per ms. */
static double read_bytes_per_ms(const CtsVolume *v)
{
    const uint64_t *words = (const uint64_t *)(const void *)v->grey;
    const size_t n = cts_volume_n_voxels(v) / 4;
    double best = INFINITY;
    for (int pass = 0; pass < 3; pass++) {
        const double start = cts_wall_ms();
        uint64_t sum = 0;
        for (size_t i = 0; i < n; i++)
            sum += words[i];
        __asm__ volatile("" : : "r"(sum)); /* the sum must not be optimised away */
        best = fmin(best, cts_wall_ms() - start);
    }
    return (double)n * 8 / best;
}

static int measure_row(const CtsModel *model, const Row *row, int n_threads, int rounds, double bytes_per_ms)
{
    double tiled_ms[BENCH_MAX_ROUNDS], classic_ms[BENCH_MAX_ROUNDS];
    CtsPreset preset;
    CtsError err = {0};
    CtsReport report = {0};
    if (cts_preset_load(row->preset, &preset, &err))
        return fail(&err);
    for (int r = 0; r < rounds; r++)
        for (int classic = 0; classic < 2; classic++) {
            CtsRenderSettings s;
            CtsPicture *picture = NULL;
            CtsReport unused = {0};
            cts_render_defaults(&s);
            s.azimuth_deg = row->azimuth_deg;
            s.elevation_deg = row->elevation_deg;
            s.shade = row->shade;
            s.n_threads = n_threads;
            s.engine = classic ? CTS_ENGINE_CLASSIC : CTS_ENGINE_TILED;
            if (!classic)
                cts_report_free(&report);
            const double start = cts_wall_ms();
            if (cts_render(model, &preset, &s, &picture, classic ? &unused : &report, &err))
                return fail(&err);
            (classic ? classic_ms : tiled_ms)[r] = cts_wall_ms() - start;
            cts_picture_free(&picture);
            cts_report_free(&unused);
        }
    const double ms = bench_median(tiled_ms, rounds), slow_ms = bench_median(classic_ms, rounds);
    const CtsStageTime *splat = &report.stages[CTS_STAGE_SPLAT], *composite = &report.stages[CTS_STAGE_COMPOSITE];
    double all = 0, march_ms = 0;
    for (int stage = CTS_STAGE_SPLAT; stage <= CTS_STAGE_SHADE; stage++)
        march_ms += report.stages[stage].cpu_ms;
    for (int stage = 0; stage < CTS_N_STAGES; stage++)
        all += report.stages[stage].wall_ms;
    const double active = 2.0 * (double)report.voxels.splatted, total = 2.0 * (double)report.voxels.total;
    printf("%-5s %3g,%-3g %-5s %2d  %7.1f ms  classic/tiled %5.1f  ns/sample %5.2f  ns/active sample %5.2f  active "
           "bytes %4.1f "
           "%%  bytes sampled/active %5.2f  time/pass over them %5.1f  ",
           row->preset, row->azimuth_deg, row->elevation_deg, row->shade == CTS_ON ? "lit" : "unlit", n_threads, ms,
           slow_ms / ms, 1e6 * splat->cpu_ms / (double)splat->items, 1e6 * march_ms / (double)composite->items,
           100 * active / total, (double)splat->bytes / active, ms * n_threads / (active / bytes_per_ms));
    for (int stage = 0; stage < CTS_N_STAGES; stage++)
        if (report.stages[stage].ran)
            printf(" %s %.0f %%", cts_stage_names[stage], 100 * report.stages[stage].wall_ms / all);
    printf("\n");
    fflush(stdout);
    cts_report_free(&report);
    return 0;
}

static int measure(const CtsModel *model, int rounds)
{
    int result = 0;
    const double bytes_per_ms = read_bytes_per_ms(model->volume);
    printf("1024 x 1024 pixels, medians of %d rounds\n", rounds);
    for (int r = 0; r < N_ROWS && !result; r++) {
        result = measure_row(model, &rows[r], cts_threads(0), rounds, bytes_per_ms);
        if (!result && cts_threads(0) > 1)
            result = measure_row(model, &rows[r], 1, rounds, bytes_per_ms);
    }
    return result;
}

int main(int argc, char **argv)
{
    return bench_main(argc, argv, "tiled_speed", measure);
}
