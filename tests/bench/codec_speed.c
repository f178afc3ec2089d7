/* Overhead of decoding a compressed series compared with its codec: codec_speed SERIES THREADS
 *
 * Loads the series, with sandboxed decoders, and decodes the same frames once more one by one in this process; best of
 * three each. The result is wall time / (the codec's own CPU time / threads): 1 is the optimum. */
#include "base/clock.h"
#include "base/file_bytes.h"
#include "ctsplat/series.h"
#include "dicom/header/slice.h"
#include "dicom/pixels/pixel_tasks.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* cpu_ms: of this process and its decoders. */
static double load_ms(const CtsSeries *series, int n_threads, double *cpu_ms)
{
    CtsVolume *volume = NULL;
    CtsError err = {0};
    const double start = cts_wall_ms(), cpu = cts_cpu_ms();
    if (cts_series_load(series, n_threads, NULL, &volume, NULL, &err))
        fprintf(stderr, "%s\n", err.text);
    const double took = cts_wall_ms() - start;
    *cpu_ms = cts_cpu_ms() - cpu;
    cts_volume_free(&volume);
    return took;
}

/* Without the 8 bytes in front of each fragment. */
static size_t join(uint8_t *stream, size_t n)
{
    size_t joined = 0;
    for (size_t pos = 0; pos + 8 <= n;) {
        const size_t length = stream[pos + 4] | (size_t)stream[pos + 5] << 8 | (size_t)stream[pos + 6] << 16;
        memmove(stream + joined, stream + pos + 8, length);
        joined += length;
        pos += 8 + length;
    }
    return joined;
}

/* CPU time of the codec alone. */
static double codec_ms(const CtsSeries *series)
{
    double total = 0;
    CtsError err = {0};
    for (int k = 0; k < series->n_slices; k++) {
        const CtsSlice *s = series->slices[k];
        const CtsFrameFormat format = {.syntax = s->syntax,
                                       .columns = s->columns,
                                       .rows = s->rows,
                                       .bits_allocated = s->bits_allocated,
                                       .bits_stored = s->bits_stored,
                                       .high_bit = s->high_bit,
                                       .is_signed = s->is_signed,
                                       .padding_word = s->padding_word};
        CtsFileBytes file;
        uint8_t *stream = malloc((size_t)s->pixel_bytes);
        void *pixels = malloc(cts_frame_bytes(&format) + 1);
        CtsStatus st = cts_slice_open(s, &file, &err);
        if (!st && stream && pixels &&
            !(st = cts_file_bytes_read(&file, stream, (size_t)s->pixel_bytes, s->pixel_offset, &err))) {
            const size_t n = join(stream, (size_t)s->pixel_bytes);
            const double start = cts_cpu_ms();
            st = cts_codec_decode(&format, stream, n, pixels, &err);
            total += cts_cpu_ms() - start;
        }
        if (st)
            fprintf(stderr, "%s\n", err.text);
        cts_file_bytes_close(&file);
        free(stream);
        free(pixels);
    }
    return total;
}

int main(int argc, char **argv)
{
    CtsSeriesList *list = NULL;
    CtsError err = {0};
    const char *path = argc == 3 ? argv[1] : ".";
    const int n_threads = argc == 3 ? atoi(argv[2]) : 1;
    if (cts_dcm_start_decoders(&err) || cts_series_find(&path, 1, n_threads, &list, NULL, &err)) {
        fprintf(stderr, "%s\n", err.text);
        return 1;
    }
    const CtsSeries *series = &list->items[0];
    double wall = 1e300, cpu = 1e300, codec = 1e300;
    for (int i = 0; i < 3; i++) {
        double load_cpu;
        const double w = load_ms(series, n_threads, &load_cpu), c = codec_ms(series);
        wall = w < wall ? w : wall;
        cpu = load_cpu < cpu ? load_cpu : cpu;
        codec = c < codec ? c : codec;
    }
    printf(
        "%s: %d slices, %d threads: load %.0f ms with %.0f ms of CPU, codec alone %.0f ms of CPU; wall ratio %.2f, CPU "
        "ratio %.2f\n",
        series->transfer_syntax, series->n_slices, n_threads, wall, cpu, codec, wall / (codec / n_threads),
        cpu / codec);
    cts_series_list_free(&list);
    return 0;
}
