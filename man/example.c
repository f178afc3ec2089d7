/* A folder of CT slices becomes a picture: example FOLDER FILE.png
 * cc example.c -o example $(pkg-config --cflags --libs ctsplat) */
#include <ctsplat/ctsplat.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    CtsError err = {CTS_ERR_USAGE, "example FOLDER FILE.png"};
    CtsSeriesList *list = NULL;
    const CtsSeries *series;
    CtsVolume *volume = NULL;
    CtsPicture *picture = NULL;
    CtsPreset preset;
    CtsRenderSettings settings;
    const CtsExportSettings as_asked = {.force = true};

    cts_render_defaults(&settings);
    settings.fit = CTS_FIT_VISIBLE;
    int failed = argc != 3 || cts_preset_load("bone", &preset, &err) ||
                 cts_series_find((const char *const *)argv + 1, 1, 0, &list, NULL, &err) ||
                 cts_series_choose(list, NULL, &series, &err) || cts_series_load(series, 0, &volume, NULL, &err) ||
                 cts_volume_remove_table(volume, 0, NULL, &err) ||
                 cts_render(volume, &preset, &settings, &picture, NULL, &err);
    if (!failed) {
        cts_picture_over(picture, preset.background, 0);
        failed = cts_export((const CtsPicture *const *)&picture, 1, argv[2], &as_asked, NULL, NULL, &err);
    }
    if (failed)
        fprintf(stderr, "%s\n", err.text);
    cts_picture_free(&picture);
    cts_volume_free(&volume);
    cts_series_list_free(&list);
    return failed;
}
