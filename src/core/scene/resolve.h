/* From the caller's settings to the scene for engines. */
#pragma once

#include "core/scene/engine.h"

/* A scene with the data it points to; must not be copied. */
typedef struct CtsSceneStore {
    CtsModel model;
    CtsPreset preset;
    CtsRenderSettings settings;
    CtsScene scene;
} CtsSceneStore;

/* Checks settings independent of the volume. */
CtsStatus cts_scene_check(const CtsRenderSettings *settings, CtsError *err);

/* The effective preset, with the settings' mode, shade and occlusion. */
CtsPreset cts_scene_preset(const CtsPreset *preset, const CtsRenderSettings *settings);

/* Checks and resolves the settings. The scene has no lut yet. */
CtsStatus cts_scene_init(CtsSceneStore *store, const CtsModel *model, const CtsPreset *preset,
                         const CtsRenderSettings *requested, CtsError *err);
