/* Preset files: accepted ones, errors with their line, and readers that no bytes can break. */
#include "ctsplat/preset.h"
#include "unit.h"

#include <math.h>
#include <string.h>

static CtsStatus parse(const char *text, CtsPreset *preset, CtsError *err)
{
    return cts_preset_parse(text, strlen(text), "f", NULL, preset, err);
}

/* Text is refused with a message that begins with "f: line LINE: " and holds part. */
static void refused(const char *text, int line, const char *part)
{
    CtsPreset preset;
    CtsError err = {0};
    char start[32];
    snprintf(start, sizeof start, "f: line %d: ", line);
    if (parse(text, &preset, &err) != CTS_ERR_PRESET)
        fail_msg("not refused: %s", text);
    if (strncmp(err.text, start, strlen(start)) || !strstr(err.text, part))
        fail_msg("refused with \"%s\", expected \"%s...%s\" for: %s", err.text, start, part, text);
}

#define POINT "{\"hu\": 0, \"opacity\": 1, \"rgb\": [1, 1, 1]}"
#define WITH(more) "{\"name\": \"a\", \"points\": [" POINT "]\n" more "}"

static void json_read(void **state)
{
    CtsPreset p;
    assert_int_equal(parse("{\"name\": \"a\", \"points\": [" POINT "]}", &p, NULL), CTS_OK);
    assert_string_equal(p.name, "a");
    assert_int_equal(p.mode, CTS_MODE_COMPOSITE);
    assert_true(!p.shade && !p.remove_table && !p.background_none && p.unit_distance_mm == 1);
    assert_true(p.window_high_hu > p.window_low_hu);
    const char *all = "\xef\xbb\xbf { \"remove_table\": true, \"background\": \"#ff8000\", \"name\": \"all of it\",\n"
                      "\"window\": [-100, 300.5], \"unit_distance_mm\": 2.5, \"mode\": \"minip\",\n"
                      "\"shade\": {\"power\": 7, \"ambient\": 0.5},\n"
                      "\"points\": [{\"opacity\": 0.25, \"hu\": -10}, {\"opacity\": 0.75, \"hu\": -10}],\n"
                      "\"colour_points\": [{\"hu\": 1, \"rgb\": [0, 0.5, 1]}, {\"hu\": 9, \"rgb\": [1, 1, 1]}]}\n";
    assert_int_equal(parse(all, &p, NULL), CTS_OK);
    assert_string_equal(p.name, "all of it");
    assert_true(p.remove_table && p.shade && p.power == 7 && p.ambient == 0.5 && p.diffuse == 0.8);
    assert_true(p.background[0] == 1 && fabs(p.background[1] - 128. / 255) < 1e-15 && p.background[2] == 0);
    assert_true(p.window_low_hu == -100 && p.window_high_hu == 300.5 && p.unit_distance_mm == 2.5);
    assert_true(p.mode == CTS_MODE_MINIP && p.n_opacity == 2 && p.n_colour == 2);
    assert_true(cts_preset_opacity(&p, -10) == 0.75 && cts_preset_opacity(&p, -11) == 0.25);
    assert_int_equal(parse(WITH(",\"background\": \"none\", \"shade\": null"), &p, NULL), CTS_OK);
    assert_true(p.background_none && !p.shade);
}

/* Numbers of another scale have the key "at"; an inverted window, and the text of it all read back. */
static void json_scale(void **state)
{
#define AT "\"points\": [{\"at\": 2e6, \"opacity\": 1, \"rgb\": [1, 1, 1]}]"
    CtsPreset p, again;
    assert_int_equal(
        parse("{\"name\": \"a\", " AT ", \"window\": [7, 0], \"scale\": \"Bq/ml\", \"modality\": \"PT\"}", &p, NULL),
        CTS_OK);
    assert_true(p.scale == CTS_SCALE_BQML && p.modality == CTS_MODALITY_PT && p.opacity[0].hu == 2e6);
    assert_true(p.window_low_hu == 7 && p.window_high_hu == 0);
    char *text = cts_preset_to_json(&p);
    assert_int_equal(parse(text, &again, NULL), CTS_OK);
    assert_memory_equal(&p, &again, sizeof p);
    free(text);
    assert_int_equal(parse(WITH(""), &p, NULL), CTS_OK);
    assert_true(p.scale == CTS_SCALE_HU && p.modality == CTS_ANY_MODALITY);
    refused("{\"name\": \"a\", " AT "}", 1, "unknown key \"at\" (known: hu");
    refused(WITH(",\"scale\": \"relative\""), 1, "unknown key \"hu\" (known: at");
    refused(WITH(",\"scale\": \"SUV\""), 2, "not one of: HU SUVbw Bq/ml stored relative");
    refused(WITH(",\"modality\": \"US\""), 2, "not one of: CT MR PT");
}

/* Without a window it is the range of all points. */
static void json_window(void **state)
{
    CtsPreset p;
    assert_int_equal(parse("{\"name\": \"a\", \"points\": [{\"hu\": -5, \"opacity\": 1}, {\"hu\": 7, \"opacity\": 1}],"
                           "\"colour_points\": [{\"hu\": -3, \"rgb\": [0,0,0]}, {\"hu\": 90, \"rgb\": [0,0,0]}]}",
                           &p, NULL),
                     CTS_OK);
    assert_true(p.window_low_hu == -5 && p.window_high_hu == 90);
}

static void json_refused(void **state)
{
    refused("", 1, "empty");
    refused(" \n\n ", 1, "empty");
    refused("[]", 1, "not an object");
    refused("{\n\"name\": \"a\",\n}", 3, "");
    refused("{\"name\": \"a\"}", 1, "points is missing");
    refused("\n\n{\"points\": [" POINT "]}", 3, "name is missing");
    refused("{\"name\": \"a\",\n\"name\": \"b\"}", 2, "duplicate");
    refused("{\"name\": 7, \"points\": []}", 1, "name is not a text");
    refused("{\"name\": \"\", \"points\": []}", 1, "name");
    refused("{\"name\": \"a/b\", \"points\": []}", 1, "name");
    refused("{\"name\": \"a\\u0007\", \"points\": []}", 1, "name");
    refused("{\"name\": \"0123456789012345678901234567890123456789012345678901234567890123\", \"points\": []}", 1,
            "name");
    refused("{\"name\": \"a\", \"points\":\n[]}", 2, "points has 0 entries");
    refused("{\"name\": \"a\", \"points\": {}}", 1, "not a list");
    refused("{\"name\": \"a\", \"points\": [\n" POINT ",\n7]}", 3, "points 2 is not an object");
    refused("{\"name\": \"a\", \"points\": [" POINT ",\n{\"hu\": -1, \"opacity\": 1, \"rgb\": [1,1,1]}]}", 2,
            "hu falls from 0 to -1");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": 1, \"rgb\": [1,1,1]}]}", 1, "no opacity");
    refused("{\"name\": \"a\", \"points\": [\n{\"hu\": 1, \"opacity\": 1}]}", 2, "no rgb");
    refused("{\"name\": \"a\", \"points\": [{\"opacity\": 1, \"rgb\": [1,1,1]}]}", 1, "no hu");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": 1, \"opacity\": 1, \"rgb\": [1,1]}]}", 1, "2 values, not 3");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": 1, \"opacity\": 1, \"rgb\": [1,1,\n1.001]}]}", 2, "1.001");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": 1, \"opacity\":\n-0.1, \"rgb\": [1,1,1]}]}", 2, "opacity is -0.1");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": 1e7, \"opacity\": 1, \"rgb\": [1,1,1]}]}", 1, "hu is");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": 1e999, \"opacity\": 1, \"rgb\": [1,1,1]}]}", 1, "");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": NaN, \"opacity\": 1, \"rgb\": [1,1,1]}]}", 1, "");
    refused("{\"name\": \"a\", \"points\": [{\"hu\": \"1\", \"opacity\": 1, \"rgb\": [1,1,1]}]}", 1,
            "hu is not a number");
    refused(WITH(",\"colour_points\": [{\"hu\": 0, \"rgb\": [1,1,1]}]"), 1, "unknown key \"rgb\"");
    refused(WITH(",\n\"windows\": [0, 1]"), 3, "unknown key \"windows\" (known: name window");
    refused(WITH(",\"window\": [1, 1]"), 2, "window");
    refused(WITH(",\"window\": [1]"), 2, "1 values, not 2");
    refused(WITH(",\"window\": 1"), 2, "not a list");
    refused(WITH(",\"mode\": \"MIP\""), 2, "not one of: composite mip minip average");
    refused(WITH(",\"unit_distance_mm\": 0"), 2, "unit_distance_mm is 0");
    refused(WITH(",\"shade\": true"), 2, "neither an object");
    refused(WITH(",\"shade\": {\"ambient\": 0.2,\n\"ambience\": 1}"), 3, "unknown key \"ambience\"");
    refused(WITH(",\"shade\": {\"power\":\n-1}"), 3, "power is -1");
    refused(WITH(",\"background\": \"red\""), 2, "background");
    refused(WITH(",\"background\": \"#12345g\""), 2, "background");
    refused(WITH(",\"remove_table\": 1"), 2, "neither true nor false");
    refused(WITH("") " x", 2, "");
}

/* The line is right where keys, texts and nesting try to confuse it. */
static void json_lines(void **state)
{
    refused("{\"name\": \"a\\\"}\\u00e8{\\u00e9\", \"points\":\n[\n {\"rgb\" : [ 1 , 1 ,\n1 ] ,\n \"hu\"\n"
            ":\n2, \"opacity\"\n:"
            "\n3}]}",
            9, "opacity is 3");
    refused("{\r\n\"name\": \"points\",\r\n\"points\": [" POINT "],\r\n\"window\": [\"points\",\r\n2]}", 4,
            "window 1 is not a number");
    char many[CTS_MAX_POINTS * 64 + 128] = "{\"name\": \"a\", \"points\": [";
    size_t n = strlen(many);
    for (int i = 0; i <= CTS_MAX_POINTS; i++)
        n += (size_t)sprintf(many + n, "%s\n{\"hu\": 0, \"opacity\": 1, \"rgb\": [1, 1, 1]}", i ? "," : "");
    strcpy(many + n, "]}");
    refused(many, 1, "points has 257 entries");
    many[n - strlen(",\n" POINT)] = 0;
    strcat(many, "]}");
    CtsPreset p;
    assert_int_equal(parse(many, &p, NULL), CTS_OK);
    assert_int_equal(p.n_opacity, CTS_MAX_POINTS);
    /* The last point's opacity. */
    *(strrchr(many, 'y') + 4) = '7';
    refused(many, 257, "opacity is 7");
}

static void same(const CtsPreset *a, const CtsPreset *b)
{
    assert_string_equal(a->name, b->name);
    assert_true(a->mode == b->mode && a->shade == b->shade && a->remove_table == b->remove_table);
    assert_true(a->window_low_hu == b->window_low_hu && a->window_high_hu == b->window_high_hu);
    assert_true(a->unit_distance_mm == b->unit_distance_mm && a->n_opacity == b->n_opacity);
    assert_int_equal(a->n_colour, b->n_colour);
    if (a->shade)
        assert_true(a->ambient == b->ambient && a->diffuse == b->diffuse && a->specular == b->specular &&
                    a->power == b->power);
    assert_memory_equal(a->opacity, b->opacity, (size_t)a->n_opacity * sizeof *a->opacity);
    assert_memory_equal(a->colour, b->colour, (size_t)a->n_colour * sizeof *a->colour);
    assert_memory_equal(a->background, b->background, sizeof a->background);
}

static void json_round_trip(void **state)
{
    const CtsPreset *p;
    for (size_t i = 0; (p = cts_preset_builtin(i)); i++) {
        CtsPreset again;
        char *text = cts_preset_to_json(p);
        assert_non_null(text);
        assert_int_equal(parse(text, &again, NULL), CTS_OK);
        same(p, &again);
        free(text);
    }
}

#define VP_OPACITY "8 -3024 0 -16.4458 0 641.385 0.715686 3071 0.705882"
#define VP_COLOUR "16 -3024 0 0 0 -16.4458 0.729412 0.254902 0.301961 641.385 0.905882 0.815686 0.552941 3071 1 1 1"
#define VP "1\n1\n0.9\n0.1\n0.2\n10\n" VP_OPACITY "\n4 0 1 255 1\n" VP_COLOUR "\n"
#define XML_ELEMENT(name)                                                                                              \
    "<VolumeProperty name=\"" name "\" interpolation=\"1\" shade=\"1\" diffuse=\"0.9\" ambient=\"0.1\" "               \
    "specular=\"0.2\" specularPower=\"10\" scalarOpacity=\"" VP_OPACITY "\" gradientOpacity=\"4 0 1 255 1\" "          \
    "colorTransfer=\"" VP_COLOUR "\" effectiveRange=\"-16.4458 641.385\"/>"
#define XML "<?xml version=\"1.0\"?>\n<MRML>\n" XML_ELEMENT("CT-Bone") "\n" XML_ELEMENT("Other") "\n</MRML>\n"

static const CtsPreset *slicer_bone(void)
{
    const CtsPreset *p;
    for (size_t i = 0; (p = cts_preset_builtin(i)); i++)
        if (!strcmp(p->name, "ct-bone"))
            return p;
    return NULL;
}

/* Slicer's own text gives the built-in preset of that name, except for table removal, which such a file does not
 * contain. */
static void slicer_text(void **state)
{
    CtsPreset p, expected = *slicer_bone();
    CtsError err = {0};
    expected.remove_table = false;
    assert_int_equal(cts_preset_parse(XML, strlen(XML), "presets.xml", "ct-BONE", &p, &err), CTS_OK);
    strcpy(expected.name, "CT-Bone");
    same(&p, &expected);
    assert_string_equal(p.note, "");
    assert_int_equal(cts_preset_parse(VP, strlen(VP), "folder/My Bone.vp", NULL, &p, &err), CTS_OK);
    strcpy(expected.name, "My Bone");
    expected.window_low_hu = -3024; /* a .vp file has no effective range */
    expected.window_high_hu = 3071;
    same(&p, &expected);

    assert_int_equal(cts_preset_parse(XML, strlen(XML), "f", NULL, &p, &err), CTS_ERR_PRESET);
    assert_string_equal(err.text, "f: holds 2 presets (take one by adding #NAME: CT-Bone Other)");
    assert_int_equal(cts_preset_parse(XML, strlen(XML), "f", "none", &p, &err), CTS_ERR_PRESET);
    assert_non_null(strstr(err.text, "there are: CT-Bone Other"));
}

static void slicer_text_refused(void **state)
{
    refused("1\n1\n", 3, "scalarOpacity is missing");
    refused("1\n1\nx\n", 3, "diffuse is not a number");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n7 0 1 2\n", 7, "scalarOpacity does not begin with the count");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n4 0 1 2\n", 7, "has 3 numbers where it says 4");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n4 0 1 2 1 3\n", 7, "more numbers than the 4");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n4 0 1 -2 1\n", 7, "falls from 0 to -2");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n4 0 1 2 1.5\n", 7, "1.5");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n4 0 1 2 nan\n", 7, "");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n1e300 0 1 2 0\n", 7, "count");
    refused("1\n1\n0.9\n0.1\n0.2\n10\n2 0 1\n2 0 1\n\n", 9, "colorTransfer is missing");
    refused(VP "more", 10, "after the nine lines");
    refused("<MRML>\n<VolumeProperty\nname=\"x\"/>", 3, "");
    refused("<MRML>\n\n<VolumeProperty\nname=\"x\"/></MRML>", 3, "scalarOpacity");
    refused("<!DOCTYPE a [<!ENTITY b \"c\">]><MRML/>", 1, "document type");
    CtsPreset p;
    CtsError err = {0};
    assert_int_equal(parse("<MRML></MRML>", &p, &err), CTS_ERR_PRESET);
    assert_string_equal(err.text, "f: holds no VolumeProperty");
    assert_int_equal(cts_preset_parse("1\n\0", 3, "f", NULL, &p, &err), CTS_ERR_PRESET);
}

#define SLICER_COMPONENT                                                                                               \
    "{\"shade\": true, \"scalarOpacityUnitDistance\": 2,\n"                                                            \
    "\"lighting\": {\"ambient\": 0.1, \"diffuse\": 0.9, \"specular\": 0.2, \"specularPower\": 10},\n"                  \
    "\"scalarOpacity\": {\"type\": \"piecewiseLinearFunction\", \"points\": [\n"                                       \
    "{\"x\": 0, \"y\": 0, \"midpoint\": 0.5, \"sharpness\": 0}, {\"x\": 100, \"y\": 0.5}]},\n"                         \
    "\"rgbTransferFunction\": {\"points\": [{\"x\": 0, \"color\": [1, 0.5, 0]}]},\n"                                   \
    "\"gradientOpacity\": {\"points\": [{\"x\": 0, \"y\": 1}]}}"
#define SLICER_JSON(component)                                                                                         \
    "{\"@schema\": \"volume-property-schema-v1.0.0.json\", \"volumeProperties\": [\n"                                  \
    "{\"effectiveRange\": [-5, 50], \"isoSurfaceValues\": [], \"interpolationType\": \"linear\",\n"                    \
    "\"components\": [" component "]}]}"

static void slicer_json(void **state)
{
    CtsPreset p;
    CtsError err = {0};
    const char *text = SLICER_JSON(SLICER_COMPONENT);
    assert_int_equal(cts_preset_parse(text, strlen(text), "a/b/c.vp.json", NULL, &p, &err), CTS_OK);
    assert_string_equal(p.name, "c.vp");
    assert_true(p.shade && p.diffuse == 0.9 && p.power == 10 && p.unit_distance_mm == 2);
    assert_true(p.window_low_hu == -5 && p.window_high_hu == 50);
    assert_true(cts_preset_opacity(&p, 50) == 0.25 && p.colour[0].rgb[1] == 0.5);
    assert_string_equal(p.note, "");
    /* Unsupported features are reported. */
    char *bent = strdup(text), *at = strstr(bent, "0.5, \"sharp");
    memcpy(at, "0.4", 3);
    at = strstr(bent, "\"y\": 1}");
    memcpy(at, "\"y\": 0", 6);
    assert_int_equal(parse(bent, &p, &err), CTS_OK);
    assert_string_equal(p.note, "midpoint and sharpness, gradient opacity");
    free(bent);
    refused(SLICER_JSON("{}"), 3, "no scalarOpacity");
    refused(SLICER_JSON(""), 3, "components has 0 entries");
    refused(SLICER_JSON("{\n\"scalarOpacity\": {\"points\": [{\"x\": 1, \"y\":\n2}]}}"), 5, "y is 2");
    refused("{\"volumeProperties\": 7}", 1, "not a list");
}

/* For any bytes, an accepted preset keeps the promises of ctsplat/preset.h. */
static void check_promises(const CtsPreset *p)
{
    assert_true(p->n_opacity >= 1 && p->n_opacity <= CTS_MAX_POINTS && p->n_colour >= 1 &&
                p->n_colour <= CTS_MAX_POINTS);
    assert_true(p->window_high_hu != p->window_low_hu && p->unit_distance_mm > 0 && (unsigned)p->mode < CTS_N_MODES);
    assert_true(p->name[0] && memchr(p->name, 0, sizeof p->name) && memchr(p->note, 0, sizeof p->note));
    for (int i = 0; i < p->n_opacity; i++) {
        assert_true(p->opacity[i].opacity >= 0 && p->opacity[i].opacity <= 1 && isfinite(p->opacity[i].hu));
        assert_true(!i || p->opacity[i].hu >= p->opacity[i - 1].hu);
    }
    for (int i = 0; i < p->n_colour; i++) {
        for (int c = 0; c < 3; c++)
            assert_true(p->colour[i].rgb[c] >= 0 && p->colour[i].rgb[c] <= 1);
        assert_true(!i || p->colour[i].hu >= p->colour[i - 1].hu);
    }
    const double extinction = cts_preset_extinction_per_mm(p, 12.5);
    assert_true(extinction >= 0 && extinction <= CTS_MAX_EXTINCTION_PER_MM);
}

static uint32_t next_random(uint32_t *seed)
{
    *seed = *seed * 1664525 + 1013904223;
    return *seed >> 8;
}

/* Bytes changed, cut out, doubled and swapped in texts that are right. */
static void mutations(void **state)
{
    const char *const seeds[] = {
        "{\"name\": \"a\", \"window\": [-1e3, 300.5], \"points\": [{\"hu\": -10, \"rgb\": [0, 0.5, 1], \"opacity\": "
        "0.25},"
        "{\"hu\": 1.5e2, \"rgb\": [0, 0.5, 1], \"opacity\": 1}], \"mode\": \"mip\", \"shade\": {\"power\": 7},\n"
        "\"background\": \"#ff8000\", \"unit_distance_mm\": 2, \"remove_table\": false}",
        VP, XML, SLICER_JSON(SLICER_COMPONENT)};
    const char bytes[] = "0123456789-+.eE,:{}[]\"\\ \n\r\t<>/#nulltruefalse\0\x01\x7f\xc3\xff";
    uint32_t seed = 20261121;
    CtsPreset preset;
    int taken = 0;
    for (int round = 0; round < 40000; round++) {
        const char *text = seeds[round % 4];
        size_t n = strlen(text);
        char *copy = malloc(2 * n + 16);
        memcpy(copy, text, n);
        for (uint32_t edits = 1 + next_random(&seed) % 4; edits; edits--) {
            const size_t at = next_random(&seed) % (n + 1), length = next_random(&seed) % 9;
            switch (next_random(&seed) % 4) {
            case 0: /* change a byte */
                if (at < n)
                    copy[at] = bytes[next_random(&seed) % sizeof bytes];
                break;
            case 1: /* cut out */
                if (at + length < n) {
                    memmove(copy + at, copy + at + length, n - at - length);
                    n -= length;
                }
                break;
            case 2: /* double */
                if (at + length < n && n + length < 2 * strlen(text)) {
                    memmove(copy + at + length, copy + at, n - at);
                    n += length;
                }
                break;
            default: /* cut short, now and then */
                if (next_random(&seed) % 8 == 0)
                    n = at;
            }
        }
        /* An exact block, so that a sanitizer detects an access beyond. */
        char *exact = malloc(n ? n : 1);
        memcpy(exact, copy, n);
        CtsError err = {0};
        const CtsStatus st = cts_preset_parse(exact, n, "f", round & 8 ? "CT-Bone" : NULL, &preset, &err);
        if (!st) {
            check_promises(&preset);
            taken++;
        } else {
            assert_int_equal(st, CTS_ERR_PRESET);
            assert_true(!strncmp(err.text, "f: ", 3) && !strchr(err.text, '\n'));
        }
        free(exact);
        free(copy);
    }
    /* Some survive, most do not: the test has teeth on both sides. */
    assert_true(taken > 400 && taken < 30000);
}

static void sizes(void **state)
{
    const size_t n = (1 << 20) + 1;
    char *text = malloc(n);
    CtsPreset preset;
    CtsError err = {0};
    memset(text, '[', n);
    assert_int_equal(cts_preset_parse(text, n, "f", NULL, &preset, &err), CTS_ERR_PRESET);
    assert_non_null(strstr(err.text, "1 MiB"));
    assert_int_equal(cts_preset_parse(text, n - 1, "f", NULL, &preset, &err), CTS_ERR_PRESET);
    memset(text, '1', n);
    assert_int_equal(cts_preset_parse(text, n - 1, "f", NULL, &preset, &err), CTS_ERR_PRESET);
    memset(text, '<', n);
    assert_int_equal(cts_preset_parse(text, n - 1, "f", NULL, &preset, &err), CTS_ERR_PRESET);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(json_read),   cmocka_unit_test(json_window),
        cmocka_unit_test(json_scale),  cmocka_unit_test(json_refused),
        cmocka_unit_test(json_lines),  cmocka_unit_test(json_round_trip),
        cmocka_unit_test(slicer_text), cmocka_unit_test(slicer_text_refused),
        cmocka_unit_test(slicer_json), cmocka_unit_test(mutations),
        cmocka_unit_test(sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
