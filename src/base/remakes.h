/* Stages of a picture, in their order. Tables of settings state with each setting the first stage to be remade when its
 * value changes; the stages after it follow. Caches and batches derive from these tables what is up to date: settings
 * of rendering (core/scene/settings.h), and options
 * (app/options/option_table.c); app/job/source_choice.c prints what a volume depends on. */
#pragma once

typedef enum CtsRemakes {
    CTS_REMAKES_SCAN,     /* the slices that are read, or labels */
    CTS_REMAKES_VOLUME,   /* the processed volume, and the assignment of its voxels to labels */
    CTS_REMAKES_TRANSFER, /* the preset, whose JSON identifies it */
    CTS_REMAKES_RENDERER, /* the renderer's cached state, or its own volume */
    CTS_REMAKES_PICTURE,
    CTS_REMAKES_FILE,    /* files alone */
    CTS_REMAKES_OBJECT,  /* files of DICOM objects alone */
    CTS_REMAKES_NOTHING, /* no byte of an output depends on it, or each picture has it in its name (view, format) */
} CtsRemakes;
