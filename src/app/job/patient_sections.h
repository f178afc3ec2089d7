/* Sections of the patient along its planes, as radiologists hang them. */
#pragma once

#include "ctsplat/labels.h"
#include "ctsplat/picture.h"
#include "ctsplat/render.h"
#include "ctsplat/series.h"

typedef enum CtsSectionPlane {
    CTS_PLANE_NONE,
    CTS_PLANE_AXIAL,
    CTS_PLANE_CORONAL,
    CTS_PLANE_SAGITTAL,
    CTS_N_PLANES
} CtsSectionPlane;
extern const char *const cts_plane_names[CTS_N_PLANES]; /* "" for none */

typedef struct CtsSection {
    CtsSectionPlane plane;
    double at_mm; /* from the centre, towards the head, the back or the left */
} CtsSection;

/* Draws n sections, except those of no plane, each of the settings' size, at one scale: the settings', or the largest
 * at which the scan fits all of them. They pass through the settings' centre; where none is given, through that of the
 * labelled voxels, without labels of what is denser than air. HU in a window of soft tissue, others from air to
 * the 99.5th percentile. The outline of label i has the hue i times the golden ratio, as in the contact sheet's list.
 * scanned must still have its grey levels, and labels (may be NULL) their statistics. Free the pictures with
 * cts_picture_free(), also after a failure. */
CtsStatus cts_sections(const CtsScanned *scanned, const CtsLabels *labels, const CtsRenderSettings *settings,
                       const CtsSection *sections, int n, CtsPicture **pictures, CtsError *err);
