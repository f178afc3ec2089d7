/* What a DICOM file of our own is called. */
#ifndef CTS_DICOM_DCM_IDS_H
#define CTS_DICOM_DCM_IDS_H

#include "ctsplat/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* By its meta header and data set: "" where it does not say. */
typedef struct CtsDcmIds {
    char class_uid[65], sop_uid[65], syntax_uid[65];
} CtsDcmIds;

/* The file must be one that ctsplat wrote: its framing is not looked over. */
CtsStatus cts_dcm_ids(const char *path, CtsDcmIds *ids, CtsError *err);

#ifdef __cplusplus
}
#endif
#endif
