#include "app/job/montage.h"

#include "app/job/render_job.h"
#include "base/mem.h"
#include "output/image/describe.h"
#include "output/image/whole_picture.h"
#include "render/framing/framing.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void cts_montage_free(CtsMontage *montage)
{
    for (int i = 0; i < montage->n; i++) {
        free(montage->tiles[i].preset);
        free(montage->tiles[i].show);
    }
    free(montage->tiles);
    *montage = (CtsMontage){.n = 0};
}

static CtsMontageGrid grid_of_columns(const CtsMontage *montage, int columns, int width, int height)
{
    const int rows = (montage->n + columns - 1) / columns;
    return (CtsMontageGrid){columns, width / columns, height / rows};
}

/* Contents are scaled to a tile's tighter side. */
CtsMontageGrid cts_montage_grid(const CtsMontage *montage, int width, int height)
{
    const int given = montage->columns < montage->n ? montage->columns : montage->n;
    CtsMontageGrid best = {0};
    for (int columns = montage->n; columns > 0 && !given; columns--) {
        const CtsMontageGrid grid = grid_of_columns(montage, columns, width, height);
        if (!best.columns || fmin(grid.width, grid.height) > fmin(best.width, best.height))
            best = grid;
    }
    return given ? grid_of_columns(montage, given, width, height) : best;
}

/* The picture of a tile. */
typedef struct TilePicture {
    CtsPicture *picture;      /* NULL: none, where the labels are missing */
    CtsRenderSettings render; /* of a view */
} TilePicture;

/* A montage in the making. */
typedef struct MontageWork {
    const CtsJob *job;
    const CtsMontage *montage;
    CtsMontageGrid grid;
    CtsLoaded *loaded;
    CtsPrepared *prepared;
    const CtsWatch *watch;
    CtsReport *report;
    TilePicture *tiles;
    int number, n_done;   /* the tile being rendered; tiles that are done */
    CtsVerified verified; /* of all tiles so far */
    CtsErrorBound bound;  /* likewise, of n_bounds tiles; its rms are sums of squares */
    int n_bounds;
} MontageWork;

/* The next view of the group from number on; n without any. */
static int next_of_group(const MontageWork *a, int group, int number)
{
    const CtsTile *const tiles = a->montage->tiles;
    while (number < a->montage->n && (tiles[number].group != group || tiles[number].section.plane))
        number++;
    return number;
}

/* The job of the group's pictures alone. */
static CtsJob job_of_group(const MontageWork *a, int group)
{
    const CtsTile *const tile = &a->montage->tiles[group];
    CtsJob job = *a->job;
    job.montage = NULL;
    job.outputs = (CtsOutputs){0};
    job.annotate.captioned_later = job.annotate.captions;
    job.annotate.captions = false;
    job.render.width = a->grid.width;
    job.render.height = a->grid.height;
    job.render.azimuth_deg = tile->azimuth_deg;
    job.render.elevation_deg = tile->elevation_deg;
    if (tile->preset)
        cts_job_set_preset(&job, tile->preset);
    if (tile->show)
        job.source.choice.show = tile->show;
    job.source.without_body = !cts_job_finds_body(&job);
    return job;
}

static CtsStatus take_tile_band(void *context, int frame, CtsPicture *band, CtsError *err)
{
    MontageWork *const a = context;
    (void)frame;
    return cts_picture_add_band(&a->tiles[a->number].picture, band, err);
}

/* Adds the errors of the tile; all tiles have the same area. */
static void add_errors(MontageWork *a)
{
    const CtsErrorBound tile = a->report->bound, all = a->bound;
    const CtsPicture *const picture = a->tiles[a->number].picture;
    a->report->verified.worst_x += a->number % a->grid.columns * a->grid.width;
    a->report->verified.worst_y += a->number / a->grid.columns * a->grid.height;
    cts_verified_add(&a->verified, &a->report->verified);
    if (!picture || picture->info.mode != CTS_MODE_COMPOSITE || !tile.known)
        return;
    a->bound = tile;
    a->bound.rmse = all.rmse + tile.rmse * tile.rmse;
    a->bound.rms_estimate = all.rms_estimate + tile.rms_estimate * tile.rms_estimate;
    a->bound.max = all.max < 0 || tile.max < 0 ? -1 : fmax(all.max, tile.max);
    a->bound.n_rerendered += all.n_rerendered;
    a->n_bounds++;
}

static CtsStatus render_tile(MontageWork *a, const CtsJob *job, CtsError *err)
{
    const CtsWatch watch = {.context = a, .band = take_tile_band};
    char step[64];
    snprintf(step, sizeof step, "tile %d of %d", a->n_done + 1, a->montage->n);
    cts_watch_step(a->watch, 2 + a->n_done, 2 + a->montage->n, step);
    a->report->bound = (CtsErrorBound){0};
    a->report->verified = (CtsVerified){0};
    CtsStatus st = cts_job_prepare(job, &a->loaded->model, a->prepared, a->report, err);
    if (!st)
        st = cts_job_pictures(job, a->loaded, a->prepared, &watch, a->report, err);
    add_errors(a);
    a->n_done++;
    cts_watch_diagnostics(a->watch, a->report);
    return st;
}

/* Each of the group's tiles fits in its view; several get the scale of the largest. */
static CtsStatus share_scale(const MontageWork *a, int group, const CtsJob *job, CtsError *err)
{
    const int n = a->montage->n;
    const bool alone = next_of_group(a, group, group + 1) == n;
    double mm_per_pixel = 0;
    CtsStatus st = CTS_OK;
    for (int i = group; i < n && !st; i = next_of_group(a, group, i + 1)) {
        CtsRenderSettings *const s = &a->tiles[i].render;
        *s = job->render;
        s->azimuth_deg = a->montage->tiles[i].azimuth_deg;
        s->elevation_deg = a->montage->tiles[i].elevation_deg;
        if (!alone)
            st = cts_framing_settle(&a->loaded->model, &a->prepared->preset, s, err);
        if (job->render.centre_given)
            memcpy(s->centre_lps, job->render.centre_lps, sizeof s->centre_lps);
        mm_per_pixel = fmax(mm_per_pixel, s->mm_per_pixel);
    }
    for (int i = group; i < n; i = next_of_group(a, group, i + 1))
        a->tiles[i].render.mm_per_pixel = mm_per_pixel;
    return st;
}

static CtsStatus render_group(MontageWork *a, int group, bool last, CtsError *err)
{
    CtsJob job = job_of_group(a, group);
    const CtsLabels *const labels = a->loaded->labels;
    /* A series of an archive may have no labels: the tiles stay empty. */
    if (a->montage->tiles[group].show && job.source.choice.show_present && !(labels && labels->counted))
        return CTS_OK;
    CtsStatus st = cts_job_volume(&job, last, a->loaded, a->prepared, a->report, err);
    if (st)
        return cts_context(err, "`montage`");
    if (!(st = cts_job_prepare(&job, &a->loaded->model, a->prepared, a->report, err)))
        st = share_scale(a, group, &job, err);
    for (a->number = group; a->number < a->montage->n && !st; a->number = next_of_group(a, group, a->number + 1)) {
        job.render = a->tiles[a->number].render;
        st = render_tile(a, &job, err);
    }
    return st;
}

static CtsStatus draw_tile_sections(MontageWork *a, CtsError *err)
{
    const CtsMarks marks = {.orientation = a->job->annotate.orientation, .scale = a->job->annotate.scale};
    CtsSection sections[CTS_MAX_TILES];
    CtsPicture *pictures[CTS_MAX_TILES] = {NULL};
    CtsRenderSettings settings = a->job->render;
    CtsStatus st = CTS_OK;
    settings.width = a->grid.width;
    settings.height = a->grid.height;
    for (int i = 0; i < a->montage->n; i++) {
        sections[i] = a->montage->tiles[i].section;
        a->n_done += sections[i].plane != CTS_PLANE_NONE;
    }
    if (a->n_done && !(st = cts_job_slices(a->job, a->loaded, a->report, err)))
        st = cts_sections(a->loaded->scanned, a->loaded->labels, &settings, sections, a->montage->n, pictures, err);
    for (int i = 0; i < a->montage->n; i++) {
        a->tiles[i].picture = pictures[i];
        if (!st && pictures[i])
            st = cts_marks_draw(&marks, NULL, pictures[i], a->report, err);
    }
    return st;
}

/* Sections first, from the slices, which the last group's volume may take. */
static CtsStatus render_montage_tiles(MontageWork *a, bool last, CtsError *err)
{
    int groups[CTS_MAX_TILES], n = 0;
    for (int i = 0; i < a->montage->n; i++)
        if (next_of_group(a, i, i) == i)
            groups[n++] = i;
    CtsStatus st = a->job->render.explain ? CTS_OK : draw_tile_sections(a, err);
    for (int i = 0; i < n && !st; i++)
        st = render_group(a, groups[i], last && i == n - 1, err);
    return st;
}

/* Describes the whole by the first tile, and by what holds for all of them, or for any. */
static void describe_montage(const MontageWork *a, CtsPictureInfo *all)
{
    int n = 0;
    for (int i = 0; i < a->montage->n; i++) {
        const CtsPictureInfo *const tile = a->tiles[i].picture ? &a->tiles[i].picture->info : NULL;
        char text[160];
        if (!tile)
            continue;
        if (n++ == 0)
            *all = *tile;
        all->mode = tile->mode < all->mode ? tile->mode : all->mode;
        all->mm_per_pixel = tile->mm_per_pixel == all->mm_per_pixel ? all->mm_per_pixel : 0;
        all->grey &= tile->grey;
        all->is_section &= tile->is_section;
        all->shows_skin |= tile->shows_skin;
        all->annotated |= tile->annotated;
        snprintf(text, sizeof text, "%s%s%s%s", n > 1 ? ", " : "", tile->preset,
                 a->montage->tiles[i].section.plane ? "" : " ",
                 a->montage->tiles[i].section.plane ? "" : cts_describe_view(tile).text);
        strncat(all->tiles, text, sizeof all->tiles - strlen(all->tiles) - 1);
    }
    snprintf(all->preset, sizeof all->preset, "montage");
    all->window_low_hu = all->window_high_hu = 0;
}

static void place_tiles(const MontageWork *a, CtsPicture *whole)
{
    for (int i = 0; i < a->montage->n; i++) {
        const CtsPicture *const p = a->tiles[i].picture;
        if (!p)
            continue;
        cts_picture_place(whole, p, i % a->grid.columns * a->grid.width, i / a->grid.columns * a->grid.height);
        whole->has_alpha |= p->n_channels == 4 && p->has_alpha;
    }
}

static CtsStatus draw_captions(MontageWork *a, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int i = 0; i < a->montage->n && !st; i++) {
        const CtsTile *const tile = &a->montage->tiles[i];
        CtsPicture *const p = a->tiles[i].picture;
        const CtsJob job = job_of_group(a, tile->group);
        if (p)
            st = cts_marks_caption(&a->job->annotate,
                                   tile->section.plane ? p->info.preset : cts_job_caption(&job, &p->info).text, i + 1,
                                   p, a->report, err);
    }
    return st;
}

static CtsStatus write_montage(MontageWork *a, CtsFiles *files, CtsError *err)
{
    CtsPicture *whole = NULL;
    const CtsPreset *const preset = a->job->preset;
    CtsStatus st = cts_picture_new(&whole, a->job->render.width, a->job->render.height, 4, err);
    if (st)
        return st;
    describe_montage(a, &whole->info);
    if (!preset->background_none)
        cts_picture_over(whole, preset->background, a->job->render.n_threads);
    place_tiles(a, whole);
    st = cts_files_rows(files, 0, whole, false, a->report, err);
    if (!st && a->job->annotate.captions && !(st = draw_captions(a, err))) {
        place_tiles(a, whole);
        whole->info.annotated = true;
    }
    if (!st && a->watch->band)
        st = a->watch->band(a->watch->context, 0, whole, err);
    if (!st && !(st = cts_files_rows(files, 0, whole, true, a->report, err)))
        st = cts_files_frame_done(files, 0, a->report, err);
    if (!st && a->watch->frame)
        st = a->watch->frame(a->watch->context, &a->report->bound, err);
    cts_picture_free(&whole);
    return st;
}

CtsStatus cts_job_montage(const CtsJob *job, bool last, CtsLoaded *loaded, CtsPrepared *prepared, const CtsWatch *watch,
                          CtsReport *report, CtsError *err)
{
    CtsExportSettings settings;
    CtsFiles files = cts_job_files(job, loaded, watch, &settings);
    MontageWork a = {.job = job,
                     .montage = job->montage,
                     .grid = cts_montage_grid(job->montage, job->render.width, job->render.height),
                     .loaded = loaded,
                     .prepared = prepared,
                     .watch = watch,
                     .report = report};
    if (watch->loaded)
        watch->loaded(watch->context);
    CtsStatus st = cts_alloc_zeroed(&a.tiles, (size_t)job->montage->n, err);
    if (!st)
        st = render_montage_tiles(&a, last, err);
    a.bound.rmse = sqrt(a.bound.rmse / fmax(a.n_bounds, 1));
    a.bound.rms_estimate = sqrt(a.bound.rms_estimate / fmax(a.n_bounds, 1));
    report->bound = a.bound;
    report->verified = a.verified;
    if (!st && !job->render.explain && !(st = cts_files_begin(&files, err)))
        st = write_montage(&a, &files, err);
    cts_files_end(&files);
    for (int i = 0; a.tiles && i < job->montage->n; i++)
        cts_picture_free(&a.tiles[i].picture);
    cts_free(&a.tiles);
    return st;
}
