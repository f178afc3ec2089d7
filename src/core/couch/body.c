#include "core/couch/table_removal.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <stdatomic.h>
#include <string.h>

/* Half the thickness of thick parts. Fingers and the tips of ears are thicker than 6 mm, blankets, tubes and plates are
 * not. Measured: 2 to 4 mm remove the same; with 2 mm a mask stays in a test. */
static const double THICK_RADIUS_MM = 3;
/* Volume below which a part is noise, kept only in the margin around the patient: a cube of 8 mm. Measured: 250 to 2000
 * mm3 give the same. */
static const double NOISE_MM3 = 500;
/* Diagonal of a thin part that is longer than an ear, a nose or a fold of skin: a mask, a strap or a blanket, unless it
 * is bone. Measured: 80 to 200 mm give the same. */
static const double SHELL_MM = 100;
/* HU of bone, denser than masks and straps. Measured: 200 to 600 HU give the same. */
static const double BONE_HU = 300;
/* Largest share of the body that such parts may have: more than a mask has of a head may be all that there is.
 * Measured: a twentieth keeps the mask of a test, a fifth removes a doubtful part of another. */
static const double SHELL_SHARE = 0.1;
/* Depth to which the soft edge of the skin reaches. Measured: -150 HU is reached within 1.4 mm at 99 of 100 places of a
 * chest and a head. */
static const double SKIN_MM = 3;
/* Distance of the nodes of the body's mask, and half a side of the cube of which a node has the share. As large as
 * SKIN_MM, so that the share falls to about 0 at the skin. */
static const double AROUND_MM = 3;
static const CtsReach ONE = {.diamond = 1};

/* The search, and numbers of its loops over sections. */
typedef struct BodySearch {
    CtsTableSearch *table; /* from find_thin() on its plates are the body's thin protrusions */
    CtsComponents parts;
    const uint8_t *flags, *others; /* of parts */
    _Atomic uint64_t n_thin;
} BodySearch;

/* flags[]: the largest part, and those of sufficient size that are mostly thick; sized[]: the other ones of sufficient
 * size. Overwrites body->dense. */
static CtsStatus choose_patient(BodySearch *s, uint8_t *flags, uint8_t *sized, CtsError *err)
{
    CtsTableSearch *const r = s->table;
    const CtsComponents *const p = &s->parts;
    CtsBits *const others = &r->body.dense;
    CtsStatus st;
    uint64_t *thick = NULL;
    uint32_t largest = 0, n_sized = 0;
    for (uint32_t n = 1; n < p->n_parts; n++)
        largest = p->parts[n].n_voxels > p->parts[largest].n_voxels ? n : largest;
    for (uint32_t n = 0; n < p->n_parts; n++) {
        flags[n] = n == largest;
        sized[n] = n != largest && (double)p->parts[n].n_voxels * r->plan.voxel_mm3 >= NOISE_MM3;
        n_sized += sized[n];
    }
    if (!n_sized)
        return CTS_OK;
    cts_components_paint(p, sized, others);
    cts_each_section(r->workers, r->n_threads, cts_open_section, others,
                     cts_reach_mm(THICK_RADIUS_MM, r->plan.spacing_mm), others);
    if ((st = cts_components_count_in(p, others, &thick, err)))
        return st;
    for (uint32_t n = 0; n < p->n_parts; n++)
        if (sized[n] && 2 * thick[n] >= p->parts[n].n_voxels) {
            flags[n] = 1;
            sized[n] = 0;
        }
    cts_free(&thick);
    return CTS_OK;
}

/* Voxels that lie neither in plates nor next to them. */
static void find_rest(void *context, int worker, size_t first, size_t end)
{
    const CtsTableSearch *const r = ((BodySearch *)context)->table;
    for (int k = (int)first; k < (int)end; k++) {
        const CtsBits section = cts_bits_slice(&r->sections, k);
        CtsBits rest = cts_bits_slice(&r->body.foreign, k);
        cts_dilate_section(&r->workers[worker], cts_bits_row(&r->plates, 0, k), ONE, rest.words);
        cts_bits_combine(&rest, CTS_BITS_NOT, &rest);
        cts_bits_combine(&rest, CTS_BITS_AND, &section);
    }
}

/* The patient's parts, with their neighbours in plates' margins, and foreign ones with the plates. */
static void paint_dense(void *context, int worker, size_t first, size_t end)
{
    const BodySearch *const s = context;
    const CtsTableSearch *const r = s->table;
    for (int k = (int)first; k < (int)end; k++) {
        const CtsBits section = cts_bits_slice(&r->sections, k), plates = cts_bits_slice(&r->plates, k);
        CtsBits dense = cts_bits_slice(&r->body.dense, k), foreign = cts_bits_slice(&r->body.foreign, k);
        cts_components_paint_slice(&s->parts, s->flags, k, NULL, &dense);
        cts_components_paint_slice(&s->parts, s->others, k, &plates, &foreign);
        cts_dilate_section(&r->workers[worker], dense.words, ONE, dense.words);
        cts_bits_combine(&dense, CTS_BITS_AND, &section);
        cts_bits_combine(&dense, CTS_BITS_AND_NOT, &plates);
    }
}

static void each_section(BodySearch *s, cts_work_fn work)
{
    cts_parallel(s->table->n_threads, (size_t)s->table->plan.dims[2], 1, work, s);
}

/* The patient's dense bits: connected parts after removal of the plates' voxels and their neighbours, which are added
 * again afterwards. */
static CtsStatus find_dense(BodySearch *s, CtsError *err)
{
    CtsStatus st;
    CtsBody *const body = &s->table->body;
    CtsComponents *const p = &s->parts;
    uint8_t *flags = NULL, *sized = NULL;
    each_section(s, find_rest);
    if ((st = cts_components_find(p, &body->foreign, CTS_CONNECTED_BY_FACES, err)) ||
        (st = cts_alloc_array(&flags, p->n_parts, err)) || (st = cts_alloc_array(&sized, p->n_parts, err)) ||
        (st = choose_patient(s, flags, sized, err)))
        goto end;
    s->flags = flags;
    s->others = sized;
    each_section(s, paint_dense);
    for (uint32_t n = 0; n < p->n_parts; n++)
        body->mm3 += flags[n] ? (double)p->parts[n].n_voxels * s->table->plan.voxel_mm3 : 0;
end:
    cts_components_free(p);
    cts_free(&flags);
    cts_free(&sized);
    return st;
}

/* The whole is the complement of the air outside. */
CtsStatus cts_body_enclose(CtsTableSearch *r, const CtsBits *dense, bool has_table, CtsError *err)
{
    CtsBits *const whole = &r->body.whole;
    CtsComponents air = {0};
    uint8_t *outside = NULL;
    CtsStatus st = whole->words ? CTS_OK : cts_bits_new_unset(whole, r->plan.dims, err);
    if (st)
        return st;
    cts_bits_combine(whole, CTS_BITS_NOT, dense);
    if (!(st = cts_components_find(&air, whole, CTS_CONNECTED_IN_SLICE, err)) &&
        !(st = cts_alloc_array(&outside, air.n_parts, err)) &&
        !(st = cts_air_outside(r, &air, has_table, outside, err))) {
        cts_components_paint(&air, outside, whole);
        cts_bits_combine(&r->body.foreign, CTS_BITS_AND, whole);
        cts_bits_combine(whole, CTS_BITS_NOT, whole);
    }
    cts_components_free(&air);
    cts_free(&outside);
    return st;
}

static void find_thin(void *context, int worker, size_t first, size_t end)
{
    BodySearch *const s = context;
    const CtsTableSearch *const r = s->table;
    uint64_t n_thin = 0;
    for (int k = (int)first; k < (int)end; k++) {
        const CtsBits dense = cts_bits_slice(&r->body.dense, k);
        CtsBits thin = cts_bits_slice(&r->plates, k);
        cts_thin_section(&r->workers[worker], cts_bits_row(&r->body.whole, 0, k),
                         cts_reach_mm(THICK_RADIUS_MM, r->plan.spacing_mm), thin.words);
        cts_bits_combine(&thin, CTS_BITS_AND, &dense);
        n_thin += cts_bits_count(&thin);
    }
    atomic_fetch_add(&s->n_thin, n_thin);
}

static bool is_longer(const CtsSectionPlan *plan, const CtsComponent *part, double length_mm)
{
    double square = 0;
    for (int axis = 0; axis < 3; axis++)
        square += pow((part->box.hi[axis] - part->box.lo[axis] + 1) * plan->spacing_mm[axis], 2);
    return square > length_mm * length_mm;
}

/* Of the connected parts longer than this, the bits become those that are not mostly denser than so many HU. */
static CtsStatus keep_light(const CtsTableSearch *r, CtsBits *bits, double length_mm, double hu, CtsError *err)
{
    CtsStatus st;
    CtsComponents p = {0};
    uint8_t *flags = NULL;
    uint64_t *n_denser = NULL;
    if ((st = cts_components_find(&p, bits, CTS_CONNECTED_BY_FACES, err)) ||
        (st = cts_alloc_array(&flags, p.n_parts, err)) || (st = cts_alloc_zeroed(&n_denser, p.n_parts, err)))
        goto end;
    for (uint32_t part = 0; part < p.n_parts; part++)
        flags[part] = is_longer(&r->plan, &p.parts[part], length_mm);
    for (int row = 0; row < p.dims[1] * p.dims[2]; row++)
        for (const CtsRun *run = p.runs + p.row_start[row]; run < p.runs + p.row_start[row + 1]; run++)
            for (uint32_t i = run->first; i < run->end && flags[run->part]; i++)
                n_denser[run->part] += cts_section_hu(r, (int)i, row % p.dims[1], row / p.dims[1]) > hu;
    for (uint32_t part = 0; part < p.n_parts; part++)
        flags[part] = flags[part] && 2 * n_denser[part] < p.parts[part].n_voxels;
    cts_components_paint(&p, flags, bits);
end:
    cts_components_free(&p);
    cts_free(&flags);
    cts_free(&n_denser);
    return st;
}

/* Marks masks and straps on the body as not part of the patient. */
static CtsStatus drop_shells(CtsTableSearch *r, bool has_table, CtsError *err)
{
    CtsBody *const body = &r->body;
    CtsBits *const thin = &r->plates;
    const CtsStatus st = keep_light(r, thin, SHELL_MM, BONE_HU, err);
    const double mm3 = st ? 0 : (double)cts_bits_count(thin) * r->plan.voxel_mm3;
    if (mm3 == 0 || mm3 > SHELL_SHARE * body->mm3)
        return st;
    cts_bits_combine(&body->foreign, CTS_BITS_OR, thin);
    cts_bits_combine(&body->dense, CTS_BITS_AND_NOT, thin);
    body->mm3 -= mm3;
    body->thin_mm3 -= mm3;
    return cts_body_enclose(r, &body->dense, has_table, err);
}

CtsStatus cts_body_find(CtsTableSearch *r, CtsError *err)
{
    CtsStatus st;
    BodySearch s = {.table = r};
    CtsBody *const body = &r->body;
    if ((st = keep_light(r, &r->plates, 0, CTS_TABLE_HU, err)) ||
        (st = keep_light(r, &r->doubtful, 0, CTS_TABLE_HU, err)) ||
        (st = cts_bits_new_unset(&body->dense, r->plan.dims, err)) ||
        (st = cts_bits_new_unset(&body->foreign, r->plan.dims, err)))
        return st;
    const bool has_table = cts_bits_any(&r->plates);
    if ((st = find_dense(&s, err)) || (st = cts_body_enclose(r, &body->dense, has_table, err)))
        return st;
    each_section(&s, find_thin);
    body->thin_mm3 = (double)atomic_load(&s.n_thin) * r->plan.voxel_mm3;
    return drop_shells(r, has_table, err);
}

/* A section where it and both its neighbours are body, eroded: the complement is dilated and inverted. */
static void narrow_section(const CtsBits *whole, int k, CtsReach reach, CtsMorphology *m, CtsBits *to)
{
    const int last = whole->dims[2] - 1;
    const uint64_t *own = cts_bits_row(whole, 0, k), *before = cts_bits_row(whole, 0, k ? k - 1 : 0);
    const uint64_t *behind = cts_bits_row(whole, 0, k < last ? k + 1 : last);
    for (size_t w = 0; w < m->n_words; w++)
        to->words[w] = ~(own[w] & before[w] & behind[w]) & cts_bits_mask(whole, w % m->row_words);
    cts_dilate_section(m, to->words, reach, to->words);
    cts_bits_combine(to, CTS_BITS_NOT, to);
}

/* Of each section, at nodes that lie step[0] columns and step[1] rows apart, the share of body within as many voxels.
 */
typedef struct Sharing {
    CtsTableSearch *table;
    CtsBits narrow; /* a section for each worker */
    int n[3], step[3];
    uint8_t *section; /* n[0] x n[1] nodes for each section, of 255 */
    uint16_t *counts; /* for each worker: of each row, at n[0] nodes */
} Sharing;

/* The part of 0 to n within half a node. */
static int clipped(int at, int n)
{
    return at < 0 ? 0 : at < n ? at : n;
}

static void share_sections(void *context, int worker, size_t first, size_t end)
{
    const Sharing *const s = context;
    const CtsTableSearch *const r = s->table;
    const int *const dims = r->plan.dims, n = s->n[0], wide = s->step[0], high = s->step[1];
    uint16_t *const counts = s->counts + (size_t)worker * (size_t)n * (size_t)dims[1];
    CtsBits narrow = cts_bits_slice(&s->narrow, worker);
    for (int k = (int)first; k < (int)end; k++) {
        uint8_t *to = s->section + (size_t)k * (size_t)s->n[1] * (size_t)n;
        narrow_section(&r->body.whole, k, cts_reach_mm(SKIN_MM, r->plan.spacing_mm), &r->workers[worker], &narrow);
        for (int j = 0; j < dims[1]; j++)
            for (int i = 0; i < n; i++)
                counts[j * n + i] =
                    (uint16_t)cts_bits_count_run(cts_bits_row(&narrow, j, 0), clipped((i - 1) * wide, dims[0]),
                                                 clipped((i + 1) * wide + 1, dims[0]));
        for (int v = 0; v < s->n[1]; v++) {
            const int low = clipped((v - 1) * high, dims[1]), last = clipped((v + 1) * high + 1, dims[1]);
            for (int i = 0; i < n; i++) {
                const int columns = clipped((i + 1) * wide + 1, dims[0]) - clipped((i - 1) * wide, dims[0]);
                uint32_t sum = 0;
                for (int j = low; j < last; j++)
                    sum += counts[j * n + i];
                *to++ = (uint8_t)(255 * sum / (uint32_t)(columns * (last - low)));
            }
        }
    }
}

/* A node lies at the first slice of its section, and has of each section as much as lies around it. */
static void share_nodes(void *context, int worker, size_t first, size_t end)
{
    const Sharing *const s = context;
    const CtsSectionPlan *const plan = &s->table->plan;
    CtsBodyMask *const mask = s->table->inside;
    const int *const n = mask->n;
    const size_t n_section = (size_t)s->n[0] * (size_t)s->n[1];
    const size_t stride[3] = {1, (size_t)n[0], (size_t)n[0] * (size_t)n[1]};
    const double half = AROUND_MM / plan->spacing_mm[2]; /* sections */
    (void)worker;
    for (size_t k = first; k < end; k++) {
        const double middle = (double)k + 0.5 / plan->n_slices;
        const int low = clipped((int)floor(middle - half), plan->dims[2] - 1);
        const int high = clipped((int)floor(middle + half), plan->dims[2] - 1);
        for (size_t i = 0; i < n_section; i++) {
            double sum = 0, all = 0;
            for (int section = low; section <= high; section++) {
                const double weight = fmin(section + 1, middle + half) - fmax(section, middle - half);
                sum += weight * s->section[(size_t)section * n_section + i];
                all += weight;
            }
            mask->share[i % (size_t)s->n[0] * stride[plan->axis[0]] + i / (size_t)s->n[0] * stride[plan->axis[1]] +
                        k * stride[plan->axis[2]]] = (uint8_t)(sum / all);
        }
    }
}

CtsStatus cts_body_inside(CtsTableSearch *r, CtsError *err)
{
    CtsStatus st;
    const CtsSectionPlan *const plan = &r->plan;
    Sharing s = {.table = r};
    const int one_each[3] = {plan->dims[0], plan->dims[1], r->n_threads};
    int n[3], step[3];
    for (int a = 0; a < 3; a++) {
        const double apart = a < 2 ? AROUND_MM / plan->spacing_mm[a] : plan->n_slices;
        s.step[a] = (int)fmax(round(apart), 1);
        s.n[a] = a < 2 ? (plan->dims[a] + 2 * s.step[a] - 2) / s.step[a] : plan->dims[2] + (plan->n_slices > 1);
        n[plan->axis[a]] = s.n[a];
        step[plan->axis[a]] = s.step[a];
    }
    const size_t n_section = (size_t)s.n[0] * (size_t)s.n[1];
    if ((st = cts_body_mask_new(&r->inside, n, step, err)) || (st = cts_bits_new(&s.narrow, one_each, err)) ||
        (st = cts_alloc_array(&s.section, n_section * (size_t)plan->dims[2], err)) ||
        (st = cts_alloc_array(&s.counts, (size_t)r->n_threads * (size_t)s.n[0] * (size_t)plan->dims[1], err)))
        goto end;
    cts_parallel(r->n_threads, (size_t)plan->dims[2], 0, share_sections, &s);
    cts_parallel(r->n_threads, (size_t)s.n[2], 0, share_nodes, &s);
end:
    cts_bits_free(&s.narrow);
    cts_free(&s.section);
    cts_free(&s.counts);
    return st;
}
