#include "scene/scene_blocks.h"

#include "base/clock.h"

CtsStatus cts_scene_blocks(const CtsScene *scene, CtsBlocks **own, const CtsBlocks **blocks, CtsReport *report,
                           CtsError *err)
{
    CtsStatus st = CTS_OK;
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    if (scene->volume->blocks || *own) {
        cts_report_skip(report, "block ranges", "made while the slices were decoded, or for an earlier picture");
    } else {
        st = cts_blocks_new(own, scene->volume, scene->settings->n_threads, err);
        cts_report_stage(report, CTS_STAGE_GREY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms,
                         cts_volume_n_voxels(scene->volume), 0);
    }
    *blocks = scene->volume->blocks ? scene->volume->blocks : *own;
    return st;
}
