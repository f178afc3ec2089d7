/* Drafts: the table of means by formulas, slabs whose opacity is known, and pictures held to what is told of them. */
#include "base/mem.h"
#include "scenes.h"
#include "engine/tiled/draft_table.h"

/* Extinction (s - 100) / 1000 per grey level from 100 to 300 on, nothing below, 0.2 above; one colour. */
static const double ramp_from = 100, ramp_to = 300, ramp_per_grey = 1e-3;

static double ramp_integral(double s)
{
    const double x = fmin(fmax(s - ramp_from, 0), ramp_to - ramp_from), beyond = fmax(s - ramp_to, 0);
    return ramp_per_grey * (0.5 * x * x + (ramp_to - ramp_from) * beyond);
}

/* Levels are near where the ramp is, and between any two the mean is that of the integral. */
static void table_of_a_ramp(void **state)
{
    (void)state;
    enum { N = 1001, LEVELS = CTS_DRAFT_LEVELS };
    CtsSlabTable table = {.n = N - 1, .grey_low = 0, .per_grey = 1};
    CtsDraftTable draft;
    CtsError err;
    assert_int_equal(cts_alloc_array(&table.sum, N, &err), CTS_OK);
    assert_int_equal(cts_alloc_zeroed(&table.here, N, &err), CTS_OK);
    assert_int_equal(cts_alloc_zeroed(&table.change, N, &err), CTS_OK);
    for (int i = 0; i < N; i++) {
        for (int c = 0; c < 4; c++)
            table.sum[i][c] = ramp_integral(i) * (c < 3 ? 0.25 * (c + 1) : 1);
        table.change[i][0] = (float)(ramp_per_grey * fmin(fmax(i - ramp_from, 0), ramp_to - ramp_from));
    }
    assert_int_equal(cts_draft_table_init(&draft, &table, (CtsRange){0, N - 1}, 2, &err), CTS_OK);
    double level[LEVELS], at = 0;
    int n = 0;
    for (int i = 0; i < CTS_DRAFT_RANGES; i++) {
        assert_true(fabs((double)draft.start[i] - at) < 1.01);
        at += (double)draft.length[i];
        const int inside = (int)floor((double)draft.length[i] * (double)draft.per_grey[i] + 0.5);
        for (int k = 0; k < inside; k++)
            level[n++] = (double)draft.start[i] + k / (double)draft.per_grey[i];
    }
    assert_int_equal(n, LEVELS - 1);
    level[n++] = N - 1;
    int near = 0;
    for (int i = 0; i < LEVELS; i++)
        near += level[i] >= ramp_from && level[i] <= ramp_to;
    assert_true(near > LEVELS / 2);
    for (int a = 0; a < LEVELS; a++)
        for (int b = 0; b < LEVELS; b++) {
            const float *mean = draft.mean[a * LEVELS + b];
            if (a == b)
                continue;
            const double expected = (ramp_integral(level[b]) - ramp_integral(level[a])) / (level[b] - level[a]);
            /* Sums are straight between entries: off by an eighth of an entry's slope at either level. */
            assert_true(fabs((double)mean[3] - expected) <=
                        1e-5 * expected + 0.25 * ramp_per_grey / fabs(level[b] - level[a]));
            for (int c = 0; c < 3 && expected > 1e-4; c++)
                assert_true(fabs((double)mean[c] - 0.25 * (c + 1)) < 1e-5);
        }
    /* A level by itself stands for what is nearest to it. */
    for (int a = 1; a < LEVELS - 1; a++) {
        const double here = ramp_per_grey * fmin(fmax(level[a] - ramp_from, 0), ramp_to - ramp_from);
        const double apart = fmax(level[a + 1] - level[a], level[a] - level[a - 1]);
        assert_true(fabs((double)draft.mean[a * LEVELS + a][3] - here) <= ramp_per_grey * apart);
    }
    cts_draft_table_free(&draft);
    cts_free(&table.sum);
    cts_free(&table.here);
    cts_free(&table.change);
}

/* A haze and a wall, in layers along the view and askew: opacity 1 - exp(-extinction * length). */
static void slab_of_one_level(void **state)
{
    (void)state;
    static const double extinctions[] = {1e-7, 0.01, 0.3, 4};
    enum { SIZE = 40, WIDTH = 1 << 12, N = 24 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, N, N, N, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = 1024;
    for (size_t e = 0; e < sizeof extinctions / sizeof *extinctions; e++)
        for (int view = 0; view < 2; view++) {
            CtsPreset preset = {.name = "slab", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2};
            for (int i = 0; i < 2; i++) {
                preset.opacity[i] = (CtsOpacityPoint){-1000 + 2000 * i, -expm1(-extinctions[e])};
                preset.colour[i] = (CtsColourPoint){-1000 + 2000 * i, {0.2, 0.4, 0.6}};
            }
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, view ? 45 : 0, 0);
            s.max_error = 4;
            s.width = WIDTH; /* many pixels, most of them empty */
            CtsReport report = {0};
            CtsPicture *p = render(v, &preset, &s, &report);
            assert_non_null(strstr(report.plan, "draft: "));
            assert_null(strstr(report.plan, "rendered anew"));
            cts_report_free(&report);
            const float *centre = p->pixels + 4 * (SIZE / 2 * WIDTH + WIDTH / 2);
            /* The centre pixel's ray lies half a pixel beside the middle, where the way askew is shorter. */
            const double mm = p->info.mm_per_pixel, length = view ? (N - 1) * sqrt(2) - mm : N - 1;
            const double opacity = -expm1(-extinctions[e] * length), stops = 0.5 * 4 / 255;
            assert_true(fabs((double)centre[3] - opacity) <= 1e-4 * opacity + (opacity > 1 - stops ? stops : 0));
            assert_true(fabs((double)centre[1] - 0.4 * opacity) <= 1e-4 * opacity + (opacity > 1 - stops ? stops : 0));
            cts_picture_free(&p);
        }
    cts_volume_free(&v);
}

static bool warns(const CtsReport *report)
{
    bool warned = false;
    for (size_t i = 0; i < report->findings.n; i++)
        warned = warned || !strcmp(report->findings.items[i].code, "error_bound");
    return warned;
}

/* What a draft tells is true, and kept or warned of; it is a draft from the error on from which it is one. */
static void told_of_drafts(void **state)
{
    (void)state;
    static const double views[][2] = {{0, 0}, {30, 20}, {-120, -50}}, asked[] = {1.9, 4, 40};
    enum { SIZE = 368 };
    CtsVolume *volumes[] = {phantom_head(48, 44, 40, 0), phantom_head(40, 44, 36, 60)};
    for (int n = 0; n < 2; n++)
        for (int view = 0; view < 3; view++)
            for (int lit = 0; lit < 2; lit++)
                for (int a = 0; a < 3; a++) {
                    const CtsPreset preset = preset_named(n ? "skin" : "bone");
                    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, views[view][0], views[view][1]);
                    CtsReport report = {0};
                    s.shade = lit ? CTS_ON : CTS_OFF;
                    s.max_error = asked[a];
                    s.verify = 1500;
                    CtsPicture *p = render(volumes[n], &preset, &s, &report);
                    assert_int_equal(strstr(report.plan, "draft: ") != NULL, asked[a] >= (lit ? 4 : 2));
                    if (asked[a] > 10) { /* a draft stands for itself */
                        assert_null(strstr(report.plan, "rendered anew"));
                        assert_true(255 * report.verified.rmse < (lit ? 4 : 2.2));
                    }
                    assert_true(report.verified.rmse <= report.bound.rmse);
                    assert_true(report.verified.max <= report.bound.max);
                    assert_true(warns(&report) || 255 * report.verified.rmse <= asked[a]);
                    cts_picture_free(&p);
                    cts_report_free(&report);
                }
    for (int n = 0; n < 2; n++)
        cts_volume_free(&volumes[n]);
}

/* A ball whose grey levels fall off evenly, with a bright core; lumps are as many voxels wide. */
static CtsVolume *lumpy_ball(int n, double lump)
{
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, n, n + 6, n - 5, &err), CTS_OK);
    for (int k = 0; k < v->dims[2]; k++)
        for (int j = 0; j < v->dims[1]; j++)
            for (int i = 0; i < n; i++) {
                const double r = hypot(hypot(i - n / 2.0, j - n / 2.0), k - n / 2.0) / (n / 2.0);
                const double wave = sin(M_PI * i / lump) + sin(M_PI * j / lump) + sin(M_PI * k / lump);
                const double hu = 700 - 1300 * r + 120 * wave;
                v->grey[((size_t)k * (size_t)v->dims[1] + (size_t)j) * (size_t)n + (size_t)i] =
                    (uint16_t)(fmax(hu, -1024) + 1024);
            }
    return v;
}

/* Every second pixel of every second row is marched, but for 2^-16 voxels where it is without a lattice, and what lies
 * between pixels that agree lies between them. */
static void lattice_of_a_draft(void **state)
{
    (void)state;
    enum { WIDTH = 381, HEIGHT = 350 };
    CtsVolume *v = lumpy_ball(40, 12);
    const CtsPreset preset = preset_named("bone");
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, WIDTH, 25, 15);
    s.height = HEIGHT;
    s.mm_per_pixel = 0.15;
    s.shade = CTS_OFF;
    s.max_error = 8;
    s.want_depth = true; /* depths are not filled in, so all is marched */
    CtsPicture *marched = render(v, &preset, &s, NULL);
    s.want_depth = false;
    CtsReport report = {0};
    CtsPicture *filled = render(v, &preset, &s, &report);
    assert_null(strstr(report.plan, "rendered anew"));
    cts_report_free(&report);
    int n_filled = 0, n_seen = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const float *a = marched->pixels + 4 * (y * WIDTH + x), *b = filled->pixels + 4 * (y * WIDTH + x);
            double apart = 0;
            for (int c = 0; c < 4; c++)
                apart = fmax(apart, fabs((double)a[c] - (double)b[c]));
            assert_true(apart < (x % 2 || y % 2 ? 4 * 8.0 / 255 : 1.0 / 255));
            n_filled += apart > 1e-3;
            n_seen += a[3] > 0;
        }
    assert_true(n_filled > n_seen / 10);
    cts_picture_free(&marched);
    cts_picture_free(&filled);
    cts_volume_free(&v);
}

/* Plates edge on, of which a hard step shows less than a pixel's height, before nothing: some lie between the lattice's
 * rows. */
static void lines_between_lattice_rows(void **state)
{
    (void)state;
    enum { SIZE = 400, N = 44, APART = 5 };
    CtsVolume *v = NULL;
    CtsError err;
    assert_int_equal(cts_volume_new(&v, N, 12, N, &err), CTS_OK);
    for (int k = 3; k < N; k += APART)
        for (int i = 0; i < N * 12; i++)
            v->grey[(size_t)k * N * 12 + (size_t)i] = 4024;
    CtsPreset preset = {.name = "edge", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2};
    preset.opacity[0] = (CtsOpacityPoint){2700, 0};
    preset.opacity[1] = (CtsOpacityPoint){2700.5, 0.9};
    preset.colour[0] = (CtsColourPoint){-1000, {0.9, 0.8, 0.7}};
    preset.colour[1] = (CtsColourPoint){3000, {0.9, 0.8, 0.7}};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 0);
    s.mm_per_pixel = 0.11;
    s.max_error = 100; /* so that no piece tells of them */
    s.want_depth = true;
    CtsPicture *marched = render(v, &preset, &s, NULL);
    s.want_depth = false;
    CtsPicture *filled = render(v, &preset, &s, NULL);
    int n_odd = 0;
    for (int y = 0; y < SIZE; y++) {
        const size_t at = 4 * ((size_t)y * SIZE + SIZE / 2) + 3;
        n_odd += y % 2 && marched->pixels[at] > 0.5f;
        assert_true(fabsf(marched->pixels[at] - filled->pixels[at]) < 12.0f / 255);
    }
    assert_true(n_odd > 1);
    cts_picture_free(&marched);
    cts_picture_free(&filled);
    cts_volume_free(&v);
}

static bool skips_half(const CtsReport *report)
{
    for (size_t i = 0; i < report->n_skips; i++)
        if (!strcmp(report->skips[i].what, "half the resolution"))
            return true;
    return false;
}

typedef struct Rows {
    float *pixels;
    size_t n;
} Rows;

static CtsStatus take_rows(void *context, CtsPicture *band, CtsError *err)
{
    Rows *rows = context;
    const size_t n = 4 * (size_t)band->width * (size_t)band->height;
    (void)err;
    memcpy(rows->pixels + rows->n, band->pixels, n * sizeof *rows->pixels);
    rows->n += n;
    return CTS_OK;
}

/* Frames of a rotation come from half the resolution where that will do, tell what they err by, and are the same bytes
 * for any number of threads and rows at a time. */
static void half_of_a_rotation(void **state)
{
    (void)state;
    enum { SIZE = 380, N_VIEWS = 3 };
    static const double lumps[] = {14, 2.2};
    for (int n = 0; n < 2; n++)
        for (int lit = 0; lit < 2; lit++) {
            CtsVolume *v = lumpy_ball(64, lumps[n]);
            const CtsPreset preset = preset_named("bone");
            CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 10);
            CtsRenderer *renderer, *banded;
            CtsError err = {0};
            Rows rows = {.pixels = malloc(sizeof(float) * 4 * SIZE * SIZE)};
            assert_non_null(rows.pixels);
            s.shade = lit ? CTS_ON : CTS_OFF;
            s.max_error = 10;
            s.rotation_frames = N_VIEWS;
            s.verify = 1500;
            assert_int_equal(cts_render_begin(&renderer, v, &preset, &s, &err), CTS_OK);
            s.n_threads = 3;
            s.verify = 0;
            assert_int_equal(cts_render_begin(&banded, v, &preset, &s, &err), CTS_OK);
            const CtsBandSink sink = {.take = take_rows, .context = &rows, .max_rows = 128};
            for (int view = 0; view < N_VIEWS; view++) {
                CtsReport report = {0};
                CtsPicture *frame;
                assert_int_equal(cts_render_frame(renderer, 120 * view, 10, &frame, &report, &err), CTS_OK);
                assert_int_equal(strstr(report.plan, "at half the resolution, 33 x 36 x 30 voxels") != NULL, n == 0);
                assert_int_equal(skips_half(&report), n == 1 && view == 0);
                assert_true(report.verified.rmse <= report.bound.rmse);
                assert_true(warns(&report) || 255 * report.verified.rmse <= 10);
                rows.n = 0;
                assert_int_equal(cts_render_bands(banded, 120 * view, 10, &sink, NULL, &err), CTS_OK);
                assert_int_equal(rows.n, 4 * SIZE * SIZE);
                assert_memory_equal(rows.pixels, frame->pixels, rows.n * sizeof(float));
                cts_picture_free(&frame);
                cts_report_free(&report);
            }
            cts_render_end(&renderer);
            cts_render_end(&banded);
            free(rows.pixels);
            cts_volume_free(&v);
        }
}

/* A small thing in a wide frame errs at its edge alone, where rays spread evenly would hardly go. */
static void half_of_a_small_thing(void **state)
{
    (void)state;
    enum { N_VIEWS = 12 };
    static const double mm[] = {0.4, 0.8};
    CtsVolume *v = lumpy_ball(40, 1e6);
    CtsPreset preset = preset_named("bone");
    preset.n_opacity = 3;
    preset.opacity[0] = (CtsOpacityPoint){400, 0};
    preset.opacity[1] = (CtsOpacityPoint){400, 0.9};
    preset.opacity[2] = (CtsOpacityPoint){3000, 0.9};
    for (int n = 0; n < 2; n++) {
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, 380, 0, 20);
        CtsRenderer *renderer;
        CtsError err = {0};
        int n_half = 0;
        s.shade = CTS_OFF;
        s.mm_per_pixel = mm[n];
        s.max_error = 20;
        s.rotation_frames = N_VIEWS;
        s.verify = 4000;
        assert_int_equal(cts_render_begin(&renderer, v, &preset, &s, &err), CTS_OK);
        for (int view = 0; view < N_VIEWS; view++) {
            CtsReport report = {0};
            CtsPicture *frame;
            assert_int_equal(cts_render_frame(renderer, 360.0 * view / N_VIEWS, 20, &frame, &report, &err), CTS_OK);
            n_half += strstr(report.plan, "rays show that it will do") != NULL;
            assert_true(report.verified.rmse > 0 && report.verified.rmse <= report.bound.rmse);
            cts_picture_free(&frame);
            cts_report_free(&report);
        }
        assert_int_equal(n_half, N_VIEWS);
        cts_render_end(&renderer);
    }
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(table_of_a_ramp),
        cmocka_unit_test(slab_of_one_level),
        cmocka_unit_test(told_of_drafts),
        cmocka_unit_test(lattice_of_a_draft),
        cmocka_unit_test(lines_between_lattice_rows),
        cmocka_unit_test(half_of_a_rotation),
        cmocka_unit_test(half_of_a_small_thing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
