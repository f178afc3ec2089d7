/* Assignment of a volume's voxels to labels, and the labels' appearances. */
#include "base/mem.h"
#include "base/mutation.h"
#include "core/labels/label_set.h"
#include "core/model/voxel_labels.h"
#include <stdlib.h>
#include <string.h>

/* Decisions for each label, and in the last entry for unlabelled voxels. */
typedef struct Deciding {
    const CtsLabels *labels;
    const CtsLabelChoice *choice;
    uint32_t *shown, *hidden, *first; /* 0: not named; first: the place in the order */
    uint8_t *appearance;              /* index in appearances */
    CtsAppearance *appearances;       /* n_appearances, from CTS_APPEARANCE_OWN on */
    int n_appearances;
    size_t *voxel_labels; /* the n_voxel_labels labels that get voxels, then the unlabelled entry for all others */
    size_t n_voxel_labels;
} Deciding;

static void free_deciding(Deciding *d)
{
    for (int i = 0; d->appearances && i < d->n_appearances; i++)
        free(d->appearances[i].preset);
    free(d->appearances);
    cts_free(&d->shown);
    cts_free(&d->hidden);
    cts_free(&d->first);
    cts_free(&d->appearance);
    cts_free(&d->voxel_labels);
}

static CtsStatus add_appearance(Deciding *d, const CtsAppearance *appearance, CtsError *err)
{
    if (d->n_appearances == CTS_MAX_APPEARANCES)
        return cts_fail(err, CTS_ERR_USAGE, "labels have more than %d appearances of their own",
                        CTS_MAX_APPEARANCES - CTS_APPEARANCE_OWN);
    d->appearances[d->n_appearances++] = *appearance;
    return CTS_OK;
}

/* NAME=LOOK: the last one that names a label applies. */
static CtsStatus take_appearance(Deciding *d, const char *text, CtsError *err)
{
    CtsAppearance appearance;
    const size_t length = cts_label_name_length(d->labels, text, '=');
    const char *const equals = length ? text + length : strchr(text, '=');
    uint32_t *named = NULL;
    if (!equals || equals == text || !equals[1])
        return cts_fail(err, CTS_ERR_USAGE, "`label` %s: not NAME=LOOK", text);
    CtsStatus st = cts_alloc_zeroed(&named, d->labels->n + 2, err);
    if (!st)
        st = cts_label_find(d->labels, "label", text, (size_t)(equals - text), 1, named, err);
    if (!st && (st = cts_label_appearance_parse(equals + 1, &appearance, err)))
        cts_context(err, "`label` %.*s", (int)(equals - text), text);
    if (!st && (st = add_appearance(d, &appearance, err)))
        free(appearance.preset);
    for (size_t i = 0; !st && i <= d->labels->n; i++)
        if (named[i])
            d->appearance[i] = (uint8_t)(d->n_appearances - 1);
    cts_free(&named);
    return st;
}

/* Colours of the files, or of the table, for visible labels without an appearance of their own. */
static CtsStatus take_colours(Deciding *d, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; !st && i < d->labels->n; i++) {
        const CtsLabel *const l = &d->labels->items[i];
        CtsAppearance appearance = {.tinted = true, .opacity = -1};
        if (d->appearance[i] != CTS_APPEARANCE_PRESET || l->surrounds || !l->fact.voxels)
            continue;
        cts_label_colour(i, appearance.rgb);
        if (l->coloured)
            memcpy(appearance.rgb, l->rgb, sizeof appearance.rgb);
        if (!(st = add_appearance(d, &appearance, err)))
            d->appearance[i] = (uint8_t)(d->n_appearances - 1);
    }
    return st;
}

bool cts_labels_show_air(const CtsLabelChoice *choice)
{
    const double AIR_HU = -1024;
    bool shows = false;
    for (int i = 0; i < choice->n_appearances && !shows; i++) {
        const char *const equals = strrchr(choice->appearances[i], '='), *const json =
                                                                             strstr(choice->appearances[i], "={");
        CtsAppearance a;
        if (json || !equals || cts_label_appearance_parse(equals + 1, &a, NULL))
            return true; /* not understood without the labels' names */
        shows = a.opacity > 0 ||
                (a.preset && (a.preset->scale != CTS_SCALE_HU || cts_preset_opacity(a.preset, AIR_HU) > 0));
        free(a.preset);
    }
    return shows;
}

/* The shown labels. Names that no label has are refused only where no other of the list has one. */
static CtsStatus choose_shown(Deciding *d, CtsReport *report, CtsError *err)
{
    const CtsLabelChoice *const c = d->choice;
    char lacking[CTS_LACKING_TEXT];
    bool any = c->show_present;
    CtsStatus st = cts_label_find_list(d->labels, "show", c->show, d->shown, lacking, err);
    for (size_t i = 0; i <= d->labels->n; i++)
        any |= d->shown[i];
    if (!st && !any)
        st = cts_label_find_list(d->labels, "show", c->show, d->shown, NULL, err);
    else if (!st && *lacking && !c->show_present)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_LABELS_UNKNOWN,
                              "`show`: no label is called %s; the others are shown (ctsplat info with `labels` lists "
                              "them)",
                              lacking);
    return st ? st : cts_label_check_shown(d->labels, d->shown, err);
}

/* report: may be NULL. */
static CtsStatus choose_appearances(Deciding *d, CtsReport *report, CtsError *err)
{
    const size_t n = d->labels->n;
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&d->shown, n + 2, err)) || (st = cts_alloc_zeroed(&d->hidden, n + 2, err)) ||
        (st = cts_alloc_zeroed(&d->first, n + 2, err)) || (st = cts_alloc_array(&d->appearance, n + 1, err)) ||
        (st = cts_alloc_zeroed(&d->voxel_labels, n + 1, err)))
        return st;
    d->n_appearances = CTS_APPEARANCE_OWN;
    if (!(d->appearances = calloc(CTS_MAX_APPEARANCES, sizeof *d->appearances)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    d->appearances[CTS_APPEARANCE_HIDDEN].opacity = d->appearances[CTS_APPEARANCE_PRESET].opacity = -1;
    const CtsLabelChoice *const c = d->choice;
    if ((c->show && (st = choose_shown(d, report, err))) ||
        (c->hide && (st = cts_label_find_list(d->labels, "hide", c->hide, d->hidden, NULL, err))) ||
        (c->order && (st = cts_label_find_list(d->labels, "label-order", c->order, d->first, NULL, err))))
        return st;
    memset(d->appearance, CTS_APPEARANCE_PRESET, n + 1);
    for (int i = 0; !st && i < c->n_appearances; i++)
        st = take_appearance(d, c->appearances[i], err);
    for (size_t i = 0; i <= n; i++) {
        if (d->hidden[i] || (c->show && !d->shown[i]))
            d->appearance[i] = CTS_APPEARANCE_HIDDEN;
        if (i < n && (!c->show || d->shown[i] || d->hidden[i]))
            d->voxel_labels[d->n_voxel_labels++] = i;
    }
    d->voxel_labels[d->n_voxel_labels] = n;
    return !st && c->own_colours ? take_colours(d, err) : st;
}

/* Of one of the voxel labels, or of the entry behind them. */
static uint8_t appearance_of(const Deciding *d, size_t voxel_label)
{
    return d->appearance[d->voxel_labels[voxel_label]];
}

static bool is_hidden(const Deciding *d, size_t voxel_label)
{
    return appearance_of(d, voxel_label) == CTS_APPEARANCE_HIDDEN;
}

/* True where b gets the voxels that both contain. */
static bool loses_overlap(const Deciding *d, size_t a, size_t b)
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

/* Labels (indices in d->voxel_labels) in painting order, the last on top. */
static void sort_for_painting(const Deciding *d, size_t *order)
{
    for (size_t i = 0; i < d->n_voxel_labels; i++) {
        size_t at = i;
        for (; at > 0 && !CTS_MUTATED(OVERLAP) && loses_overlap(d, d->voxel_labels[i], d->voxel_labels[order[at - 1]]);
             at--)
            order[at] = order[at - 1];
        order[at] = i;
    }
}

static CtsStatus paint(const Deciding *d, CtsModel *model, int n_threads, CtsError *err)
{
    size_t *order = NULL;
    CtsStatus st = cts_alloc_array(&order, d->n_voxel_labels + 1, err);
    if (!st) {
        sort_for_painting(d, order);
        st = cts_labels_to_volume(d->labels, d->voxel_labels, order, d->n_voxel_labels, model, n_threads, err);
    }
    for (size_t i = 0; !st && i <= d->n_voxel_labels; i++)
        model->voxel_labels->appearance[i] = appearance_of(d, i);
    cts_free(&order);
    return st;
}

/* Names are kept with the model, which outlasts the labels. */
static CtsStatus name_colours(const Deciding *d, CtsVoxelLabels *l, CtsError *err)
{
    for (size_t i = 0; i < d->n_voxel_labels; i++) {
        const CtsLabelFact *const f = &d->labels->items[d->voxel_labels[i]].fact;
        if (!f->voxels || !l->appearances[l->appearance[i]].tinted)
            continue;
        if (!(l->name[i] = strdup(f->name)))
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        l->number[i] = f->number;
    }
    return CTS_OK;
}

const char *cts_model_label_colour(const CtsModel *model, size_t i, double rgb[3], int *number)
{
    const CtsVoxelLabels *const l = model->voxel_labels;
    for (int n = 0; l && n < l->n; n++)
        if (l->name[n] && !i--) {
            memcpy(rgb, l->appearances[l->appearance[n]].rgb, sizeof l->appearances->rgb);
            *number = l->number[n];
            return l->name[n];
        }
    return NULL;
}

static bool labels_overlap(const CtsLabel *a, const CtsLabel *b)
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
    for (size_t a = 0; a < d->n_voxel_labels; a++)
        for (size_t b = 0; b < d->n_voxel_labels; b++) {
            const size_t i = d->voxel_labels[a], j = d->voxel_labels[b];
            if (is_hidden(d, a) && !is_hidden(d, b) && labels_overlap(&d->labels->items[i], &d->labels->items[j]))
                *(loses_overlap(d, i, j) ? yield : take) = true;
        }
}

/* The cropping by all hidden labels, or by all visible ones. */
static void crop_by(const Deciding *d, bool hidden, const char *study_uid, CtsLabelCrop *crop, const char **unsaid)
{
    size_t n = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t a = 0; a < d->n_voxel_labels; a++) {
            const CtsLabel *const l = &d->labels->items[d->voxel_labels[a]];
            const CtsLabelObject *const o = l->object ? &d->labels->objects[l->object - 1] : NULL;
            if (is_hidden(d, a) != hidden)
                continue;
            if (pass)
                crop[d->voxel_labels[a]] = hidden ? CTS_CROP_EXCLUDE : CTS_CROP_INCLUDE;
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
    const CtsStatus st = choose_appearances(&d, NULL, err);
    *unsaid = NULL;
    if (!st) {
        const bool alone = is_hidden(&d, d.n_voxel_labels);
        for (size_t a = 0; a < d.n_voxel_labels; a++)
            any_hidden |= is_hidden(&d, a);
        compare_hidden(&d, &take, &yield);
        if (alone)
            crop_by(&d, false, study_uid, crop, unsaid);
        if (any_hidden && (take || !alone) && yield)
            *unsaid = "shown labels lie within hidden ones";
        else if (any_hidden && (take || !alone))
            crop_by(&d, true, study_uid, crop, unsaid);
    }
    free_deciding(&d);
    return st;
}

static bool all_equal(const Deciding *d)
{
    bool equal = true;
    for (size_t i = 0; i <= d->n_voxel_labels; i++)
        equal &= appearance_of(d, i) == CTS_APPEARANCE_PRESET;
    return equal;
}

static void report_assignment(const Deciding *d, CtsReport *report)
{
    size_t n_hidden = 0;
    for (size_t i = 0; i < d->n_voxel_labels; i++)
        n_hidden += is_hidden(d, i);
    cts_report_plan(report,
                    "labels: %zu have voxels, %zu of them hidden; voxels without a label are %s; %d appearances other "
                    "than the preset's",
                    d->n_voxel_labels, n_hidden, is_hidden(d, d->n_voxel_labels) ? "hidden" : "shown",
                    d->n_appearances - CTS_APPEARANCE_OWN);
}

CtsStatus cts_model_take_labels(CtsModel *model, const CtsLabels *labels, const CtsLabelChoice *choice, int n_threads,
                                CtsReport *report, CtsError *err)
{
    Deciding d = {.labels = labels, .choice = choice};
    CtsStatus st = choose_appearances(&d, report, err);
    for (int i = 0; i < d.n_appearances && !st; i++)
        if (d.appearances[i].preset && (st = cts_preset_resolve(d.appearances[i].preset, model->volume, err)))
            cts_context(err, "`label`");
    cts_voxel_labels_free(&model->voxel_labels);
    if (!st && all_equal(&d)) {
        cts_report_skip(report, "labels in the picture", "nothing is hidden and all have the preset's appearance");
    } else if (!st && !(st = paint(&d, model, n_threads, err))) {
        model->voxel_labels->appearances = d.appearances;
        model->voxel_labels->n_appearances = d.n_appearances;
        d.appearances = NULL;
        report_assignment(&d, report);
        if (!(st = name_colours(&d, model->voxel_labels, err)))
            st = cts_voxel_labels_finish(model, n_threads, err);
    }
    free_deciding(&d);
    return st;
}
