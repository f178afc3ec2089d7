#include "core/couch/table_removal.h"

#include "base/mem.h"
#include "base/parallel.h"
#include <math.h>
#include <stdatomic.h>
#include <string.h>

/* Length over which a plate keeps its position: longer than the straight part of an ear, a nose or a fold of skin.
 * Measured: with 50 mm a sixth more of a skull phantom is removed, with 70 mm a tenth of a holder stays. */
static const double PLATE_MM = 60;
/* Length over which a plate in contact with the patient is followed by static voxels. Measured: 12 to 40 mm differ by
 * less than 1 % of a holder, 60 mm leave an eighth of it. */
static const double FOLLOWED_MM = 24;
/* Half the thickness up to which a thin part is a plate or a rail, with the voxel that is added on either side.
 * Measured: 6 to 8 mm pass the tests and differ by less than 0.5 % of a holder. */
static const double PLATE_RADIUS_MM = 7;
/* Half the thickness up to which a part may be a plate, and is doubtful. Measured: 12 mm report too little of a
 * doubtful part in a test, 20 mm cause a warning about a chest whose table is removed. */
static const double DOUBT_RADIUS_MM = 16;
/* Least static cross-section of a plate; a smaller one is noise. Measured: 10 to 160 mm2 remove the same. */
static const double MIN_MM2 = 40;
/* Static cross-section from which a part is a plate although most of it moves, as where an ear leans on a wall.
 * Measured: with 60 mm2 2 % more of a skull phantom is removed, with 150 mm2 2 % of a holder stay. */
static const double SURE_MM2 = 100;

/* Sections first to end of the stack, evaluated together. */
typedef struct Window {
    int first, end;
} Window;

/* Windows of one length, each a step behind the one before, over the whole stack. */
typedef struct Windows {
    int length, step, n, last; /* the last one begins here */
} Windows;

typedef struct Search {
    CtsTableSearch *table;
    /* The sections dilated by a voxel: wavering by a voxel counts as static. In the memory of the doubtful plates. */
    CtsBits wide;
    Windows windows, shorter;
    CtsBits plates, doubtful;   /* by window */
    CtsBits followed;           /* by shorter window */
    CtsBits always, ever, thin; /* a section for each worker */
    CtsReach reach, doubt_reach;
    double least_voxels, sure_voxels;
    atomic_int n_failed;
} Search;

static Windows windows_of(const CtsSectionPlan *plan, double length_mm)
{
    /* The step is an eighth of the length: at either end of a plate less than that lies outside all windows. */
    Windows w = {.length = (int)ceil(length_mm / plan->spacing_mm[2])};
    w.step = w.length > 8 ? w.length / 8 : 1;
    w.last = plan->dims[2] - w.length;
    w.n = w.last < 0 ? 0 : (w.last + w.step - 1) / w.step + 1;
    return w;
}

static Window window_at(const Windows *w, int n)
{
    const int first = n * w->step < w->last ? n * w->step : w->last;
    return (Window){first, first + w->length};
}

/* Scratch memory of one thread: sections of one slice. */
typedef struct Worker {
    CtsMorphology *morphology;
    CtsBits always, ever, thin;
} Worker;

static Worker worker_of(const Search *s, int n)
{
    return (Worker){&s->table->workers[n], cts_bits_slice(&s->always, n), cts_bits_slice(&s->ever, n),
                    cts_bits_slice(&s->thin, n)};
}

/* Voxels that are set in every section of the window, except for single ones lost in noise; and those set in any. */
static void scan_window_columns(const Search *s, Window window, Worker *w)
{
    const size_t n = w->morphology->n_words;
    const int last = s->table->plan.dims[2] - 1;
    uint64_t *restrict const always = w->always.words, *restrict const ever = w->ever.words;
    memset(always, 0xff, n * sizeof *always);
    memset(ever, 0, n * sizeof *ever);
    for (int k = window.first; k < window.end; k++) {
        const uint64_t *const own = cts_bits_row(&s->wide, 0, k), *const before =
                                                                      cts_bits_row(&s->wide, 0, k ? k - 1 : 0);
        const uint64_t *const behind = cts_bits_row(&s->wide, 0, k < last ? k + 1 : last);
        for (size_t i = 0; i < n; i++) {
            always[i] &= own[i] | (before[i] & behind[i]);
            ever[i] |= own[i];
        }
    }
}

/* Chooses the static voxels of the thin parts that are static; counts a lack of memory. */
static void choose_parts(Search *s, Worker *w, CtsBits *chosen_parts)
{
    uint64_t *count = NULL;
    uint8_t *chosen = NULL;
    CtsComponents p = {0};
    const bool failed = cts_components_find(&p, &w->thin, CTS_CONNECTED_IN_SLICE, NULL) ||
                        cts_components_count_in(&p, &w->always, &count, NULL) ||
                        cts_alloc_array(&chosen, p.n_parts, NULL);
    atomic_fetch_add(&s->n_failed, failed);
    for (uint32_t n = 0; !failed && n < p.n_parts; n++)
        chosen[n] = (double)count[n] >= s->sure_voxels ||
                    ((double)count[n] >= s->least_voxels && 2 * count[n] >= p.parts[n].n_voxels);
    if (!failed)
        cts_components_paint(&p, chosen, chosen_parts);
    cts_bits_combine(chosen_parts, CTS_BITS_AND, &w->always);
    cts_components_free(&p);
    cts_free(&count);
    cts_free(&chosen);
}

/* A plate is thin in the union of all sections and static, unlike the patient's ears, skin and walls, which move from
 * section to section. Where a back lies on it, it is thin on both sides only. */
static void find_plates_in_windows(void *context, int worker, size_t first, size_t end)
{
    Search *const s = context;
    Worker w = worker_of(s, worker);
    for (int n = (int)first; n < (int)end; n++) {
        CtsBits plates = cts_bits_slice(&s->plates, n), doubtful = cts_bits_slice(&s->doubtful, n);
        scan_window_columns(s, window_at(&s->windows, n), &w);
        cts_thin_section(w.morphology, w.ever.words, s->reach, w.thin.words);
        choose_parts(s, &w, &plates);
        cts_plate_contacts_add(&w.always, &w.ever, &plates);
        cts_thin_section(w.morphology, w.ever.words, s->doubt_reach, w.thin.words);
        choose_parts(s, &w, &doubtful);
    }
}

/* The end of an obliquely cut plate moves, so that it ends before the contact; in a shorter window more of it is
 * static. This step only extends plates along their faces. */
static void follow_plates(const Search *s, int n, Worker *w)
{
    const Window window = window_at(&s->shorter, n);
    const CtsReach waver = {.diamond = 1, .box = {1, 1}};
    CtsBits followed = cts_bits_slice(&s->followed, n);
    for (int l = 0; l < s->windows.n; l++) {
        const Window longer = window_at(&s->windows, l);
        const CtsBits plates = cts_bits_slice(&s->plates, l);
        if (longer.first <= window.first && longer.end >= window.end)
            cts_bits_combine(&followed, CTS_BITS_OR, &plates);
    }
    if (!cts_bits_any(&followed))
        return;
    scan_window_columns(s, window, w);
    /* In the longer window the plate wavered: extend it to its faces in this one. */
    cts_thin_section(w->morphology, w->ever.words, s->reach, w->thin.words);
    cts_bits_combine(&w->thin, CTS_BITS_OR, &followed);
    cts_dilate_section(w->morphology, followed.words, waver, followed.words);
    cts_bits_combine(&followed, CTS_BITS_AND, &w->thin);
    cts_bits_combine(&followed, CTS_BITS_AND, &w->always);
    cts_plate_contacts_add(&w->always, &w->ever, &followed);
}

static void follow_in_windows(void *context, int worker, size_t first, size_t end)
{
    const Search *const s = context;
    Worker w = worker_of(s, worker);
    for (int n = (int)first; n < (int)end; n++)
        follow_plates(s, n, &w);
}

/* Section k gets the union of the results of its windows. */
static void gather(const Windows *windows, const CtsBits *found, int k, CtsBits *section)
{
    for (int n = 0; n < windows->n; n++) {
        const Window window = window_at(windows, n);
        const CtsBits from = cts_bits_slice(found, n);
        if (window.first <= k && k < window.end)
            cts_bits_combine(section, CTS_BITS_OR, &from);
    }
}

static void gather_sections(void *context, int worker, size_t first, size_t end)
{
    const Search *const s = context;
    (void)worker;
    for (int k = (int)first; k < (int)end; k++) {
        const CtsBits section = cts_bits_slice(&s->table->sections, k);
        CtsBits plates = cts_bits_slice(&s->table->plates, k), doubtful = cts_bits_slice(&s->table->doubtful, k);
        memset(doubtful.words, 0, cts_bits_n_words(&doubtful) * sizeof *doubtful.words);
        gather(&s->windows, &s->plates, k, &plates);
        gather(&s->shorter, &s->followed, k, &plates);
        gather(&s->windows, &s->doubtful, k, &doubtful);
        cts_bits_combine(&plates, CTS_BITS_AND, &section);
        cts_bits_combine(&doubtful, CTS_BITS_AND, &section);
    }
}

static CtsStatus search_plates(Search *s, CtsError *err)
{
    const CtsTableSearch *const r = s->table;
    cts_each_section(r->workers, r->n_threads, cts_dilate_section, &r->sections, (CtsReach){.diamond = 1}, &s->wide);
    cts_parallel(r->n_threads, (size_t)s->windows.n, 1, find_plates_in_windows, s);
    cts_parallel(r->n_threads, (size_t)s->shorter.n, 1, follow_in_windows, s);
    if (atomic_load(&s->n_failed))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    cts_parallel(r->n_threads, (size_t)r->plan.dims[2], 1, gather_sections, s);
    return CTS_OK;
}

CtsStatus cts_plates_find(CtsTableSearch *r, CtsError *err)
{
    const CtsSectionPlan *const plan = &r->plan;
    const double mm2 = plan->spacing_mm[0] * plan->spacing_mm[1];
    Search s = {.table = r,
                .windows = windows_of(plan, PLATE_MM),
                .shorter = windows_of(plan, FOLLOWED_MM),
                .reach = cts_reach_mm(PLATE_RADIUS_MM, plan->spacing_mm),
                .doubt_reach = cts_reach_mm(DOUBT_RADIUS_MM, plan->spacing_mm),
                .least_voxels = MIN_MM2 / mm2,
                .sure_voxels = SURE_MM2 / mm2};
    const struct {
        CtsBits *bits;
        int n;
    } scratch[] = {{&s.plates, s.windows.n},  {&s.doubtful, s.windows.n}, {&s.followed, s.shorter.n},
                   {&s.always, r->n_threads}, {&s.ever, r->n_threads},    {&s.thin, r->n_threads}};
    enum { N_SCRATCH = sizeof scratch / sizeof *scratch };
    CtsStatus st = cts_bits_new(&r->plates, plan->dims, err);
    if (st || (st = cts_bits_new(&r->doubtful, plan->dims, err)) || s.windows.n == 0)
        return st;
    for (int i = 0; i < N_SCRATCH && !st; i++)
        st = cts_bits_new(scratch[i].bits, (const int[]){plan->dims[0], plan->dims[1], scratch[i].n}, err);
    s.wide = r->doubtful;
    if (!st)
        st = search_plates(&s, err);
    for (int i = 0; i < N_SCRATCH; i++)
        cts_bits_free(scratch[i].bits);
    return st;
}
