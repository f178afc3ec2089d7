/* Table removal: head holder, table, blanket and tubes become air, the patient stays whole. */
#ifndef CTSPLAT_COUCH_H
#define CTSPLAT_COUCH_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Set to grey 0 what lies outside the patient. Kept to the bit: every connected part above -350 HU that is thick and
 * compact like a body, a limb or a finger, however many there are; what is attached to it or enclosed by it (ears,
 * earrings, lungs, bowel gas, the nose); and a rim of 3 mm around it, at least 2 voxels within a slice and 1 between
 * slices, which holds the partial-volume ramp. Thin sheets and rods go. A sheet that touches the body is cut from it
 * along its own face; where no clean cut is found it stays.
 *
 * Directions come from step_lps, so tilted, coronal and sagittal stacks, supine and prone, are all one.
 *
 * The report gets one of: a skip "table removal" with the reason when nothing lies outside the body, and the volume is
 * left as it was; a note `table_removed` with the number of voxels. What might be either table or patient stays, with
 * the warning `table_removal_uncertain` when it is more than 5 % of the body, else with the note
 * `table_removal_partial`. The time counts as stage classify. Memory: about a
 * third of the volume, two thirds while a contact is cut. n_threads 0: all
 * cores; threads never change the result. Fails with CTS_ERR_MEMORY only. */
CtsStatus cts_volume_remove_table(CtsVolume *volume, int n_threads, CtsReport *report, CtsError *err);

/* The same for cts_volume_crop() with this box to follow: the patient is told from the table by the whole, but what the
 * crop takes away may be left as it was. */
CtsStatus cts_volume_remove_table_within(CtsVolume *volume, const double lo_lps[3], const double hi_lps[3],
                                         int n_threads, CtsReport *report, CtsError *err);

#ifdef __cplusplus
}
#endif
#endif
