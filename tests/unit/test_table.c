/* Table removal on volumes from formulas: the body and its margin are kept to the bit, everything else is removed. */
#include "base/cpu.h"
#include "core/couch/table_removal.h"
#include "ctsplat/table.h"
#include "solids.h"

typedef struct Tally {
    int body, body_changed;     /* voxels of the patient */
    int margin, margin_changed; /* the ramp around it, away from anything else */
    int other, other_left;      /* voxels of everything else, except those within `near_mm` of the patient */
    int far_left;               /* denser than air, 6 mm and more from the patient */
} Tally;

static Tally tally(const Scene *s, const CtsVolume *before, const CtsVolume *after, double near_mm)
{
    Tally t = {0};
    size_t n = 0;
    for (int k = 0; k < s->dims[2]; k++)
        for (int j = 0; j < s->dims[1]; j++)
            for (int i = 0; i < s->dims[0]; i++, n++) {
                double p[3];
                voxel_lps(s, i, j, k, p);
                const double body = distance_to(s, p, true), rest = distance_to(s, p, false);
                const bool changed = before->grey[n] != after->grey[n];
                t.body += body <= 0;
                t.body_changed += body <= 0 && changed;
                t.margin += body > 0 && body <= 1 && rest > 5;
                t.margin_changed += body > 0 && body <= 1 && rest > 5 && changed;
                t.other += rest <= -0.5 && body > near_mm;
                t.other_left += rest <= -0.5 && body > near_mm && after->grey[n];
                t.far_left += body > 6 && cts_volume_hu(after, after->grey[n]) > -999;
            }
    return t;
}

static bool is_skipped(const CtsReport *report)
{
    return report->n_skips == 1 && !strcmp(report->skips[0].what, "table removal") && report->skips[0].why[0];
}

static void remove_table_of(CtsModel *model, int n_threads, CtsReport *report)
{
    CtsError err;
    *report = (CtsReport){0};
    assert_int_equal(cts_model_remove_table(model, true, n_threads, report, &err), CTS_OK);
    assert_true(report->stages[CTS_STAGE_CLASSIFY].ran);
}

static void remove_table(CtsVolume *v, int n_threads, CtsReport *report)
{
    CtsModel model = {.volume = v};
    remove_table_of(&model, n_threads, report);
    model.volume = NULL;
    cts_model_free(&model);
}

/* A scene before and after the removal of its table. */
typedef struct Removed {
    CtsVolume *before, *after;
    CtsReport report;
    Tally tally;
} Removed;

static Removed removed(const Scene *s, int n_threads, double near_mm)
{
    Removed r = {.before = make(s)};
    r.after = copy(r.before);
    remove_table(r.after, n_threads, &r.report);
    r.tally = tally(s, r.before, r.after, near_mm);
    return r;
}

static void free_removed(Removed *r)
{
    cts_report_free(&r->report);
    cts_volume_free(&r->before);
    cts_volume_free(&r->after);
}

/* The table is removed, the patient is kept to the bit, and any number of threads and SIMD path gives the same bytes.
 */
static void check_removal(const Scene *s)
{
    Removed r = removed(s, 1, 0.5);
    const Tally t = r.tally;
    assert_true(t.body > 1000 && t.margin > 100 && t.other > 100);
    assert_true(t.body_changed * 2000 <= t.body);
    assert_int_equal(t.margin_changed, 0);
    assert_int_equal(t.other_left, 0);
    assert_int_equal(t.far_left, 0);
    assert_non_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVED));
    assert_int_equal(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVED)->severity, CTS_NOTE);
    assert_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
    assert_int_equal(r.report.n_skips, 0);
    const int threads[] = {2, 7};
    for (int n = 0; n < 2; n++) {
        CtsModel again = {.volume = copy(r.before)};
        CtsReport report;
        CtsError err;
        assert_int_equal(cts_model_prepare(&again, 2, &err), CTS_OK);
        cts_cpu_set_mask(n ? 0 : ~0u);
        remove_table_of(&again, threads[n], &report);
        cts_cpu_set_mask(~0u);
        assert_null(again.macrocells); /* data derived before are invalid */
        assert_memory_equal(again.volume->grey, r.after->grey, cts_volume_n_voxels(r.after) * sizeof *r.after->grey);
        cts_report_free(&report);
        cts_model_free(&again);
    }
    free_removed(&r);
}

/* Nothing is removed, and the report contains the reason. */
static void check_untouched(const Scene *s)
{
    CtsVolume *before = make(s), *after = copy(before);
    CtsReport report;
    remove_table(after, 2, &report);
    assert_memory_equal(after->grey, before->grey, cts_volume_n_voxels(before) * sizeof *before->grey);
    assert_true(is_skipped(&report));
    assert_int_equal(report.diagnostics.n, 0);
    cts_report_free(&report);
    cts_volume_free(&before);
    cts_volume_free(&after);
}

#define N(solids) (int)(sizeof(solids) / sizeof *(solids))
#define AXIAL                                                                                                          \
    {                                                                                                                  \
        {1.5, 0, 0}, {0, 1.5, 0},                                                                                      \
        {                                                                                                              \
            0, 0, 2                                                                                                    \
        }                                                                                                              \
    }

/* A head with ears, nose and an earring. */
#define HEAD                                                                                                           \
    {ellipsoid, {0, 0, 0, 75, 95, 110}, 40, true}, {ellipsoid, {80, 10, 0, 12, 3, 28}, 30, true},                      \
        {ellipsoid, {-80, 10, 0, 12, 3, 28}, 30, true}, {ellipsoid, {0, -98, -10, 9, 14, 20}, 20, true},               \
    {                                                                                                                  \
        ellipsoid, {-87, 10, -23, 3, 3, 3}, 3000, true                                                                 \
    }

/* A trough 3 mm thick along all slices, its wall touching the left ear and its bottom the back of the head. */
static const Solid head_in_trough[] = {HEAD, {trough, {0, 0, 98, 95, 30, 1}, 200, false}};
static const Solid head_on_ear_rest[] = {HEAD, {trough, {0.5, 4, 95, 92, 0, 1}, 200, false}};

static void test_head_on_holder(void **state)
{
    /* The back of the head at y = 95 touches the shell's inner face over an area. */
    const Scene back = {head_in_trough, N(head_in_trough), {144, 144, 80}, AXIAL, {0, 0, 0}, 0};
    check_removal(&back);
    /* The ears' tips, 92 mm from the middle, end at or in the walls. */
    const Scene ears = {head_on_ear_rest, N(head_on_ear_rest), {144, 144, 80}, AXIAL, {0, 0, 0}, 0};
    Removed r = removed(&ears, 2, 0.5);
    const Tally t = r.tally;
    assert_int_equal(t.margin_changed, 0);
    assert_int_equal(t.far_left, 0);
    assert_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
    free_removed(&r);
}

/* A plate of 8 voxels that is known from row 60 on; from 40 to 55 an ear lies against it, before and behind that it is
 * thin. In the window where it was found it may have wavered: its far face is a voxel further there. */
static void test_contact(void **state)
{
    for (int wavers = 0; wavers < 4; wavers++) {
        const bool across = wavers & 1;
        CtsBits there = {0}, plates = {0};
        CtsError err;
        const int dims[3] = {128, 128, 1};
        assert_int_equal(cts_bits_new(&there, dims, &err), CTS_OK);
        assert_int_equal(cts_bits_new(&plates, dims, &err), CTS_OK);
        for (int n = 10; n <= 100; n++)
            for (int m = 20; m <= (n >= 40 && n <= 55 ? 60 : 27); m++) {
                cts_bits_set(&there, across ? n : m, across ? m : n, 0);
                if (n >= 60 && m >= 20 + (wavers >> 1))
                    cts_bits_set(&plates, across ? n : m, across ? m : n, 0);
            }
        cts_plate_contacts_add(&there, &there, &plates);
        for (int n = 10; n <= 100; n++)
            for (int m = 22; m <= 60; m++) {
                const bool is_plate = cts_bits_get(&plates, across ? n : m, across ? m : n, 0);
                assert_true(m == 27 || is_plate == (m < 27)); /* the last one is the ear's where it lies against it */
            }
        cts_bits_free(&there);
        cts_bits_free(&plates);
    }
}

static void test_prone(void **state)
{
    const Solid solids[] = {HEAD, {trough, {0, 0, 115, 112, -30, -1}, 200, false}};
    const Scene s = {solids, N(solids), {160, 160, 80}, AXIAL, {0, 0, 0}, 0};
    check_removal(&s);
}

/* A trunk with lungs, arms beside it, a flat table of two skins, a mattress with a cover, a blanket, a tube. */
#define TRUNK                                                                                                          \
    {ellipsoid, {0, 0, 0, 150, 100, 900}, 40, true}, {pipe, {185, 20, 26, 0, -999, 999}, 40, true},                    \
    {                                                                                                                  \
        pipe, {-185, 20, 26, 0, -999, 999}, 40, true                                                                   \
    }

static void test_trunk_on_table(void **state)
{
    const Solid solids[] = {
        TRUNK,
        {box, {0, 124, 0, 210, 20, 999}, -850, false}, /* mattress */
        {box, {0, 105, 0, 210, 0.8, 999}, 0, false},   /* its cover, 4 mm from the back */
        {box, {0, 150, 0, 220, 1.5, 999}, 100, false}, /* table: two skins */
        {box, {0, 180, 0, 220, 1.5, 999}, 100, false},
        {cloth, {-112, 4, 20, 0.8, 200}, -50, false},    /* blanket */
        {pipe, {60, -130, 5, 3, -999, 999}, 100, false}, /* tube */
    };
    const Scene s = {solids, N(solids), {160, 128, 40}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}}, {0, 20, 0}, 0};
    Removed r = removed(&s, 2, 3);
    const Tally t = r.tally;
    assert_int_equal(t.body_changed, 0);
    assert_int_equal(t.margin_changed, 0);
    assert_int_equal(t.far_left, 0);
    assert_non_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVED));
    free_removed(&r);
}

/* Room air of a scanner that calls it so many HU, with the patient and the table as they were. */
static void raise_air(CtsVolume *v, double air_hu)
{
    for (size_t n = 0; n < cts_volume_n_voxels(v); n++) {
        const double hu = cts_volume_hu(v, v->grey[n]);
        v->grey[n] = (uint16_t)lround((hu < 0 ? hu * air_hu / -1000 : hu) - v->hu_offset);
    }
}

static void test_raised_air(void **state)
{
    const Solid solids[] = {
        {ellipsoid, {0, 0, 0, 150, 100, 900}, 40, true},
        {box, {0, 112, 0, 210, 6, 999}, -950, false},  /* mattress */
        {box, {0, 104, 0, 210, 1.5, 999}, 0, false},   /* its cover */
        {box, {0, 130, 0, 220, 1.5, 999}, 100, false}, /* table */
    };
    const Scene s = {solids, N(solids), {160, 112, 40}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}}, {0, 20, 0}, 0};
    const Scene alone = {solids, 1, {160, 112, 40}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}}, {0, 20, 0}, 0};
    const double levels[] = {-900, -867, -849, -760, -600};
    for (size_t n = 0; n < sizeof levels / sizeof *levels; n++) {
        CtsVolume *before = make(&s), *after;
        CtsReport report;
        raise_air(before, levels[n]);
        after = copy(before);
        remove_table(after, 2, &report);
        const Tally t = tally(&s, before, after, 3);
        if (t.body_changed || t.margin_changed || t.other_left ||
            !cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVED) ||
            cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN))
            fail_msg(
                "air of %g HU: %d voxels of the body and %d of its rim changed, %d of the table stay, and the report "
                "has no note, or a doubt",
                levels[n], t.body_changed, t.margin_changed, t.other_left);
        cts_report_free(&report);
        cts_volume_free(&before);
        cts_volume_free(&after);
        /* Without a table only minip and average have a mask: the air is outside the body. */
        CtsModel model = {.volume = make(&alone)};
        raise_air(model.volume, levels[n]);
        remove_table_of(&model, 2, &report);
        assert_true(is_skipped(&report) && report.diagnostics.n == 0);
        assert_int_equal(*model.body->share, 0);
        cts_report_free(&report);
        cts_model_free(&model);
    }
}

/* A field of view within the chest: only lungs reach its border. They are not room air, as their density varies, or as
 * the windpipe is darker; with a table in air without a level of its own the result is doubtful. */
static void test_lungs_at_border(void **state)
{
    enum { VARYING, WITH_WINDPIPE, WITH_TABLE, N_KINDS };
    for (int kind = 0; kind < N_KINDS; kind++) {
        const Solid solids[] = {
            {box, {0, 0, 0, 40, 999, 999}, 40, true},
            {box, {0, 90, 0, 999, 1.5, 999}, 100, false},
        };
        const Scene s = {solids, kind == WITH_TABLE ? 2 : 1, {128, 128, 50}, AXIAL, {0, 0, 0}, 0};
        CtsVolume *v = make(&s), *before;
        size_t n = 0;
        for (int k = 0; k < v->dims[2]; k++)
            for (int j = 0; j < v->dims[1]; j++)
                for (int i = 0; i < v->dims[0]; i++, n++) {
                    double p[3];
                    voxel_lps(&s, i, j, k, p);
                    /* One density for 8 x 8 voxels, as it varies over more than noise does. */
                    const uint32_t seed = (uint32_t)(i / 8 * 7919 + j / 8 * 104729 + k * 31 + 1) * 2654435761u;
                    const double spread = kind == WITH_TABLE ? 500 : 160, share = (seed >> 16) / 65536.0;
                    if (kind == WITH_WINDPIPE && hypot(p[0], p[1]) < 10)
                        v->grey[n] = 24;
                    else if (v->grey[n] < 600)
                        v->grey[n] = (uint16_t)(1024 - 850 + (kind == WITH_WINDPIPE ? 0 : spread * (share - 0.2)));
                }
        before = copy(v);
        CtsReport report;
        remove_table(v, 2, &report);
        if (!is_skipped(&report))
            fail_msg("kind %d: something went: %s", kind, report.diagnostics.n ? report.diagnostics.items[0].text : "");
        assert_memory_equal(v->grey, before->grey, cts_volume_n_voxels(v) * sizeof *v->grey);
        assert_int_equal(report.diagnostics.n, kind == WITH_TABLE);
        if (kind == WITH_TABLE)
            assert_string_equal(report.diagnostics.items[0].code, "table_removal_uncertain");
        cts_report_free(&report);
        cts_volume_free(&before);
        cts_volume_free(&v);
    }
}

/* No mattress: the flattened back lies on the table's skin over 160 mm and all slices. */
static void test_broad_contact(void **state)
{
    const Solid solids[] = {
        TRUNK,
        {box, {0, 82, 0, 80, 16, 999}, 40, true},
        {box, {0, 99.5, 0, 230, 1.5, 999}, 100, false},
    };
    const Scene s = {solids, N(solids), {160, 100, 40}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}}, {0, 0, 0}, 0};
    Removed r = removed(&s, 2, 4);
    const Tally t = r.tally;
    assert_int_equal(t.body_changed, 0);
    assert_int_equal(t.margin_changed, 0);
    assert_int_equal(t.far_left, 0);
    assert_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
    free_removed(&r);
}

/* More than 5 % of the body in doubt: a warning, and the part is kept; a cloth without contact is still removed. */
/* A mask on a nose is removed; the head under it is kept, with its nose. */
static void test_mask(void **state)
{
    const Solid masked[] = {{ellipsoid, {0, 0, 0, 70, 88, 100}, 40, true},
                            {ellipsoid, {0, -88, 0, 9, 9, 12}, 40, true},
                            {mask, {0, 0, 0, 78, 96, 108, 1.5, 20}, 100, false}};
    const Scene scene = {masked, N(masked), {120, 140, 120}, {{1.8, 0, 0}, {0, 1.8, 0}, {0, 0, 2}}, {0, -5, 0}, 0};
    Removed r = removed(&scene, 2, 6);
    const Tally t = r.tally;
    assert_true(t.body > 1000 && t.margin > 100 && t.other > 1000);
    assert_int_equal(t.body_changed, 0);
    assert_int_equal(t.margin_changed, 0);
    assert_true(8 * t.other_left < t.other + t.other / 8); /* the caps, broad in their sections, stay */
    assert_non_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVED));
    assert_null(cts_diagnostics_find(&r.report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
    free_removed(&r);
}

/* A board as thick as a limb is removed by its wings, with a warning. */
static void test_thick_gone(void **state)
{
    const Solid winged[] = {
        TRUNK, {box, {0, 150, 0, 16, 16, 25}, 40, false}, {box, {0, 150, 0, 200, 2, 25}, 40, false}};
    const Scene scene = {winged, N(winged), {160, 120, 40}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}}, {0, 30, 0}, 0};
    CtsVolume *v = make(&scene);
    CtsReport report;
    remove_table(v, 2, &report);
    assert_non_null(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVED));
    assert_non_null(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
    assert_non_null(strstr(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN)->text,
                           "parts thicker than tables"));
    /* The board's middle of 10 x 10 x 16 voxels, except its corners; a trunk and two arms. */
    const double limb_mm3 = 10 * 10 * 16 * 27, body_mm3 = 3.1416 * (150 * 100 + 2 * 20 * 26) * 120;
    assert_true(report.table.thick_mm3 > 0.8 * limb_mm3 && report.table.thick_mm3 <= limb_mm3);
    assert_true(fabs(report.table.body_mm3 - body_mm3) < 0.03 * body_mm3);
    assert_true(report.table.removed_mm3 > report.table.thick_mm3);
    cts_report_free(&report);
    cts_volume_free(&v);
}

/* A dry bone, and the rod of a fixator on its pins, as straight along the scanner's axis as a table. */
static void test_bone_and_metal(void **state)
{
    const Solid bone[] = {{pipe, {0, 0, 13, 7.5, -100, 100}, 1300, true},
                          {ellipsoid, {0, 0, -95, 25, 25, 20}, 700, true},
                          {ellipsoid, {0, 0, 95, 20, 20, 15}, 700, true},
                          {box, {0, 45, 0, 70, 2, 999}, 100, false}};
    const Solid leg[] = {{pipe, {0, 0, 35, 0, -999, 999}, 40, true},
                         {pipe, {0, -50, 5, 0, -90, 90}, 3000, true},
                         {box, {0, -30, -60, 2.5, 20, 3}, 3000, true},
                         {box, {0, -30, 60, 2.5, 20, 3}, 3000, true},
                         {box, {0, 45, 0, 70, 2, 999}, 100, false}};
    const Scene scenes[] = {{bone, N(bone), {100, 80, 120}, AXIAL, {0, 0, 0}, 0},
                            {leg, N(leg), {100, 100, 120}, AXIAL, {0, -10, 0}, 0}};
    check_removal(&scenes[0]);
    check_removal(&scenes[1]);
    const Scene no_table = {bone, N(bone) - 1, {100, 80, 120}, AXIAL, {0, 0, 0}, 0};
    check_untouched(&no_table);
}

/* Thin fingers are as straight, and mostly flesh: they go, with a warning about their bones. */
static void test_bone_gone(void **state)
{
    const Solid hand[] = {{box, {-9, 0, -30, 36, 12, 35}, 40, true},
                          {pipe, {-27, 0, 5.5, 0, 0, 80}, 40, true},
                          {pipe, {-27, 0, 3.5, 0, 0, 76}, 900, true},
                          {pipe, {9, 0, 5.5, 0, 0, 80}, 40, true},
                          {pipe, {9, 0, 3.5, 0, 0, 76}, 900, true}};
    const Scene scene = {hand, N(hand), {80, 60, 100}, AXIAL, {0, 0, 0}, 0};
    Removed r = removed(&scene, 2, 0.5);
    size_t n = 0;
    while (n < r.report.diagnostics.n && !strstr(r.report.diagnostics.items[n].text, "as dense as bone or metal"))
        n++;
    assert_true(n < r.report.diagnostics.n);
    assert_int_equal(r.report.diagnostics.items[n].severity, CTS_WARNING);
    assert_true(r.report.table.thick_mm3 > 2000);
    free_removed(&r);
}

static void test_uncertain(void **state)
{
    const Solid thick_slab[] = {
        TRUNK, {box, {0, 109, 0, 220, 10, 999}, 100, false}, {cloth, {-118, 2, 30, 1, 150}, 0, false}};
    const Solid masked[] = {{ellipsoid, {0, 0, 0, 45, 55, 60}, 40, true},
                            {ellipsoid, {0, -57, 0, 5, 8, 8}, 40, true},
                            {mask, {0, 0, 0, 52, 62, 67, 1.5, 20}, 100, false},
                            {cloth, {-80, 2, 30, 1.5, 60}, 0, false}};
    const Scene scenes[] = {
        {thick_slab, N(thick_slab), {160, 100, 40}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}}, {0, 0, 0}, 0},
        {masked, N(masked), {120, 140, 100}, AXIAL, {0, -20, 0}, 0},
    };
    for (int n = 0; n < 2; n++) {
        const Scene *s = &scenes[n];
        CtsVolume *before = make(s), *after = copy(before);
        CtsReport report;
        remove_table(after, 2, &report);
        assert_non_null(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
        assert_int_equal(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN)->severity,
                         CTS_WARNING);
        size_t voxel = 0;
        for (int k = 0; k < s->dims[2]; k++)
            for (int j = 0; j < s->dims[1]; j++)
                for (int i = 0; i < s->dims[0]; i++, voxel++) {
                    double p[3];
                    voxel_lps(s, i, j, k, p);
                    double kept = INFINITY, gone = s->solids[s->n_solids - 1].distance(p, s->solids[s->n_solids - 1].a);
                    for (int m = 0; m + 1 < s->n_solids; m++)
                        kept = fmin(kept, s->solids[m].distance(p, s->solids[m].a));
                    if (kept <= 1)
                        assert_int_equal(after->grey[voxel], before->grey[voxel]);
                    else if (kept > 6 && gone <= 0)
                        assert_int_equal(after->grey[voxel], 0);
                }
        cts_report_free(&report);
        cts_volume_free(&before);
        cts_volume_free(&after);
    }
}

/* At most 10 % of the table are kept and 0.5 % of the body removed, for any kind of contact. */
static void check_shares(const char *name, const Scene *s)
{
    Removed r = removed(s, 2, 0.5);
    const Tally t = r.tally;
    if (t.body_changed * 200 > t.body || t.other_left * 10 > t.other)
        fail_msg("%s: %d of %d voxels of the body went, %d of %d of the table stay", name, t.body_changed, t.body,
                 t.other_left, t.other);
    free_removed(&r);
}

/* A trunk and a neck whose back varies along z, as backs do. */
#define WAVY_TRUNK                                                                                                     \
    {ellipsoid, {0, 0, 0, 150, 98, 160}, 40, true}, {ellipsoid, {0, 5, 100, 120, 92, 120}, 40, true},                  \
    {                                                                                                                  \
        ellipsoid, {0, 0, -120, 140, 98, 110}, 40, true                                                                \
    }
#define WIDE                                                                                                           \
    {                                                                                                                  \
        {3, 0, 0}, {0, 3, 0},                                                                                          \
        {                                                                                                              \
            0, 0, 3                                                                                                    \
        }                                                                                                              \
    }

static void test_shares(void **state)
{
    const Solid shell[] = {WAVY_TRUNK, {box, {0, 98.5, 0, 230, 1.5, 999}, 100, false}};
    const Solid pet[] = {WAVY_TRUNK, {hollow, {0, 125, 220, 27, 4}, 150, false}};
    const Solid cradle[] = {WAVY_TRUNK, {trough, {0, -202, 303, 300, 0, 1}, 100, false}};
    const Solid plate[] = {{ellipsoid, {0, 0, 0, 75, 95, 110}, 40, true},
                           {ellipsoid, {0, -98, -10, 9, 14, 20}, 20, true},
                           {box, {0, 99, 0, 130, 5, 999}, 100, false}};
    const Solid two_feet[] = {{ellipsoid, {60, 0, 0, 40, 110, 45}, 40, true},
                              {ellipsoid, {-60, 0, 0, 38, 112, 43}, 40, true},
                              {ellipsoid, {45, -118, 0, 7, 16, 7}, 40, true},
                              {box, {0, 112, 0, 150, 1.5, 999}, 100, false}};
    const Solid masked[] = {{ellipsoid, {0, 0, 0, 75, 95, 110}, 40, true},
                            {ellipsoid, {0, -98, -10, 9, 14, 20}, 20, true},
                            {box, {0, 101, 0, 150, 2, 999}, 150, false},
                            {box, {0, 111, 0, 150, 2, 999}, 150, false}};
    const struct {
        const char *name;
        Scene scene;
    } cases[] = {
        {"flat shell", {shell, N(shell), {160, 100, 80}, WIDE, {0, 0, 0}, 0}},
        {"PET table", {pet, N(pet), {160, 120, 80}, WIDE, {0, 40, 0}, 0}},
        {"cradle", {cradle, N(cradle), {160, 100, 80}, WIDE, {0, 0, 0}, 0}},
        {"head on a plate", {plate, N(plate), {190, 150, 110}, AXIAL, {0, 0, 0}, 0}},
        {"two feet", {two_feet, N(two_feet), {210, 180, 60}, AXIAL, {0, 0, 0}, 0}},
        {"base plate", {masked, N(masked), {210, 160, 110}, AXIAL, {0, 0, 0}, 0}},
    };
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++)
        check_shares(cases[n].name, &cases[n].scene);
}

/* The same patient and holder in other orders of axes, tilted, and with a fractional step of grey levels. */
static void test_orientations(void **state)
{
    const double steps[][3][3] = {
        {{-1.5, 0, 0}, {0, -1.5, 0}, {0, 0, -2}},                               /* head first the other way round */
        {{1.5, 0, 0}, {0, 0, -1.5}, {0, 1.5, 0}},                               /* coronal */
        {{0, 1.5, 0}, {0, 0, -1.5}, {2, 0, 0}},                                 /* sagittal */
        {{1.5, 0, 0}, {0, 1.5 * 0.94, -1.5 * 0.34}, {0, 0, 4}},                 /* tilted by 20 degrees: sheared */
        {{1.5 * 0.96, 1.5 * 0.28, 0}, {-1.5 * 0.28, 1.5 * 0.96, 0}, {0, 0, 2}}, /* turned about z */
    };
    const int dims[][3] = {{150, 150, 80}, {150, 120, 150}, {150, 120, 110}, {144, 144, 40}, {160, 160, 80}};
    const Solid solids[] = {HEAD, {trough, {0, 0, 110, 107, 30, 1}, 200, false}};
    for (int n = 0; n < 5; n++) {
        Scene s = {solids, N(solids), {dims[n][0], dims[n][1], dims[n][2]}, AXIAL, {0, 0, 0}, n % 2 ? 0.5 : 0};
        memcpy(s.step_lps, steps[n], sizeof s.step_lps);
        check_removal(&s);
    }
}

/* Separate legs, a hand, and the tip of an ear that the last slice cuts off the head. */
static void test_limbs(void **state)
{
    const Solid solids[] = {
        {pipe, {60, 0, 45, 0, -999, 999}, 40, true},     {pipe, {-60, 0, 45, 0, -999, 999}, 40, true},
        {ellipsoid, {130, 0, 0, 14, 40, 60}, 40, true},  /* a hand beside */
        {ellipsoid, {-118, 0, 62, 4, 14, 30}, 40, true}, /* a tip in the last slices */
        {box, {0, 70, 0, 150, 1.5, 999}, 100, false},    {pipe, {0, -80, 4, 0, -999, 999}, 100, false}, /* a cable */
    };
    const Scene s = {solids, N(solids), {144, 120, 64}, AXIAL, {0, 0, 0}, 0};
    check_removal(&s);
}

/* Structures that the body encloses are kept: lungs, stones in bowel gas, plates in a skull without flesh. */
static void test_inside(void **state)
{
    const Solid solids[] = {
        {pipe, {0, 0, 90, 50, -999, 999}, 40, true},
        {ellipsoid, {0, 10, 0, 8, 8, 8}, 300, true},
        {box, {0, 20, 0, 1.5, 12, 30}, 60, true},
        {box, {0, 110, 0, 110, 1.5, 999}, 100, false},
    };
    const Scene s = {solids, N(solids), {150, 150, 50}, AXIAL, {0, 10, 0}, 0};
    check_removal(&s);
    /* The air within stays as it was, with all its noise. */
    CtsVolume *v = make(&s), *before;
    for (size_t n = 0; n < cts_volume_n_voxels(v); n++)
        v->grey[n] = (uint16_t)(v->grey[n] + n % 7);
    before = copy(v);
    CtsReport report;
    remove_table(v, 2, &report);
    size_t voxel = 0;
    for (int k = 0; k < s.dims[2]; k++)
        for (int j = 0; j < s.dims[1]; j++)
            for (int i = 0; i < s.dims[0]; i++, voxel++) {
                double p[3];
                voxel_lps(&s, i, j, k, p);
                if (hypot(p[0], p[1]) < 90)
                    assert_int_equal(v->grey[voxel], before->grey[voxel]);
            }
    cts_report_free(&report);
    cts_volume_free(&before);
    cts_volume_free(&v);
}

static void test_nothing_to_remove(void **state)
{
    const Solid head[] = {HEAD};
    const Solid bone[] = {{box, {0, 0, 0, 999, 999, 999}, 1000, true}};
    const Solid in_view[] = {{pipe, {0, 0, 200, 40, -999, 999}, 40, true}, {box, {0, 0, 0, 1, 20, 999}, 40, true}};
    const Scene scenes[] = {
        {head, N(head), {144, 160, 80}, AXIAL, {0, 0, 0}, 0},
        {bone, N(bone), {50, 40, 30}, AXIAL, {0, 0, 0}, 0},
        {NULL, 0, {50, 40, 30}, AXIAL, {0, 0, 0}, 0},
        {in_view, N(in_view), {80, 80, 30}, AXIAL, {0, 0, 0}, 0}, /* a field of view within the body */
    };
    for (size_t n = 0; n < sizeof scenes / sizeof *scenes; n++)
        check_untouched(&scenes[n]);
}

/* No size is too small; nothing thick is ever lost. */
static void test_tiny(void **state)
{
    const Solid ball[] = {{ellipsoid, {0, 0, 0, 12, 12, 12}, 40, true}};
    const int dims[][3] = {{1, 1, 1},   {1, 1, 64},  {64, 1, 1}, {1, 64, 1},
                           {65, 64, 1}, {64, 65, 2}, {2, 3, 5},  {128, 2, 2}};
    for (size_t n = 0; n < sizeof dims / sizeof *dims; n++) {
        const Scene s = {ball, 1, {dims[n][0], dims[n][1], dims[n][2]}, AXIAL, {0, 0, 0}, 0};
        check_untouched(&s);
    }
}

/* Noise is refused by name, ragged masks never fail, and a volume without room is left alone. */
static void test_odd(void **state)
{
    CtsVolume *v;
    CtsError err;
    CtsReport report;
    assert_int_equal(cts_volume_new(&v, 128, 128, 100, &err), CTS_OK);
    uint32_t seed = 1;
    for (size_t n = 0; n < cts_volume_n_voxels(v); n++) {
        seed = seed * 1664525u + 1013904223u;
        v->grey[n] = (uint16_t)(seed >> 31 ? 1064 : 24);
    }
    CtsVolume *before = copy(v);
    remove_table(v, 2, &report);
    assert_true(is_skipped(&report));
    assert_non_null(cts_diagnostics_find(&report.diagnostics, CTS_DIAGNOSTIC_TABLE_REMOVAL_UNCERTAIN));
    assert_memory_equal(v->grey, before->grey, cts_volume_n_voxels(v) * sizeof *v->grey);
    cts_report_free(&report);
    for (size_t n = 0; n < cts_volume_n_voxels(v); n++) {
        seed = seed * 1664525u + 1013904223u;
        v->grey[n] = (uint16_t)(seed >> 26 ? 24 : 1064);
    }
    remove_table(v, 2, &report);
    cts_report_free(&report);
    memset(v->step_lps[1], 0, sizeof v->step_lps[1]);
    CtsReport flat = {0};
    CtsModel model = {.volume = v};
    assert_int_equal(cts_model_remove_table(&model, true, 2, &flat, &err), CTS_OK);
    assert_true(is_skipped(&flat));
    cts_report_free(&flat);
    assert_int_equal(cts_model_remove_table(&model, true, 0, NULL, NULL), CTS_OK);
    cts_volume_free(&before);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_head_on_holder),
        cmocka_unit_test(test_contact),
        cmocka_unit_test(test_prone),
        cmocka_unit_test(test_trunk_on_table),
        cmocka_unit_test(test_raised_air),
        cmocka_unit_test(test_lungs_at_border),
        cmocka_unit_test(test_broad_contact),
        cmocka_unit_test(test_mask),
        cmocka_unit_test(test_thick_gone),
        cmocka_unit_test(test_bone_and_metal),
        cmocka_unit_test(test_bone_gone),
        cmocka_unit_test(test_uncertain),
        cmocka_unit_test(test_shares),
        cmocka_unit_test(test_orientations),
        cmocka_unit_test(test_limbs),
        cmocka_unit_test(test_inside),
        cmocka_unit_test(test_nothing_to_remove),
        cmocka_unit_test(test_tiny),
        cmocka_unit_test(test_odd),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
