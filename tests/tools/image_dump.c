/* Prints the thumbnail of each series that is no volume, as JSON, a line for each: image_dump PATH */
#include "ctsplat/series.h"
#include <stdio.h>

int main(int argc, char **argv)
{
    static CtsImage image;
    CtsError err = {0};
    CtsSeriesList *list = NULL;
    const char *paths[] = {argv[argc - 1]};
    const CtsSeriesSearch search = {.paths = paths, .n_paths = 1, .images = true};
    if (cts_series_search(&search, &list, NULL, &err)) {
        fprintf(stderr, "%s\n", err.text);
        return 1;
    }
    for (size_t i = 0; i < list->n; i++) {
        if (!list->items[i].passed)
            continue;
        if (cts_series_image(&list->items[i], &image, &err)) {
            printf("{\"uid\":\"%s\",\"error\":\"%s\"}\n", list->items[i].uid, err.text);
            continue;
        }
        printf("{\"uid\":\"%s\",\"size\":[%d,%d],\"rgb\":\"", list->items[i].uid, image.width, image.height);
        for (int k = 0; k < 3 * image.width * image.height; k++)
            printf("%02x", image.rgb[k]);
        puts("\"}");
    }
    cts_series_list_free(&list);
    return 0;
}
