/* The option `montage`: tiles with commas between them. */
#include "app/options/options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static CtsSectionPlane named_plane(const char *text, size_t n)
{
    int plane = CTS_N_PLANES - 1;
    while (plane && (strlen(cts_plane_names[plane]) != n || strncmp(cts_plane_names[plane], text, n) != 0))
        plane--;
    return (CtsSectionPlane)plane;
}

/* The length of the list's first tile; a view by numbers holds a comma itself. */
static size_t tile_length(const char *list)
{
    const size_t n = strcspn(list, ","), n_name = strcspn(list, "@,");
    const char *const view = n_name < n ? list + n_name + 1 : list;
    const size_t both = list[n] ? n + 1 + strcspn(list + n + 1, ",") : n;
    char pair[64];
    double angles[2];
    snprintf(pair, sizeof pair, "%.*s", (int)(list + both - view), view);
    return !named_plane(list, n_name) && cts_numbers(pair, angles, 2) ? both : n;
}

/* The preset of this name, else, where there may be some, the labels. */
static CtsStatus take_name(const CtsOptions *options, CtsCommand command, const char *name, CtsTile *tile,
                           CtsError *err)
{
    if (!(tile->preset = malloc(sizeof *tile->preset)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const CtsStatus st = cts_options_preset(options, name, tile->preset, NULL, err);
    if (!st)
        return CTS_OK;
    if (!options->labels.n && command != CTS_FOR_JOB)
        return cts_context(err, "not a view or section (labels need `labels`)");
    free(tile->preset);
    tile->preset = NULL;
    if (!(tile->show = strdup(name)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    for (char *plus = tile->show; (plus = strchr(plus, '+'));)
        *plus = ',';
    return CTS_OK;
}

/* names: of the tiles so far, "" for a view alone; the tile's is added. */
static CtsStatus take_tile(CtsOptions *options, CtsCommand command, char *text, const char **names, CtsError *err)
{
    CtsMontage *const m = &options->montage;
    CtsTile *const tile = &m->tiles[m->n];
    char *const at = strchr(text, '@'), *const place = at ? at + 1 : NULL;
    if (at)
        *at = 0;
    *tile = (CtsTile){.section.plane = named_plane(text, strlen(text)),
                      .azimuth_deg = options->render.azimuth_deg,
                      .elevation_deg = options->render.elevation_deg};
    names[m->n++] = text;
    if (tile->section.plane)
        return !place || cts_number(place, &tile->section.at_mm)
                   ? CTS_OK
                   : cts_fail(err, CTS_ERR_USAGE, "%s: not a distance from the middle in millimetres", place);
    if (place ? cts_view_of(place, &tile->azimuth_deg, &tile->elevation_deg, err) != CTS_OK : !*text)
        return place ? CTS_ERR_USAGE : cts_fail(err, CTS_ERR_USAGE, "a tile without a name");
    if (!place && !cts_view_of(text, &tile->azimuth_deg, &tile->elevation_deg, NULL))
        names[m->n - 1] = "";
    while (strcmp(names[tile->group], names[m->n - 1]))
        tile->group++;
    return *names[m->n - 1] && tile->group == m->n - 1 ? take_name(options, command, text, tile, err) : CTS_OK;
}

static CtsStatus take_tiles(CtsOptions *options, CtsCommand command, char *list, CtsError *err)
{
    const char *names[CTS_MAX_TILES];
    CtsStatus st = CTS_OK;
    for (char *text = list, *next; text && !st; text = next) {
        const size_t n = tile_length(text);
        next = text[n] ? text + n + 1 : NULL;
        text[n] = 0;
        if (options->montage.n == CTS_MAX_TILES)
            return cts_fail(err, CTS_ERR_USAGE, "`montage`: more than %d tiles (make several)", CTS_MAX_TILES);
        if ((st = take_tile(options, command, text, names, err)))
            cts_context(err, "`montage`%s%s", *text ? " " : "", text);
    }
    return st;
}

CtsStatus cts_options_montage(CtsOptions *options, CtsCommand command, CtsError *err)
{
    static const char *const of_one_view[] = {"rotation", "swivel", "state", "write-state", "depth"};
    CtsMontage *const m = &options->montage;
    if (!options->montage_list)
        return m->columns ? cts_fail(err, CTS_ERR_USAGE, "`columns`: there is no `montage`") : CTS_OK;
    for (size_t i = 0; i < sizeof of_one_view / sizeof *of_one_view; i++)
        if (cts_options_given(options, of_one_view[i]))
            return cts_fail(err, CTS_ERR_USAGE, "`montage`: `%s` is given too, which is of one view (choose one)",
                            of_one_view[i]);
    char *const list = strdup(options->montage_list);
    m->tiles = calloc(CTS_MAX_TILES, sizeof *m->tiles);
    CtsStatus st =
        list && m->tiles ? take_tiles(options, command, list, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    free(list);
    if (st)
        return st;
    const CtsMontageGrid grid = cts_montage_grid(m, options->render.width, options->render.height);
    return grid.width && grid.height ? CTS_OK
                                     : cts_fail(err, CTS_ERR_USAGE,
                                                "`montage`: %d tiles do not fit %d x %d pixels (a "
                                                "larger `size`)",
                                                m->n, options->render.width, options->render.height);
}
