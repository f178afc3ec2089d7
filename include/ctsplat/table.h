/* Table removal: table, mattress, head holder, blankets and tubes become air, the patient stays whole. */
#ifndef CTSPLAT_TABLE_H
#define CTSPLAT_TABLE_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>

CTS_API_BEGIN

/* Set to grey 0 what lies outside the patient. Two ideas tell the table from the patient, on what is denser than
 * -350 HU in sections across the scanner's axis:
 *
 * - Tables, mattresses and head holders are drawn along the scanner's axis: what is less than some 12 mm thick and
 *   stands at the same place over 60 mm of it is no patient, even where it touches one. It goes.
 *   Where an ear or a back lies against such a plate, it is followed along its far face.
 * - Of the connected parts that are then left, the largest is the patient; others stay if at least half of them is
 *   thicker than 6 mm, as limbs and fingers are and blankets, tubes and plates are not. What stands out from them
 *   thinner than that over more than 100 mm, and is no bone, is a mask, a strap or a blanket: it goes, as long as it is
 *   no more than a tenth of the body.
 *
 * Kept to the bit: the patient, whatever is attached to it or enclosed by it within a section (lungs, bowel gas), and a
 * rim of 3 mm around it, at least 2 voxels within a section and one section beyond, which holds the partial-volume
 * ramp. Air at the border of the field of view counts as enclosed when it is a lung by its density: above -930 HU, or
 * 70 HU above room air where the scanner puts that higher. Such room air is the darkest large peak of what reaches the
 * border, and a table stands in it, or it is one sharp level than which nothing is darker.
 *
 * finds_inside: volume->body becomes the inside of the patient, 3 mm under the skin, with the air that it encloses, for
 * the modes minip and average.
 *
 * The sections lie across the volume axis nearest to z, so axial, tilted, coronal and sagittal stacks, supine and
 * prone, head or feet first are all one.
 *
 * The report gets one of: a skip "table removal" with the reason when nothing lies outside the body, and the volume is
 * left as it was; a note `table_removed` with the number of voxels. When thin parts that hang on the body make up more
 * than 5 % of it, they stay, with the warning `table_removal_uncertain`; the same where more than 0.1 % of it went as
 * something thicker than 20 mm, and where a table stands in what is as dense as lungs and has no peak. The time counts
 * as stage classify. Memory: about an eighth of the volume. n_threads 0: all cores; threads never change the result.
 * Fails with CTS_ERR_MEMORY only.
 *
 * seen is what the table is told by: volume itself (NULL), or where its layers were made up of uneven slices the same
 * layers joined by straight lines, since plates stand still there. */
CtsStatus cts_volume_remove_table(CtsVolume *volume, const CtsVolume *seen, bool finds_inside, int n_threads,
                                  CtsReport *report, CtsError *err);

CTS_API_END
#endif
