/* A montage: one picture of several tiles of one size, each a view or a section of the job's series. */
#pragma once

#include "app/job/patient_sections.h"
#include "ctsplat/preset.h"

typedef struct CtsTile {
    CtsSection section; /* of no plane: a view */
    double azimuth_deg, elevation_deg;
    int group;         /* index of the first tile with the same preset and labels, whose scale it shares */
    CtsPreset *preset; /* of a group's first tile, owned; NULL: the job's */
    char *show;        /* likewise: the labels that alone are visible, a list; NULL: as the job's */
} CtsTile;

enum { CTS_MAX_TILES = 256 }; /* of 64 x 64 pixels in a picture of the default size */
typedef struct CtsMontage {
    CtsTile *tiles; /* n, in reading order; owned */
    int n, columns; /* columns 0: those that make the tiles largest */
} CtsMontage;

/* The arrangement of tiles; what they leave of the picture, right and below, is background. */
typedef struct CtsMontageGrid {
    int columns, width, height; /* pixels of a tile; 0 where the picture is too small */
} CtsMontageGrid;
CtsMontageGrid cts_montage_grid(const CtsMontage *montage, int width, int height);

void cts_montage_free(CtsMontage *montage);
