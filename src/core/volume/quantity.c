#include "ctsplat/quantity.h"

#include "base/enum_table.h"

CTS_ENUM_TABLE(char *const, cts_quantity_names, CTS_N_QUANTITIES, [CTS_QUANTITY_HU] = "HU",
               [CTS_QUANTITY_SUVBW] = "SUVbw", [CTS_QUANTITY_BQML] = "Bq/ml", [CTS_QUANTITY_STORED] = "stored");
CTS_ENUM_TABLE(char *const, cts_quantity_units, CTS_N_QUANTITIES, [CTS_QUANTITY_HU] = "HU",
               [CTS_QUANTITY_SUVBW] = "g/ml", [CTS_QUANTITY_BQML] = "Bq/ml", [CTS_QUANTITY_STORED] = "");
CTS_ENUM_TABLE(char *const, cts_modality_names,
               CTS_N_MODALITIES, [CTS_MODALITY_CT] = "CT", [CTS_MODALITY_MR] = "MR", [CTS_MODALITY_PT] = "PT");
