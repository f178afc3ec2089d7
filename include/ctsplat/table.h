/* Table removal: table, mattress, head holder, blankets and tubes become air, the patient stays whole. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <stdbool.h>

CTS_API_BEGIN

/* Sets voxels outside the patient to grey 0. Two rules distinguish table and patient, on voxels denser than -350 HU in
 * sections across the scanner's axis:
 *
 * - Tables, mattresses and head holders are extruded along the scanner's axis: parts thinner than about 12 mm that keep
 *   their position over 60 mm of it are removed, even in contact with the patient, unless at least half of their voxels
 *   are above 600 HU, like bone and metal. Where an ear or a back lies against such a plate, it is followed along
 *   its far face.
 * - Of the remaining connected parts, the largest is the patient; others are kept if at least half of them is thicker
 *   than 6 mm, like limbs and fingers, unlike blankets, tubes and plates. Protrusions thinner than that and longer than
 *   100 mm that are not bone are masks, straps or blankets: they are removed, unless they are more than a tenth of the
 *   body.
 *
 * Kept to the bit: the patient, everything attached to it or enclosed by it within a section (lungs, bowel gas), and a
 * margin of 3 mm around it, at least 2 voxels within a section and one section beyond, which contains the
 * partial-volume ramp. Air at the border of the field of view counts as enclosed when it has the density of lung: above
 * -930 HU, or 70 HU above room air where the scanner's level for that is higher. Such room air is the darkest large
 * peak of the air at the border; additionally a table stands in it, or it is one sharp level that is also the darkest.
 *
 * finds_inside: model->body becomes the inside of the patient, 3 mm under the skin, with the enclosed air, for the
 * modes minip and average.
 *
 * A volume of another quantity than HU keeps all voxels; the inside of its body is what lies above air (air_limit),
 * with what that encloses within a section.
 *
 * The sections lie across the volume axis nearest to z, so axial, tilted, coronal and sagittal stacks, supine and
 * prone, head or feet first are treated alike.
 *
 * The report gets one of: a skip "table removal" with the reason when nothing lies outside the body, and the volume is
 * unchanged; a note `table_removed` with the number of voxels. Thin parts attached to the body that make up more than 5
 * % of it are kept, with the warning `table_removal_uncertain`; the same warning is given where more than 0.1 % of the
 * body was removed in parts thicker than 20 mm or above 600 HU, and where a table stands in air as dense as lungs
 * without a peak. The time counts as stage classify. Memory: about an eighth of the volume. n_threads 0: all cores;
 * threads never change the result. Fails with CTS_ERR_MEMORY only. */
CtsStatus cts_model_remove_table(CtsModel *model, bool finds_inside, int n_threads, CtsReport *report, CtsError *err);

/* Its two steps, for layers that are made after the search: interpolated along shapes, plates would not keep their
 * position. */
typedef struct CtsTableSearch CtsTableSearch;

/* Searches in the volume, or in these layers of a volume whose grey levels are not used. Free with
 * cts_table_search_free(). */
CtsStatus cts_table_search(const CtsVolume *volume, const CtsLinearLayers *layers, bool finds_inside, int n_threads,
                           CtsTableSearch **found, CtsReport *report, CtsError *err);
void cts_table_search_free(CtsTableSearch **found);
/* Voxels low[] to high[], inclusive, of the volume that was searched: cts_volume_crop_air() keeps no others after the
 * table is cleared. */
void cts_table_kept_box(const CtsTableSearch *found, const CtsVolume *volume, int low[3], int high[3]);
/* Clears what was found; the model gets the inside of the body. Its volume is the one that was searched, or a box of it
 * that counts the voxels around itself as air. */
void cts_table_clear(CtsTableSearch *found, CtsModel *model, CtsReport *report);
/* The same of the volume that was searched, which shrinks to the box of cts_table_kept_box(), in one pass. */
void cts_table_crop(CtsTableSearch *found, CtsModel *model);

CTS_API_END
