#include "core/volume/components.h"

#include "base/mem.h"
#include <string.h>

/* The start of a run sets one bit and its end, one past the last voxel, another; both alternate. Run number n is the
 * next to be stored; returns the number behind the row's runs. */
static uint32_t list_row(const uint64_t *row, size_t n_words, int nx, CtsRun *runs, uint32_t n)
{
    uint64_t before = 0;
    bool inside = false;
    for (size_t w = 0; w < n_words; w++) {
        uint64_t edges = row[w] ^ (row[w] << 1 | before);
        before = row[w] >> 63;
        for (; edges; edges &= edges - 1) {
            const uint32_t at = (uint32_t)(64 * w) + (uint32_t)__builtin_ctzll(edges);
            if (!inside)
                runs[n] = (CtsRun){.first = at, .part = n};
            else
                runs[n++].end = at;
            inside = !inside;
        }
    }
    if (inside)
        runs[n++].end = (uint32_t)nx;
    return n;
}

/* CtsRun.part is the parent link until the labels are known: a run's parent never follows it. */
static uint32_t root_of_run(CtsRun *runs, uint32_t n)
{
    while (runs[n].part != n) {
        runs[n].part = runs[runs[n].part].part;
        n = runs[n].part;
    }
    return n;
}

/* reach: 1 if runs that end where others begin are connected, by an edge or a corner; else 0. */
static void join_rows(CtsComponents *p, size_t row_a, size_t row_b, uint32_t reach)
{
    uint32_t a = p->row_start[row_a], b = p->row_start[row_b];
    const uint32_t end_a = p->row_start[row_a + 1], end_b = p->row_start[row_b + 1];
    while (a < end_a && b < end_b) {
        /* Most adjacent runs are already joined, which is visible without searching their roots. */
        if (p->runs[a].first < p->runs[b].end + reach && p->runs[b].first < p->runs[a].end + reach &&
            p->runs[a].part != p->runs[b].part) {
            const uint32_t ra = root_of_run(p->runs, a), rb = root_of_run(p->runs, b);
            if (ra < rb)
                p->runs[rb].part = ra;
            else
                p->runs[ra].part = rb;
        }
        if (p->runs[a].end < p->runs[b].end)
            a++;
        else
            b++;
    }
}

/* Runs for which memory is allocated at first, for each row: few volumes need more. Measured: at most 3. */
enum { RUNS_A_ROW = 4 };

static CtsStatus list_runs(CtsComponents *p, const CtsBits *bits, CtsError *err)
{
    const size_t n_rows = (size_t)bits->dims[1] * (size_t)bits->dims[2], n_words = bits->row_words;
    const size_t most = (size_t)bits->dims[0] / 2 + 1; /* of a row */
    size_t room = RUNS_A_ROW * n_rows + most;
    uint32_t n = 0;
    CtsStatus st;
    cts_components_free(p);
    *p = (CtsComponents){.dims = {bits->dims[0], bits->dims[1], bits->dims[2]}};
    if ((st = cts_alloc_array(&p->row_start, n_rows + 1, err)) || (st = cts_alloc_array(&p->runs, room, err)))
        return st;
    for (size_t row = 0; row < n_rows; row++) {
        if (n >= UINT32_MAX - most)
            return cts_fail(err, CTS_ERR_MEMORY, "a mask of more than %u runs is too ragged", n);
        if (room - n < most && (st = cts_resize_array(&p->runs, n, room = 2 * room, err)))
            return st;
        p->row_start[row] = n;
        n = list_row(bits->words + row * n_words, n_words, bits->dims[0], p->runs, n);
    }
    p->row_start[n_rows] = n;
    p->n_runs = n;
    return CTS_OK;
}

/* Runs are in order and parents precede their children, so one pass suffices. */
static CtsStatus number_components(CtsComponents *p, CtsError *err)
{
    const size_t ny = (size_t)p->dims[1];
    for (uint32_t run = 0; run < p->n_runs; run++)
        p->n_parts += p->runs[run].part == run;
    const CtsStatus st = cts_alloc_zeroed(&p->parts, p->n_parts, err);
    uint32_t next = 0;
    uint32_t r = 0;
    for (int k = 0; k < p->dims[2] && !st; k++)
        for (int j = 0; j < p->dims[1]; j++)
            for (const uint32_t end = p->row_start[(size_t)k * ny + (size_t)j + 1]; r < end; r++) {
                CtsRun *const run = &p->runs[r];
                run->part = run->part == r ? next++ : p->runs[run->part].part;
                CtsComponent *const part = &p->parts[run->part];
                if (!part->n_voxels)
                    part->box = CTS_NO_VOXELS;
                cts_voxel_box_grow(&part->box, (int)run->first, (int)run->end - 1, j, k);
                part->n_voxels += run->end - run->first;
            }
    return st;
}

CtsStatus cts_components_join(CtsComponents *p, CtsConnection connection, CtsError *err)
{
    const size_t ny = (size_t)p->dims[1];
    const uint32_t reach = connection == CTS_CONNECTED_BY_CORNERS;
    for (size_t k = 0, row = 0; k < (size_t)p->dims[2]; k++)
        for (size_t j = 0; j < ny; j++, row++) {
            if (j > 0)
                join_rows(p, row - 1, row, reach);
            if (k == 0 || connection == CTS_CONNECTED_IN_SLICE)
                continue;
            join_rows(p, row - ny, row, reach);
            if (reach && j > 0)
                join_rows(p, row - ny - 1, row, reach);
            if (reach && j + 1 < ny)
                join_rows(p, row - ny + 1, row, reach);
        }
    return number_components(p, err);
}

CtsStatus cts_components_find(CtsComponents *p, const CtsBits *bits, CtsConnection connection, CtsError *err)
{
    CtsStatus st = list_runs(p, bits, err);
    if (st || (st = cts_components_join(p, connection, err)))
        cts_components_free(p);
    return st;
}

CtsStatus cts_components_count_in(const CtsComponents *p, const CtsBits *bits, uint64_t **count, CtsError *err)
{
    const CtsStatus st = cts_alloc_zeroed(count, p->n_parts, err);
    for (int k = 0; !st && k < bits->dims[2]; k++)
        for (int j = 0; j < bits->dims[1]; j++) {
            const uint64_t *row = cts_bits_row(bits, j, k);
            const size_t at = (size_t)k * (size_t)bits->dims[1] + (size_t)j;
            for (uint32_t r = p->row_start[at]; r < p->row_start[at + 1]; r++)
                (*count)[p->runs[r].part] += cts_bits_count_run(row, (int)p->runs[r].first, (int)p->runs[r].end);
        }
    return st;
}

void cts_components_free(CtsComponents *p)
{
    cts_free(&p->runs);
    cts_free(&p->row_start);
    cts_free(&p->parts);
}

void cts_components_paint_slice(const CtsComponents *p, const uint8_t *flags, int k, const CtsBits *under,
                                CtsBits *slice)
{
    const size_t n_bytes = cts_bits_n_words(slice) * sizeof *slice->words;
    const uint32_t *const row_start = p->row_start + (size_t)k * (size_t)p->dims[1];
    if (under)
        memcpy(slice->words, under->words, n_bytes);
    else
        memset(slice->words, 0, n_bytes);
    for (int j = 0; j < p->dims[1]; j++)
        for (uint32_t r = row_start[j]; r < row_start[j + 1]; r++)
            if (flags[p->runs[r].part])
                cts_bits_fill(cts_bits_row(slice, j, 0), (int)p->runs[r].first, (int)p->runs[r].end);
}

void cts_components_paint(const CtsComponents *p, const uint8_t *flags, CtsBits *bits)
{
    for (int k = 0; k < p->dims[2]; k++) {
        CtsBits slice = cts_bits_slice(bits, k);
        cts_components_paint_slice(p, flags, k, NULL, &slice);
    }
}
