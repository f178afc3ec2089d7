#include "table/couch_body.h"

#include "base/mem.h"
#include "table/couch_sheet.h"
#include <math.h>

/* What is thin, what is not; how far an ear reaches. */
static const double THIN_MM = 10, BULKY_MM = 18, REACH_MM = 45;
static const double SLAB_MM = 30, SLAB_BULKY_MM = 50, SLAB_LONG_MM = 100;
/* A seam that frees less than this share of its own volume is no seam: it is given back. */
static const double LEAST_FREED = 0.15;
enum { DEEPEST_SLACK = 2 };

static void forget_cells(CouchBody *body)
{
    cts_bits_free(&body->any);
    cts_bits_free(&body->solid);
}

CtsStatus couch_body_find(const CouchScene *scene, CouchBody *body, const CtsBits *away, CtsError *err)
{
    CtsStatus st;
    CtsBits left = {0};
    if (away) {
        if ((st = cts_bits_new(&left, away->dims, err)))
            return st;
        cts_bits_combine(&left, CTS_BITS_COPY, &body->mask);
        cts_bits_combine(&left, CTS_BITS_AND_NOT, away);
    }
    forget_cells(body);
    body->is_cut = away != NULL;
    st = cts_parts_find(&body->parts, away ? &left : &body->mask, scene->n_threads, err);
    cts_bits_free(&left);
    return st ? st : couch_judge(scene, &body->parts, &body->verdict, err);
}

void couch_body_free(CouchBody *body)
{
    cts_bits_free(&body->mask);
    cts_parts_free(&body->parts);
    couch_verdict_free(&body->verdict);
    forget_cells(body);
}

CtsStatus couch_body_cells(const CouchScene *scene, const CouchGrid *g, CouchBody *body, CtsError *err)
{
    return body->any.words ? CTS_OK
                           : couch_cells(scene, g, &body->parts, body->verdict.body, &body->any, &body->solid, err);
}

static void hints_free(CouchHints *hints)
{
    cts_bits_free(&hints->core);
    cts_bits_free(&hints->inside);
    cts_bits_free(&hints->far);
}

/* Voxels of a run in the cells of its row. */
static uint64_t run_in_cells(const CtsRun *run, const CouchGrid *g, const uint64_t *cells)
{
    const int first = (int)run->first, end = (int)run->end, last_cell = couch_cell(g, 0, end - 1);
    uint64_t n = 0;
    for (int c = couch_cell(g, 0, first); c <= last_cell; c++) {
        if (!(cells[c >> 6] >> (c & 63) & 1))
            continue;
        const int from = couch_cell_end(g, 0, c - 1), to = couch_cell_end(g, 0, c);
        n += (uint64_t)((to < end ? to : end) - (from > first ? from : first));
    }
    return n;
}

/* Voxels of the body in the cells. */
static uint64_t count_in_cells(const CouchBody *b, const CouchGrid *g, const CtsBits *cells)
{
    uint64_t n = 0;
    const size_t ny = (size_t)b->parts.dims[1], n_rows = ny * (size_t)b->parts.dims[2];
    for (size_t row = 0; row < n_rows; row++) {
        const int cj = couch_cell(g, 1, (int)(row % ny)), ck = couch_cell(g, 2, (int)(row / ny));
        const uint64_t *in_row = cts_bits_row(cells, cj, ck);
        if (!cts_bits_count_run(in_row, 0, g->dims[0]))
            continue;
        for (uint32_t r = b->parts.row_start[row]; r < b->parts.row_start[row + 1]; r++)
            if (b->verdict.body[b->parts.runs[r].part])
                n += run_in_cells(&b->parts.runs[r], g, in_row);
    }
    return n;
}

/* A skull without flesh around something thick is no table: most of the body then has its thin parts on all sides. */
static CtsStatus forget_shell(const CouchScene *scene, const CtsBits *any, const CtsBits *thick, CouchHints *hints,
                              CtsError *err)
{
    CtsStatus st;
    CtsBits thin = {0};
    bool is_shell;
    if ((st = cts_bits_new(&thin, any->dims, err)))
        goto end;
    cts_bits_combine(&thin, CTS_BITS_COPY, any);
    cts_bits_combine(&thin, CTS_BITS_AND_NOT, thick);
    if (!(st = couch_surrounds(scene, &thin, &hints->core, &is_shell, err)) && is_shell)
        cts_bits_combine(&hints->far, CTS_BITS_AND_NOT, &hints->far);
end:
    cts_bits_free(&thin);
    return st;
}

/* What is far from anything thin_mm thick; far_mm3 is how much of the body it is. */
static CtsStatus look(const CouchScene *scene, const CouchGrid *g, CouchBody *b, double thin_mm, double bulky_mm,
                      CouchHints *hints, double *far_mm3, CtsError *err)
{
    CtsStatus st;
    CtsBits thick = {0};
    bool has_outside;
    *hints = (CouchHints){.grid = g};
    *far_mm3 = 0;
    if ((st = couch_body_cells(scene, g, b, err)) ||
        (st = couch_thick(scene, g, &b->any, &b->solid, thin_mm, bulky_mm, &hints->core, &thick, err)) ||
        (st = couch_inside(scene, g, &thick, &hints->inside, &has_outside, err)) ||
        (st = couch_far(scene, g, &b->any, &thick, &hints->inside, REACH_MM, &hints->far, err)))
        goto end;
    if (!cts_bits_is_empty(&hints->far))
        *far_mm3 = (double)count_in_cells(b, g, &hints->far) * scene->voxel_mm3;
    if (*far_mm3 <= COUCH_UNCERTAIN_SHARE * b->verdict.body_mm3)
        goto end;
    if (!(st = forget_shell(scene, &b->any, &thick, hints, err)) && cts_bits_is_empty(&hints->far))
        *far_mm3 = 0;
end:
    cts_bits_free(&thick);
    return st;
}

CtsStatus couch_find_slab(const CouchScene *scene, const CouchGrid *g, CouchBody *b, double *slab_mm3, CtsError *err)
{
    CtsStatus st;
    CouchHints hints = {0};
    CtsParts parts = {0};
    CtsBits through = {0};
    uint8_t *flags = NULL;
    const int head = scene->head_axis;
    if ((st = look(scene, g, b, SLAB_MM, SLAB_BULKY_MM, &hints, slab_mm3, err)) || *slab_mm3 == 0)
        goto end;
    *slab_mm3 = 0;
    if (cts_bits_is_empty(&hints.core) || g->dims[head] * g->cell_mm[head] < SLAB_LONG_MM)
        goto end;
    if ((st = cts_parts_find(&parts, &hints.far, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&flags, parts.n_parts, err)) || (st = cts_bits_new(&through, g->dims, err)))
        goto end;
    for (uint32_t n = 0; n < parts.n_parts; n++)
        flags[n] = parts.parts[n].lo[head] == 0 && parts.parts[n].hi[head] == g->dims[head] - 1;
    cts_parts_paint(&parts, flags, &through, scene->n_threads);
    *slab_mm3 = (double)count_in_cells(b, g, &through) * scene->voxel_mm3;
end:
    hints_free(&hints);
    cts_parts_free(&parts);
    cts_bits_free(&through);
    cts_free(&flags);
    return st;
}

/* The body of whole->mask less away, and in off what of the former body is not in it. */
static CtsStatus without(const CouchScene *scene, const CouchBody *whole, const CtsBits *body, const CtsBits *away,
                         CouchBody *cut, CtsBits *off, CtsError *err)
{
    CtsStatus st;
    CtsBits left = {0};
    couch_body_free(cut);
    cts_bits_free(off);
    if ((st = cts_bits_new(&cut->mask, whole->mask.dims, err)) || (st = cts_bits_new(off, whole->mask.dims, err)) ||
        (st = cts_bits_new(&left, whole->mask.dims, err)))
        goto end;
    cts_bits_combine(&cut->mask, CTS_BITS_COPY, &whole->mask);
    if ((st = couch_body_find(scene, cut, away, err)))
        goto end;
    cts_parts_paint(&cut->parts, cut->verdict.body, &left, scene->n_threads);
    cts_bits_combine(off, CTS_BITS_COPY, body);
    cts_bits_combine(off, CTS_BITS_AND_NOT, &left);
end:
    cts_bits_free(&left);
    return st;
}

/* Reduce away to those parts of off in which the seam frees enough; *changed says whether it lost anything. */
static CtsStatus give_back(const CouchScene *scene, const CtsBits *off, const CtsBits *seam, CtsBits *away,
                           bool *changed, CtsError *err)
{
    CtsStatus st;
    CtsParts parts = {0};
    CtsBits good = {0};
    uint64_t *n_seam = NULL;
    uint8_t *flags = NULL;
    if ((st = cts_parts_find(&parts, off, scene->n_threads, err)) ||
        (st = cts_alloc_zeroed(&n_seam, parts.n_parts, err)) || (st = cts_alloc_zeroed(&flags, parts.n_parts, err)) ||
        (st = cts_bits_new(&good, off->dims, err)))
        goto end;
    const size_t n_rows = (size_t)parts.dims[1] * (size_t)parts.dims[2];
    for (size_t row = 0; row < n_rows; row++) {
        const uint64_t *words = seam->words + row * seam->row_words;
        for (uint32_t r = parts.row_start[row]; r < parts.row_start[row + 1]; r++)
            n_seam[parts.runs[r].part] += cts_bits_count_run(words, (int)parts.runs[r].first, (int)parts.runs[r].end);
    }
    for (uint32_t n = 0; n < parts.n_parts; n++)
        flags[n] = (double)(parts.parts[n].n_voxels - n_seam[n]) > LEAST_FREED * (double)n_seam[n];
    cts_parts_paint(&parts, flags, &good, scene->n_threads);
    const uint64_t before = cts_bits_count(away);
    cts_bits_combine(away, CTS_BITS_AND, &good);
    *changed = cts_bits_count(away) != before;
end:
    cts_parts_free(&parts);
    cts_bits_free(&good);
    cts_free(&n_seam);
    cts_free(&flags);
    return st;
}

/* One attempt. *useful is false when the cut frees nothing or takes too much; the latter counts as attached to whole.
 */
static CtsStatus attempt(const CouchScene *scene, CouchBody *whole, const CtsBits *body, const CouchHints *hints,
                         int slack, CouchBody *cut, bool *useful, CtsError *err)
{
    CtsStatus st;
    CouchCut at = {0};
    CouchHints left = {0};
    CtsBits away = {0}, off = {0};
    bool changed;
    *useful = false;
    if ((st = couch_cut(scene, body, hints, slack, &at, err)) || (st = cts_bits_new(&away, body->dims, err)))
        goto end;
    cts_bits_combine(&away, CTS_BITS_COPY, &at.seam);
    cts_bits_combine(&away, CTS_BITS_OR, &at.loose);
    if ((st = without(scene, whole, body, &away, cut, &off, err)) ||
        (st = give_back(scene, &off, &at.seam, &away, &changed, err)) ||
        (changed && (st = without(scene, whole, body, &away, cut, &off, err))) ||
        (st = look(scene, hints->grid, cut, THIN_MM, BULKY_MM, &left, &cut->attached_mm3, err)))
        goto end;
    cut->cut_mm3 = (double)cts_bits_count(&off) * scene->voxel_mm3;
    const bool too_much = cut->cut_mm3 > COUCH_UNCERTAIN_SHARE * cut->verdict.body_mm3;
    if (too_much)
        whole->attached_mm3 = fmax(whole->attached_mm3, cut->cut_mm3);
    *useful = !too_much && cut->cut_mm3 > 0;
end:
    couch_cut_free(&at);
    hints_free(&left);
    cts_bits_free(&away);
    cts_bits_free(&off);
    return st;
}

static void swap(CouchBody *a, CouchBody *b)
{
    const CouchBody t = *a;
    *a = *b;
    *b = t;
}

CtsStatus couch_separate(const CouchScene *scene, const CouchGrid *g, CouchBody *whole, CtsError *err)
{
    CtsStatus st;
    CouchHints hints = {0};
    CtsBits body = {0};
    CouchBody cut = {0}, best = {0};
    bool useful, found = false;
    if ((st = look(scene, g, whole, THIN_MM, BULKY_MM, &hints, &whole->attached_mm3, err)) ||
        whole->attached_mm3 == 0 || (st = cts_bits_new(&body, whole->mask.dims, err)))
        goto end;
    cts_parts_paint(&whole->parts, whole->verdict.body, &body, scene->n_threads);
    /* The shallowest cut that leaves nothing attached; where all leave something, a deeper one has to leave much less.
     */
    for (int slack = 0; slack <= DEEPEST_SLACK && !(found && best.attached_mm3 == 0); slack++) {
        if ((st = attempt(scene, whole, &body, &hints, slack, &cut, &useful, err)))
            goto end;
        if (!useful || (found && cut.attached_mm3 > 0.5 * best.attached_mm3))
            continue;
        swap(&cut, &best);
        found = true;
    }
    if (found)
        swap(whole, &best);
end:
    hints_free(&hints);
    cts_bits_free(&body);
    couch_body_free(&cut);
    couch_body_free(&best);
    return st;
}
