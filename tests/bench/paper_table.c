/* The paper's table on our data: paper_table [-r ROUNDS] [-t THREADS] FOLDER...
 *
 * Renders each CT series by the engines classic, layers, void and combined, unlit, from the front and from the side,
 * with the presets bone and skin, at raw grey levels and at 8 bits as the paper's pictures have. Prints classic's time
 * and the others' relative to it (medians of interleaved rounds; wall time, or with one thread CPU time, which other
 * programs disturb less), what the log says of layer reuse, and the means beside the paper's. Never a timed test. */
#include "bench_series.h"

#include "base/clock.h"
#include "base/cpu.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { N_ENGINES = 4, RAW_BITS = 16, PAPER_BITS = 8 };

static const CtsEngineId engines[N_ENGINES] = {CTS_ENGINE_CLASSIC, CTS_ENGINE_LAYERS, CTS_ENGINE_VOID,
                                               CTS_ENGINE_COMBINED};
static const double paper_mean[N_ENGINES] = {100, 69.1, 50.9, 46.8};
static const char *const presets[] = {"bone", "skin"};
static const struct {
    const char *name;
    double azimuth_deg;
} views[] = {{"front", 0}, {"side", 90}};
enum { N_PRESETS = 2, N_VIEWS = 2 };

typedef struct Options {
    int rounds, n_threads;
} Options;

/* Sums of percentages, by grey bits (raw, 8) and engine. */
typedef struct Means {
    double sum[2][N_ENGINES];
    int n[2];
} Means;

static int fail(const CtsError *err)
{
    fprintf(stderr, "paper_table: %s\n", err->text);
    return 1;
}

static const char *reuse_note(const CtsReport *report)
{
    for (size_t i = 0; i < report->n_skips; i++)
        if (!strcmp(report->skips[i].what, "layer reuse"))
            return report->skips[i].why;
    return "used";
}

static CtsStatus render_once(const CtsVolume *volume, const CtsPreset *preset, double azimuth_deg, CtsEngineId engine,
                             int n_threads, double *ms, CtsReport *report, CtsError *err)
{
    CtsRenderSettings s;
    CtsPicture *picture = NULL;
    cts_render_defaults(&s);
    s.azimuth_deg = azimuth_deg;
    s.shade = CTS_OFF;
    s.n_threads = n_threads;
    s.engine = engine;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const CtsStatus st = cts_render(volume, preset, &s, &picture, report, err);
    *ms = n_threads == 1 ? cts_cpu_ms() - cpu : cts_wall_ms() - wall;
    cts_picture_free(&picture);
    return st;
}

static int measure(const CtsVolume *volume, const CtsPreset *preset, int view, int bits, const Options *options,
                   Means *means)
{
    static double ms[N_ENGINES][BENCH_MOST_ROUNDS];
    char note[2][sizeof((CtsSkip *)0)->why] = {""};
    CtsVoxelCounts voxels = {0};
    CtsError err = {0};
    for (int r = 0; r < options->rounds; r++)
        for (int e = 0; e < N_ENGINES; e++) {
            CtsReport report = {0};
            if (render_once(volume, preset, views[view].azimuth_deg, engines[e], options->n_threads, &ms[e][r], &report,
                            &err))
                return fail(&err);
            if (engines[e] == CTS_ENGINE_LAYERS || engines[e] == CTS_ENGINE_COMBINED)
                snprintf(note[engines[e] == CTS_ENGINE_COMBINED], sizeof note[0], "%s", reuse_note(&report));
            if (engines[e] == CTS_ENGINE_VOID)
                voxels = report.voxels;
            cts_report_free(&report);
        }
    const double classic_ms = bench_median(ms[0], options->rounds);
    printf("  %-5s %-5s %6s  %8.1f ms", views[view].name, preset->name, bits == RAW_BITS ? "raw" : "8 bits",
           classic_ms);
    means->n[bits == PAPER_BITS]++;
    for (int e = 1; e < N_ENGINES; e++) {
        const double percent = 100 * bench_median(ms[e], options->rounds) / classic_ms;
        means->sum[bits == PAPER_BITS][e] += percent;
        printf("  %s %5.1f %%", cts_engine_names[engines[e]], percent);
    }
    printf("  not void %4.1f %%  reuse: layers %s; combined %s\n",
           100 * (1 - (double)voxels.void_voxels / (double)voxels.total), note[0], note[1]);
    fflush(stdout);
    return 0;
}

static int measure_volume(const CtsVolume *volume, const char *preset_name, int bits, const Options *options,
                          Means *means)
{
    CtsPreset preset;
    CtsVolume *levels = NULL;
    CtsError err = {0};
    int result = 0;
    if (cts_preset_load(preset_name, &preset, &err) ||
        (bits < RAW_BITS && cts_volume_quantise(volume, bits, preset.window_low_hu, preset.window_high_hu,
                                                options->n_threads, &levels, &err)) ||
        (levels && cts_volume_prepare(levels, options->n_threads, &err)))
        result = fail(&err);
    for (int view = 0; view < N_VIEWS && !result; view++)
        result = measure(levels ? levels : volume, &preset, view, bits, options, means);
    cts_volume_free(&levels);
    return result;
}

static int measure_series(const char *folder, const Options *options, Means *means)
{
    CtsVolume *volume = NULL;
    CtsError err = {0};
    int result = 0;
    if (bench_load(folder, &volume, &err))
        return fail(&err);
    printf("%d x %d x %d voxels, 1024 x 1024 pixels, medians of %d rounds, %d thread%s\n", volume->dims[0],
           volume->dims[1], volume->dims[2], options->rounds, options->n_threads, options->n_threads > 1 ? "s" : "");
    for (int bits = PAPER_BITS; bits <= RAW_BITS && !result; bits += RAW_BITS - PAPER_BITS)
        for (int preset = 0; preset < N_PRESETS && !result; preset++)
            result = measure_volume(volume, presets[preset], bits, options, means);
    cts_volume_free(&volume);
    return result;
}

int main(int argc, char **argv)
{
    Options options = {.rounds = 5, .n_threads = cts_threads(0)};
    Means means = {0};
    int option, result = 0;
    while ((option = getopt(argc, argv, "r:t:")) != -1) {
        if (option == '?') {
            fprintf(stderr, "usage: paper_table [-r ROUNDS] [-t THREADS] FOLDER...\n");
            return 2;
        }
        if (option == 'r')
            options.rounds = bench_rounds(optarg, 5);
        else
            options.n_threads = cts_threads(atoi(optarg));
    }
    for (int i = optind; i < argc && !result; i++)
        result = measure_series(argv[i], &options, &means);
    for (int paper = 1; paper >= 0 && means.n[paper] > 0 && !result; paper--) {
        printf("mean, %s", paper ? "8 bits:" : "raw:   ");
        for (int e = 1; e < N_ENGINES; e++)
            printf("  %s %.1f %% (paper %.1f)", cts_engine_names[engines[e]], means.sum[paper][e] / means.n[paper],
                   paper_mean[e]);
        printf("\n");
    }
    return result;
}
