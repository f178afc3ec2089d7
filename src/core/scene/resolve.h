/* From what the caller asked for to the scene that engines get. */
#ifndef CTS_SCENE_RESOLVE_H
#define CTS_SCENE_RESOLVE_H

#include "core/scene/engine.h"

/* A scene with what it points at; not to be copied. */
typedef struct CtsSceneStore {
    CtsPreset preset;
    CtsRenderSettings settings;
    CtsScene scene;
} CtsSceneStore;

/* All that can be said of settings by themselves. */
CtsStatus cts_scene_check(const CtsRenderSettings *settings, CtsError *err);

/* The effective preset: the settings' mode and shade have gone into it. */
CtsPreset cts_scene_preset(const CtsPreset *preset, const CtsRenderSettings *settings);

/* Checks and resolves the settings. The scene has no lut yet. */
CtsStatus cts_scene_init(CtsSceneStore *store, const CtsVolume *volume, const CtsPreset *preset,
                         const CtsRenderSettings *asked, CtsError *err);

#endif
