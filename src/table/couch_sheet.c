#include "table/couch_sheet.h"

#include "base/mem.h"
#include <math.h>
#include <stdlib.h>

/* A sheet cut at 55 degrees is 1.75 times as long as it is thick; no table skin is thicker than about 8 mm. */
static const double SHEET_MM = 15, STEEPEST = 1.5, STEEPEST_ALONG = 0.35;
/* The share of a step by which a sheet's thickness along the line may change from one line to the next: what a shell of
 * 100 mm radius does at 55 degrees. A wedge that closes between shell and skin changes faster. */
static const float THICKNESS_DRIFT = 0.15F;

/* A part of a slice is sheet when so much of it lies in runs of the sheet. */
static const double SHEET_SHARE = 0.6;

typedef struct LineRun {
    int first, last; /* voxels along the line, last included */
    uint32_t line;
    float thickness; /* voxels, of the sheet hereabouts; 0: not known to be a sheet */
} LineRun;

/* All lines of the mask along one axis, in order of their place along the table, then across it. */
typedef struct Lines {
    int axis, across, along;
    int n_across, n_along;
    int step_limit[2]; /* voxels a face may move from one line to the next: across, along */
    uint32_t *start;
    LineRun *runs;
    uint32_t n_runs;
} Lines;

static size_t line_of(const Lines *l, const int at[3])
{
    return (size_t)at[l->along] * (size_t)l->n_across + (size_t)at[l->across];
}

static void lines_free(Lines *l)
{
    cts_free(&l->start);
    cts_free(&l->runs);
}

/* Visit the runs along axis 1 or 2 of all rows of words at `other` on the remaining axis: where a word differs from the
 * one before, runs start or end. With runs NULL they are counted in next[], else put at next[] and counted up. */
static void scan_across(const CtsBits *bits, const Lines *l, int other, uint32_t *next, LineRun *runs)
{
    const int n = bits->dims[l->axis], other_axis = 3 - l->axis;
    int at[3] = {0, 0, 0};
    at[other_axis] = other;
    for (size_t w = 0; w < bits->row_words; w++) {
        uint64_t before = 0;
        for (int t = 0; t <= n; t++) {
            const int j = l->axis == 1 ? t : other, k = l->axis == 1 ? other : t;
            const uint64_t word = t < n ? cts_bits_row(bits, j, k)[w] : 0;
            for (uint64_t change = word ^ before; change; change &= change - 1) {
                const int bit = __builtin_ctzll(change);
                at[0] = (int)(64 * w) + bit;
                const size_t line = line_of(l, at);
                uint32_t *const to = &next[line];
                const bool starts = word >> bit & 1;
                if (!runs)
                    *to += starts;
                else if (starts)
                    runs[*to] = (LineRun){.first = t, .line = (uint32_t)line};
                else
                    runs[(*to)++].last = t - 1;
            }
            before = word;
        }
    }
}

/* The same for lines along the rows themselves. */
static void scan_rows(const CtsBits *bits, const Lines *l, int k, uint32_t *next, LineRun *runs)
{
    for (int j = 0; j < bits->dims[1]; j++) {
        const int at[3] = {0, j, k};
        const size_t line = line_of(l, at);
        uint32_t *const to = &next[line];
        const uint64_t *row = cts_bits_row(bits, j, k);
        uint64_t carry = 0;
        bool inside = false;
        for (size_t w = 0; w < bits->row_words; w++) {
            for (uint64_t change = row[w] ^ (row[w] << 1 | carry); change; change &= change - 1) {
                const int t = (int)(64 * w) + __builtin_ctzll(change);
                if (!runs)
                    *to += !inside;
                else if (!inside)
                    runs[*to] = (LineRun){.first = t, .line = (uint32_t)line};
                else
                    runs[(*to)++].last = t - 1;
                inside = !inside;
            }
            carry = row[w] >> 63;
        }
        if (inside && runs)
            runs[(*to)++].last = bits->dims[0] - 1;
    }
}

static void scan(const CtsBits *bits, const Lines *l, uint32_t *next, LineRun *runs, int n_threads)
{
    const int n_other = l->axis == 0 ? bits->dims[2] : bits->dims[3 - l->axis];
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (int other = 0; other < n_other; other++) {
        if (l->axis == 0)
            scan_rows(bits, l, other, next, runs);
        else
            scan_across(bits, l, other, next, runs);
    }
}

static CtsStatus lines_new(Lines *l, const CouchScene *scene, const CtsBits *bits, int axis, CtsError *err)
{
    CtsStatus st = CTS_OK;
    uint32_t *next = NULL;
    *l = (Lines){.axis = axis, .along = scene->head_axis, .across = 3 - axis - scene->head_axis};
    l->n_across = bits->dims[l->across];
    l->n_along = bits->dims[l->along];
    const double mm = scene->spacing_mm[axis];
    l->step_limit[0] = (int)fmax(2, round(STEEPEST * scene->spacing_mm[l->across] / mm));
    l->step_limit[1] = (int)fmax(2, round(STEEPEST_ALONG * scene->spacing_mm[l->along] / mm));
    const size_t n_lines = (size_t)l->n_across * (size_t)l->n_along;
    if (n_lines >= UINT32_MAX)
        return cts_fail(err, CTS_ERR_MEMORY, "%zu lines are too many", n_lines);
    if ((st = cts_alloc_zeroed(&l->start, n_lines + 1, err)) || (st = cts_alloc_zeroed(&next, n_lines, err)))
        goto end;
    scan(bits, l, next, NULL, scene->n_threads);
    uint64_t total = 0;
    for (size_t n = 0; n < n_lines; n++) {
        l->start[n] = (uint32_t)total;
        total += next[n];
        next[n] = l->start[n];
    }
    if (total >= UINT32_MAX) {
        st = cts_fail(err, CTS_ERR_MEMORY, "a mask of %llu runs is too ragged", (unsigned long long)total);
        goto end;
    }
    l->start[n_lines] = l->n_runs = (uint32_t)total;
    if ((st = cts_alloc_array(&l->runs, l->n_runs, err)))
        goto end;
    scan(bits, l, next, l->runs, scene->n_threads);
end:
    cts_free(&next);
    if (st)
        lines_free(l);
    return st;
}

static int length(const LineRun *run)
{
    return run->last - run->first + 1;
}

/* The run of a line whose one face (side 0: first, 1: last) lies nearest to `at`, or NULL beyond limit. */
static LineRun *run_at(const Lines *l, size_t line, int side, int at, int limit)
{
    LineRun *best = NULL;
    int best_off = limit + 1;
    for (uint32_t r = l->start[line]; r < l->start[line + 1]; r++) {
        const int off = abs((side ? l->runs[r].last : l->runs[r].first) - at);
        if (off < best_off) {
            best = &l->runs[r];
            best_off = off;
        }
    }
    return best;
}

/* The run of a neighbouring line that goes on with both faces and about the same thickness, or NULL. */
static LineRun *goes_on(const Lines *l, const LineRun *from, size_t line, int limit)
{
    LineRun *to = run_at(l, line, 0, from->first, limit);
    if (!to || abs(to->last - from->last) > limit)
        return NULL;
    const double off = fabs(length(to) - (double)from->thickness);
    return off <= fmax(1.5, 0.2 * (double)from->thickness) ? to : NULL;
}

/* Whether the middle of a run lies in one of the cells. */
static bool in_cells(const Lines *l, const LineRun *run, const CouchGrid *g, const CtsBits *cells)
{
    int at[3];
    at[l->across] = (int)(run->line % (uint32_t)l->n_across);
    at[l->along] = (int)(run->line / (uint32_t)l->n_across);
    at[l->axis] = (run->first + run->last) / 2;
    return cts_bits_get(cells, couch_cell(g, 0, at[0]), couch_cell(g, 1, at[1]), couch_cell(g, 2, at[2]));
}

static size_t seed(const Lines *l, const CouchScene *scene, const CouchHints *hints, uint32_t *queue)
{
    size_t n = 0;
    const int limit = (int)(SHEET_MM / scene->spacing_mm[l->axis]);
    for (uint32_t r = 0; r < l->n_runs; r++)
        if (length(&l->runs[r]) <= limit && in_cells(l, &l->runs[r], hints->grid, &hints->far)) {
            l->runs[r].thickness = (float)length(&l->runs[r]);
            queue[n++] = r;
        }
    return n;
}

/* From the runs in the queue, follow the sheet line by line as far as it lies free. */
static void follow(const Lines *l, const CouchHints *hints, uint32_t *queue, size_t n)
{
    for (size_t q = 0; q < n; q++) {
        const LineRun *from = &l->runs[queue[q]];
        const size_t line = from->line;
        const int across = (int)(line % (size_t)l->n_across), along = (int)(line / (size_t)l->n_across);
        for (int way = 0; way < 4; way++) {
            const int step = way % 2 ? 1 : -1, place = (way < 2 ? across : along) + step;
            if (place < 0 || place >= (way < 2 ? l->n_across : l->n_along))
                continue;
            const size_t next = way < 2 ? line + (size_t)step : line + (size_t)step * (size_t)l->n_across;
            LineRun *to = goes_on(l, from, next, l->step_limit[way / 2]);
            if (!to || to->thickness > 0 || in_cells(l, to, hints->grid, &hints->inside))
                continue;
            const float change = (float)length(to) - from->thickness;
            to->thickness = from->thickness + fminf(fmaxf(change, -THICKNESS_DRIFT), THICKNESS_DRIFT);
            queue[n++] = (uint32_t)(to - l->runs);
        }
    }
}

/* A walk along one face of a sheet across a contact, from a free run to the next free one. */
typedef struct Walk {
    const LineRun **path; /* the runs in between */
    int n;
    const LineRun *end; /* NULL: the face does not go on */
    int bend;           /* sum of second differences of the face, voxels */
} Walk;

static void walk(const Lines *l, const LineRun *from, size_t line, size_t stride, int n_left, int limit, int side,
                 Walk *w)
{
    int face = side ? from->last : from->first, slope = 0;
    w->n = w->bend = 0;
    w->end = NULL;
    for (int step = 1; step <= n_left; step++) {
        const LineRun *run = run_at(l, line + (size_t)step * stride, side, face, limit);
        if (!run)
            return;
        const int next = side ? run->last : run->first;
        if (step > 1)
            w->bend += abs(next - face - slope);
        slope = next - face;
        face = next;
        if (run->thickness > 0) {
            w->end = run;
            return;
        }
        w->path[w->n++] = run;
    }
}

static void mark(const Lines *l, size_t line, int first, int last, CtsBits *seam)
{
    int at[3];
    at[l->across] = (int)(line % (size_t)l->n_across);
    at[l->along] = (int)(line / (size_t)l->n_across);
    for (at[l->axis] = first; at[l->axis] <= last; at[l->axis]++)
        cts_bits_set(seam, at[0], at[1], at[2]);
}

static void mark_walk(const Lines *l, const LineRun *from, size_t line, size_t stride, int side, const Walk *w,
                      int slack, CtsBits *seam)
{
    for (int n = 0; n < w->n; n++) {
        const LineRun *run = w->path[n];
        const double share = (n + 1.0) / (w->n + 1.0);
        const double thickness = (1 - share) * length(from) + share * length(w->end);
        int deep = (int)lround(thickness) + slack;
        if (length(run) <= deep + 1)
            deep = length(run);
        const int first = side ? run->last - deep + 1 : run->first;
        mark(l, line + (size_t)(n + 1) * stride, first, first + deep - 1, seam);
    }
}

/* Bridge every contact between two free runs along one direction (0: across the table, 1: along it). */
static void bridge(const Lines *l, int direction, int slack, Walk walks[2], CtsBits *seam)
{
    const size_t stride = direction ? (size_t)l->n_across : 1;
    const int limit = l->step_limit[direction];
    for (int along = 0; along < l->n_along; along++)
        for (int across = 0; across < l->n_across; across++) {
            const int n_left = direction ? l->n_along - 1 - along : l->n_across - 1 - across;
            const size_t line = (size_t)along * (size_t)l->n_across + (size_t)across;
            for (uint32_t r = l->start[line]; n_left && r < l->start[line + 1]; r++) {
                const LineRun *from = &l->runs[r], *next;
                if (from->thickness <= 0 || ((next = goes_on(l, from, line + stride, limit)) && next->thickness > 0))
                    continue;
                for (int side = 0; side < 2; side++)
                    walk(l, from, line, stride, n_left, limit, side, &walks[side]);
                if (!walks[0].end && !walks[1].end)
                    continue;
                /* Where both faces go on, a bump on one of them is what touches the sheet. */
                const int side = !walks[0].end || (walks[1].end && walks[1].bend < walks[0].bend);
                mark_walk(l, from, line, stride, side, &walks[side], slack, seam);
            }
        }
}

/* Every free run of the sheet. */
static void mark_sheet(const Lines *l, CtsBits *sheet)
{
    for (uint32_t r = 0; r < l->n_runs; r++)
        if (l->runs[r].thickness > 0)
            mark(l, l->runs[r].line, l->runs[r].first, l->runs[r].last, sheet);
}

static CtsStatus cut_lines(const CouchScene *scene, const CtsBits *body, const CouchHints *hints, int axis, int slack,
                           CtsBits *seam, CtsBits *sheet, CtsError *err)
{
    CtsStatus st = CTS_OK;
    Lines lines = {0};
    uint32_t *queue = NULL;
    Walk walks[2] = {{0}, {0}};
    if ((st = lines_new(&lines, scene, body, axis, err)))
        goto end;
    const size_t longest = (size_t)(lines.n_across > lines.n_along ? lines.n_across : lines.n_along);
    if ((st = cts_alloc_array(&queue, lines.n_runs, err)) || (st = cts_alloc_array(&walks[0].path, longest, err)) ||
        (st = cts_alloc_array(&walks[1].path, longest, err)))
        goto end;
    follow(&lines, hints, queue, seed(&lines, scene, hints, queue));
    bridge(&lines, 0, slack, walks, seam);
    bridge(&lines, 1, slack, walks, seam);
    mark_sheet(&lines, sheet);
end:
    cts_free(&queue);
    cts_free(&walks[0].path);
    cts_free(&walks[1].path);
    lines_free(&lines);
    return st;
}

/* For each part: how many of its voxels are in the sheet, and whether one is in a core cell. */
static void count_sheet(const CtsParts *p, const CtsBits *sheet, const CouchHints *hints, uint64_t *n_sheet,
                        uint8_t *has_core)
{
    const CouchGrid *g = hints->grid;
    const size_t ny = (size_t)p->dims[1], n_rows = ny * (size_t)p->dims[2];
    for (size_t row = 0; row < n_rows; row++) {
        const int j = (int)(row % ny), k = (int)(row / ny), cj = couch_cell(g, 1, j), ck = couch_cell(g, 2, k);
        for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++) {
            const int first = (int)p->runs[r].first, end = (int)p->runs[r].end;
            n_sheet[p->runs[r].part] += cts_bits_count_run(cts_bits_row(sheet, j, k), first, end);
            if (!has_core[p->runs[r].part])
                has_core[p->runs[r].part] =
                    cts_bits_count_run(cts_bits_row(&hints->core, cj, ck), couch_cell(g, 0, first),
                                       couch_cell(g, 0, end - 1) + 1) > 0;
        }
    }
}

/* Slices far apart step over the gap between sheet and body. So what hangs together within a slice, once the seam is
 * out, is loose when most of it is sheet and none of it deep in the body. */
static CtsStatus find_loose(const CouchScene *scene, const CtsBits *body, const CouchHints *hints, const CtsBits *sheet,
                            CouchCut *cut, CtsError *err)
{
    CtsStatus st;
    CtsBits rest = {0};
    CtsParts parts = {0};
    uint64_t *n_sheet = NULL;
    uint8_t *flags = NULL;
    if ((st = cts_bits_new(&rest, body->dims, err)))
        goto end;
    cts_bits_combine(&rest, CTS_BITS_COPY, body);
    cts_bits_combine(&rest, CTS_BITS_AND_NOT, &cut->seam);
    if ((st = cts_parts_find_in_slices(&parts, &rest, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&n_sheet, parts.n_parts, err)) || (st = cts_alloc_zeroed(&flags, parts.n_parts, err)))
        goto end;
    count_sheet(&parts, sheet, hints, n_sheet, flags);
    for (uint32_t n = 0; n < parts.n_parts; n++)
        flags[n] = !flags[n] && (double)n_sheet[n] >= SHEET_SHARE * (double)parts.parts[n].n_voxels;
    cts_parts_paint(&parts, flags, &cut->loose, scene->n_threads);
end:
    cts_bits_free(&rest);
    cts_parts_free(&parts);
    cts_free(&n_sheet);
    cts_free(&flags);
    return st;
}

CtsStatus couch_cut(const CouchScene *scene, const CtsBits *body, const CouchHints *hints, int slack, CouchCut *cut,
                    CtsError *err)
{
    CtsBits sheet = {0};
    CtsStatus st;
    couch_cut_free(cut);
    if ((st = cts_bits_new(&cut->seam, body->dims, err)) || (st = cts_bits_new(&cut->loose, body->dims, err)) ||
        (st = cts_bits_new(&sheet, body->dims, err)))
        goto end;
    for (int axis = 0; axis < 3 && !st; axis++)
        if (axis != scene->head_axis)
            st = cut_lines(scene, body, hints, axis, slack, &cut->seam, &sheet, err);
    if (!st && scene->head_axis == 2)
        st = find_loose(scene, body, hints, &sheet, cut, err);
end:
    cts_bits_free(&sheet);
    return st;
}

void couch_cut_free(CouchCut *cut)
{
    cts_bits_free(&cut->seam);
    cts_bits_free(&cut->loose);
}
