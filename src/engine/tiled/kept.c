#include "engine/tiled/kept.h"

#include "base/clock.h"
#include "base/mem.h"
#include "core/scene/scene_macrocells.h"
#include <stdlib.h>
#include <string.h>

static void tell(const CtsScene *scene, const char *what, int made_for, CtsReport *report)
{
    if (made_for != scene->frame)
        cts_report_skip(report, what, "made for an earlier frame");
}

CtsStatus cts_tiled_kept_open(const CtsScene *scene, TiledKept **kept, CtsError *err)
{
    *kept = scene->kept ? *scene->kept : NULL;
    if (!*kept && !(*kept = calloc(1, sizeof **kept)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (scene->kept)
        *scene->kept = *kept;
    return CTS_OK;
}

void cts_tiled_kept_close(const CtsScene *scene, TiledKept *kept)
{
    if (!scene->kept)
        cts_tiled_kept_free(kept);
}

void cts_tiled_kept_free(void *kept)
{
    TiledKept *k = kept;
    if (!k)
        return;
    cts_macrocells_free(&k->own_macrocells);
    cts_layout_free(&k->copied);
    cts_slab_table_free(&k->table);
    cts_draft_table_free(&k->draft);
    cts_free(&k->lattice);
    cts_empty_space_free(&k->empty);
    free(k);
}

static bool same_axes(const CtsLayout *a, const CtsLayout *b)
{
    return a->axis_u == b->axis_u && a->axis_v == b->axis_v && a->axis_k == b->axis_k;
}

CtsStatus cts_tiled_kept_macrocells(TiledKept *kept, const CtsScene *scene, const CtsMacrocells **macrocells,
                                    CtsReport *report, CtsError *err)
{
    if (kept->own_macrocells)
        tell(scene, "macro-cells", kept->macrocells_frame, report);
    else
        kept->macrocells_frame = scene->frame;
    return cts_scene_macrocells(scene, &kept->own_macrocells, macrocells, report, err);
}

CtsStatus cts_tiled_kept_tables(TiledKept *kept, const CtsScene *scene, const CtsMacrocells *macrocells,
                                const CtsLayout *layout, CtsReport *report, CtsError *err)
{
    CtsStatus st;
    const int axes[3] = {layout->axis_u, layout->axis_v, layout->axis_k};
    if (kept->table.sum && kept->table_scale == scene->extinction_scale) {
        tell(scene, "slab integrals", kept->table_frame, report);
    } else {
        cts_slab_table_free(&kept->table);
        cts_draft_table_free(&kept->draft);
        if ((st = cts_slab_table_init(&kept->table, scene, macrocells->all, err)))
            return st;
        kept->table_scale = scene->extinction_scale;
        kept->table_frame = scene->frame;
    }
    if (cts_scene_drafts(scene) && !kept->draft.mean &&
        (st = cts_draft_table_init(&kept->draft, &kept->table, macrocells->all, scene->settings->n_threads, err)))
        return st;
    if (kept->empty.distance && !memcmp(kept->empty_axes, axes, sizeof axes)) {
        tell(scene, "distances to what is visible", kept->empty_frame, report);
        return CTS_OK;
    }
    cts_empty_space_free(&kept->empty);
    memcpy(kept->empty_axes, axes, sizeof axes);
    kept->empty_frame = scene->frame;
    return cts_empty_space_init(&kept->empty, macrocells, layout, scene->lut, scene->settings->n_threads, err);
}

CtsStatus cts_tiled_kept_lattice(TiledKept *kept, size_t n, float **rgba, CtsError *err)
{
    CtsStatus st;
    if (kept->n_lattice != n) {
        cts_free(&kept->lattice);
        kept->n_lattice = 0;
        if ((st = cts_alloc_array(&kept->lattice, 4 * n, err)))
            return st;
        kept->n_lattice = n;
    }
    memset(kept->lattice, 0, 4 * n * sizeof *kept->lattice);
    *rgba = kept->lattice;
    return CTS_OK;
}

CtsStatus cts_tiled_kept_layout(TiledKept *kept, const CtsScene *scene, int reach, CtsLayout *layout, CtsReport *report,
                                CtsError *err)
{
    CtsStatus st;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    if (layout->grey)
        return CTS_OK;
    if (!kept->copied.copy || !same_axes(&kept->copied, layout)) {
        cts_layout_free(&kept->copied);
        kept->copied = *layout;
        kept->copied_reach = -1;
        if ((st = cts_layout_make(&kept->copied, err)))
            return st;
    }
    *layout = kept->copied;
    if (reach <= kept->copied_reach) {
        tell(scene, "transposed copy", kept->copied_frame, report);
        return CTS_OK;
    }
    const CtsEmptySpace *empty = &kept->empty;
    const CtsLayoutCells wanted = {empty->distance, empty->nu, empty->nv, empty->nk, kept->copied_reach, reach};
    const int64_t n = cts_layout_copy(layout, scene->volume, &wanted, scene->settings->n_threads);
    const uint64_t voxels = (uint64_t)n * CTS_MACROCELL * CTS_MACROCELL * CTS_MACROCELL;
    kept->copied_reach = reach;
    kept->copied_frame = scene->frame;
    cts_report_stage(report, CTS_STAGE_GREY, cts_wall_ms() - wall, cts_cpu_ms() - cpu, voxels, 2 * voxels);
    return CTS_OK;
}
