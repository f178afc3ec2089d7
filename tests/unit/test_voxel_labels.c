/* Labels in the picture: names and lists, the same bytes on every path, tiled beside the float64 reference. */
#include "base/cpu.h"
#include "base/mem.h"
#include "core/labels/label_set.h"
#include "core/model/voxel_labels.h"
#include "scenes.h"

enum { NX = 30, NY = 28, NZ = 26, N_LABELS = 5 };

/* Balls that overlap, and one that none of them touches; of two files. */
static CtsLabels *some_labels(const CtsVolume *v)
{
    static const char *const names[N_LABELS] = {"Bone left", "bone right", "brain", "Lesion", "brain"};
    static const int ball[N_LABELS][4] = {
        {8, 14, 13, 7}, {20, 14, 13, 8}, {14, 12, 12, 10}, {14, 12, 14, 4}, {3, 3, 3, 3}};
    CtsLabels *labels = NULL;
    CtsError err;
    CtsLabelGrid grid = {.columns = NX, .rows = NY, .n_slices = NZ / v->slice_layers};
    assert_int_equal(cts_alloc_zeroed(&grid.position_lps, NZ, &err), CTS_OK);
    for (int k = 0; k < grid.n_slices; k++)
        grid.position_lps[k][2] = k * v->slice_layers * v->step_lps[2][2];
    const int n_slices = grid.n_slices;
    assert_int_equal(cts_labels_new(&labels, &grid, &err), CTS_OK);
    for (int n = 0; n < N_LABELS; n++) {
        assert_int_equal(cts_labels_add(labels, 1 + n / 4, n % 4 + 1, names[n], CTS_LABEL_NIFTI, &err), CTS_OK);
        const int *const b = ball[n];
        for (int row = 0; row < NY * n_slices; row++)
            for (int i = 0; i < NX; i++) {
                const int x = i - b[0], y = row % NY - b[1], z = row / NY * v->slice_layers - b[2];
                if (x * x + y * y + z * z > b[3] * b[3])
                    continue;
                cts_label_add_run(&labels->items[n], (uint32_t)row, i, i + 1, &err);
                labels->items[n].fact.voxels++;
            }
        cts_label_sort_runs(&labels->items[n]);
    }
    labels->counted = true;
    return labels;
}

static CtsStatus take(CtsModel *model, const CtsLabelChoice *choice, CtsError *err)
{
    CtsLabels *labels = some_labels(model->volume);
    const CtsStatus st = cts_model_take_labels(model, labels, choice, 2, NULL, err);
    cts_labels_free(&labels);
    return st;
}

static CtsModel owned_head(int layers, const CtsLabelChoice *choice)
{
    CtsModel model = {.volume = phantom_head(NX, NY, NZ, 20)};
    CtsError err = {0};
    model.volume->slice_layers = layers;
    if (take(&model, choice, &err))
        fail_msg("%s", err.text);
    return model;
}

static int look_at(const CtsModel *model, int i, int j, int k)
{
    return cts_appearance_of_voxel(model->voxel_labels, i, j, k);
}

static void lists(void **state)
{
    CtsModel model = owned_head(1, &(CtsLabelChoice){.hide = "BONE*"});
    assert_int_equal(look_at(&model, 5, 14, 13), CTS_APPEARANCE_HIDDEN);
    assert_int_equal(look_at(&model, 24, 14, 13), CTS_APPEARANCE_HIDDEN);
    assert_int_equal(look_at(&model, 14, 12, 14), CTS_APPEARANCE_PRESET); /* the lesion's, which is smaller */
    assert_int_equal(model.voxel_labels->shown.volume->grey[(13 * NY + 14) * NX + 5], 0);
    cts_model_free(&model);
    model = owned_head(1, &(CtsLabelChoice){.show = "1:brain,rest", .hide = "4"});
    assert_int_equal(look_at(&model, 14, 12, 14), CTS_APPEARANCE_HIDDEN);
    assert_int_equal(look_at(&model, 14, 12, 6), CTS_APPEARANCE_PRESET);
    assert_int_equal(look_at(&model, 3, 3, 3), CTS_APPEARANCE_PRESET); /* the other brain counts as rest */
    cts_model_free(&model);
    model = owned_head(1, &(CtsLabelChoice){.hide = "lesion", .order = "bone right,3"});
    assert_int_equal(look_at(&model, 14, 12, 14), CTS_APPEARANCE_PRESET);
    cts_model_free(&model);
    static const char *const appearances[] = {"all=#ff0000", "lesion=#00FF00:0.5", "rest=skin"};
    model = owned_head(1, &(CtsLabelChoice){.appearances = appearances, .n_appearances = 3});
    assert_int_equal(look_at(&model, 14, 12, 14), CTS_APPEARANCE_OWN + 1);
    assert_int_equal(look_at(&model, 14, 12, 6), CTS_APPEARANCE_OWN);
    assert_string_equal(model.voxel_labels->appearances[look_at(&model, 29, 27, 25)].preset->name, "skin");
    cts_model_free(&model);
    model = owned_head(1, &(CtsLabelChoice){.order = "lesion", .show = "all,rest"});
    assert_null(model.voxel_labels); /* nothing is hidden, and all have one appearance */
    cts_model_free(&model);
}

static void refused(void **state)
{
    static const char *const appearances[] = {"lesion=#12",       "lesion",         "=bone",
                                              "lesion=#123456:2", "lesion=no such", "x=bone"};
    static const struct {
        CtsLabelChoice choice;
        const char *why;
    } cases[] = {
        {{.show = "leison"}, "did you mean Lesion?"},
        {{.hide = "brain"}, "1:brain or 2:brain"},
        {{.hide = "1"}, "label files 1 and 2 both"},
        {{.show = "lesion,,"}, "empty name"},
        {{.hide = "3:brain"}, "no label has this name or number"},
        {{.order = "zz*"}, "`label-order` zz*"},
    };
    CtsModel model = {.volume = phantom_head(NX, NY, NZ, 0)};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsError err = {0};
        assert_int_equal(take(&model, &cases[i].choice, &err), CTS_ERR_USAGE);
        if (!strstr(err.text, cases[i].why))
            fail_msg("%s", err.text);
    }
    for (size_t i = 0; i < sizeof appearances / sizeof *appearances; i++) {
        CtsError err = {0};
        assert_int_not_equal(take(&model, &(CtsLabelChoice){.appearances = &appearances[i], .n_appearances = 1}, &err),
                             CTS_OK);
        assert_non_null(strstr(err.text, "`label`"));
        assert_null(model.voxel_labels);
    }
    cts_model_free(&model);
}

/* Several appearances, hidden labels, layers between slices; lit and in every mode. */
static void same_bytes_and_near_reference(void **state)
{
    static const char *const appearances[] = {"lesion=#00ff00:0.05", "bone*=#8080ff", "1:brain=skin"};
    static const CtsLabelChoice choices[] = {{.appearances = appearances, .n_appearances = 3},
                                             {.hide = "lesion,1:brain"},
                                             {.show = "bone*", .appearances = appearances, .n_appearances = 2}};
    static const unsigned cpu[] = {~0u, 0, CTS_CPU_AVX2};
    for (int variant = 0; variant < 6; variant++) {
        CtsModel model = owned_head(variant % 2 ? 2 : 1, &choices[variant % 3]);
        const int n_modes = cts_voxel_labels_coloured(model.voxel_labels) ? 1 : CTS_N_MODES;
        for (int mode = 0; mode < n_modes; mode++) {
            CtsPreset preset = preset_named(variant < 3 ? "bone" : "muscle");
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 40, 35 * variant, 20 * variant - 50);
            CtsPicture *p[4];
            double squares = 0;
            s.mode = mode;
            s.shade = variant % 2 ? CTS_ON : CTS_OFF;
            for (int run = 0; run < 4; run++) {
                s.engine = run < 3 ? CTS_ENGINE_TILED : CTS_ENGINE_RAYCAST;
                cts_cpu_set_mask(run < 3 ? cpu[run] : ~0u);
                s.n_threads = 1 + run;
                p[run] = render_model(&model, &preset, &s, NULL);
            }
            const size_t n = 4 * (size_t)s.width * (size_t)s.height;
            for (int run = 1; run < 3; run++)
                assert_same_picture(p[0], p[run], "variant %d, mode %s, view %g,%g, SIMD mask %x", variant,
                                    cts_mode_names[mode], s.azimuth_deg, s.elevation_deg, cpu[run]);
            for (size_t i = 0; i < n; i++)
                squares += pow((double)p[0]->pixels[i] - (double)p[3]->pixels[i], 2);
            assert_true(sqrt(squares / (double)n) < (mode == CTS_MODE_COMPOSITE ? 0.5 / 255 : 1e-6));
            for (int run = 0; run < 4; run++)
                cts_picture_free(&p[run]);
        }
        cts_model_free(&model);
    }
}

/* White, black and blue are themselves, and dcmqi's liver is 221, 130, 101: writers take D65. */
static void colours_of_files(void **state)
{
    static const struct {
        int lab[3];
        double rgb[3];
    } cases[] = {{{41661, 41167, 40792}, {221, 130, 101}},
                 {{65535, 32896, 32896}, {255, 255, 255}},
                 {{0, 32896, 32896}, {0}},
                 {{21165, 53249, 5175}, {0, 0, 255}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsLabel label = {.runs = NULL};
        cts_label_take_lab(&label, cases[i].lab);
        assert_true(label.coloured);
        for (int c = 0; c < 3; c++)
            assert_true(fabs(255 * label.rgb[c] - cases[i].rgb[c]) < 0.5);
    }
}

/* Of a choice: for each label N, I or E, and whether whole segments cannot express some of it. */
static void crops_by_segment(void **state)
{
    static const struct {
        const char *show, *hide, *study, *crop;
        bool unsaid;
    } cases[] = {
        {NULL, "lesion", "1.2", "NNNEN", false},        {NULL, "1:brain", "1.2", "NNNNN", true},
        {"lesion", NULL, "1.2", "NNNIN", false},        {"1:brain", "lesion", "1.2", "NNIEN", false},
        {"lesion", "1:brain", "1.2", "NNNIN", false},   {"bone*,1:brain", "lesion", "1.2", "IIIEN", false},
        {NULL, "all,rest", "1.2", "NNNNN", true},       {NULL, "lesion", "1.3", "NNNNN", true},
        {NULL, "2:brain,lesion", "1.2", "NNNNN", true}, {NULL, "rest", "1.2", "NNNNN", true},
    };
    CtsVolume *v = phantom_head(NX, NY, NZ, 20);
    CtsLabels *labels = some_labels(v);
    CtsError err = {0};
    const CtsLabelObject object = {.class_uid = "1", .sop_uid = "2", .series_uid = "3", .study_uid = "1.2"};
    assert_int_equal(cts_grow(&labels->objects, 0, &err), CTS_OK);
    labels->objects[labels->n_objects++] = object;
    for (int n = 0; n < N_LABELS; n++) {
        labels->items[n].fact.overlap = n < 4;
        labels->items[n].object = n < 4; /* the last one comes from elsewhere */
    }
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        CtsLabelCrop crop[N_LABELS] = {CTS_CROP_NONE};
        const char *unsaid = NULL;
        const CtsLabelChoice choice = {.show = cases[i].show, .hide = cases[i].hide};
        assert_int_equal(cts_labels_crop(labels, &choice, cases[i].study, crop, &unsaid, &err), CTS_OK);
        for (int n = 0; n < N_LABELS; n++)
            assert_int_equal("NIE"[crop[n]], cases[i].crop[n]);
        assert_int_equal(unsaid != NULL, cases[i].unsaid);
    }
    cts_labels_free(&labels);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lists),
        cmocka_unit_test(refused),
        cmocka_unit_test(crops_by_segment),
        cmocka_unit_test(colours_of_files),
        cmocka_unit_test(same_bytes_and_near_reference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
