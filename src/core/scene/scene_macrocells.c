#include "core/scene/scene_macrocells.h"

#include "base/clock.h"

CtsStatus cts_scene_macrocells(const CtsScene *scene, CtsMacrocells **own, const CtsMacrocells **macrocells,
                               CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const double wall_ms = cts_wall_ms(), cpu_ms = cts_cpu_ms();
    if (scene->model->macrocells) {
        cts_report_skip(report, "macro-cells", "made with the volume");
    } else if (!*own) {
        st = cts_macrocells_new(own, scene->volume, scene->settings->n_threads, err);
        cts_report_stage(report, CTS_STAGE_GREY, cts_wall_ms() - wall_ms, cts_cpu_ms() - cpu_ms,
                         cts_volume_n_voxels(scene->volume), 0);
    }
    *macrocells = scene->model->macrocells ? scene->model->macrocells : *own;
    return st;
}
