/* CPU time of the openness field: openness_speed FOLDER [ROUNDS]
 *
 * Prints, for the presets bone, skin and muscle, the median of the CPU time by one thread and by all, the number of
 * blocks, and whether both give the same bytes as plain C. Never a timed test. */
#include "bench_series.h"

#include "base/clock.h"
#include "base/cpu.h"
#include "core/scene/openness.h"
#include <stdio.h>
#include <string.h>

static int measure_preset(const CtsModel *model, const char *name, int rounds)
{
    static const struct {
        unsigned cpu;
        int n_threads;
    } ways[] = {{0, 1}, {~0u, 1}, {~0u, 2}};
    CtsPreset preset;
    CtsError err = {0};
    CtsOpenness *first = NULL;
    if (cts_preset_load(name, &preset, &err)) {
        fprintf(stderr, "openness_speed: %s\n", err.text);
        return 1;
    }
    printf("%-8s", name);
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        double ms[BENCH_MAX_ROUNDS];
        bool same = true;
        cts_cpu_set_mask(ways[w].cpu);
        for (int r = 0; r < rounds; r++) {
            CtsOpenness *o;
            const double start = cts_cpu_ms();
            if (cts_openness_new(&o, model, &preset, ways[w].n_threads, &err)) {
                fprintf(stderr, "openness_speed: %s\n", err.text);
                return 1;
            }
            ms[r] = cts_cpu_ms() - start;
            const size_t n = (size_t)o->n[0] * (size_t)o->n[1] * (size_t)o->n[2];
            if (!first) {
                first = o;
                printf(" %zu blocks", n);
                continue;
            }
            same = same && !memcmp(o->square, first->square, n * sizeof *o->square);
            cts_openness_free(&o);
        }
        printf("  %s, %d threads: %.1f ms%s", ways[w].cpu ? "SIMD" : "plain", ways[w].n_threads,
               bench_median(ms, rounds), same ? "" : " DIFFERS");
    }
    printf("\n");
    cts_cpu_set_mask(~0u);
    cts_openness_free(&first);
    return 0;
}

static int measure(const CtsModel *model, int rounds)
{
    int result = 0;
    for (int p = 0; p < 3 && !result; p++)
        result = measure_preset(model, (const char *const[]){"bone", "skin", "muscle"}[p], rounds);
    return result;
}

int main(int argc, char **argv)
{
    return bench_main(argc, argv, "openness_speed", measure);
}
