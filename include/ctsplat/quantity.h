/* Quantities of volumes: the meaning and unit of their values; and modalities that volumes are of. */
#pragma once

#include "ctsplat/status.h"

CTS_API_BEGIN

typedef enum CtsQuantity {
    CTS_QUANTITY_HU,
    CTS_QUANTITY_SUVBW,  /* standardised uptake value by body weight */
    CTS_QUANTITY_BQML,   /* activity concentration */
    CTS_QUANTITY_STORED, /* values of MR and others, after rescale if there is one */
    CTS_N_QUANTITIES
} CtsQuantity;
extern const char *const cts_quantity_names[CTS_N_QUANTITIES]; /* as in --quantity and in a preset's "scale" */
extern const char *const cts_quantity_units[CTS_N_QUANTITIES]; /* "" without a unit */

/* Decides reading, the default preset, and whether there is a table. */
typedef enum CtsModality { CTS_MODALITY_CT, CTS_MODALITY_MR, CTS_MODALITY_PT, CTS_N_MODALITIES } CtsModality;
extern const char *const cts_modality_names[CTS_N_MODALITIES]; /* Modality (0008,0060) */

CTS_API_END
