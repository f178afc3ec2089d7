/* The trace of a pixel's ray (--trace-pixel): segments that follow each other, add up to what a formula says of a slab,
 * and end in the pixel of the picture. */
#include "scenes.h"
#include <jansson.h>

enum { SIZE = 48 };

/* The lines of one march. */
typedef struct Traced {
    int n_segments, n_split;
    double depth, t_mm, transmittance; /* sum; where the next segment begins; in front of it */
    double rgba[4];
    bool done;
} Traced;

static double number(const json_t *object, const char *key)
{
    return json_number_value(json_object_get(object, key));
}

static double item(const json_t *object, const char *key, size_t i)
{
    return json_number_value(json_array_get(json_object_get(object, key), i));
}

static void take_segment(Traced *t, const json_t *line, double volume_hu)
{
    const double t_mm = number(line, "t_mm"), before = item(line, "transmittance", 0),
                 after = item(line, "transmittance", 1);
    if (strcmp(json_string_value(json_object_get(line, "outcome")), "integrated")) {
        t->n_split++;
        return;
    }
    if (t->n_segments && (t_mm < t->t_mm - 1e-4 || fabs(before - t->transmittance) > 1e-6))
        fail_msg("segment %d: expected t_mm >= %.9g and transmittance %.9g, actual %.9g and %.9g", t->n_segments,
                 t->t_mm, t->transmittance, t_mm, before);
    for (size_t i = 0; i < 4 && !isnan(volume_hu); i++)
        if (fabs(item(line, "hu", i) - volume_hu) > 1e-3)
            fail_msg("segment %d: expected %g HU, actual %.9g", t->n_segments, volume_hu, item(line, "hu", i));
    if (!(0 <= after && after <= before && before <= 1))
        fail_msg("segment %d: transmittance %.9g behind %.9g", t->n_segments, after, before);
    t->n_segments++;
    t->depth += number(line, "depth");
    t->t_mm = t_mm + number(line, "length_mm");
    t->transmittance = after;
}

/* The trace of pixel x, y, read back; NAN: a volume of several HU. */
static Traced read_trace(const CtsReport *report, const char *precision, double volume_hu)
{
    Traced t = {.transmittance = 1};
    assert_non_null(report->trace);
    for (const char *p = report->trace; *p; p = strchr(p, '\n') + 1) {
        json_error_t why;
        json_t *line = json_loadb(p, strcspn(p, "\n"), 0, &why);
        if (!line)
            fail_msg("%s: %.200s", why.text, p);
        const char *kind = json_string_value(json_object_get(line, "trace"));
        if (!strcmp(json_string_value(json_object_get(line, "precision")), precision)) {
            if (!strcmp(kind, "segment"))
                take_segment(&t, line, volume_hu);
            t.done |= !strcmp(kind, "pixel");
            for (size_t c = 0; c < 4 && !strcmp(kind, "pixel"); c++)
                t.rgba[c] = item(line, "rgba", c);
        }
        json_decref(line);
    }
    return t;
}

/* A slab of 0 HU, 20 layers of 1 mm, with extinction 0.03 per mm: depth 0.03 times 19 mm. */
static void constant_slab(void **state)
{
    CtsVolume *v = NULL;
    CtsError err;
    CtsReport report = {0};
    assert_int_equal(cts_volume_new(&v, 24, 20, 24, &err), CTS_OK);
    for (size_t i = 0; i < cts_volume_n_voxels(v); i++)
        v->grey[i] = 1024;
    CtsPreset p = {.name = "slab", .unit_distance_mm = 1, .n_opacity = 2, .n_colour = 2};
    for (int i = 0; i < 2; i++) {
        p.opacity[i] = (CtsOpacityPoint){-500 + 1000 * i, -expm1(-0.03)};
        p.colour[i] = (CtsColourPoint){-500 + 1000 * i, {0.2, 0.4, 0.6}};
    }
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 0);
    s.trace = true;
    s.trace_x = s.trace_y = SIZE / 2;
    CtsPicture *picture = render(v, &p, &s, &report);
    static const char *const precisions[] = {"single", "double"};
    for (int i = 0; i < 2; i++) {
        const Traced t = read_trace(&report, precisions[i], 0);
        if (!t.done || t.n_segments < 1 || fabs(t.depth - 0.03 * 19) > 1e-5)
            fail_msg("%s: expected a depth of %g, actual %.9g in %d segments", precisions[i], 0.03 * 19, t.depth,
                     t.n_segments);
    }
    cts_report_free(&report);
    cts_picture_free(&picture);
    cts_volume_free(&v);
}

/* Pixels of a lit head: the trace in single precision ends in the picture's pixel, or, where error control re-rendered
 * that, the one in double precision does. */
static void ends_in_the_pixel(void **state)
{
    CtsVolume *v = phantom_head(40, 36, 30, 10);
    const CtsPreset skin = preset_named("skin");
    for (int i = 0; i < 12; i++) {
        CtsReport report = {0};
        CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 30 * i, 5 * i);
        s.shade = i % 2 ? CTS_ON : CTS_OFF;
        s.trace = true;
        s.trace_x = SIZE / 2 - 6 + i;
        s.trace_y = SIZE / 2 + 5 - i;
        CtsPicture *p = render(v, &skin, &s, &report);
        const float *pixel = p->pixels + 4 * (s.trace_y * SIZE + s.trace_x);
        const Traced single = read_trace(&report, "single", NAN), twice = read_trace(&report, "double", NAN);
        for (int c = 0; c < 4; c++)
            if ((double)pixel[c] != (double)(float)single.rgba[c] && (double)pixel[c] != (double)(float)twice.rgba[c])
                fail_msg("view %g,%g, pixel %d,%d, channel %d: expected %.9g, traced %.9g in single and %.9g in "
                         "double precision",
                         s.azimuth_deg, s.elevation_deg, s.trace_x, s.trace_y, c, (double)pixel[c], single.rgba[c],
                         twice.rgba[c]);
        cts_report_free(&report);
        cts_picture_free(&p);
    }
    cts_volume_free(&v);
}

/* Pixels outside the picture, and modes without segments. */
static void refused(void **state)
{
    CtsVolume *v = phantom_head(20, 18, 16, 0);
    const CtsPreset bone = preset_named("bone");
    CtsReport report = {0};
    CtsPicture *picture = NULL;
    CtsError err = {0};
    CtsRenderSettings s = settings_for(CTS_ENGINE_TILED, SIZE, 0, 0);
    s.trace = true;
    s.trace_x = SIZE;
    assert_int_equal(cts_render(MODEL_OF(v), &bone, &s, &picture, &report, &err), CTS_ERR_USAGE);
    assert_non_null(strstr(err.text, "48 x 48"));
    s.trace_x = 0;
    s.mode = CTS_MODE_MIP;
    picture = render(v, &bone, &s, &report);
    assert_null(report.trace);
    assert_int_equal(report.diagnostics.n, 1);
    assert_string_equal(report.diagnostics.items[0].code, "trace_left_out");
    cts_report_free(&report);
    cts_picture_free(&picture);
    cts_volume_free(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(constant_slab),
        cmocka_unit_test(ends_in_the_pixel),
        cmocka_unit_test(refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
