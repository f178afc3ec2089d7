/* Assignment of a volume's voxels to labels, and the labels' appearances. */
#include "base/mem.h"
#include "base/mutation.h"
#include "core/labels/label_set.h"
#include "core/volume/owners.h"
#include <stdlib.h>
#include <string.h>

/* Decisions for each label, and in the last entry for unlabelled voxels. */
typedef struct Deciding {
    const CtsLabels *labels;
    const CtsLabelChoice *choice;
    uint32_t *shown, *hidden, *first; /* 0: not named; first: the place in the order */
    uint32_t *own;                    /* index + 1 in looks of a label's own appearance; 0: none */
    CtsOwnerLook *looks;              /* n_looks, from CTS_LOOK_OWN on */
    int n_looks;
    size_t *owners; /* the n_owners labels that get voxels; others count as unlabelled */
    size_t n_owners;
} Deciding;

static void forget(Deciding *d)
{
    for (int i = 0; d->looks && i < d->n_looks; i++)
        free(d->looks[i].preset);
    free(d->looks);
    cts_free(&d->shown);
    cts_free(&d->hidden);
    cts_free(&d->first);
    cts_free(&d->own);
    cts_free(&d->owners);
}

static CtsStatus add_look(Deciding *d, const CtsOwnerLook *look, CtsError *err)
{
    if (d->n_looks == CTS_MAX_LOOKS)
        return cts_fail(err, CTS_ERR_USAGE, "labels have more than %d appearances of their own",
                        CTS_MAX_LOOKS - CTS_LOOK_OWN);
    d->looks[d->n_looks++] = *look;
    return CTS_OK;
}

/* NAME=LOOK: the last one that names a label applies. */
static CtsStatus take_look(Deciding *d, const char *text, CtsError *err)
{
    CtsOwnerLook look;
    const size_t length = cts_label_name_length(d->labels, text, '=');
    const char *const equals = length ? text + length : strchr(text, '=');
    uint32_t *named = NULL;
    if (!equals || equals == text || !equals[1])
        return cts_fail(err, CTS_ERR_USAGE, "`label` %s: not NAME=LOOK", text);
    CtsStatus st = cts_alloc_zeroed(&named, d->labels->n + 1, err);
    if (!st)
        st = cts_label_find(d->labels, "label", text, (size_t)(equals - text), 1, named, err);
    if (!st && (st = cts_label_look(equals + 1, &look, err)))
        cts_context(err, "`label` %.*s", (int)(equals - text), text);
    if (!st && (st = add_look(d, &look, err)))
        free(look.preset);
    for (size_t i = 0; !st && i <= d->labels->n; i++)
        if (named[i])
            d->own[i] = (uint32_t)d->n_looks;
    cts_free(&named);
    return st;
}

/* Colours of the files, or of the table, for visible labels without an appearance of their own. */
static CtsStatus take_colours(Deciding *d, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; !st && i < d->labels->n; i++) {
        const CtsLabel *const l = &d->labels->items[i];
        CtsOwnerLook look = {.tinted = true, .opacity = -1};
        if (d->own[i] || d->hidden[i] || (d->choice->show && !d->shown[i]) || l->surrounds || !l->fact.voxels)
            continue;
        cts_label_colour(i, look.rgb);
        if (l->coloured)
            memcpy(look.rgb, l->rgb, sizeof look.rgb);
        if (!(st = add_look(d, &look, err)))
            d->own[i] = (uint32_t)d->n_looks;
    }
    return st;
}

static CtsStatus decide(Deciding *d, CtsError *err)
{
    const size_t n = d->labels->n;
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&d->shown, n + 1, err)) || (st = cts_alloc_zeroed(&d->hidden, n + 1, err)) ||
        (st = cts_alloc_zeroed(&d->first, n + 1, err)) || (st = cts_alloc_zeroed(&d->own, n + 1, err)) ||
        (st = cts_alloc_zeroed(&d->owners, n + 1, err)))
        return st;
    d->n_looks = CTS_LOOK_OWN;
    if (!(d->looks = calloc(CTS_MAX_LOOKS, sizeof *d->looks)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    d->looks[CTS_LOOK_HIDDEN].opacity = d->looks[CTS_LOOK_PRESET].opacity = -1;
    const CtsLabelChoice *const c = d->choice;
    char *lacking = NULL;
    if (c->show && c->show_present)
        st = cts_label_find_present(d->labels, c->show, d->shown, &lacking, err);
    else if (c->show)
        st = cts_label_find_list(d->labels, "show", c->show, d->shown, err);
    free(lacking);
    if (st || (c->hide && (st = cts_label_find_list(d->labels, "hide", c->hide, d->hidden, err))) ||
        (c->order && (st = cts_label_find_list(d->labels, "label-order", c->order, d->first, err))))
        return st;
    for (int i = 0; !st && i < c->n_looks; i++)
        st = take_look(d, c->looks[i], err);
    if (!st && c->own_colours)
        st = take_colours(d, err);
    for (size_t i = 0; i < n; i++)
        if (!c->show || d->shown[i] || d->hidden[i])
            d->owners[d->n_owners++] = i;
    return st;
}

static uint8_t look_of(const Deciding *d, size_t label)
{
    if (d->hidden[label] || (d->choice->show && !d->shown[label]))
        return CTS_LOOK_HIDDEN;
    return d->own[label] ? (uint8_t)(d->own[label] - 1) : CTS_LOOK_PRESET;
}

/* True where b gets the voxels that both contain. */
static bool yields(const Deciding *d, size_t a, size_t b)
{
    const CtsLabel *const p = &d->labels->items[a], *const q = &d->labels->items[b];
    const uint32_t none = UINT32_MAX, place_a = d->first[a] ? d->first[a] : none,
                   place_b = d->first[b] ? d->first[b] : none;
    if (place_a != place_b)
        return place_b < place_a;
    if (p->surrounds != q->surrounds)
        return p->surrounds;
    return p->fact.voxels != q->fact.voxels ? q->fact.voxels < p->fact.voxels : b < a;
}

/* Labels (indices in d->owners) in painting order, the last on top. */
static void sort(const Deciding *d, size_t *order)
{
    for (size_t i = 0; i < d->n_owners; i++) {
        size_t at = i;
        for (; at > 0 && !CTS_MUTATED(OVERLAP) && yields(d, d->owners[i], d->owners[order[at - 1]]); at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
}

static CtsStatus paint(const Deciding *d, CtsVolume *v, int n_threads, CtsError *err)
{
    size_t *order = NULL;
    CtsStatus st = cts_alloc_array(&order, d->n_owners + 1, err);
    if (!st) {
        sort(d, order);
        st = cts_labels_paint(d->labels, d->owners, order, d->n_owners, v, n_threads, err);
    }
    for (size_t i = 0; !st && i < d->n_owners; i++)
        v->owners->look[i] = look_of(d, d->owners[i]);
    if (!st)
        v->owners->look[d->n_owners] = look_of(d, d->labels->n);
    cts_free(&order);
    return st;
}

/* Names are kept with the volume, which outlasts the labels. */
static CtsStatus name_colours(const Deciding *d, CtsOwners *o, CtsError *err)
{
    for (size_t i = 0; i < d->n_owners; i++) {
        const CtsLabelFact *const f = &d->labels->items[d->owners[i]].fact;
        if (!f->voxels || !o->looks[o->look[i]].tinted)
            continue;
        if (!(o->name[i] = strdup(f->name)))
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        o->number[i] = f->number;
    }
    return CTS_OK;
}

const char *cts_volume_label_colour(const CtsVolume *v, size_t i, double rgb[3], int *number)
{
    const CtsOwners *const o = v->owners;
    for (int n = 0; o && n < o->n; n++)
        if (o->name[n] && !i--) {
            memcpy(rgb, o->looks[o->look[n]].rgb, sizeof o->looks->rgb);
            *number = o->number[n];
            return o->name[n];
        }
    return NULL;
}

static bool overlap(const CtsLabel *a, const CtsLabel *b)
{
    for (size_t i = 0, j = 0; a->fact.overlap && b->fact.overlap && i < a->n_runs && j < b->n_runs;) {
        const CtsLabelRun p = a->runs[i], q = b->runs[j];
        if (p.row == q.row && p.first < q.end && q.first < p.end)
            return true;
        if (p.row < q.row || (p.row == q.row && p.end <= q.end))
            i++;
        else
            j++;
    }
    return false;
}

/* Sets take if hidden labels take voxels from visible ones, yield for the opposite. */
static void compare_hidden(const Deciding *d, bool *take, bool *yield)
{
    *take = *yield = false;
    for (size_t a = 0; a < d->n_owners; a++)
        for (size_t b = 0; b < d->n_owners; b++) {
            const size_t i = d->owners[a], j = d->owners[b];
            if (look_of(d, i) == CTS_LOOK_HIDDEN && look_of(d, j) != CTS_LOOK_HIDDEN &&
                overlap(&d->labels->items[i], &d->labels->items[j]))
                *(yields(d, i, j) ? yield : take) = true;
        }
}

/* The cropping by all hidden labels, or by all visible ones. */
static void crop_by(const Deciding *d, bool hidden, const char *study_uid, CtsLabelCrop *crop, const char **unsaid)
{
    size_t n = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t a = 0; a < d->n_owners; a++) {
            const CtsLabel *const l = &d->labels->items[d->owners[a]];
            const CtsLabelObject *const o = l->object ? &d->labels->objects[l->object - 1] : NULL;
            if ((look_of(d, d->owners[a]) == CTS_LOOK_HIDDEN) != hidden)
                continue;
            if (pass)
                crop[d->owners[a]] = hidden ? CTS_CROP_EXCLUDE : CTS_CROP_INCLUDE;
            else if (!o || !*o->sop_uid || !*o->series_uid || strcmp(o->study_uid, study_uid) != 0) {
                *unsaid = "they are no segments of a BINARY segmentation of this study";
                return;
            }
            n++;
        }
    if (!n)
        *unsaid = "no segment is visible";
}

CtsStatus cts_labels_crop(const CtsLabels *labels, const CtsLabelChoice *choice, const char *study_uid,
                          CtsLabelCrop *crop, const char **unsaid, CtsError *err)
{
    Deciding d = {.labels = labels, .choice = choice};
    bool any_hidden = false, take, yield;
    const CtsStatus st = decide(&d, err);
    *unsaid = NULL;
    if (!st) {
        const bool alone = look_of(&d, labels->n) == CTS_LOOK_HIDDEN;
        for (size_t a = 0; a < d.n_owners; a++)
            any_hidden |= look_of(&d, d.owners[a]) == CTS_LOOK_HIDDEN;
        compare_hidden(&d, &take, &yield);
        if (alone)
            crop_by(&d, false, study_uid, crop, unsaid);
        if (any_hidden && (take || !alone) && yield)
            *unsaid = "shown labels lie within hidden ones";
        else if (any_hidden && (take || !alone))
            crop_by(&d, true, study_uid, crop, unsaid);
    }
    forget(&d);
    return st;
}

static bool all_alike(const Deciding *d)
{
    bool alike = look_of(d, d->labels->n) == CTS_LOOK_PRESET;
    for (size_t i = 0; i < d->n_owners; i++)
        alike &= look_of(d, d->owners[i]) == CTS_LOOK_PRESET;
    return alike;
}

static void tell(const Deciding *d, CtsReport *report)
{
    size_t n_hidden = 0;
    for (size_t i = 0; i < d->n_owners; i++)
        n_hidden += look_of(d, d->owners[i]) == CTS_LOOK_HIDDEN;
    cts_report_plan(report,
                    "labels: %zu have voxels, %zu of them hidden; voxels without a label are %s; %d appearances other "
                    "than the preset's",
                    d->n_owners, n_hidden, look_of(d, d->labels->n) == CTS_LOOK_HIDDEN ? "hidden" : "shown",
                    d->n_looks - CTS_LOOK_OWN);
}

CtsStatus cts_volume_take_labels(CtsVolume *v, const CtsLabels *labels, const CtsLabelChoice *choice, int n_threads,
                                 CtsReport *report, CtsError *err)
{
    Deciding d = {.labels = labels, .choice = choice};
    CtsStatus st = decide(&d, err);
    if (!st && all_alike(&d)) {
        cts_report_skip(report, "labels in the picture", "nothing is hidden and all have the preset's appearance");
    } else if (!st && !(st = paint(&d, v, n_threads, err))) {
        v->owners->looks = d.looks;
        v->owners->n_looks = d.n_looks;
        d.looks = NULL;
        tell(&d, report);
        if (!(st = name_colours(&d, v->owners, err)))
            st = cts_owners_finish(v->owners, v, n_threads, err);
    }
    forget(&d);
    return st;
}
