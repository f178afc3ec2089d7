/* Quantity of a series' values, and SUV of PET. */
#pragma once

#include "dicom/header/slice.h"

/* Quantity of n slices' values, after multiplication by factor. */
typedef struct CtsValueScale {
    CtsQuantity quantity;
    double factor;
    char why[400]; /* reason why it is not SUVbw of PET; "" where it is, and of other modalities */
} CtsValueScale;

/* SUVbw as QIBA's vendor-neutral formula computes it, with one factor for all slices; Bq/ml where attributes are
 * missing, and stored values where the unit is another one. */
CtsValueScale cts_pet_scale(const CtsSlice *const *slices, int n);
