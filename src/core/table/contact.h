/* A plate under the patient's back, where both are one: found between the plate's two ends that stick out. */
#ifndef CTS_TABLE_CONTACT_H
#define CTS_TABLE_CONTACT_H

#include "base/bits.h"

/* All of one section: what is always and ever there, and the plates found in it, to which the strips are added that
 * continue a plate from where it meets something thicker to where it comes out again: along the far face, under which
 * nothing lies, and as thick as the plate. */
void cts_contact_add(const CtsBits *always, const CtsBits *ever, CtsBits *plates);

#endif
