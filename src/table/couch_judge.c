#include "table/couch_judge.h"

#include "base/mem.h"
#include <math.h>
#include <omp.h>

static const double SMALL_MM3 = 500, BODY_THICK_MM = 9, LIMIT_MM = 40;
/* The mean area across the table over the square of the thickness: about 1 for a limb, 3 for a hand, W / T for a sheet
 * W wide and T thick. */
static const double SHEET_AREA = 8, DOUBTFUL_AREA = 5;
/* A rod thinner than this that runs through all slices, at least so long, so much longer than thick. */
static const double ROD_THICK_MM = 25, ROD_LONG_MM = 100, ROD_VOLUME = 8;
static const double TIP_NEAR_MM = 12, TIP_LARGEST_MM = 60, TIP_MM3 = 100, TIP_HU = -200;

/* HOLLOW: thick somewhere, but a sheet or a rod on the whole; body if it holds the body, as a phantom's skull does. */
typedef enum Kind { FOREIGN, HOLLOW, DOUBTFUL, BODY } Kind;

static CtsStatus kind_of(const CouchScene *scene, const CtsParts *p, uint32_t part, Kind *kind, CtsError *err)
{
    const CtsPart *it = &p->parts[part];
    const double mm3 = (double)it->n_voxels * scene->voxel_mm3;
    const int head = scene->head_axis;
    *kind = FOREIGN;
    if (mm3 < SMALL_MM3)
        return CTS_OK;
    double thick_mm;
    const CtsStatus st = couch_thickness(scene, p, part, LIMIT_MM, &thick_mm, err);
    if (st || thick_mm < BODY_THICK_MM)
        return st;
    const double long_mm = (it->hi[head] - it->lo[head] + 1) * scene->spacing_mm[head];
    const double area = mm3 / (long_mm * thick_mm * thick_mm);
    const bool through = it->lo[head] == 0 && it->hi[head] == p->dims[head] - 1;
    const bool is_rod = thick_mm < ROD_THICK_MM && through && long_mm > ROD_LONG_MM &&
                        mm3 > ROD_VOLUME * thick_mm * thick_mm * thick_mm;
    if (thick_mm >= LIMIT_MM)
        *kind = BODY;
    else if (area >= SHEET_AREA || is_rod)
        *kind = HOLLOW;
    else
        *kind = area >= DOUBTFUL_AREA ? DOUBTFUL : BODY;
    return CTS_OK;
}

static CtsStatus cells_of(const CouchScene *scene, const CouchGrid *g, const CtsParts *p, uint32_t part, CtsBits *cells,
                          CtsError *err)
{
    uint8_t *flags = NULL;
    CtsStatus st = cts_alloc_zeroed(&flags, p->n_parts, err);
    if (!st) {
        flags[part] = 1;
        st = couch_cells(scene, g, p, flags, cells, NULL, err);
    }
    cts_free(&flags);
    return st;
}

static CtsStatus encloses(const CouchScene *scene, const CtsParts *p, uint32_t outer, uint32_t inner, bool *yes,
                          CtsError *err)
{
    CtsStatus st;
    CtsBits ring = {0}, held = {0};
    const CouchGrid g = couch_grid_whole(scene);
    if (!(st = cells_of(scene, &g, p, outer, &ring, err)) && !(st = cells_of(scene, &g, p, inner, &held, err)))
        st = couch_surrounds(scene, &ring, &held, yes, err);
    cts_bits_free(&ring);
    cts_bits_free(&held);
    return st;
}

/* The largest part of a kind, or n_parts. */
static uint32_t largest(const CtsParts *p, const uint8_t *kinds, Kind at_least)
{
    uint32_t best = p->n_parts;
    for (uint32_t n = 0; n < p->n_parts; n++)
        if (kinds[n] >= at_least && (best == p->n_parts || p->parts[n].n_voxels > p->parts[best].n_voxels))
            best = n;
    return best;
}

CtsStatus couch_judge(const CouchScene *scene, const CtsParts *p, CouchVerdict *verdict, CtsError *err)
{
    CtsStatus st;
    double doubtful_mm3 = 0;
    couch_verdict_free(verdict);
    if ((st = cts_alloc_zeroed(&verdict->body, p->n_parts, err)))
        return st;
    uint8_t *const kinds = verdict->body; /* kinds first, flags in the end */
    for (uint32_t n = 0; n < p->n_parts; n++) {
        Kind kind;
        if ((st = kind_of(scene, p, n, &kind, err)))
            return st;
        kinds[n] = (uint8_t)kind;
    }
    for (Kind kind = BODY; largest(p, kinds, BODY) == p->n_parts; kind--)
        if (largest(p, kinds, kind) < p->n_parts)
            kinds[largest(p, kinds, kind)] = BODY;
    const uint32_t main_part = largest(p, kinds, BODY);
    for (uint32_t n = 0; n < p->n_parts; n++) {
        bool holds_body = false;
        if ((kinds[n] == HOLLOW || kinds[n] == DOUBTFUL) && (st = encloses(scene, p, n, main_part, &holds_body, err)))
            return st;
        if (holds_body)
            kinds[n] = BODY;
    }
    for (uint32_t n = 0; n < p->n_parts; n++) {
        const double mm3 = (double)p->parts[n].n_voxels * scene->voxel_mm3;
        verdict->body_mm3 += kinds[n] == BODY ? mm3 : 0;
        doubtful_mm3 += kinds[n] == DOUBTFUL ? mm3 : 0;
    }
    const bool keep_doubtful = doubtful_mm3 > COUCH_UNCERTAIN_SHARE * verdict->body_mm3;
    for (uint32_t n = 0; n < p->n_parts; n++)
        kinds[n] = kinds[n] == BODY || (kinds[n] == DOUBTFUL && keep_doubtful);
    verdict->disputed_mm3 = keep_doubtful ? doubtful_mm3 : 0;
    return CTS_OK;
}

void couch_verdict_free(CouchVerdict *verdict)
{
    cts_free(&verdict->body);
    *verdict = (CouchVerdict){0};
}

/* What the runs of a part that is not body tell about it. */
typedef struct Tip {
    bool reaches_out; /* some of it is not inside the body */
    bool near;        /* some of it is near the body */
} Tip;

static void look_at_run(const CouchGrid *g, const CtsRun *run, int cj, int ck, const CtsBits *inside,
                        const CtsBits *near, Tip *tip)
{
    const int last = couch_cell(g, 0, (int)run->end - 1);
    for (int ci = couch_cell(g, 0, (int)run->first); ci <= last; ci++) {
        tip->reaches_out |= !cts_bits_get(inside, ci, cj, ck);
        tip->near |= cts_bits_get(near, ci, cj, ck);
    }
}

static double mean_hu(const CouchScene *scene, const CtsParts *p, uint32_t part)
{
    const CtsVolume *v = scene->volume;
    const CtsPart *it = &p->parts[part];
    uint64_t sum = 0;
    for (int k = it->lo[2]; k <= it->hi[2]; k++)
        for (int j = it->lo[1]; j <= it->hi[1]; j++) {
            const size_t row = (size_t)k * (size_t)p->dims[1] + (size_t)j;
            const uint16_t *grey = v->grey + row * (size_t)p->dims[0];
            for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++)
                for (uint32_t i = p->runs[r].first; p->runs[r].part == part && i < p->runs[r].end; i++)
                    sum += grey[i];
        }
    return v->hu_offset + v->hu_step * (double)sum / (double)it->n_voxels;
}

/* Cut off by one end of the stack, not by both as a tube is. */
static bool is_tip(const CouchScene *scene, const CtsParts *p, uint32_t part, const Tip *tip)
{
    const CtsPart *it = &p->parts[part];
    const int head = scene->head_axis;
    const bool at_foot = it->lo[head] == 0, at_head = it->hi[head] == p->dims[head] - 1;
    if (!tip->near || at_foot == at_head || (double)it->n_voxels * scene->voxel_mm3 < TIP_MM3)
        return false;
    for (int axis = 0; axis < 3; axis++)
        if ((it->hi[axis] - it->lo[axis] + 1) * scene->spacing_mm[axis] > TIP_LARGEST_MM)
            return false;
    return mean_hu(scene, p, part) > TIP_HU;
}

CtsStatus couch_adopt(const CouchScene *scene, const CouchGrid *g, const CtsParts *p, const CtsBits *body_cells,
                      const CtsBits *inside, CouchVerdict *verdict, bool *grew, CtsError *err)
{
    CtsStatus st;
    CtsBits near = {0};
    Tip *tips = NULL;
    *grew = false;
    if ((st = cts_alloc_zeroed(&tips, p->n_parts * (size_t)scene->n_threads, err)) ||
        (st = couch_near(scene, g, body_cells, TIP_NEAR_MM, &near, err)))
        goto end;
    const size_t ny = (size_t)p->dims[1], n_rows = ny * (size_t)p->dims[2];
#pragma omp parallel for schedule(static) num_threads(scene->n_threads)
    for (size_t row = 0; row < n_rows; row++) {
        Tip *mine = tips + p->n_parts * (size_t)omp_get_thread_num();
        for (uint32_t r = p->row_start[row]; r < p->row_start[row + 1]; r++)
            if (!verdict->body[p->runs[r].part])
                look_at_run(g, &p->runs[r], couch_cell(g, 1, (int)(row % ny)), couch_cell(g, 2, (int)(row / ny)),
                            inside, &near, &mine[p->runs[r].part]);
    }
    for (size_t n = p->n_parts; n < p->n_parts * (size_t)scene->n_threads; n++) {
        tips[n % p->n_parts].reaches_out |= tips[n].reaches_out;
        tips[n % p->n_parts].near |= tips[n].near;
    }
    for (uint32_t n = 0; n < p->n_parts; n++)
        if (!verdict->body[n] && (!tips[n].reaches_out || is_tip(scene, p, n, &tips[n])))
            verdict->body[n] = *grew = true;
end:
    cts_bits_free(&near);
    cts_free(&tips);
    return st;
}
