/* Prints the thumbnail of each series that is no volume, as JSON, a line for each: image_dump PATH */
#include "dicom/codec/pixels.h"
#include <stdio.h>

int main(int argc, char **argv)
{
    enum { SIDE = 240 };
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
        const CtsSeries *const series = &list->items[i];
        CtsPicture *image = NULL;
        if (cts_slice_picture(series->slices[series->n_slices / 2], SIDE, SIDE, &image, &err)) {
            printf("{\"uid\":\"%s\",\"error\":\"%s\"}\n", list->items[i].uid, err.text);
            continue;
        }
        printf("{\"uid\":\"%s\",\"size\":[%d,%d],\"rgb\":\"", list->items[i].uid, image->width, image->height);
        for (int k = 0; k < 4 * image->width * image->height; k++)
            if (k % 4 < 3)
                printf("%02x", (unsigned)(image->pixels[k] * 255 + 0.5F));
        cts_picture_free(&image);
        puts("\"}");
    }
    cts_series_list_free(&list);
    return 0;
}
